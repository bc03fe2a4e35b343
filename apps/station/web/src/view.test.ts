import { describe, expect, it } from 'vitest';
import { fitView, maxScale, toPicture, toScreen, zoomAt } from './view';

describe('the view', () => {
  it('goes from picture to screen and back', () => {
    const view = { scale: 2.5, x: 13, y: -7 }, [x, y] = toScreen(view, 100.25, 50.5), [u, v] = toPicture(view, x, y);
    expect(u).toBeCloseTo(100.25, 12);
    expect(v).toBeCloseTo(50.5, 12);
  });
  it('has the centre of the first pixel half a pixel inside the picture', () => expect(toScreen({ scale: 4, x: 10, y: 20 }, 0, 0)).toEqual([12, 22]));
  it('keeps the point under the pointer while it zooms', () => {
    const view = { scale: 1, x: 0, y: 0 }, before = toPicture(view, 320, 200), after = toPicture(zoomAt(view, 3, 320, 200), 320, 200);
    expect(after[0]).toBeCloseTo(before[0], 12);
    expect(after[1]).toBeCloseTo(before[1], 12);
  });
  it('ends at its largest scale', () => expect(zoomAt({ scale: 1, x: 0, y: 0 }, 1e6, 0, 0).scale).toBe(maxScale));
  it('shows the whole picture', () => {
    const view = fitView(4000, 1000, 800, 600), [x0, y0] = toScreen(view, 0, 0), [x1, y1] = toScreen(view, 3999, 999);
    expect(x0).toBeGreaterThan(0); expect(y0).toBeGreaterThan(0);
    expect(x1).toBeLessThan(800); expect(y1).toBeLessThan(600);
  });
});
