// A proposal of which picked line is which contour.
import type { Pick } from './types';

// A line that is not the part's has the contour -1.
export function readAs(picks: Pick[], contours: number[]): Pick[] {
  return picks.map((p, i) => ({ ...p, contour: contours[i] ?? p.contour, residual_px: null })).filter((p) => p.contour >= 0);
}

// Whether they are the same lines, in the same order.
export function samePicks(a: Pick[], b: Pick[]): boolean {
  return a.length === b.length && a.every((p, i) => p.image === b[i].image && p.line === b[i].line && p.circle === b[i].circle);
}
