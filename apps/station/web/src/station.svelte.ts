// The state of the page: what the server says, and what the operator looks at.
import { api, download, endEarly, listen, Refused, setWho } from './api';
import { contourAt, samePlace, type Contour } from './contours';
import type { Keys } from './keymap';
import { arcPoints, lengthOf, LineIndex, linePoints, type ColourBy, type Found } from './lines';
import { readAs, samePicks } from './proposal';
import { tasksOf, type Unknown } from './queue';
import { t } from './texts';
import { plainTone, type Tone } from './tone';
import type { Fit, Hint, Item, KnownObject, Lines, Parameter, Part, Pick, Piece, Projection, Proposal, Run, ScenePart, SceneSeam, State, Survey } from './types';

export type Tab = 'parts' | 'todo' | 'build' | 'parameters' | 'cameras' | 'history' | 'help';
export type Tool = 'look' | 'band' | 'draw' | 'arc' | 'cut' | 'split' | 'extend' | 'merge' | 'remove';
export type ViewMode = 'picture' | 'scene' | 'both';
export interface Layers { picture: boolean; lines: boolean; parts: boolean; hidden: boolean; residuals: boolean; vertices: boolean }
export interface Toast { text: string; bad: boolean; id: number }
export interface LoadedLines extends Lines { index: LineIndex; stamp: string }

export interface Build {
  kind: string; features?: string[]; part: string; standsOn: string; restingPose: string; picks: Pick[]; fixed: Record<string, number>; contour: { index: number; circle: boolean } | null; chosen?: boolean;  // chosen: by the operator, not by the page
}

function remembered<T>(name: string, otherwise: T): T {
  try { return { ...otherwise, ...(JSON.parse(localStorage.getItem('vss.' + name) ?? 'null') as T) }; } catch { return otherwise; }
}
function remember(name: string, value: unknown) {
  try { localStorage.setItem('vss.' + name, JSON.stringify(value)); } catch { /* a private window keeps nothing */ }
}

const mostProposed = 16;  // lines that a proposal takes
const longestWaitMs = 2000;  // that the rest waits for the first picture

class Station {
  survey = $state.raw<Survey | null>(null);
  objects = $state.raw<KnownObject[]>([]);
  items = $state.raw<Map<string, Item>>(new Map());
  revision = $state(0);
  undo = $state.raw<State['undo']>(null);
  redo = $state.raw<State['redo']>(null);
  run = $state.raw<Run>({ state: 'none' });
  stale = $state(false);                 // the parts were found with other cameras
  parameters = $state.raw<Parameter[]>([]);
  connected = $state(true);
  fatal = $state('');
  toasts = $state<Toast[]>([]);

  image = $state(remembered('page', { image: 0 }).image);
  selected = $state('');                 // a part
  hovered = $state('');
  line = $state<Found | null>(null);     // a line of the present picture
  tab = $state<Tab>('parts');
  tool = $state<Tool>('look');
  view = $state<ViewMode>('picture');
  layers = $state<Layers>({ picture: true, lines: true, parts: true, hidden: true, residuals: false, vertices: false });
  colourBy = $state<ColourBy>('strength');
  tone = $state<Tone>({ ...plainTone });
  magnify = $state(40);
  who = $state('operator');
  helpPage = $state('');
  helpSection = $state('');             // a heading of that page
  parameterSearch = $state('');
  keys = $state.raw<Keys>({});           // that the operator changed
  showKeys = $state(false);
  exportOpen = $state(false);
  choosing = $state<'' | 'kind' | 'merge'>('');  // what the selected part shall become, or with what be one
  showScene: ((name: string) => boolean) | null = null;  // set by the 3D view: what a key does there
  guide = $state(-1);
  guideDone = $state<Record<string, boolean>>({});

  lines = $state.raw<Map<number, LoadedLines>>(new Map());
  projections = $state.raw<Map<number, Projection & { revision: number }>>(new Map());
  outlines = $state.raw<{ part: string; pictures: Record<string, Piece[]> }>({ part: '', pictures: {} });  // of the selected part, in all pictures
  broken = $state.raw<Map<number, string>>(new Map());  // pictures that cannot be read, and why
  scene = $state.raw<{ parts: ScenePart[]; seams: SceneSeam[]; revision: number }>({ parts: [], seams: [], revision: -1 });

  build = $state<Build | null>(null);
  fit = $state.raw<Fit | null>(null);
  fitError = $state('');
  // Shown, but not accepted yet. `asked`: the picks that were read; `before`: those that there were.
  proposed = $state.raw<{ readings: Proposal['readings']; decided: boolean; shown: number; asked: Pick[]; before: Pick[] } | null>(null);
  proposing = $state.raw<AbortController | null>(null);  // a proposal is being looked for

  compared = $state(0);                  // the edit before which the pictures show changed parts, dotted
  before = $state.raw<{ image: number; edit: number; pieces: Piece[] } | null>(null);

  pictured = $state(false);              // the first picture is on the screen

  // Set by the picture view: brings a box of the picture (px) into view.
  show: ((u0: number, v0: number, u1: number, v1: number) => void) | null = null;

  parts = $derived([...this.items.values()].filter((i) => i.kind === 'part').map((i) => i.value as Part)
    .sort((a, b) => a.id.localeCompare(b.id, 'en', { numeric: true })));
  part = $derived(this.parts.find((p) => p.id === this.selected) ?? null);
  unknown = $derived(((this.items.get('settings/run')?.value as { unknown?: Unknown[] } | undefined)?.unknown ?? []));
  reduced = $derived(!!(this.items.get('settings/run')?.value as { temperature?: object } | undefined)?.temperature);  // lengths are as at 20 degrees
  tasks = $derived(tasksOf(this.parts, this.unknown));
  // Which part uses a line: "image:line" -> part; arcs as "image:a:line".
  users = $derived.by(() => {
    const users = new Map<string, string>(), files = new Map(this.survey?.images.map((im, i) => [im.file, i]) ?? []);
    for (const p of this.parts) for (const m of p.matches) users.set(`${files.get(m.image)}:${m.arc ? 'a:' : ''}${m.line}`, p.id);
    return users;
  });
  partOfLine(image: number, line: number, circle: boolean) { return this.users.get(`${image}:${circle ? 'a:' : ''}${line}`); }

  version(kind: string, id: string): number { return this.items.get(`${kind}/${id}`)?.version ?? 0; }
  fileOf(image: number) { return this.survey?.images[image]?.file ?? ''; }
  imageOf(file: string) { return this.survey?.images.findIndex((i) => i.file === file) ?? -1; }

  async start() {
    const place = remembered('place', { survey: '', tab: this.tab, selected: '' }), kept = remembered('page', { image: 0, layers: this.layers, colourBy: this.colourBy, who: this.who, view: this.view, tone: { ...plainTone }, magnify: this.magnify, keys: this.keys });
    Object.assign(this, { ...kept, image: this.image, layers: { ...this.layers, ...kept.layers } });
    setWho(this.who);
    try {
      this.survey = await api.survey();
      this.image = Math.min(kept.image, this.survey.images.length - 1);
      setTimeout(() => this.firstPictureShown(), this.view === 'scene' ? 0 : longestWaitMs);  // where none is shown, or it cannot be read
      await this.refresh();
      this.started = true;
      if (place.survey === this.survey.name) this.tab = place.tab === 'build' ? 'parts' : place.tab;
      if (place.survey === this.survey.name && this.items.has(`part/${place.selected}`)) this.selected = place.selected;
      this.loadRest();
      this.objects = (await api.knowledge()).objects;
    } catch (e) {
      this.fatal = (e as Error).message;
      return;
    }
    const open = remembered<{ build: Build | null; survey: string }>('build', { build: null, survey: '' });
    if (open.build && open.survey === this.survey.name) { this.build = open.build; this.tab = 'build'; void this.ask(); }
    listen((m) => this.hear(m), (yes) => {
      if (yes && !this.connected) void this.refresh();
      this.connected = yes;
    });
  }

  private started = false;               // survey and parts are known
  private loadRest() { if (this.pictured && this.started) void this.loadPicture(this.image).then(() => this.loadAllLines()); }

  // What is not needed for the first picture waits for it.
  firstPictureShown() {
    if (this.pictured) return;
    this.pictured = true;
    endEarly();
    this.loadRest();
  }

  keep() {
    remember('page', { image: this.image, layers: this.layers, colourBy: this.colourBy, who: this.who, view: this.view, tone: this.tone, magnify: this.magnify, keys: this.keys });
    remember('build', { build: this.build, survey: this.survey?.name });
  }
  keepPlace() { if (this.survey) remember('place', { survey: this.survey.name, tab: this.tab, selected: this.selected }); }
  setName(name: string) { this.who = name.trim() || 'operator'; setWho(this.who); this.keep(); }

  say(text: string, bad = false) {
    const id = Math.random();
    this.toasts = [...this.toasts.filter((x) => x.text !== text).slice(-2), { text, bad, id }];
    setTimeout(() => (this.toasts = this.toasts.filter((x) => x.id !== id)), bad ? 9000 : 4500);
  }

  private hear(m: { type: string; [key: string]: unknown }) {
    if (m.type === 'run') {
      this.run = m.run as Run;
      const said = t.runs[this.run.job ?? 'survey'];
      if (this.run.state === 'done') this.say(said.done(this.run.message ?? ''));
      if (this.run.state === 'cancelled') this.say(said.cancelled);
      if (this.run.state === 'done') { this.guideDone.run ||= this.run.job !== 'calibration'; void this.refresh(); }
    }
    // Whether it is an edit of this page is known once its own commands are answered.
    if (m.type === 'edit') void this.queue.then(() => {
      const revision = m.revision as number;
      if (this.mine.has(revision)) return;
      this.others++;
      this.say(t.othersEdit(String(m.who)));
      if (revision > this.revision) void this.refresh();
    });
  }

  private refreshing: Promise<void> = Promise.resolve();
  refresh(): Promise<void> { return (this.refreshing = this.refreshing.catch(() => {}).then(() => this.fetchState())); }

  private async fetchState() {
    let state: State;
    try {
      state = await api.state(this.revision);
    } catch (e) {
      if ((e as Refused).status !== 0 || this.revision === 0) throw e;
      return;  // the station is away; when it is back, everything is fetched
    }
    const items = new Map(this.items), cameras = this.version('settings', 'cameras');
    for (const item of state.items) {
      if (item.value === null) items.delete(`${item.kind}/${item.id}`); else items.set(`${item.kind}/${item.id}`, item);
    }
    this.items = items;
    this.revision = state.revision;
    this.undo = state.undo; this.redo = state.redo; this.run = state.run; this.stale = state.stale; this.parameters = state.parameters;
    if (this.selected && !items.has(`part/${this.selected}`)) this.selected = '';
    if (this.version('settings', 'cameras') !== cameras) {  // other cameras: other places and lenses
      this.survey = await api.survey();
      void this.loadAllLines();
    }
    if (this.pictured && this.started) void this.loadPicture(this.image);
    if (this.view !== 'picture') void this.loadScene();
  }

  // Lines change with the run's parameters, with the cameras' lenses and with the operator's edits of that picture.
  private linesStamp(image: number) { return ['run', 'cameras'].map((id) => this.version('settings', id)).join(':') + ':' + this.version('lines', this.fileOf(image)); }

  async loadLines(image: number) {
    const stamp = this.linesStamp(image);
    if (this.lines.get(image)?.stamp === stamp) return;
    const lines = await api.lines(image).catch((e: Refused) => {
      if (e.status === 422) this.markBroken(image, e.message);
      throw e;
    });
    this.lines = new Map(this.lines).set(image, { ...lines, index: new LineIndex(lines), stamp });
  }

  async loadPicture(image: number) {
    try {
      await this.loadLines(image);
      if (this.projections.get(image)?.revision === this.revision) return;
      const revision = this.revision, projection = await api.projection(image);
      this.projections = new Map(this.projections).set(image, { ...projection, revision });
    } catch (e) { if (!this.broken.has(image)) this.complain(e as Refused); }
  }

  // Of a picture that can be read again `why` is empty.
  markBroken(image: number, why: string) {
    if ((this.broken.get(image) ?? '') === why) return;
    const broken = new Map(this.broken);
    if (why) broken.set(image, why); else broken.delete(image);
    this.broken = broken;
  }

  // Where the selected part lies in every picture, for the strip.
  private outlined = '';
  async loadOutlines() {
    const part = this.selected, asked = `${part} ${this.revision}`;
    if (!part) { this.outlined = ''; this.outlines = { part: '', pictures: {} }; return; }
    if (asked === this.outlined) return;
    this.outlined = asked;
    const answer = await api.outlines(part).catch(() => ({ pictures: {} }));  // its kind may be unknown here
    if (asked === this.outlined) this.outlines = { part, ...answer };
  }
  // What lights up in a picture of the strip: the part that is being built, else the selected one.
  outlineIn(image: number): Piece[] {
    const pieces = this.build ? this.fit?.projections[String(image)] : this.outlines.part === this.selected ? this.outlines.pictures[String(image)] : undefined;
    return pieces?.filter((p) => !p.hidden) ?? [];
  }

  private async loadAllLines() {
    for (let i = 0; i < (this.survey?.images.length ?? 0); i++) await this.loadLines(i).catch(() => {});
  }

  // How the parts that an edit changed looked before it, in the present picture; 0: not any more.
  async compare(edit: number) {
    this.compared = edit;
    this.before = null;
    if (!edit) return;
    const image = this.image;
    try {
      const pieces = Object.values((await api.before(image, edit)).parts).flat();
      if (edit === this.compared && image === this.image) this.before = { image, edit, pieces };
    } catch (e) { this.complain(e as Error); }
  }

  async loadScene() {
    if (this.scene.revision === this.revision) return;
    const revision = this.revision;
    this.scene = { ...(await api.scene()), revision };
  }

  go(image: number) {
    const n = this.survey?.images.length ?? 0;
    if (n === 0) return;
    this.image = ((image % n) + n) % n;
    this.line = null;
    this.guideDone.look = true;
    this.keep();
    void this.loadPicture(this.image);
    if (this.compared) void this.compare(this.compared);
  }

  // A cut divides one dimension of the selected part: which ones it may, and which one is chosen.
  cuts = $derived(this.objects.find((o) => o.kind === this.part?.kind)?.cuts ?? []);
  along = $state('');
  turnCut() { this.along = this.cuts[(this.cuts.indexOf(this.along) + 1) % this.cuts.length] ?? ''; }
  startCut() { this.along = this.cuts[0] ?? ''; this.tool = 'cut'; }

  select(id: string) {
    if (id !== this.selected && this.tool === 'cut') this.tool = 'look';
    if (id !== this.selected) this.choosing = '';
    this.selected = id;
    if (id) this.guideDone.select = true;
  }

  openTab(tab: Tab) {
    this.tab = tab;
    if (tab === 'build' && !this.build) this.startBuild();
  }
  runOrCancel() { void this.command(this.run.state === 'running' ? 'cancel' : 'run'); }
  // What a key does to the selected part is shown beside it.
  choose(what: 'kind' | 'merge') { this.tab = 'parts'; this.choosing = this.choosing === what ? '' : what; }
  refit(part: Part) { return this.command('refit_part', { part: part.id, version: this.version('part', part.id) }); }
  // Pointing is done in a picture that shows the part.
  async cut(part: Part) {
    if (this.tool === 'cut') { this.tool = 'look'; return; }
    this.tab = 'parts';
    if (this.view === 'scene') this.view = 'both';
    await this.showPart(part);
    this.startCut();
  }

  async take(path: string) { try { await download(path); } catch (e) { this.complain(e as Error); } }

  // The picture that shows a part best: the one with most of its lines.
  bestImageOf(part: Part): number {
    const count = new Map<string, number>();
    for (const m of part.matches) count.set(m.image, (count.get(m.image) ?? 0) + 1);
    const best = [...count].sort((a, b) => b[1] - a[1])[0]?.[0];
    return best ? this.imageOf(best) : this.nearestImageOf(part.pose.position);
  }
  // A place of the world in a picture, px, as a pinhole would show it; null behind the camera.
  private seenAt(place: number[], image: number): [number, number] | null {
    const im = this.survey!.images[image], c = this.survey!.cameras[im.camera], d = place.map((x, k) => x - im.center[k]);
    const [x, y, z] = im.rotation.map((row) => row[0] * d[0] + row[1] * d[1] + row[2] * d[2]);
    return z > 0 ? [(c.fx * x) / z + c.cx, (c.fy * y) / z + c.cy] : null;
  }
  // The picture in whose middle a place lies most nearly.
  private nearestImageOf(place: [number, number, number]): number {
    let best = this.image, least = Infinity;
    this.survey?.images.forEach((im, i) => {
      const c = this.survey!.cameras[im.camera], at = this.seenAt(place, i);
      const off = at ? Math.hypot(at[0] - c.width / 2, at[1] - c.height / 2) : Infinity;
      if (off < least) { least = off; best = i; }
    });
    return best;
  }

  async nextTask() {
    this.guideDone.doubt = true;
    if (this.tasks.length === 0) { this.tab = 'todo'; return; }
    const at = this.tasks.findIndex((x) => x.id === this.selected);
    await this.openTask(this.tasks[(at + 1) % this.tasks.length].id);
  }

  async openTask(id: string) {
    this.tab = 'todo';
    this.guideDone.doubt = true;
    const part = this.parts.find((p) => p.id === id);
    this.selected = id;
    if (part) { await this.showPart(part); return; }
    const group = this.unknown[Number(/^unknown-(\d+)$/.exec(id)?.[1]) - 1];
    if (group) this.showPlace(group.center, group.extent);
  }

  // A box of the world (mm, centre and extent) in the picture in whose middle it lies.
  private showPlace(center: [number, number, number], extent: [number, number, number]) {
    this.showing++;
    this.go(this.nearestImageOf(center));
    const us: number[] = [], vs: number[] = [];
    for (const corner of [0, 1, 2, 3, 4, 5, 6, 7]) {
      const at = this.seenAt(center.map((x, k) => x + (extent[k] / 2) * ((corner >> k) & 1 ? 1 : -1)), this.image);
      if (at) { us.push(at[0]); vs.push(at[1]); }
    }
    if (us.length > 1) this.show?.(Math.min(...us), Math.min(...vs), Math.max(...us), Math.max(...vs));
  }

  private showing = 0;
  async showPart(part: Part) {
    const asked = ++this.showing, best = this.bestImageOf(part);
    if (best >= 0) this.go(best);
    await this.loadPicture(this.image);
    if (asked !== this.showing) return;  // another one was asked for meanwhile
    const pieces = this.projections.get(this.image)?.parts[part.id]?.pieces ?? [];
    const points = pieces.flatMap((p) => p.points);
    if (points.length < 4) return;
    const us = points.filter((_, i) => i % 2 === 0), vs = points.filter((_, i) => i % 2 === 1);
    this.show?.(Math.min(...us), Math.min(...vs), Math.max(...us), Math.max(...vs));
  }

  // That the station is away is said once, in its own place.
  complain(e: Error) { if (!(e instanceof Refused && e.status === 0 && !this.connected)) this.say(e.message, true); }

  private queue: Promise<unknown> = Promise.resolve();
  private mine = new Set<number>();  // revisions that this page made
  private others = 0;                // edits of other pages heard of

  // One edit after the other, each upon what the one before left; what the server refuses is said, and what somebody else
  // changed is fetched. `args` as a function is asked when its turn comes; null: there is nothing to do any more.
  command(name: string, args: object | (() => object | null) = {}): Promise<(Record<string, unknown> & { revision: number }) | null> {
    const seen = this.others;
    const turn = this.queue.then(() => {
      if (typeof args !== 'function') return this.send(name, args);
      const now = args();
      return now && seen === this.others ? this.send(name, now) : null;
    });
    this.queue = turn.catch(() => {});
    return turn;
  }
  private async send(name: string, args: object): Promise<(Record<string, unknown> & { revision: number }) | null> {
    try {
      const answer = await api.command(name, args);
      if (answer.revision) {
        this.mine.add(answer.revision);
        this.guideDone.edit ||= name === 'undo';
        await this.refresh();
      }
      return answer;
    } catch (e) {
      const refused = e as Refused;
      if (refused.status === 409) { this.say(t.conflict(refused.message), true); await this.refresh(); } else this.complain(refused);
      return null;
    }
  }
  undoIt() { return this.command('undo', () => this.undo && { edit: this.undo.edit }); }
  redoIt() { return this.command('redo', () => this.redo && { edit: this.redo.edit }); }
  confirm(part: Part, confirmed = true) { return this.command('confirm_part', { part: part.id, confirmed, version: this.version('part', part.id) }); }
  measure(part: Part) { return this.command('measure_part', { part: part.id, version: this.version('part', part.id) }); }
  removeLine(line: Found) { return this.command('remove_line', { image: this.image, line: line.line, circle: line.circle, version: this.version('lines', this.fileOf(this.image)) }); }
  remove(part: Part) { return this.command('delete_part', { part: part.id, version: this.version('part', part.id) }); }

  // ---- by hand ----
  startBuild(kind = '') {
    this.build = { kind, part: '', standsOn: 'ground', restingPose: '', picks: [], fixed: {}, contour: null };
    this.fit = null; this.fitError = ''; this.proposed = null;
    this.tab = 'build'; this.tool = 'look';
    if (this.view === 'scene') this.view = 'both';
  }
  correct(part: Part) {
    const picks = part.matches.map((m) => ({ image: this.imageOf(m.image), line: m.line, contour: m.edge, circle: m.arc, residual_px: m.residual_px }));
    const fixed = Object.fromEntries(Object.entries(part.dimensions).filter(([, d]) => d.origin === 'given by the operator').map(([n, d]) => [n, d.value]));
    this.build = { kind: part.kind, features: part.features, part: part.id, standsOn: part.stands_on, restingPose: part.resting_pose, picks, fixed, contour: null };
    this.fit = null; this.fitError = ''; this.proposed = null;
    this.tab = 'build'; this.tool = 'look';
    this.selected = part.id;
    void this.ask();
  }
  stopBuild() { this.build = null; this.fit = null; this.proposed = null; this.fitError = ''; this.tab = 'parts'; if (this.tool === 'band') this.tool = 'look'; this.keep(); }

  private question(collect = false) {
    const b = this.build!;
    return {
      kind: b.kind, features: b.features, part: b.part || undefined, stands_on: b.standsOn, resting_pose: b.restingPose || undefined, fixed: b.fixed, collect, image: this.image,
      picks: b.picks.map(({ image, line, contour, circle }) => ({ image, line, contour, circle })),
    };
  }

  private asked = 0;
  async ask(collect = false) {
    if (!this.build || !this.build.kind || this.build.picks.length === 0) { this.fit = null; this.keep(); return; }
    const asked = ++this.asked;
    try {
      const fit = await api.fit(this.question(collect));
      if (asked !== this.asked || !this.build) return;
      this.fit = fit; this.fitError = '';
      this.build.picks = fit.picks;
      if (this.build.contour && !this.build.chosen) this.advance?.();
    } catch (e) {
      if (asked === this.asked) this.fitError = (e as Error).message;
    }
    this.keep();
  }

  pick(line: number, circle: boolean) {
    const b = this.build;
    if (!b) return;
    this.proposed = null;
    const had = b.picks.findIndex((p) => p.image === this.image && p.line === line && p.circle === circle);
    if (had >= 0) {  // a second click takes the line out
      b.picks.splice(had, 1);
      void this.ask();
      return;
    }
    const there = this.contourOf(line, circle);
    if (there && (!b.contour || !samePlace(there, b.contour, this.fit?.projections[String(this.image)] ?? [], this.pointsOf(line, circle)))) {
      if (b.contour && b.chosen) this.say(t.build.taken(t.build.contourName(there.circle, there.index)));
      b.contour = there;
    }
    if (!b.contour) { this.say(t.build.contourHint); return; }
    if (b.contour.circle !== circle) { this.say(t.build.otherShape(b.contour.circle), true); return; }
    b.picks.push({ image: this.image, line, contour: b.contour.index, circle });
    this.advance?.();
    void this.ask();
  }
  // Which line is which: VSS's reading of the picks is shown until the operator accepts it or goes back.
  // `boxed`: lines that were not picked one by one; those that are not the part's are left out.
  async propose(boxed: Pick[] = []) {
    const b = this.build;
    if (!b?.kind) return;
    const before = b.picks.map((p) => ({ ...p })), asked = [...before, ...boxed];
    if (asked.length === 0) { this.say(t.build.proposeFirst); return; }
    this.proposing?.abort();
    const mine = (this.proposing = new AbortController());
    try {
      const { readings, decided } = await api.propose({ ...this.question(), picks: asked.map(({ image, line, contour, circle }) => ({ image, line, contour, circle })), some: boxed.length > 0 }, mine.signal);
      if (this.build !== b || !samePicks(b.picks, before)) return;  // the operator went on
      this.proposed = { readings, decided, shown: 0, asked, before };
      this.showReading(0);
    } catch (e) {
      if (mine.signal.aborted) return;
      this.proposed = null;
      this.complain(e as Error);
    } finally { if (this.proposing === mine) this.proposing = null; }
  }
  stopProposing() { this.proposing?.abort(); this.proposing = null; }
  showReading(i: number) {
    if (!this.build || !this.proposed) return;
    this.proposed = { ...this.proposed, shown: i };
    this.build.picks = readAs(this.proposed.asked, this.proposed.readings[i].contours);
    void this.ask();
  }
  endProposal(accept: boolean) {
    if (!this.build || !this.proposed) return;
    if (!accept) { this.build.picks = this.proposed.before; void this.ask(); }  // with `before` empty there is no fit any more
    this.proposed = null;
  }
  // Another contour for a pick.
  reassign(i: number, contour: number) {
    if (!this.build) return;
    this.proposed = null;
    this.build.picks[i].contour = contour;
    void this.ask();
  }
  private pointsOf(line: number, circle: boolean): number[] {
    const lines = this.lines.get(this.image), row = (circle ? lines?.arcs : lines?.segments)?.find((r) => r[0] === line);
    return row ? (circle ? arcPoints(row) : linePoints(row)) : [];
  }
  // The contour of the fitted part on which that line of the present picture lies.
  contourOf(line: number, circle: boolean): Contour | null {
    return this.fit?.placed ? contourAt(this.fit.projections[String(this.image)] ?? [], this.pointsOf(line, circle), circle) : null;
  }
  // Lines of the present picture. Those that lie on a contour of the fitted part are picked; where there is no fit yet, VSS says
  // which is which.
  pickAll(lines: Found[]) {
    const b = this.build;
    if (!b) return;
    const others = lines.filter((l) => !b.picks.some((p) => p.image === this.image && p.line === l.line && p.circle === l.circle));
    if (!this.fit?.placed) {
      const room = mostProposed - b.picks.length, longest = others.map((l) => ({ ...l, px: lengthOf(this.pointsOf(l.line, l.circle)) })).sort((x, y) => y.px - x.px).slice(0, Math.max(0, room));
      if (longest.length === 0) { this.say(t.build.nothingBoxed); return; }
      void this.propose(longest.map((l) => ({ image: this.image, line: l.line, contour: 0, circle: l.circle })));
      return;
    }
    const fresh = others.map((l) => ({ ...l, contour: this.contourOf(l.line, l.circle) })).filter((l) => l.contour);
    b.picks.push(...fresh.map((l) => ({ image: this.image, line: l.line, contour: l.contour!.index, circle: l.circle })));
    if (fresh.length > 0) { this.advance?.(); void this.ask(); }
  }
  advance: (() => void) | null = null;  // set by the build panel: goes to the contour to pick next

  async savePart() {
    if (!this.build || !this.fit?.placed) return;
    const b = this.build;
    const saved = await this.command('save_part', { ...this.question(), part: b.part || undefined, version: b.part ? this.version('part', b.part) : undefined });
    if (!saved) return;
    const elsewhere = this.tab !== 'build' ? this.tab : null;  // where the operator went on to meanwhile
    this.stopBuild();
    if (elsewhere) this.tab = elsewhere; else this.select(String(saved.part));
  }

  chooseContour(index: number, circle: boolean) { if (this.build) { this.build.contour = { index, circle }; this.build.chosen = true; } }
  goHint(hint: Hint) {
    this.chooseContour(hint.contour, hint.circle);
    this.go(hint.image);
  }
}

export const station = new Station();
