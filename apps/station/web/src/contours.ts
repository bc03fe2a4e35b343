// Which contour of an object a person should pick next.
import { distanceToSegment } from './lines';
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
// `seen`: the projected contours of the present picture, where the part is placed already; then only visible ones.
export function nextContour(drawing: Piece[], picks: Pick[], present: Contour | null, seen: Piece[] = []): Contour | null {
  const shown = new Map<string, { contour: Contour; length: number; direction: number }>();
  const here = new Set(seen.filter((p) => !p.hidden).map((p) => `${p.source}${p.index}`));
  for (const p of drawing) {
    if (p.source === 'limb' || (here.size > 0 ? !here.has(`${p.source}${p.index}`) : p.hidden)) continue;
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

// Mean distance (px) of a line's points from a projected contour; infinite where it runs another way or lies beyond.
function distanceFrom(pieces: Piece[], contour: Contour, points: number[]): number {
  const source = contour.circle ? 'circle' : 'edge', mine = pieces.filter((p) => p.source === source && p.index === contour.index && !p.hidden);
  if (mine.length === 0 || points.length < 4) return Infinity;
  let sum = 0;
  const samples = 5;
  for (let k = 0; k < samples; k++) {
    const at = Math.min(points.length / 2 - 2, Math.floor((k / (samples - 1)) * (points.length / 2 - 1))), w = (k / (samples - 1)) * (points.length / 2 - 1) - at;
    const u = (1 - w) * points[2 * at] + w * points[2 * at + 2], v = (1 - w) * points[2 * at + 1] + w * points[2 * at + 3];
    let least = Infinity;
    for (const { points: q } of mine) for (let i = 0; i + 3 < q.length; i += 2) least = Math.min(least, distanceToSegment(u, v, q[i], q[i + 1], q[i + 2], q[i + 3]));
    sum += least;
  }
  return sum / samples;
}

const nearPx = 6;      // a first fit lies so near to its lines
const distinctPx = 1;  // two contours whose distances differ by less cannot be told apart

// The one visible contour on which a line lies; null where there is none, or where two would do.
export function contourAt(pieces: Piece[], points: number[], circle: boolean): Contour | null {
  const contours = new Map<number, Contour>();
  for (const p of pieces) if (!p.hidden && p.source === (circle ? 'circle' : 'edge')) contours.set(p.index, { index: p.index, circle });
  const ranked = [...contours.values()].map((contour) => ({ contour, distance: distanceFrom(pieces, contour, points) })).sort((a, b) => a.distance - b.distance);
  if (ranked.length === 0 || ranked[0].distance > nearPx || (ranked.length > 1 && ranked[1].distance - ranked[0].distance < distinctPx)) return null;
  return ranked[0].contour;
}

// Whether a line may as well be the contour that the operator chose as the one on which it lies.
export function samePlace(there: Contour, chosen: Contour, pieces: Piece[], points: number[]): boolean {
  if (there.circle === chosen.circle && there.index === chosen.index) return true;
  return distanceFrom(pieces, chosen, points) - distanceFrom(pieces, there, points) < nearPx;
}

// A length as people type it, with a point or a comma; null where it is none.
export function millimetresOf(text: string): number | null {
  const value = Number(text.trim().replace(',', '.'));
  return text.trim() !== '' && Number.isFinite(value) && value > 0 ? value : null;
}
