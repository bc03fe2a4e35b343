// How a grey picture is shown: contrast about its typical grey value, then gamma. The picture itself stays as it is.
export interface Tone { contrast: number; gamma: number }

export const plainTone: Tone = { contrast: 1, gamma: 1 };
export function isPlain(tone: Tone): boolean { return tone.contrast === 1 && tone.gamma === 1; }

// Grey values (0 to 255), row by row, of RGBA; colour becomes grey (Rec. 601).
export function greyOf(rgba: Uint8ClampedArray): Uint8Array {
  const grey = new Uint8Array(rgba.length / 4);
  for (let k = 0, i = 0; k < grey.length; k++, i += 4) grey[k] = 0.299 * rgba[i] + 0.587 * rgba[i + 1] + 0.114 * rgba[i + 2] + 0.5;
  return grey;
}

// The grey value that half of the pixels do not exceed: it stays where it is when the contrast changes.
export function medianOf(grey: Uint8Array): number {
  const count = new Uint32Array(256);
  for (const g of grey) count[g]++;
  let below = 0, median = 0;
  while (median < 255 && (below += count[median]) * 2 < grey.length) median++;
  return median;
}

// What is shown for each grey value. Gamma above 1 lightens dark places.
export function toneTable({ contrast, gamma }: Tone, median: number): Uint8ClampedArray {
  const table = new Uint8ClampedArray(256);
  for (let i = 0; i < 256; i++) {
    const stretched = Math.max(0, Math.min(1, (median + contrast * (i - median)) / 255));
    table[i] = 255 * Math.pow(stretched, 1 / gamma);
  }
  return table;
}
