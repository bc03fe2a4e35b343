// Every key of the page. Fields keep their own keys.
import { station as s } from './station.svelte';
import type { ColourBy } from './lines';

const colours: ColourBy[] = ['strength', 'use', 'part'];
type Action = () => void;

export function handleKey(e: KeyboardEvent, picture: (name: string) => boolean) {
  const target = e.target as HTMLElement;
  const inField = /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName) && !['checkbox', 'range', 'radio'].includes((target as HTMLInputElement).type);
  if (e.key === 'Escape') {
    if (s.showKeys) s.showKeys = false;
    else if (s.tool !== 'look') s.tool = 'look';
    else if (s.line) s.line = null;
    else if (s.build && s.build.picks.length === 0) s.stopBuild();
    else if (s.selected) s.selected = '';
    else return;
    e.preventDefault();
    return;
  }
  if (e.key === 'F1') { e.preventDefault(); s.tab = 'help'; return; }
  if (inField || s.showKeys) { if (e.key === '?' && !inField) s.showKeys = false; return; }
  if (e.ctrlKey || e.metaKey) {
    const key = e.key.toLowerCase();
    if (key === 'z' && !e.shiftKey) { e.preventDefault(); s.undoIt(); }
    else if (key === 'y' || (key === 'z' && e.shiftKey)) { e.preventDefault(); s.redoIt(); }
    return;
  }
  if (e.altKey) return;
  const layer = (name: keyof typeof s.layers): Action => () => { s.layers[name] = !s.layers[name]; s.keep(); };
  const view = (v: typeof s.view): Action => () => { s.view = v; s.keep(); };
  const tool = (name: typeof s.tool): Action => () => { s.tool = s.tool === name ? 'look' : name; };
  const actions: Record<string, Action> = {
    '?': () => (s.showKeys = true), '1': view('picture'), '2': view('scene'), '3': view('both'),
    PageUp: () => s.go(s.image - 1), PageDown: () => s.go(s.image + 1),
    g: layer('picture'), l: layer('lines'), p: layer('parts'), h: layer('hidden'), r: layer('residuals'), v: layer('vertices'),
    k: () => { s.colourBy = colours[(colours.indexOf(s.colourBy) + 1) % 3]; s.keep(); },
    n: () => void s.nextTask(), c: () => { if (s.part) void s.confirm(s.part, true); },
    b: () => s.startBuild(), e: () => { if (s.part) s.correct(s.part); },
    a: () => { if (s.build) void s.ask(true); },
    d: tool('draw'), s: tool('split'), x: tool('extend'), m: tool('merge'),
    Delete: () => {
      if (s.line && !s.line.circle) void s.command('remove_line', { image: s.image, line: s.line.line, version: s.version('lines', s.fileOf(s.image)) });
      else if (s.part && !s.build) void s.remove(s.part);
    },
  };
  const key = e.key.length === 1 ? e.key.toLowerCase() : e.key;
  if (key === 'Enter' && s.build && target.tagName !== 'BUTTON' && target.tagName !== 'A') { e.preventDefault(); void s.savePart(); return; }
  if (['+', '=', '-', '0', 'ArrowLeft', 'ArrowRight', 'ArrowUp', 'ArrowDown', 'Tab'].includes(e.key)) {
    if (target.getAttribute('role') === 'tab' || (target as HTMLInputElement).type === 'range') return;
    if (picture(e.key)) e.preventDefault();
    return;
  }
  const action = actions[key] ?? (key === ' ' ? undefined : undefined);
  if (!action) return;
  e.preventDefault();
  action();
}
