// Which key does what: the usual keys, and what the operator changed.
export type Keys = Record<string, string>;  // action: key; only what differs from the usual ones, '' for none

export const usualKeys: Keys = {
  keys: '?', picture: '1', scene: '2', both: '3', previous: 'PageUp', next: 'PageDown', zoomIn: '+', zoomOut: '-', whole: '0',
  left: 'ArrowLeft', right: 'ArrowRight', up: 'ArrowUp', down: 'ArrowDown',
  grey: 'g', lines: 'l', parts: 'p', hidden: 'h', residuals: 'r', vertices: 'v', colour: 'k',
  doubtful: 'n', confirm: 'c', build: 'b', correct: 'e', collect: 'a', propose: 'w', draw: 'd', curve: 'o', split: 's', extend: 'x', merge: 'm', delete: 'Delete',
  band: 'f', measure: 'q', refit: 'u', kind: 'y', cut: 't', unite: 'j', run: 'F9', export: 'F2', distance: 'i', section: 'z', above: 'Home', cameras: 'End',
  panelParts: '4', panelTodo: '5', panelBuild: '6', panelParameters: '7', panelCameras: '8', panelHistory: '9', guide: 'F8',
};
// Keys that always mean the same.
const fixedKeys = ['Escape', 'Enter', 'Tab', ' ', 'F1', 'Shift', 'Control', 'Alt', 'Meta'];

// A letter means the same with and without Shift; "=" is "+" without Shift on many keyboards.
export function nameOfKey(key: string): string { return key === '=' ? '+' : key.length === 1 ? key.toLowerCase() : key; }

export function keyOf(keys: Keys, action: string): string { return keys[action] ?? usualKeys[action] ?? ''; }
export function actionOf(keys: Keys, key: string): string | undefined { return Object.keys(usualKeys).find((action) => keyOf(keys, action) === key); }

// The table with `key` for `action`; the action that had the key gets none. Null where the key cannot be given away.
export function withKey(keys: Keys, action: string, key: string): Keys | null {
  if (fixedKeys.includes(key)) return null;
  const next = { ...keys }, had = actionOf(keys, key);
  if (had && had !== action) next[had] = '';
  next[action] = key;
  for (const a of Object.keys(next)) if (next[a] === usualKeys[a]) delete next[a];
  return next;
}

const short: Record<string, string> = { ArrowLeft: '←', ArrowRight: '→', ArrowUp: '↑', ArrowDown: '↓', Delete: 'Del', '-': '−' };
export function shown(key: string): string { return short[key] ?? (key.length === 1 ? key.toUpperCase() : key); }
