import { describe, expect, it } from 'vitest';
import { arcPoints, batchLines, distanceToSegment, LineIndex, linePoints, strengthBucket, unusedColour, usedColour, lengthOf } from './lines';
import type { Lines } from './types';

const lines = (segments: number[][], arcs: number[][] = []): Lines => ({ segments, arcs, removed: [], version: 0, noise: 1 });

describe('LineIndex', () => {
  const index = new LineIndex(lines([[7, 0, 0, 100, 0, 30, 0.1], [8, 0, 4, 100, 4, 30, 0.1], [9, 50, 50, 60, 90, 30, 0.1]], [[0, 200, 200, 20, 20, 0, 0, 6.283, 50]]));
  it('gives the lines near a point, nearest first', () => {
    expect(index.near(50, 1, 5).map((f) => f.line)).toEqual([7, 8]);
    expect(index.near(50, 3, 5).map((f) => f.line)).toEqual([8, 7]);
  });
  it('measures to the end of a line, not to its prolongation', () => {
    expect(index.near(110, 0, 5)).toEqual([]);
    expect(distanceToSegment(103, 4, 0, 0, 100, 0)).toBeCloseTo(5, 12);
  });
  it('finds an arc on its rim and not in its middle', () => {
    expect(index.near(220, 200, 3)[0]).toMatchObject({ line: 0, circle: true });
    expect(index.near(200, 200, 3)).toEqual([]);
  });
  it('gives what lies wholly in a box', () => {
    expect(index.inside(-1, -1, 101, 10).map((f) => f.line).sort()).toEqual([7, 8]);
    expect(index.inside(-1, -1, 90, 10)).toEqual([]);
  });
  it('has nothing to say of a picture without lines', () => expect(new LineIndex(lines([])).near(0, 0, 100)).toEqual([]));
  it('finds the nearest of 30,000 lines as a search of all would', () => {
    const many: number[][] = [];
    let seed = 1;
    const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
    for (let i = 0; i < 30000; i++) { const u = random() * 4000, v = random() * 4000, a = random() * 7; many.push([i, u, v, u + 30 * Math.cos(a), v + 30 * Math.sin(a), 20, 0.1]); }
    const big = new LineIndex(lines(many));
    for (let k = 0; k < 30; k++) {
      const u = random() * 4000, v = random() * 4000;
      const best = many.map((m) => distanceToSegment(u, v, m[1], m[2], m[3], m[4])).reduce((x, y) => Math.min(x, y), Infinity);
      const found = big.near(u, v, 40)[0];
      if (best <= 40) expect(found.distance).toBeCloseTo(best, 9); else expect(found).toBeUndefined();
    }
  });
});

describe('drawing', () => {
  it('bends a line that the lens bends', () => expect(linePoints([1, 0, 0, 10, 0, 5, 0.1, 3, 1, 6, 1])).toEqual([0, 0, 3, 1, 6, 1, 10, 0]));
  it('closes a whole circle', () => {
    const p = arcPoints([0, 5, 5, 2, 2, 0.3, 0, 2 * Math.PI, 9]);
    expect(Math.hypot(p[0] - p[p.length - 2], p[1] - p[p.length - 1])).toBeLessThan(1e-9);
    for (let i = 0; i < p.length; i += 2) expect(Math.hypot(p[i] - 5, p[i + 1] - 5)).toBeCloseTo(2, 9);
  });
  it('has stronger colours for stronger lines', () => {
    expect(strengthBucket(1)).toBe(0);
    expect(strengthBucket(20)).toBeLessThan(strengthBucket(80));
    expect(strengthBucket(1e9)).toBe(6);
  });
  it('puts every line into exactly one batch', () => {
    const batches = batchLines(lines([[1, 0, 0, 1, 1, 5, 1], [2, 0, 0, 1, 1, 5, 1], [3, 0, 0, 1, 1, 5, 1]]), 'use', (line) => (line === 2 ? 'part-1' : undefined), 1);
    expect(batches.find((b) => b.colour === usedColour)?.shapes.length).toBe(1);
    expect(batches.find((b) => b.colour === unusedColour)?.shapes.length).toBe(2);
  });
});
it('the length of a polyline is that of its pieces', () => { expect(lengthOf([0, 0, 3, 4, 3, 10])).toBe(11); expect(lengthOf([1, 1])).toBe(0); });
