// The operator manual inside the page: the same Markdown files as docs/manual.
import { marked } from 'marked';

export interface Page { name: string; title: string; lead: string; text: string }
export interface Hit { page: string; title: string; excerpt: string; score: number }

const plain = (markdown: string) => markdown.replace(/```[\s\S]*?```/g, ' ').replace(/!\[[^\]]*\]\([^)]*\)/g, '').replace(/\[([^\]]*)\]\([^)]*\)/g, '$1').replace(/[#*_`|>]/g, ' ').replace(/\s+/g, ' ').trim();

export function pagesOf(files: { name: string; text: string }[]): Page[] {
  return files.map(({ name, text }) => {
    const title = /^#\s+(.*)$/m.exec(text)?.[1] ?? name;
    const lead = plain(text.replace(/^#\s+.*$/m, '').trim().split(/\n\s*\n/)[0] ?? '');
    return { name, title, lead: lead.slice(0, 140), text };
  });
}

// Every word has to occur; a title counts more than the text.
export function searchPages(pages: Page[], search: string): Hit[] {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean), hits: Hit[] = [];
  for (const page of pages)
    for (const section of page.text.split(/^(?=##? )/m)) {
      const title = /^##?\s+(.*)$/m.exec(section)?.[1] ?? page.title, text = plain(section), low = text.toLowerCase();
      if (!words.every((w) => low.includes(w))) continue;
      const at = Math.max(0, low.indexOf(words[0]) - 40);
      const score = words.reduce((sum, w) => sum + (title.toLowerCase().includes(w) ? 10 : 0) + low.split(w).length - 1, 0);
      hits.push({ page: page.name, title: title === page.title ? title : `${page.title}: ${title}`, excerpt: (at > 0 ? '…' : '') + text.slice(at, at + 150) + '…', score });
    }
  return hits.sort((a, b) => b.score - a.score).slice(0, 20);
}

// The manual's pictures come from the station; what is no picture of the manual is left out.
export function render(markdown: string): string {
  const own = markdown.replace(/!\[([^\]]*)\]\(images\/([\w-]+\.jpg)\)/g, '![$1](/api/manual/$2)');
  return marked.parse(own.replace(/!\[[^\]]*\]\((?!\/api\/manual\/)[^)]*\)/g, ''), { async: false });
}
