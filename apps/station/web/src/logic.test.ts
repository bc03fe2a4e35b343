import { describe, expect, it } from 'vitest';
import { nextContour } from './contours';
import { differencesOf } from './differences';
import { pagesOf, searchPages, withMarks } from './manual';
import { tasksOf } from './queue';
import type { Part, Piece } from './types';

const part = (id: string, more: Partial<Part> = {}): Part => ({
  id, kind: 'box', source: 'automatic', resting_pose: '', stands_on: 'ground', residual_px: 0.1, doubtful: false, log_odds: 50, confirmed: false, doubt: '',
  pose: { position: [0, 0, 0], rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], yaw: 0 }, dimensions: { length: { value: 100, sigma: 0.1, observable: true } },
  vertices: [], vertex_sigma: [], edges: [], circles: [], images: [], matches: [], ...more,
});

describe('the queue', () => {
  it('leads through the worst first and leaves out what is sure or confirmed', () => {
    const tasks = tasksOf([
      part('part-1'), part('part-2', { doubtful: true, log_odds: 15 }), part('part-3', { doubtful: true, log_odds: 9 }), part('part-4', { doubtful: true, log_odds: 1, confirmed: true }),
      part('part-10', { dimensions: { height: { value: 1, sigma: 1, observable: false } } }),
    ], [{ center: [1, 2, 3], extent: [1, 1, 1], num_lines: 9 }]);
    expect(tasks.map((x) => x.id)).toEqual(['part-3', 'part-2', 'unknown-1', 'part-10']);
    expect(tasks[3].why).toContain('height');
  });
  it('does not ask about a dimension that the operator gave', () => {
    expect(tasksOf([part('part-1', { dimensions: { height: { value: 1, sigma: 0, observable: false, origin: 'given by the operator' } } })], [])).toEqual([]);
  });
});

describe('the next contour', () => {
  const piece = (index: number, points: number[], hidden = false): Piece => ({ source: 'edge', index, hidden, points });
  const drawing = [piece(0, [0, 0, 100, 0]), piece(1, [0, 0, 0, 60]), piece(2, [0, 60, 100, 60]), piece(3, [0, 0, 200, 200], true)];
  it('begins with the longest that is seen', () => expect(nextContour(drawing, [], null)).toEqual({ index: 0, circle: false }));
  it('goes on with another direction', () => expect(nextContour(drawing, [{ image: 0, line: 1, contour: 0, circle: false }], null)).toEqual({ index: 1, circle: false }));
  it('stays where it is when all are picked', () => {
    const picks = [0, 1, 2].map((contour) => ({ image: 0, line: contour, contour, circle: false }));
    expect(nextContour(drawing, picks, { index: 2, circle: false })).toEqual({ index: 2, circle: false });
  });
});

describe('what an edit changed', () => {
  it('names kinds, dimensions and places', () => {
    const after = part('part-1', { kind: 'tee', dimensions: { length: { value: 101.5, sigma: 0.1, observable: true } }, pose: { ...part('x').pose, position: [3, 4, 0] } });
    expect(differencesOf([{ kind: 'part', id: 'part-1', before: part('part-1'), after }])[0].what).toBe('box → tee, length 100.00 → 101.50, moved 5.00 mm');
  });
  it('tells added from removed', () => {
    expect(differencesOf([{ kind: 'part', id: 'a', before: null, after: part('a') }, { kind: 'part', id: 'b', before: part('b'), after: null }]).map((d) => d.how)).toEqual(['added', 'removed']);
  });
});

describe('the manual', () => {
  it('puts what an operator needs first', () => {
    const names = ['accuracy.md', 'knowledge-base.md', '04-trouble.md', 'calibration.md', '01-normal-operation.md'];
    expect(pagesOf(names.map((name) => ({ name, text: '# ' + name }))).map((p) => p.name)).toEqual(['01-normal-operation.md', 'calibration.md', 'knowledge-base.md', '04-trouble.md', 'accuracy.md']);
  });
  it('cuts no word, and tells of the sections where a page has no lead', () => {
    const [long, short] = pagesOf([{ name: '1.md', text: '# A\n\n' + 'wonderful '.repeat(40) }, { name: '2.md', text: '# B\n\n## First\n\nx\n\n## Second' }]);
    expect(long.lead).toMatch(/^(wonderful )+…$/);
    expect(short.lead).toBe('First · Second');
  });
  it('marks what was searched for', () => {
    expect(withMarks('Contrast and gamma', ['gamma', 'con'])).toEqual([{ text: 'Con', hit: true }, { text: 'trast and ', hit: false }, { text: 'gamma', hit: true }]);
    expect(withMarks('a (b', ['('])).toEqual([{ text: 'a ', hit: false }, { text: '(', hit: true }, { text: 'b', hit: false }]);
  });
  const pages = pagesOf([{ name: 'a.md', text: '# Normal operation\n\nHow a day goes.\n\n## Undo\n\nPress Ctrl+Z to undo an edit.' }, { name: 'b.md', text: '# Trouble\n\nWhat to do when an edit was refused.' }]);
  it('has titles and leads', () => expect(pages.map((p) => [p.title, p.lead])).toEqual([['Normal operation', 'How a day goes.'], ['Trouble', 'What to do when an edit was refused.']]));
  it('finds sections with every word, titles first', () => {
    expect(searchPages(pages, 'undo')[0]).toMatchObject({ title: 'Normal operation: Undo', section: 'Undo', excerpt: 'Press Ctrl+Z to undo an edit.' });
    expect(searchPages(pages, 'edit refused').map((h) => h.page)).toEqual(['b.md']);
    expect(searchPages(pages, 'gantry')).toEqual([]);
  });
});
