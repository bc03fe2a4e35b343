import { expect, test } from 'vitest';
import { contourAt, millimetresOf, nextContour, samePlace } from './contours';
import type { Piece } from './types';

const edge = (index: number, points: number[], hidden = false): Piece => ({ source: 'edge', index, hidden, points });
const pieces = [edge(0, [0, 0, 100, 0]), edge(1, [0, 50, 100, 50]), edge(2, [0, 0, 0, 50]), edge(3, [0, 20, 100, 20], true)];

test('a line belongs to the visible contour on which it lies', () => {
  expect(contourAt(pieces, [10, 1, 80, 2], false)).toEqual({ index: 0, circle: false });
  expect(contourAt(pieces, [10, 48, 80, 49], false)).toEqual({ index: 1, circle: false });
});
test('a line on a hidden contour, beside every contour or across them belongs to none', () => {
  expect(contourAt(pieces, [10, 20, 80, 20], false)).toBeNull();
  expect(contourAt(pieces, [10, 30, 80, 30], false)).toBeNull();
  expect(contourAt(pieces, [50, 0, 50, 50], false)).toBeNull();
});
test('of two contours that lie on each other none is chosen', () => {
  expect(contourAt([...pieces, edge(4, [0, 0.5, 100, 0.5])], [10, 0, 80, 0], false)).toBeNull();
});
test('what the operator chose holds where the line may as well be that', () => {
  const close = [...pieces, edge(4, [0, 3, 100, 3])], line = [10, 0, 80, 0];
  expect(samePlace({ index: 0, circle: false }, { index: 4, circle: false }, close, line)).toBe(true);
  expect(samePlace({ index: 0, circle: false }, { index: 1, circle: false }, close, line)).toBe(false);
});
test('the next contour is one that the present picture shows', () => {
  const drawing = [edge(0, [0, 0, 100, 0]), edge(1, [0, 50, 90, 50]), edge(2, [0, 0, 0, 50])];
  expect(nextContour(drawing, [], null)).toEqual({ index: 0, circle: false });
  expect(nextContour(drawing, [], null, [edge(1, [0, 0, 9, 0]), edge(0, [0, 0, 9, 0], true)])).toEqual({ index: 1, circle: false });
});
test('a length is taken with a point or a comma, and nothing else is', () => {
  expect([' 12.5 ', '12,5', '300'].map(millimetresOf)).toEqual([12.5, 12.5, 300]);
  expect(['', 'abc', '-3', '0', '1.2.3'].map(millimetresOf)).toEqual([null, null, null, null, null]);
});
