// Every key of the page. Fields keep their own keys. What a key does is looked up in the operator's own table.
import { station as s } from './station.svelte';
import { actionOf, nameOfKey } from './keymap';
import type { ColourBy } from './lines';
import { t } from './texts';
import type { Part } from './types';

const colours: ColourBy[] = ['strength', 'use', 'part'];
type Action = () => void;

const layer = (name: keyof typeof s.layers): Action => () => { s.layers[name] = !s.layers[name]; s.keep(); };
const view = (v: typeof s.view): Action => () => { s.view = v; s.keep(); };
const tool = (name: typeof s.tool): Action => () => { s.tool = s.tool === name ? 'look' : name; };
const ofPart = (what: (part: Part) => unknown): Action => () => { if (s.part) void what(s.part); else s.say(t.parts.selectFirst); };
// What is done in 3D opens it where only the picture is shown.
const inScene = (name: string): Action => () => {
  if (s.view === 'picture') s.view = 'both';
  const end = performance.now() + 3000;  // it is loaded when it is first shown
  const attempt = () => { if (!s.showScene?.(name) && performance.now() < end) setTimeout(attempt, 50); };
  attempt();
};
const actions: Record<string, Action> = {
  keys: () => (s.showKeys = true), picture: view('picture'), scene: view('scene'), both: view('both'),
  previous: () => s.go(s.image - 1), next: () => s.go(s.image + 1),
  grey: layer('picture'), lines: layer('lines'), parts: layer('parts'), hidden: layer('hidden'), residuals: layer('residuals'), vertices: layer('vertices'),
  colour: () => { s.colourBy = colours[(colours.indexOf(s.colourBy) + 1) % 3]; s.keep(); },
  doubtful: () => void s.nextTask(), confirm: () => { if (s.part) void s.confirm(s.part, true); },
  build: () => s.startBuild(), correct: () => { if (s.part) s.correct(s.part); }, collect: () => { if (s.build) void s.ask(true); }, propose: () => void s.propose(),
  draw: tool('draw'), curve: tool('arc'), split: tool('split'), extend: tool('extend'), merge: tool('merge'),
  band: tool('band'), measure: ofPart((p) => s.measure(p)), refit: ofPart((p) => s.refit(p)), kind: ofPart(() => s.choose('kind')), unite: ofPart(() => s.choose('merge')),
  cut: ofPart((p) => { if (s.cuts.length > 0) void s.cut(p); else s.say(t.parts.noSplit, true); }),
  run: () => s.runOrCancel(), export: () => (s.exportOpen = !s.exportOpen),
  distance: inScene('measure'), section: inScene('section'), above: inScene('top'), cameras: inScene('cameras'),
  panelParts: () => s.openTab('parts'), panelTodo: () => s.openTab('todo'), panelBuild: () => s.openTab('build'), panelParameters: () => s.openTab('parameters'), panelCameras: () => s.openTab('cameras'), panelHistory: () => s.openTab('history'),
  guide: () => { s.guideDone = {}; s.guide = 0; },
  delete: () => {
    if (s.line) void s.removeLine(s.line);
    else if (s.part && !s.build) void s.remove(s.part);
  },
};
// What the picture does itself, by the name that it knows.
const ofPicture: Record<string, string> = { zoomIn: '+', zoomOut: '-', whole: '0', left: 'ArrowLeft', right: 'ArrowRight', up: 'ArrowUp', down: 'ArrowDown' };

export function handleKey(e: KeyboardEvent, picture: (name: string) => boolean) {
  const target = e.target as HTMLElement;
  const inField = /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName) && !['checkbox', 'range', 'radio'].includes((target as HTMLInputElement).type);
  if (s.showKeys) return;  // the dialog has its own
  if (e.key === 'Escape') {
    if (s.exportOpen) s.exportOpen = false;
    else if (s.choosing) s.choosing = '';
    else if (s.proposing) s.stopProposing();
    else if (s.tool !== 'look') s.tool = 'look';
    else if (s.proposed) s.endProposal(false);
    else if (s.line) s.line = null;
    else if (s.build && s.build.picks.length === 0) s.stopBuild();
    else if (s.selected) s.selected = '';
    else return;
    e.preventDefault();
    return;
  }
  if (e.key === 'F1') { e.preventDefault(); s.tab = 'help'; return; }
  if (inField) return;
  if (e.ctrlKey || e.metaKey) {
    const key = e.key.toLowerCase();
    if (key === 'z' && !e.shiftKey) { e.preventDefault(); s.undoIt(); }
    else if (key === 'y' || (key === 'z' && e.shiftKey)) { e.preventDefault(); s.redoIt(); }
    return;
  }
  if (e.altKey) return;
  if (e.key === 'Enter' && s.proposed && target.tagName !== 'BUTTON' && target.tagName !== 'A') { e.preventDefault(); s.endProposal(true); return; }
  if (e.key === 'Enter' && s.build && target.tagName !== 'BUTTON' && target.tagName !== 'A') { e.preventDefault(); void s.savePart(); return; }
  const onTab = target.getAttribute('role') === 'tab' || (target as HTMLInputElement).type === 'range';
  if (e.key === 'Tab') { if (!onTab && picture('Tab')) e.preventDefault(); return; }
  const name = actionOf(s.keys, nameOfKey(e.key));
  if (!name || (onTab && e.key.startsWith('Arrow'))) return;
  if (ofPicture[name] && s.view === 'scene') { if (s.showScene?.(ofPicture[name])) e.preventDefault(); return; }
  if (ofPicture[name]) { if (picture(ofPicture[name])) e.preventDefault(); return; }
  e.preventDefault();
  actions[name]();
}
