// The lines of a picture: drawn fast, and found under the pointer.
import Flatbush from 'flatbush';
import type { ArcRow, LineRow, Lines } from './types';
import type { ViewBox } from './view';

export type ColourBy = 'strength' | 'use' | 'part';

// Dark blue to yellow: readable for every kind of colour sight, light is strong.
export const strengthColours = ['#46579b', '#3d7fb8', '#2fa3b5', '#3fc1a0', '#86d780', '#cfe36c', '#fff06a'];
export function strengthBucket(contrast: number): number {
  return Math.max(0, Math.min(strengthColours.length - 1, Math.floor(Math.log2(Math.max(contrast, 1) / 4))));
}

const palette = ['#4cc9f0', '#f9a03f', '#9ee37d', '#f56fa1', '#b79cff', '#ffe066', '#5ce1c6', '#ff8a71', '#8ab4ff', '#d6a2e8'];
export function partColour(id: string): string {
  const number = Number(/(\d+)$/.exec(id)?.[1] ?? 1);
  return palette[(number - 1 + palette.length * 100) % palette.length];
}
export const unusedColour = '#f0b429', usedColour = '#3ddc97', neutralColour = '#7f93a6';

export function arcPoints(a: ArcRow, steps = 40): number[] {
  const [, u, v, ax, ay, angle, from, to] = a;
  const c = Math.cos(angle), s = Math.sin(angle), out: number[] = [];
  for (let i = 0; i <= steps; i++) {
    const t = from + ((to - from) * i) / steps, x = ax * Math.cos(t), y = ay * Math.sin(t);
    out.push(u + c * x - s * y, v + s * x + c * y);
  }
  return out;
}

// The polyline of a line as [u, v, u, v, ...].
export function linePoints(row: LineRow): number[] {
  return row.length > 7 ? [row[1], row[2], ...row.slice(7), row[3], row[4]] : [row[1], row[2], row[3], row[4]];
}

export function lengthOf(points: number[]): number {
  let sum = 0;
  for (let k = 0; k + 3 < points.length; k += 2) sum += Math.hypot(points[k + 2] - points[k], points[k + 3] - points[k + 1]);
  return sum;
}

export function distanceToSegment(u: number, v: number, a: number, b: number, c: number, d: number): number {
  const x = c - a, y = d - b, l2 = x * x + y * y;
  const t = l2 > 0 ? Math.max(0, Math.min(1, ((u - a) * x + (v - b) * y) / l2)) : 0;
  return Math.hypot(u - a - t * x, v - b - t * y);
}

export interface Found { line: number; circle: boolean; distance: number }

export class LineIndex {
  private tree: Flatbush | null = null;
  private readonly shapes: { line: number; circle: boolean; points: number[] }[] = [];

  constructor(lines: Lines) {
    for (const row of lines.segments) this.shapes.push({ line: row[0], circle: false, points: linePoints(row) });
    for (const row of lines.arcs) this.shapes.push({ line: row[0], circle: true, points: arcPoints(row, 24) });
    if (this.shapes.length === 0) return;
    this.tree = new Flatbush(this.shapes.length);
    for (const s of this.shapes) {
      let u0 = Infinity, v0 = Infinity, u1 = -Infinity, v1 = -Infinity;
      for (let i = 0; i < s.points.length; i += 2) {
        u0 = Math.min(u0, s.points[i]); u1 = Math.max(u1, s.points[i]);
        v0 = Math.min(v0, s.points[i + 1]); v1 = Math.max(v1, s.points[i + 1]);
      }
      this.tree.add(u0, v0, u1, v1);
    }
    this.tree.finish();
  }

  // Lines within `reach` px of the point, nearest first.
  near(u: number, v: number, reach: number): Found[] {
    if (!this.tree) return [];
    const found: Found[] = [];
    for (const i of this.tree.search(u - reach, v - reach, u + reach, v + reach)) {
      const { line, circle, points } = this.shapes[i];
      let distance = Infinity;
      for (let k = 0; k + 3 < points.length; k += 2) distance = Math.min(distance, distanceToSegment(u, v, points[k], points[k + 1], points[k + 2], points[k + 3]));
      if (distance <= reach) found.push({ line, circle, distance });
    }
    return found.sort((a, b) => a.distance - b.distance || a.line - b.line);
  }

  // Straight lines that lie wholly in the box.
  inside(u0: number, v0: number, u1: number, v1: number): Found[] {
    if (!this.tree) return [];
    return this.tree.search(u0, v0, u1, v1).map((i) => this.shapes[i])
      .filter((s) => !s.circle && s.points.every((p, k) => (k % 2 ? p >= v0 && p <= v1 : p >= u0 && p <= u1)))
      .map((s) => ({ line: s.line, circle: false, distance: 0 }));
  }
}

// Strokes of one colour. Software rasterisers slow down with the length of a path: 50 lines a path are fastest.
const linesAPath = 50;
export interface Batch { colour: string; width: number; shapes: number[][] }
export interface Place { batch: number; shape: number }  // in a list of batches: what is drawn next

export function drawBatches(context: CanvasRenderingContext2D, batches: Batch[], view: ViewBox, width: number, height: number) {
  drawSome(context, batches, view, width, height, { batch: 0, shape: 0 }, Infinity);
}

// At most `most` shapes from `place` on; where to go on, or null when all is drawn.
export function drawSome(context: CanvasRenderingContext2D, batches: Batch[], view: ViewBox, width: number, height: number, place: Place, most: number): Place | null {
  const { scale } = view, x = view.x + scale * 0.5, y = view.y + scale * 0.5;
  context.lineCap = 'butt';
  let left = most;
  for (let b = place.batch; b < batches.length; b++) {
    const { colour, width: lineWidth, shapes } = batches[b];
    context.strokeStyle = colour;
    context.lineWidth = lineWidth;
    let count = 0;
    context.beginPath();
    for (let i = b === place.batch ? place.shape : 0; i < shapes.length; i++) {
      if (left-- <= 0) { context.stroke(); return { batch: b, shape: i }; }
      const points = shapes[i];
      const u0 = scale * points[0] + x, v0 = scale * points[1] + y;
      const u1 = scale * points[points.length - 2] + x, v1 = scale * points[points.length - 1] + y;
      if (Math.max(u0, u1) < -50 || Math.max(v0, v1) < -50 || Math.min(u0, u1) > width + 50 || Math.min(v0, v1) > height + 50) continue;
      context.moveTo(u0, v0);
      for (let k = 2; k < points.length; k += 2) context.lineTo(scale * points[k] + x, scale * points[k + 1] + y);
      if (++count % linesAPath === 0) { context.stroke(); context.beginPath(); }
    }
    context.stroke();
  }
  return null;
}

// Groups lines by colour. `partOf(line, circle)`: the part that uses it.
export function batchLines(lines: Lines, by: ColourBy, partOf: (line: number, circle: boolean) => string | undefined, width: number): Batch[] {
  const groups = new Map<string, number[][]>();
  const add = (colour: string, points: number[]) => {
    const group = groups.get(colour);
    if (group) group.push(points); else groups.set(colour, [points]);
  };
  const colourOf = (line: number, circle: boolean, contrast: number) => {
    if (by === 'strength') return strengthColours[strengthBucket(contrast)];
    const part = partOf(line, circle);
    if (by === 'use') return part ? usedColour : unusedColour;
    return part ? partColour(part) : neutralColour;
  };
  for (const row of lines.segments) add(colourOf(row[0], false, row[5]), linePoints(row));
  for (const row of lines.arcs) add(colourOf(row[0], true, row[8]), arcPoints(row));
  return [...groups].map(([colour, shapes]) => ({ colour, width, shapes }));
}
