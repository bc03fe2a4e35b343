// The operator manual inside the page: the same Markdown files as docs/manual.
import { marked } from 'marked';

export interface Page { name: string; title: string; lead: string; text: string }
export interface Hit { page: string; section: string; title: string; excerpt: string; score: number }  // section: its heading

const plain = (markdown: string) => markdown.replace(/```[\s\S]*?```/g, ' ').replace(/!\[[^\]]*\]\([^)]*\)/g, '').replace(/\[([^\]]*)\]\([^)]*\)/g, '$1')
  .replace(/^\s*\|?[-:| ]+\|?\s*$/gm, ' ').replace(/^#+ .*$/gm, ' ').replace(/[#*`|>]/g, ' ').replace(/\s+/g, ' ').trim();

const leadLength = 150, excerptLength = 170;

// At most so many characters, whole words.
function shortened(text: string, most: number): string {
  if (text.length <= most) return text;
  return text.slice(0, text.lastIndexOf(' ', most)) + ' …';
}

// What an operator needs first: the numbered pages, then calibration, then the rest by title.
function rank(name: string): string {
  if (/^01-/.test(name)) return '0';
  if (name === 'calibration.md') return '1';
  if (name === 'knowledge-base.md') return '2';
  return /^\d/.test(name) ? '3' + name : '4' + name;
}

export function pagesOf(files: { name: string; text: string }[]): Page[] {
  const pages = files.map(({ name, text }) => {
    const title = /^#\s+(.*)$/m.exec(text)?.[1] ?? name;
    // The first paragraph; where a page begins with a heading, what its sections are about.
    const first = text.replace(/^#\s+.*$/m, '').trim().split(/\n\s*\n/)[0] ?? '';
    const sections = [...text.matchAll(/^##\s+(.*)$/gm)].map((m) => m[1]);
    return { name, title, lead: shortened(first.startsWith('#') ? sections.join(' · ') : plain(first), leadLength), text };
  });
  return pages.sort((a, b) => rank(a.name).localeCompare(rank(b.name)));
}

function excerptOf(text: string, word: string): string {
  const at = Math.max(0, text.toLowerCase().indexOf(word) - 50), start = at === 0 ? 0 : text.indexOf(' ', at) + 1;
  return (start > 0 ? '… ' : '') + shortened(text.slice(start), excerptLength);
}

export function wordsOf(search: string): string[] { return search.toLowerCase().split(/\s+/).filter(Boolean); }

// Every word has to occur; a title counts more than the text.
export function searchPages(pages: Page[], search: string): Hit[] {
  const words = wordsOf(search), hits: Hit[] = [];
  for (const page of pages)
    for (const section of page.text.split(/^(?=##? )/m)) {
      const heading = /^##?\s+(.*)$/m.exec(section)?.[1] ?? page.title, text = plain(section), low = (heading + ' ' + text).toLowerCase();
      if (!words.every((w) => low.includes(w))) continue;
      const score = words.reduce((sum, w) => sum + (heading.toLowerCase().includes(w) ? 10 : 0) + low.split(w).length - 1, 0);
      hits.push({ page: page.name, section: heading, title: heading === page.title ? heading : `${page.title}: ${heading}`, excerpt: excerptOf(text, words[0]), score });
    }
  return hits.sort((a, b) => b.score - a.score).slice(0, 20);
}

// A text in pieces, those that are one of the words marked.
export function withMarks(text: string, words: string[]): { text: string; hit: boolean }[] {
  if (words.length === 0) return [{ text, hit: false }];
  const any = new RegExp(`(${words.map((w) => w.replace(/[.*+?^${}()|[\]\\]/g, '\\$&')).join('|')})`, 'i');
  return text.split(any).map((piece, i) => ({ text: piece, hit: i % 2 === 1 })).filter((piece) => piece.text);
}

// The manual's pictures come from the station; what is no picture of the manual is left out.
export function render(markdown: string): string {
  const own = markdown.replace(/!\[([^\]]*)\]\(images\/([\w-]+\.jpg)\)/g, '![$1](/api/manual/$2)');
  return marked.parse(own.replace(/!\[[^\]]*\]\((?!\/api\/manual\/)[^)]*\)/g, ''), { async: false });
}
