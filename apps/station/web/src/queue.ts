// What needs a person, worst first, and why.
import type { Part } from './types';
import { t } from './texts';

export interface Task { id: string; kind: 'part' | 'unknown'; why: string; severity: number; place: [number, number, number] }
export interface Unknown { center: [number, number, number]; extent: [number, number, number]; num_lines: number }

export function reasonOf(part: Part): string {
  if (part.doubt) return part.doubt;
  if (part.doubtful) return t.queue.doubtful;
  const hidden = Object.entries(part.dimensions).filter(([, d]) => !d.observable && d.origin !== 'given by the operator').map(([name]) => name);
  return hidden.length > 0 ? t.queue.hidden(hidden) : '';
}

export function tasksOf(parts: Part[], unknown: Unknown[]): Task[] {
  const tasks: Task[] = [];
  for (const part of parts) {
    if (part.confirmed) continue;
    const why = reasonOf(part);
    if (!why) continue;
    // Doubtful ones first, the least likely of them before the others; then parts with a dimension that nobody sees.
    const severity = part.doubtful ? 1000 - Math.min(500, Math.max(-400, part.log_odds)) : 100;
    tasks.push({ id: part.id, kind: 'part', why, severity, place: part.pose.position });
  }
  unknown.forEach((u, i) => tasks.push({ id: `unknown-${i + 1}`, kind: 'unknown', why: t.queue.unknown(u.num_lines), severity: 300 + Math.min(99, u.num_lines), place: u.center }));
  return tasks.sort((a, b) => b.severity - a.severity || a.id.localeCompare(b.id, 'en', { numeric: true }));
}
