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
