// The picture that was open last is asked for before the page itself is here, and shown where the page will show it.
{
  let kept = {};
  try { kept = JSON.parse(localStorage.getItem('vss.page') ?? '{}') ?? {}; } catch { /* a private window keeps nothing */ }
  const image = kept.image ?? 0, answer = fetch(`/api/pictures/${image}/image`);
  answer.catch(() => {});
  // Where the page puts the picture's view (App.svelte, view.ts): beside the strip and the panels, below the bars.
  const place = () => (innerWidth > 1180 ? { left: 168, right: 384 } : { left: 118, right: 352 });
  const plain = (kept.view ?? 'picture') === 'picture' && kept.layers?.picture !== false && (kept.tone?.contrast ?? 1) === 1 && (kept.tone?.gamma ?? 1) === 1;
  async function show(response) {
    const bytes = response.ok && response.clone().blob();  // the page reads the answer itself
    if (!bytes || !plain || innerWidth <= 860) return;
    const picture = await createImageBitmap(await bytes), { left, right } = place(), top = 95;
    if (window.vssEarly.done) return;  // the page was faster
    const w = innerWidth - left - right, h = innerHeight - top, scale = Math.min(w / picture.width, h / picture.height) * 0.97;
    const canvas = document.createElement('canvas'), ratio = Math.min(2, devicePixelRatio || 1);
    canvas.id = 'early';
    canvas.width = Math.round(picture.width * scale * ratio);
    canvas.height = Math.round(picture.height * scale * ratio);
    canvas.style.cssText = `position: fixed; pointer-events: none; left: ${left + (w - picture.width * scale) / 2}px; top: ${top + (h - picture.height * scale) / 2}px; width: ${picture.width * scale}px; height: ${picture.height * scale}px`;
    canvas.getContext('2d').drawImage(picture, 0, 0, canvas.width, canvas.height);
    while (!document.body) await new Promise(requestAnimationFrame);
    document.body.append(canvas);
    await new Promise(requestAnimationFrame);  // drawn in this frame, seen when the next one begins
    await new Promise(requestAnimationFrame);
    performance.mark('first-picture');
  }
  window.vssEarly = { image, answer, done: false, shown: answer.then(show).catch(() => {}) };
}
