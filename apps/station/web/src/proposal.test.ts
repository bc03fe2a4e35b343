import { expect, test } from 'vitest';
import { readAs, samePicks } from './proposal';

const picks = [{ image: 2, line: 7, contour: 0, circle: false, residual_px: 3 }, { image: 4, line: 1, contour: 0, circle: true }];
test('a reading names the contour of each pick and leaves the picks themselves alone', () => {
  const read = readAs(picks, [5, 1]);
  expect(read.map((p) => p.contour)).toEqual([5, 1]);
  expect(read.map((p) => [p.image, p.line, p.circle])).toEqual([[2, 7, false], [4, 1, true]]);
  expect(read[0].residual_px).toBeNull();
  expect(picks[0].contour).toBe(0);
});
test('lines that are not the part\'s are left out', () => { expect(readAs(picks, [-1, 2]).map((p) => [p.line, p.contour])).toEqual([[1, 2]]); });
test('picks are the same whatever their contours are', () => {
  expect(samePicks(picks, readAs(picks, [5, 1]))).toBe(true);
  expect(samePicks(picks, picks.slice(1))).toBe(false);
  expect(samePicks(picks, [picks[1], picks[0]])).toBe(false);
});
