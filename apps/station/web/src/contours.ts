// Which contour of an object a person should pick next.
import type { Piece, Pick } from './types';

export interface Contour { index: number; circle: boolean }

function length(points: number[]): number {
  let sum = 0;
  for (let i = 0; i + 3 < points.length; i += 2) sum += Math.hypot(points[i + 2] - points[i], points[i + 3] - points[i + 1]);
  return sum;
}

// The direction of a contour on the drawing, folded to [0, pi).
function direction(points: number[]): number {
  const a = Math.atan2(points[points.length - 1] - points[1], points[points.length - 2] - points[0]);
  return ((a % Math.PI) + Math.PI) % Math.PI;
}

// Visible contours that no pick has yet: those of a direction that is still rare first, among them the longest.
export function nextContour(drawing: Piece[], picks: Pick[], present: Contour | null): Contour | null {
  const shown = new Map<string, { contour: Contour; length: number; direction: number }>();
  for (const p of drawing) {
    if (p.hidden || p.source === 'limb') continue;
    const key = `${p.source}${p.index}`, had = shown.get(key), l = length(p.points);
    if (!had || l > had.length) shown.set(key, { contour: { index: p.index, circle: p.source === 'circle' }, length: l + (had?.length ?? 0), direction: direction(p.points) });
  }
  const picked = new Set(picks.map((p) => `${p.circle ? 'circle' : 'edge'}${p.contour}`));
  const like = (d: number) => [...shown.entries()].filter(([key, c]) => picked.has(key) && Math.min(Math.abs(c.direction - d), Math.PI - Math.abs(c.direction - d)) < 0.2).length;
  const open = [...shown.entries()].filter(([key]) => !picked.has(key)).map(([, c]) => c);
  if (open.length === 0) return present;
  open.sort((a, b) => like(a.direction) - like(b.direction) || b.length - a.length || a.contour.index - b.contour.index);
  return open[0].contour;
}
