import { t } from './texts';
import type { CalibrationJobs, Cut, Difference, Fit, HistoryRow, KnownObject, Lines, Piece, Projection, Proposal, ScenePart, SceneSeam, State, Survey } from './types';

export class Refused extends Error {
  constructor(public status: number, message: string) { super(message); }
}

let who = 'operator';
export function setWho(name: string) { who = name; }

async function ask<T>(path: string, body?: object, signal?: AbortSignal): Promise<T> {
  let answer: Response;
  try {
    answer = await fetch('/api/' + path, body === undefined ? {} : {
      signal, method: 'POST', headers: { 'Content-Type': 'application/json', 'X-VSS-Who': encodeURIComponent(who) }, body: JSON.stringify(body),
    });
  } catch {
    throw new Refused(0, t.noAnswer);
  }
  const json = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Refused(answer.status, (json as { error?: string }).error ?? t.answered(answer.status));
  return json as T;
}

export const api = {
  survey: () => ask<Survey>('survey'),
  state: (since: number) => ask<State>(`state?since=${since}`),
  knowledge: () => ask<{ objects: KnownObject[] }>('knowledge'),
  lines: (image: number) => ask<Lines>(`pictures/${image}/lines`),
  projection: (image: number) => ask<Projection>(`pictures/${image}/projection`),
  outlines: (part: string) => ask<{ pictures: Record<string, Piece[]> }>(`outlines/${encodeURIComponent(part)}`),
  before: (image: number, edit: number) => ask<{ parts: Record<string, Piece[]> }>(`pictures/${image}/before?edit=${edit}`),
  scene: () => ask<{ parts: ScenePart[]; seams: SceneSeam[] }>('scene'),
  history: (before = 0, limit = 100) => ask<{ rows: HistoryRow[] }>(`history?before=${before}&limit=${limit}`),
  differences: (edit: number) => ask<{ differences: Difference[] }>(`history?limit=1&edit=${edit}`),
  calibrationJobs: () => ask<CalibrationJobs>('calibration'),
  manual: () => ask<{ pages: { name: string; text: string }[] }>('manual'),
  measure: (a: string, b: string) => ask<{ distance: number; sigma: number | null; delta: [number, number, number] }>(`measure?a=${encodeURIComponent(a)}&b=${encodeURIComponent(b)}`),
  drawing: (kind: string, features: string[] | undefined, dimensions: Record<string, number> = {}, resting_pose = 0) => ask<{ pieces: Piece[]; size: number }>('drawing', { kind, features, dimensions, resting_pose }),
  cut: (part: string, image: number, at: [number, number], along: string) => ask<Cut>('cut', { part, image, at, along }),
  fit: (question: object) => ask<Fit>('fit', question),
  propose: (question: object, signal: AbortSignal) => ask<Proposal>('propose', question, signal),
  command: (name: string, args: object = {}) => ask<Record<string, unknown> & { revision: number }>('command', { do: name, ...args }),
};

// Saves what the station answers as a file of that name; a refusal is an error with its sentence.
export async function download(path: string) {
  const answer = await fetch('/api/' + path).catch(() => { throw new Refused(0, t.noAnswer); });
  if (!answer.ok) throw new Refused(answer.status, ((await answer.json().catch(() => ({}))) as { error?: string }).error ?? t.answered(answer.status));
  const name = /filename="([^"]+)"/.exec(answer.headers.get('Content-Disposition') ?? '')?.[1] ?? 'file', link = document.createElement('a');
  link.href = URL.createObjectURL(await answer.blob());
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// The first picture is on its way already (public/early.js).
declare global { interface Window { vssEarly?: { image: number; answer: Promise<Response>; shown: Promise<void>; done: boolean } } }
let taken = false;
export function fetchPicture(image: number): Promise<Response> {
  const early = taken ? undefined : window.vssEarly;
  taken = true;
  return early?.image === image ? early.answer : fetch(`/api/pictures/${image}/image`);
}
// The page shows the picture itself from here on.
export function endEarly() {
  if (window.vssEarly) window.vssEarly.done = true;
  document.getElementById('early')?.remove();
}

// Messages of the server; opens again by itself after the server was away.
export function listen(message: (m: { type: string; [key: string]: unknown }) => void, connected: (yes: boolean) => void) {
  const open = () => {
    const socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/api/live`);
    socket.onopen = () => connected(true);
    socket.onmessage = (e) => message(JSON.parse(e.data as string));
    socket.onclose = () => { connected(false); setTimeout(open, 1000); };
  };
  open();
}
