// Section 5.7 of docs/format.md: what a tile corrects at its borders (feature bit 12).

import { CellIndex } from "./geometry.js";

const OFFSET = 2 ** 20;
const BITS = 2;
const WIDTH = 1 << BITS;
const FINENESS = 64;

/** Cells from the nearest face of a cube to a cell; 0 for those beside a face, and beyond. */
function distance({ low, side }, cell) {
  const along = cell.map((c, a) => Math.min(c - low[a], side - 1 - (c - low[a])));
  return Math.max(Math.min(...along), 0);
}

/** The blocks of cells at the faces of a cube; `cells` are sorted by key. */
export class BorderBlocks {
  constructor({ low, side }, cells) {
    // Coordinates of cells are counted from -2^20.
    const cube = { low: low.map((c) => c + OFFSET), side };
    const near = [];
    const blocks = [[], [], []];
    let n = 0;
    for (let i = 0; i < cells.n; i++) {
      const cell = [cells.x[i], cells.y[i], cells.z[i]];
      const far = distance(cube, cell);
      if (far >= WIDTH) continue;
      near.push([i, far]);
      const block = cell.map((c) => c >> BITS);
      if (n > 0 && block.every((c, a) => blocks[a][n - 1] === c)) continue;
      block.forEach((c, a) => blocks[a].push(c));
      n++;
    }
    const [x, y, z] = blocks.map((c) => Int32Array.from(c));
    this.near = near;
    this.cells = cells;
    this.blocks = { n, x, y, z, index: new CellIndex(x, y, z) };
  }

  /** Adds corrections of the blocks to the means of the cells. */
  add(corrections, means, channels) {
    const { cells, blocks } = this;
    const sum = new Float64Array(channels);
    for (const [i, far] of this.near) {
      const cell = [cells.x[i], cells.y[i], cells.z[i]];
      // Twice the way from the middle of the block to that of the cell.
      const off = cell.map((c) => 2 * (c & (WIDTH - 1)) + 1 - WIDTH);
      const block = cell.map((c) => c >> BITS);
      let total = 0;
      sum.fill(0);
      for (let k = 0; k < 8; k++) {
        const at = block.map((c, a) => ((k >> a) & 1 ? c + (off[a] > 0 ? 1 : -1) : c));
        const q = blocks.index.find(...at);
        if (q < 0) continue;
        const part = (a) => ((k >> a) & 1 ? Math.abs(off[a]) : 2 * WIDTH - Math.abs(off[a]));
        const weight = part(0) * part(1) * part(2);
        total += weight;
        for (let c = 0; c < channels; c++) sum[c] += weight * corrections[channels * q + c] * 64;
      }
      const share = 2 * WIDTH - 2 * far - 1;
      const whole = 2 * WIDTH * FINENESS * total;
      for (let c = 0; c < channels; c++) {
        means[channels * i + c] += Math.floor((2 * share * sum[c] + whole) / (2 * whole)) / 64;
      }
    }
  }
}
