// Section 5.4 of docs/format.md: the pyramid over the cells of a field.

import { CellIndex } from "./geometry.js";

/** The pyramid over cells: each level has coordinates, weights, an index, and the first child of each cell. */
export function pyramid(cells) {
  if (cells.levels) return cells.levels;
  const levels = [{ ...cells, weight: new Float64Array(cells.n).fill(1), first: null }];
  while (levels[levels.length - 1].n > 1) {
    const below = levels[levels.length - 1];
    const [x, y, z] = [0, 1, 2].map(() => new Int32Array(below.n));
    const weight = new Float64Array(below.n);
    const first = new Uint32Array(below.n + 1);
    let n = 0;
    for (let i = 0; i < below.n; i++) {
      const px = below.x[i] >> 1;
      const py = below.y[i] >> 1;
      const pz = below.z[i] >> 1;
      if (n === 0 || x[n - 1] !== px || y[n - 1] !== py || z[n - 1] !== pz) {
        x[n] = px;
        y[n] = py;
        z[n] = pz;
        first[n++] = i;
      }
      weight[n - 1] += below.weight[i];
    }
    first[n] = below.n;
    const [cx, cy, cz] = [x, y, z].map((c) => c.slice(0, n));
    levels.push({ n, x: cx, y: cy, z: cz, weight, first, index: new CellIndex(cx, cy, cz) });
  }
  cells.levels = levels;
  return levels;
}

/**
 * Means of all cells of `level` from those of the level above: of the parent and of the seven next to it on the cell's
 * side that exist. `weights[k]` is that of the parent displaced along the axes in the bits of k; `divide(sum, total)` the mean.
 */
export function interpolated(level, above, weights, means, channels, divide) {
  const C = channels;
  const predicted = new Float64Array(C * level.n);
  const { index, first } = above;
  for (let p = 0; p < above.n; p++) {
    const px = above.x[p];
    const py = above.y[p];
    const pz = above.z[p];
    for (let i = first[p]; i < first[p + 1]; i++) {
      const dx = level.x[i] & 1 ? 1 : -1;
      const dy = level.y[i] & 1 ? 1 : -1;
      const dz = level.z[i] & 1 ? 1 : -1;
      let total = 0;
      for (let k = 0; k < 8; k++) {
        const q = k === 0 ? p : index.find(px + (k & 1) * dx, py + ((k >> 1) & 1) * dy, pz + (k >> 2) * dz);
        if (q < 0) continue;
        const w = weights[k];
        total += w;
        for (let c = 0; c < C; c++) predicted[C * i + c] += w * means[C * q + c];
      }
      for (let c = 0; c < C; c++) predicted[C * i + c] = divide(predicted[C * i + c], total);
    }
  }
  return predicted;
}

/** Pairs of slots that meet; made once and used for all parents. What a pair has is added by `meet(a, b, axis)`. */
export class SlotPairs {
  constructor() {
    this.n = 0;
    this.weight = new Float64Array(8);
    this.slot = new Uint8Array(8);
    this.first = new Uint8Array(7);
    this.second = new Uint8Array(7);
  }

  begin() {
    this.n = 0;
    this.weight.fill(0);
    for (let o = 0; o < 8; o++) this.slot[o] = o;
  }

  pair() {
    const { weight, slot } = this;
    for (let axis = 0; axis < 3; axis++) {
      const stride = 1 << axis;
      for (let o = 0; o < 8; o += 2 * stride) {
        const a = slot[o];
        const b = slot[o + stride];
        if (weight[a] > 0 && weight[b] > 0) {
          this.first[this.n] = a;
          this.second[this.n] = b;
          this.meet(a, b, axis);
          this.n++;
          weight[a] += weight[b];
        } else if (weight[b] > 0) {
          slot[o] = b;
        }
      }
    }
  }
}
