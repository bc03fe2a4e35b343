// Starts a station on a copy of a survey, and a Chromium on its page.
import { spawn } from 'node:child_process';
import { cpSync, existsSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { chromium } from 'playwright-core';

export function copySurvey(source) {
  const folder = mkdtempSync(join(tmpdir(), 'vss-station-'));
  cpSync(source, folder, { recursive: true, filter: (path) => !/station\.(sqlite|lock)/.test(path) });
  return folder;
}

export async function startStation(vss, folder, args = []) {
  const child = spawn(vss, ['station', folder, ...args], { stdio: ['ignore', 'pipe', 'pipe'] });
  const url = await new Promise((resolve, reject) => {
    let text = '';
    const hear = (chunk) => {
      text += chunk;
      const found = /http:\/\/[^\s?]+/.exec(text);
      if (found) resolve(found[0]);
    };
    child.stdout.on('data', hear);
    child.stderr.on('data', hear);
    child.on('exit', (code) => reject(new Error(`the station ended with ${code}: ${text}`)));
  });
  const ended = new Promise((resolve) => child.on('exit', resolve));
  return { url, child, kill: async (signal = 'SIGTERM') => { child.kill(signal); await ended; } };
}

// `like`: what the browser is to be like otherwise, such as a tablet.
export async function startBrowser(like = {}) {
  const executablePath = process.env.VSS_CHROMIUM ?? '/usr/bin/chromium';
  if (!existsSync(executablePath)) return null;
  const profile = mkdtempSync(join(tmpdir(), 'vss-chromium-'));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath, headless: true, viewport: { width: 1280, height: 800 }, serviceWorkers: 'block', ...like,
    args: ['--no-sandbox', '--disable-gpu', '--disable-background-networking', '--no-first-run', '--enable-unsafe-swiftshader'],
  });
  // The share of two JPEG pictures that differs: blocks of 4 x 4 px whose mean grey values are more than 20 apart, of 255.
  const unlike = async (before, after) => {
    const page = await context.newPage();
    const share = await page.evaluate(async (pictures) => {
      const [a, b] = await Promise.all(pictures.map(async (picture) => {
        const bitmap = await createImageBitmap(new Blob([Uint8Array.from(atob(picture), (c) => c.charCodeAt(0))], { type: 'image/jpeg' }));
        const { width, height } = bitmap, canvas = new OffscreenCanvas(width, height), draw = canvas.getContext('2d'), w = Math.floor(width / 4), blocks = new Float64Array(w * Math.floor(height / 4));
        draw.drawImage(bitmap, 0, 0);
        const { data } = draw.getImageData(0, 0, width, height);
        for (let v = 0; v < 4 * Math.floor(height / 4); v++) for (let u = 0; u < 4 * w; u++) {
          const i = 4 * (v * width + u);
          blocks[(v >> 2) * w + (u >> 2)] += (0.299 * data[i] + 0.587 * data[i + 1] + 0.114 * data[i + 2]) / 16;
        }
        return { width, height, blocks };
      }));
      if (a.width !== b.width || a.height !== b.height) return 1;
      return a.blocks.filter((x, i) => Math.abs(x - b.blocks[i]) > 20).length / a.blocks.length;
    }, [before, after].map((picture) => picture.toString('base64')));
    await page.close();
    return share;
  };
  return { context, unlike, close: async () => { await context.close(); rmSync(profile, { recursive: true, force: true }); } };
}

export async function ask(url, path, body) {
  const answer = await fetch(url + 'api/' + path, body ? { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body) } : {});
  return { status: answer.status, json: await answer.json() };
}

// Largest distance (mm) of the vertices (or circle centres) of a part from the nearest of the truth's.
export function vertexError(part, truth) {
  const points = (p) => [...(p.vertices ?? []), ...(p.circles ?? []).map((c) => c.center)];
  const found = points(part), right = points(truth);
  if (found.length === 0 || found.length !== right.length) return Infinity;
  return Math.max(...right.map((r) => Math.min(...found.map((f) => Math.hypot(...f.map((x, i) => x - r[i]))))));
}
