import { describe, expect, it } from 'vitest';
import { curvePath, extended, merged, splitAt } from './edits';

describe('what a click would do to a line', () => {
  it('splits it where the pointer is, not at its ends', () => {
    expect(splitAt([0, 0], [100, 0], [30, 5])).toEqual({ at: [30, 0], lengths: [30, 70] });
    expect(splitAt([0, 0], [100, 0], [98, 0])).toBeNull();
  });
  it('moves the nearer end along it', () => {
    expect(extended([0, 0], [100, 0], [140, 8])).toEqual([[0, 0], [140, 0]]);
    expect(extended([0, 0], [100, 0], [-20, 3])).toEqual([[-20, 0], [100, 0]]);
  });
  it('merges from the outermost end to the other', () => expect(merged([[10, 0], [0, 0]], [[20, 1], [40, 1]])).toEqual([[40, 1], [0, 0]]));
  it('draws a curve through three points, and a straight line where they lie on one', () => {
    expect(curvePath([[0, 0], [1, 1], [2, 0]])).toBe('M0,0 A1 1 0 0 0 1,1 A1 1 0 0 0 2,0');
    expect(curvePath([[0, 0], [1, 0], [2, 0]])).toBe('M0,0 L1,0 L2,0');
    expect(curvePath([[0, 0]])).toBe('');
  });
});
