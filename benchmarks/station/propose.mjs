// Whether the station finds which picked line is which, for every part of a survey: of the lines that the survey gave a
// part, some of one picture or of two are handed back without their contours, in another order.
//   node benchmarks/station/propose.mjs VSS SURVEY
// Prints, for each part and number of lines: how many first readings give the same solid, to 10 mm, as the lines with their true contours do, or the survey's own part,
// (the survey assigns lines that lie on each other to one contour or the other), how many of the two shown do, how often VSS says that the lines decide though the first is wrong, the time. Figures: README.md.
import { rmSync } from 'node:fs';
import { ask, copySurvey, startStation, vertexError } from '../../apps/station/web/tests/harness.mjs';

const [vss, survey] = process.argv.slice(2), trials = 8, nearMm = 10;
const folder = copySurvey(survey), station = await startStation(vss, folder);
await ask(station.url, 'command', { do: 'run' });
while ((await ask(station.url, 'state')).json.run.state === 'running') await new Promise((done) => setTimeout(done, 200));
const state = (await ask(station.url, 'state')).json, files = (await ask(station.url, 'survey')).json.images.map((i) => i.file);
let seed = 7;
const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
const shuffled = (list) => list.map((x) => [random(), x]).sort((a, b) => a[0] - b[0]).map((x) => x[1]);

const all = { asked: 0, first: 0, sure: 0, either: 0, misled: 0, ms: [] };
for (const part of state.items.filter((i) => i.kind === 'part').map((i) => i.value))
  for (const count of [4, 6, 8]) {
    const one = { asked: 0, first: 0, sure: 0, either: 0, misled: 0, ms: [] };
    for (let t = 0; t < trials; t++) {
      // One line a contour and picture, of the two pictures with most.
      const seen = new Set(), byImage = new Map();
      for (const m of shuffled(part.matches)) {
        const image = files.indexOf(m.image), key = `${image} ${m.edge} ${m.arc}`;
        if (seen.has(key)) continue;
        seen.add(key);
        byImage.set(image, [...(byImage.get(image) ?? []), { image, line: m.line, contour: m.edge, circle: m.arc }]);
      }
      const picks = shuffled([...byImage.values()].sort((a, b) => b.length - a.length).slice(0, 1 + (t % 2)).flat()).slice(0, count);
      if (picks.length < count) continue;
      const question = { kind: part.kind, resting_pose: part.resting_pose, stands_on: part.stands_on ?? 'ground' };
      const begin = performance.now(), answer = await ask(station.url, 'propose', { ...question, picks: picks.map((p) => ({ ...p, contour: 0 })) });
      one.ms.push(performance.now() - begin);
      one.asked++;
      if (answer.status !== 200) { if (process.env.VSS_WHY) console.log('   ', answer.json.error); continue; }
      if (process.env.VSS_WHY) console.log('  truth rms', (await ask(station.url, 'fit', { ...question, picks })).json.rms_px, 'picture(s)', new Set(picks.map((p) => p.image)).size, 'readings', answer.json.readings?.map((r) => r.rms_px.toFixed(2) + ' ' + r.log_odds.toFixed(0) + ' ' + r.contours.join()).join(' / '), 'true', picks.map((p) => p.contour).join());
      const should = await ask(station.url, 'fit', { ...question, picks }), right = [];
      for (const r of answer.json.readings) {
        const fit = await ask(station.url, 'fit', { ...question, picks: picks.map((p, i) => ({ ...p, contour: r.contours[i] })) });
        right.push(fit.status === 200 && [should.json.part, part].some((p) => vertexError(fit.json.part, p) < nearMm));
      }
      one.first += right[0] ?? 0;
      one.either += right.some(Boolean);
      if (process.env.VSS_WHY && answer.json.decided && !right[0]) {
        const fit = (await ask(station.url, 'fit', { ...question, picks: picks.map((p, i) => ({ ...p, contour: answer.json.readings[0].contours[i] })) })).json, dims = (f) => (f.placed ? '' : 'NOT PLACED ') + Object.entries(f.part.dimensions).map(([n, d]) => `${n} ${d.value.toFixed(0)}${d.observable ? '' : '?'}`).join(' ');
        console.log('    wrong and sure:', dims(fit), '| should:', dims(should.json), '| part:', dims({ placed: true, part }), '| off', vertexError(fit.part, should.json.part).toFixed(0), vertexError(fit.part, part).toFixed(0));
      }
      one.sure += answer.json.decided && !!right[0];
      one.misled += answer.json.decided && !right[0];
    }
    if (one.asked === 0) continue;
    console.log(`${part.id} ${part.kind}, ${count} lines: ${one.first} of ${one.asked} first readings right (${one.sure} and called sure), ${one.either} with the runner-up, ${one.misled} wrong and called sure; worst ${Math.max(...one.ms).toFixed(0)} ms`);
    for (const k of ['asked', 'first', 'sure', 'either', 'misled']) all[k] += one[k];
    all.ms.push(...one.ms);
  }
all.ms.sort((a, b) => a - b);
console.log(`all: ${all.first} of ${all.asked} first readings right (${all.sure} and called sure), ${all.either} with the runner-up, ${all.misled} wrong and called sure; median ${all.ms[all.ms.length >> 1].toFixed(0)} ms, worst ${all.ms.at(-1).toFixed(0)} ms`);
await station.kill();
rmSync(folder, { recursive: true, force: true });
