// What a click with a tool would do to a line, before it is done: as the server does it (line_commands.cc).
type Point = [number, number];

const along = (a: Point, b: Point, p: Point) => ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / ((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2);
const between = (a: Point, b: Point, t: number): Point => [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
const distance = (a: Point, b: Point) => Math.hypot(a[0] - b[0], a[1] - b[1]);

const leastPiecePx = 3;

// Where the line from a to b would be split; null too near to an end.
export function splitAt(a: Point, b: Point, p: Point): { at: Point; lengths: Point } | null {
  const length = distance(a, b), first = along(a, b, p) * length;
  return first > leastPiecePx && length - first > leastPiecePx ? { at: between(a, b, first / length), lengths: [first, length - first] } : null;
}

// The line with its nearer end moved to the place along it where p lies.
export function extended(a: Point, b: Point, p: Point): [Point, Point] {
  const to = between(a, b, along(a, b, p));
  return distance(p, a) < distance(p, b) ? [to, b] : [a, to];
}

// The line from the outermost end of the one to that of the other.
export function merged(a: [Point, Point], b: [Point, Point]): [Point, Point] {
  const ends = [...a, ...b].sort((p, q) => along(...a, p) - along(...a, q));
  return [ends[0], ends[3]];
}

// The circle through two points and a third as a path on the screen; a straight line where they lie on one.
export function curvePath(points: Point[]): string {
  const [a, b, c] = points;
  if (!b) return '';
  if (!c) return `M${a} L${b}`;
  const x1 = b[0] - a[0], y1 = b[1] - a[1], x2 = c[0] - a[0], y2 = c[1] - a[1], cross = x1 * y2 - y1 * x2;
  if (Math.abs(cross) < 0.02 * Math.hypot(x1, y1) * Math.hypot(x2, y2)) return `M${a} L${b} L${c}`;
  const p = x1 * x1 + y1 * y1, q = x2 * x2 + y2 * y2, r = Math.hypot(y2 * p - y1 * q, x1 * q - x2 * p) / Math.abs(2 * cross), sweep = cross > 0 ? 1 : 0;
  return `M${a} A${r} ${r} 0 0 ${sweep} ${b} A${r} ${r} 0 0 ${sweep} ${c}`;
}
