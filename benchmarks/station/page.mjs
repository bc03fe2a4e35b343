// How fast the station's page is, in headless Chromium with software rendering.
//   node benchmarks/station/page.mjs VSS SURVEY
// Prints: time to the first picture; the longest pan and zoom frame with 3,000 and 30,000 lines; live fits.
// Bars: 500 ms; 80 and 170 ms; 100 ms after a click.
import { rmSync } from 'node:fs';
import { ask, copySurvey, startBrowser, startStation } from '../../apps/station/web/tests/harness.mjs';

const [vss, survey] = process.argv.slice(2);
const folder = copySurvey(survey), station = await startStation(vss, folder), browser = await startBrowser();
if (!browser) { console.log('SKIPPED: there is no Chromium'); process.exit(77); }
const { context } = browser;
const percentile = (list, p) => [...list].sort((a, b) => a - b)[Math.min(list.length - 1, Math.floor(p * list.length))];

async function firstPicture() {
  const times = [];
  for (let i = 0; i < 5; i++) {
    const page = await context.newPage();
    await page.goto(station.url);
    await page.waitForFunction(() => document.body.dataset.picture !== undefined);
    times.push(await page.evaluate(() => performance.now()));
    await page.close();
  }
  console.log(`first picture: median ${percentile(times, 0.5).toFixed(0)} ms, worst ${Math.max(...times).toFixed(0)} ms (bar 500)`);
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

async function frames(count) {
  const page = await context.newPage();
  const { width, height } = (await ask(station.url, 'survey')).json.cameras[0];
  const body = JSON.stringify(manyLines(count, width, height));
  await page.route('**/api/pictures/*/lines', (route) => route.fulfill({ contentType: 'application/json', body }));
  await page.goto(station.url);
  await page.waitForFunction(() => document.body.dataset.picture !== undefined);
  await page.waitForTimeout(1500);
  const box = await page.locator('.picture').boundingBox(), x = box.x + box.width / 2, y = box.y + box.height / 2;
  await page.evaluate(() => { window.vssFrames = []; });
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let i = 0; i < 40; i++) await page.mouse.move(x + 4 * i, y + 2 * i);
  await page.mouse.up();
  await page.waitForTimeout(400);
  const pan = await page.evaluate(() => window.vssFrames.splice(0));
  for (let i = 0; i < 24; i++) { await page.mouse.wheel(0, i < 12 ? -120 : 120); await page.waitForTimeout(30); }
  await page.waitForTimeout(400);
  const zoom = await page.evaluate(() => window.vssFrames.splice(0));
  for (const [name, list] of [['pan', pan], ['zoom', zoom]])
    console.log(`${name}, ${count} lines: median ${percentile(list, 0.5).toFixed(1)} ms, worst ${Math.max(...list).toFixed(1)} ms of ${list.length} frames (bar ${count > 3000 ? 170 : 80})`);
  await page.close();
}

// A fit of a box to lines of one picture after the other: the answer's time as the page sees it.
async function fits() {
  const rows = (await ask(station.url, 'pictures/0/lines')).json.segments.map((l) => l[0]).slice(0, 8), times = [];
  await ask(station.url, 'fit', { kind: 'box', picks: [{ image: 0, line: rows[0], contour: 0 }] });
  for (let n = 1; n <= rows.length; n++) {
    const begin = performance.now();
    await ask(station.url, 'fit', { kind: 'box', picks: rows.slice(0, n).map((line, i) => ({ image: 0, line, contour: i })) });
    times.push(performance.now() - begin);
  }
  console.log(`live fit, 1 to ${rows.length} lines: median ${percentile(times, 0.5).toFixed(0)} ms, worst ${Math.max(...times).toFixed(0)} ms (bar 100)`);
}

await firstPicture();
await frames(3000);
await frames(30000);
await fits();
await browser.close();
await station.kill();
rmSync(folder, { recursive: true, force: true });
