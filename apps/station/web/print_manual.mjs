// The operator manual as one HTML file and as PDF, from the same pages as the station's help.
//   node print_manual.mjs DOCS OUT      DOCS: the folder docs; OUT: where manual.html and manual.pdf go
import { mkdirSync, readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { marked } from 'marked';
import { startBrowser } from './tests/harness.mjs';

const [docs, out] = process.argv.slice(2), manual = join(docs, 'manual');
// In the order of the station's help (src/manual.ts): what an operator needs first.
const first = ['01-normal-operation.md', 'calibration.md', 'knowledge-base.md', '04-trouble.md', '05-limits.md'];
const others = readdirSync(manual).filter((f) => f.endsWith('.md') && !first.includes(f)).sort();
const files = [...first, ...others].map((f) => join(f === 'knowledge-base.md' ? docs : manual, f));
const picture = (_, caption, name) => `<figure><img alt="${caption}" src="data:image/jpeg;base64,${readFileSync(join(manual, 'images', name)).toString('base64')}"><figcaption>${caption}</figcaption></figure>`;
const pages = files.map((f) => `<section>${marked.parse(readFileSync(f, 'utf8').replace(/!\[([^\]]*)\]\(images\/([\w-]+\.jpg)\)/g, picture))}</section>`);
const style = `body { font: 11pt/1.5 sans-serif; max-width: 46em; margin: 2em auto; padding: 0 1em; } section + section { break-before: page; }
  img { max-width: 100%; display: block; } figure { margin: 1em 0; break-inside: avoid; } figcaption { color: #555; font-size: 9pt; } h1, h2, h3 { break-after: avoid; line-height: 1.2; }
  @media print { body { font-size: 10pt; line-height: 1.4; max-width: none; margin: 0; padding: 0; } h2 { clear: both; margin: 1em 0 .4em; } p { margin: .5em 0; } figure { float: right; width: 42%; margin: .2em 0 .6em 1.2em; } } pre, code { background: #f2f4f6; font-size: 9.5pt; }
  pre { padding: .6em; white-space: pre-wrap; } table { border-collapse: collapse; } td, th { border: 1px solid #ccc; padding: .25em .5em; text-align: left; vertical-align: top; }`;
mkdirSync(out, { recursive: true });
const html = `<!doctype html><html lang="en"><head><meta charset="utf-8"><title>VSS operator manual</title><style>${style}</style></head><body>${pages.join('')}</body></html>`;
writeFileSync(join(out, 'manual.html'), html);
const browser = await startBrowser();
if (!browser) { console.log('SKIPPED the PDF: there is no Chromium'); process.exit(0); }
const page = await browser.context.newPage();
await page.setContent(html, { waitUntil: 'load' });
await page.pdf({ path: join(out, 'manual.pdf'), format: 'A4', margin: { top: '18mm', bottom: '18mm', left: '16mm', right: '16mm' }, displayHeaderFooter: true, headerTemplate: '<span></span>',
  footerTemplate: '<div style="font-size:8px;width:100%;text-align:center"><span class="pageNumber"></span> / <span class="totalPages"></span></div>' });
await browser.close();
console.log(`${join(out, 'manual.html')}\n${join(out, 'manual.pdf')}`);
