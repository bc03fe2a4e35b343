// The picture that was open last is asked for before the page itself is here.
{
  let image = 0;
  try { image = JSON.parse(localStorage.getItem('vss.page') ?? '{}').image ?? 0; } catch { /* a private window keeps nothing */ }
  window.vssEarly = { image, answer: fetch(`/api/pictures/${image}/image`) };
  window.vssEarly.answer.catch(() => {});
}
