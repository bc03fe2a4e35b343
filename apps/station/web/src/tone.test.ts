import { describe, expect, it } from 'vitest';
import { greyOf, medianOf, toneTable } from './tone';

describe('the tone of a picture', () => {
  it('leaves it alone at 1', () => expect([...toneTable({ contrast: 1, gamma: 1 }, 60)]).toEqual([...Array(256).keys()]));
  it('stretches about the typical grey value, which stays', () => {
    const table = toneTable({ contrast: 3, gamma: 1 }, 60);
    expect(table[60]).toBe(60);
    expect(table[70] - table[60]).toBe(30);
    expect(table[60] - table[55]).toBe(15);
    expect([table[0], table[255]]).toEqual([0, 255]);
  });
  it('lightens dark places with gamma, and leaves black and white', () => {
    const table = toneTable({ contrast: 1, gamma: 2 }, 60);
    expect(table[64]).toBeGreaterThan(120);
    expect([table[0], table[255]]).toEqual([0, 255]);
  });
  it('never turns the order round', () => {
    for (const contrast of [0.2, 1, 6]) for (const gamma of [0.4, 3]) {
      const table = toneTable({ contrast, gamma }, 100);
      expect([...table].every((x, i) => i === 0 || x >= table[i - 1])).toBe(true);
    }
  });
  it('takes the median of grey values', () => {
    expect(medianOf(new Uint8Array([0, 10, 10, 200, 250]))).toBe(10);
    expect(medianOf(new Uint8Array([255, 255]))).toBe(255);
  });
  it('makes colour grey', () => expect([...greyOf(new Uint8ClampedArray([255, 255, 255, 255, 255, 0, 0, 255, 7, 7, 7, 255]))]).toEqual([255, 76, 7]));
});
