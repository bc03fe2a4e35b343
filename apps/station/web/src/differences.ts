// What an edit changed, for people.
import { dimensionsOf, type Difference, type Part } from './types';

export interface Shown { id: string; how: 'added' | 'removed' | 'changed'; what: string; part: boolean }

export function differencesOf(differences: Difference[]): Shown[] {
  const shown: Shown[] = [];
  for (const d of differences) {
    if (d.kind !== 'part') {
      shown.push({ id: d.kind === 'lines' ? d.id : d.id === 'run' ? 'survey run' : d.id, how: d.before === null ? 'added' : d.after === null ? 'removed' : 'changed', what: '', part: false });
      continue;
    }
    const before = d.before as Part | null, after = d.after as Part | null;
    if (!before || !after) { shown.push({ id: d.id, how: before ? 'removed' : 'added', what: (after ?? before)!.kind, part: true }); continue; }
    const what = changesOf(before, after);
    if (what) shown.push({ id: d.id, how: 'changed', what, part: true });
  }
  return shown;
}

function changesOf(before: Part, after: Part): string {
  const out: string[] = [];
  if (before.kind !== after.kind) out.push(`${before.kind} → ${after.kind}`);
  if (before.confirmed !== after.confirmed) out.push(after.confirmed ? 'confirmed' : 'no longer confirmed');
  for (const [name, d] of dimensionsOf(after)) {
    const old = before.dimensions[name];
    if (old && old.value.toFixed(2) !== d.value.toFixed(2)) out.push(`${name} ${old.value.toFixed(2)} → ${d.value.toFixed(2)}`);
  }
  const moved = Math.hypot(...after.pose.position.map((x, i) => x - before.pose.position[i]));
  if (moved > 0.005) out.push(`moved ${moved.toFixed(2)} mm`);
  if (before.matches.length !== after.matches.length) out.push(`lines ${before.matches.length} → ${after.matches.length}`);
  return out.join(', ');
}
