// How fast the station's page is, in headless Chromium with software rendering.
//   node benchmarks/station/page.mjs VSS SURVEY
// Prints: time to the first picture; pan and zoom frames with 3,000 and 30,000 lines; live fits. Figures: README.md.
// Bars: 500 ms; 80 and 170 ms; 100 ms after a click.
import { readFileSync, rmSync } from 'node:fs';
import { ask, copySurvey, startBrowser, startStation } from '../../apps/station/web/tests/harness.mjs';

const [vss, survey] = process.argv.slice(2);
const folder = copySurvey(survey), station = await startStation(vss, folder), browser = await startBrowser();
if (!browser) { console.log('SKIPPED: there is no Chromium'); process.exit(77); }
const { context } = browser;
const percentile = (list, p) => [...list].sort((a, b) => a - b)[Math.min(list.length - 1, Math.floor(p * list.length))];

async function firstPicture() {
  const times = [], ready = [];
  for (let i = 0; i < 12; i++) {
    const page = await context.newPage();
    await page.goto(station.url);
    await page.waitForFunction(() => document.body.dataset.picture !== undefined);
    times.push(await page.evaluate(() => performance.getEntriesByName('first-picture')[0].startTime));
    ready.push(await page.evaluate(() => performance.getEntriesByName('page-ready')[0].startTime));
    await page.close();
  }
  console.log(`the page around it, lines can be asked for: ${ready[0].toFixed(0)} ms in a browser just started; then median ${percentile(ready, 0.5).toFixed(0)} ms, worst ${Math.max(...ready.slice(1)).toFixed(0)} ms`);
  console.log(`first picture: ${times[0].toFixed(0)} ms in a browser just started; then median ${percentile(times, 0.5).toFixed(0)} ms, worst ${Math.max(...times.slice(1)).toFixed(0)} ms (bar 500)`);
}

// Lines at random, as long as real ones.
function manyLines(count, width, height) {
  let seed = 7;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const segments = [];
  for (let i = 0; i < count; i++) {
    const u = random() * width, v = random() * height, a = random() * 6.28, l = 10 + 50 * random() * random();
    segments.push([i, u, v, u + l * Math.cos(a), v + l * Math.sin(a), 4 + 120 * random(), 0.05]);
  }
  return { segments, removed: [], arcs: [], version: 0, noise: 1 };
}

// One step of `move` a frame; ms from the begin of the frame until its pixels are there: they are read back, since the
// browser rasterises a canvas later than it is drawn.
async function frameTimes(page, move) {
  return page.evaluate(async (move) => {
    const target = document.querySelector('.picture'), r = target.getBoundingClientRect(), times = [];
    const canvases = [...target.querySelectorAll('canvas')].map((c) => c.getContext('2d'));
    const frame = (work) => new Promise((done) => requestAnimationFrame(() => { work?.(); done(); }));
    for (let i = 0; i < 60; i++) {
      let begin = 0;
      const first = frame(() => { begin = performance.now(); });
      if (move === 'recolour') target.dispatchEvent(new KeyboardEvent('keydown', { key: 'k', bubbles: true }));
      else if (move === 'pan') target.dispatchEvent(new KeyboardEvent('keydown', { key: i % 20 < 10 ? 'ArrowLeft' : 'ArrowRight', bubbles: true }));
      else target.dispatchEvent(new WheelEvent('wheel', { deltaY: i % 20 < 10 ? -120 : 120, clientX: r.left + r.width / 2, clientY: r.top + r.height / 2, bubbles: true, cancelable: true }));
      await new Promise((done) => queueMicrotask(() => queueMicrotask(done)));  // the page asks for its frame
      const last = frame(() => { for (const c of canvases) c.getImageData(0, 0, 1, 1); times.push(performance.now() - begin); });
      await first; await last;
    }
    return times;
  }, move);
}

// From the key until a frame is the same as the last one of all: the lines come in several frames.
async function untilDrawn(page) {
  return page.evaluate(async () => {
    const target = document.querySelector('.picture'), canvas = [...target.querySelectorAll('canvas')].at(-1), context = canvas.getContext('2d'), times = [];
    const sum = () => { const d = context.getImageData(0, 0, canvas.width, canvas.height).data; let n = 0; for (let i = 0; i < d.length; i += 97) n = (n * 31 + d[i]) | 0; return n; };
    const frame = () => new Promise((done) => requestAnimationFrame(done));
    for (let i = 0; i < 6; i++) {
      const begin = performance.now(), seen = [];
      target.dispatchEvent(new KeyboardEvent('keydown', { key: 'k', bubbles: true }));
      while (performance.now() - begin < 3000) { await frame(); seen.push([performance.now() - begin, sum()]); }
      times.push(seen.find((s) => s[1] === seen.at(-1)[1])[0]);
    }
    return times;
  });
}

async function frames(count) {
  const page = await context.newPage();
  const { width, height } = (await ask(station.url, 'survey')).json.cameras[0];
  const body = JSON.stringify(manyLines(count, width, height)), none = JSON.stringify({ segments: [], removed: [], arcs: [], version: 0, noise: 1 });
  await page.route('**/api/pictures/*/lines', (route) => route.fulfill({ contentType: 'application/json', body: route.request().url().includes('/pictures/0/') ? body : none }));
  await page.goto(station.url);
  await page.waitForFunction((n) => document.body.dataset.picture !== undefined && document.querySelector('.strip .on')?.textContent.includes(`${n} lines`), count);
  await page.waitForLoadState('networkidle');
  for (const move of ['pan', 'zoom', 'recolour']) {  // the last one draws every line anew
    const times = await frameTimes(page, move);
    if (move === 'recolour') await page.evaluate(() => new Promise((done) => setTimeout(done, 500)));
    console.log(`${move}, ${count} lines: median ${percentile(times, 0.5).toFixed(0)} ms, 95 of 100 within ${percentile(times, 0.95).toFixed(0)} ms, worst ${Math.max(...times).toFixed(0)} ms (bar ${count > 3000 ? 170 : 80})`);
  }
  if (count > 3000) console.log(`every line of ${count} in a new colour, until all are drawn: ${(await untilDrawn(page)).map((ms) => ms.toFixed(0)).join(', ')} ms`);
  if (process.env.VSS_SCREENSHOTS) await page.screenshot({ path: `${process.env.VSS_SCREENSHOTS}/lines-${count}.png` });
  await page.close();
}

// Processor time that the station has taken so far, ms: where other programs want the processors too, this is what a change
// is judged by.
function processorMs() {
  const fields = readFileSync(`/proc/${station.child.pid}/stat`, 'utf8').replace(/^.*\) /, '').split(' ');
  return (Number(fields[11]) + Number(fields[12])) * 10;  // user and system, in ticks of 10 ms
}

// Live fits as the page asks for them: from nothing with ever more lines of one picture, and of the part with the most
// lines of all pictures, each time with one line less.
async function fits() {
  const rows = (await ask(station.url, 'pictures/0/lines')).json.segments.map((l) => l[0]).slice(0, 8);
  await ask(station.url, 'command', { do: 'run' });
  while ((await ask(station.url, 'state')).json.run.state === 'running') await new Promise((done) => setTimeout(done, 200));
  const state = (await ask(station.url, 'state')).json, files = (await ask(station.url, 'survey')).json.images.map((i) => i.file);
  const most = state.items.filter((i) => i.kind === 'part').map((i) => i.value).sort((a, b) => b.matches.length - a.matches.length)[0];
  const picks = most.matches.map((m) => ({ image: files.indexOf(m.image), line: m.line, contour: m.edge, circle: m.arc }));
  const timed = async (what, questions) => {
    const times = [], inside = [], before = processorMs();
    for (const question of questions) {
      const begin = performance.now(), answer = await ask(station.url, 'fit', question);
      if (answer.status !== 200) throw new Error(answer.json.error);
      times.push(performance.now() - begin);
      inside.push(answer.json.ms);  // without parsing the question, writing the answer, and the way
    }
    console.log(`live fit, ${what}: inside the server median ${percentile(inside, 0.5).toFixed(1)} ms; processor ${((processorMs() - before) / times.length).toFixed(1)} ms each; first ${times[0].toFixed(0)} ms, median ${percentile(times, 0.5).toFixed(0)} ms, worst ${Math.max(...times).toFixed(0)} ms (bar 100)`);
  };
  await timed(`1 to ${rows.length} lines, from nothing`, rows.map((_, n) => ({ kind: 'box', picks: rows.slice(0, n + 1).map((line, i) => ({ image: 0, line, contour: i })) })));
  await timed(`${most.kind} with ${picks.length} lines in ${most.images.length} pictures`, picks.slice(0, 20).map((_, i) => ({ kind: most.kind, part: most.id, picks: picks.filter((_, k) => k !== i) })));
  await timed(`the same from nothing`, picks.slice(0, 5).map((_, i) => ({ kind: most.kind, picks: picks.filter((_, k) => k !== i) })));
}

const only = process.env.VSS_ONLY ?? '';
for (const [name, part] of [['picture', firstPicture], ['frames', () => frames(3000)], ['frames', () => frames(30000)], ['fits', fits]]) if (name.includes(only)) await part();
await browser.close();
await station.kill();
rmSync(folder, { recursive: true, force: true });
