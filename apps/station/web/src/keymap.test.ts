import { expect, test } from 'vitest';
import { t } from './texts';
import { actionOf, keyOf, nameOfKey, usualKeys, withKey } from './keymap';

test('every action has a key of its own', () => {
  expect(new Set(Object.values(usualKeys)).size).toBe(Object.keys(usualKeys).length);
});
test('every action has its words, and every word an action', () => { expect(Object.keys(t.keys).sort()).toEqual(Object.keys(usualKeys).sort()); });
test('a letter means the same in capitals', () => { expect(actionOf({}, nameOfKey('N'))).toBe('doubtful'); });
test('a key that is given to another action leaves the one that had it', () => {
  const keys = withKey({}, 'draw', 'n')!;
  expect(actionOf(keys, 'n')).toBe('draw');
  expect(keyOf(keys, 'doubtful')).toBe('');
  expect(actionOf(keys, 'd')).toBeUndefined();
});
test('the usual key put back leaves no trace', () => { expect(withKey(withKey({}, 'draw', '&')!, 'draw', 'd')).toEqual({}); });
test('Escape and Enter are not given away', () => { for (const key of ['Escape', 'Enter', 'Tab']) expect(withKey({}, 'draw', key)).toBeNull(); });
