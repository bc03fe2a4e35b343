// Residuals drawn into a picture: from the projected contour to the line that was assigned to it, stretched.
import { linePoints, type Batch } from './lines';
import type { Lines, Part, Piece, Projection } from './types';

// The point of the projected contour nearest to (u, v): perpendicular to it, beyond its ends too.
export function footOn(pieces: Piece[], u: number, v: number): [number, number] | null {
  let best: [number, number] | null = null, least = Infinity;
  for (const { points: q } of pieces) for (let i = 0; i + 3 < q.length; i += 2) {
    const a = q[i], b = q[i + 1], x = q[i + 2] - a, y = q[i + 3] - b, l2 = x * x + y * y;
    if (l2 < 1e-9) continue;
    const w = ((u - a) * x + (v - b) * y) / l2, beyond = Math.max(0, -w, w - 1) * Math.sqrt(l2), foot: [number, number] = [a + w * x, b + w * y];
    const distance = Math.hypot(u - foot[0], v - foot[1]) + beyond;
    if (distance < least) { least = distance; best = foot; }
  }
  return best;
}

const placesALine = 7;

export function batchResiduals(lines: Lines, parts: Part[], projection: Projection | undefined, file: string, magnify: number): Batch[] {
  const rows = new Map(lines.segments.map((r) => [r[0], r])), out: number[][] = [];
  for (const part of parts) {
    const pieces = projection?.parts[part.id]?.pieces ?? [];
    for (const m of part.matches) {
      if (m.image !== file || m.arc) continue;
      const row = rows.get(m.line), edge = pieces.filter((p) => p.source === 'edge' && p.index === m.edge);
      if (!row || edge.length === 0) continue;
      const line = linePoints(row), spans = line.length / 2 - 1;
      for (let k = 0; k < placesALine; k++) {
        const t = (k * spans) / (placesALine - 1), at = Math.min(spans - 1, Math.floor(t)), w = t - at;
        const u = (1 - w) * line[2 * at] + w * line[2 * at + 2], v = (1 - w) * line[2 * at + 1] + w * line[2 * at + 3];
        const foot = footOn(edge, u, v);
        if (foot) out.push([foot[0], foot[1], foot[0] + (u - foot[0]) * magnify, foot[1] + (v - foot[1]) * magnify]);
      }
    }
  }
  return [{ colour: '#ff5d8f', width: 1.6, shapes: out }];
}
