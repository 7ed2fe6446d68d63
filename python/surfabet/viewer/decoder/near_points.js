// Section 5.5 of docs/format.md with feature bit 9: points beside patches, level by level, given those around.

import { fail } from "./bytes.js";
import { Bits, Mixers } from "./entropy.js";

const COUNT = Uint8Array.of(0, 1, 1, 2, 1, 2, 2, 3);

/** Numbers of cells by their coordinates. */
class Places {
  constructor(xs, ys, zs) {
    Object.assign(this, { xs, ys, zs });
    this.mask = 2 ** Math.ceil(Math.log2(2 * xs.length + 2)) - 1;
    this.slots = new Int32Array(this.mask + 1).fill(-1);
    for (let i = 0; i < xs.length; i++) {
      let slot = this.slot(xs[i], ys[i], zs[i]);
      while (this.slots[slot] !== -1) slot = (slot + 1) & this.mask;
      this.slots[slot] = i;
    }
  }

  slot(x, y, z) {
    const h = Math.imul(x, 0x9e3779b1) ^ Math.imul(y, 0x85ebca6b) ^ Math.imul(z, 0xc2b2ae35);
    return (h ^ (h >>> 15)) & this.mask;
  }

  /** The number of a cell, -1 for none. */
  of(x, y, z) {
    let slot = this.slot(x, y, z);
    for (; ; slot = (slot + 1) & this.mask) {
      const i = this.slots[slot];
      if (i === -1 || (this.xs[i] === x && this.ys[i] === y && this.zs[i] === z)) return i;
    }
  }
}

/** The models of all nodes. */
class Models {
  constructor() {
    this.bits = [new Bits(4 << 13), new Bits(4 << 15)];
    this.mixers = new Mixers(16);
  }
}

/** The children of a node of height `h + 1` as bits, given those of the nodes around. */
function readChildren(stream, models, h, around) {
  const { below, edge, above, m } = around;
  let coded = 0;
  let k = 0;
  for (let c = 0; c < 8; c++) {
    if (c === 7 && k === 0) return 128;
    let faces = 0;
    let edges = 0;
    let ahead = 0;
    for (let a = 0; a < 3; a++) {
      const u = (a + 1) % 3;
      const v = (a + 2) % 3;
      const [onA, onU, onV] = [(c >> a) & 1, (c >> u) & 1, (c >> v) & 1];
      faces |= (((onA ? coded : below[a]) >> (c ^ (1 << a))) & 1) << a;
      const of = onU ? (onV ? coded : below[v]) : onV ? below[u] : edge[a];
      edges |= ((of >> (c ^ (1 << u) ^ (1 << v))) & 1) << a;
      ahead |= (onA & above[a]) << a;
    }
    const b = Math.min(k, 3);
    let count = (h << 3) | c;
    for (const field of [COUNT[faces], b, COUNT[ahead], COUNT[edges], m]) count = (count << 2) | field;
    let place = h;
    for (const field of [c, faces, k, edges, ahead]) place = (place << 3) | field;
    if (stream.mixedBit(models.mixers, 4 * h + b, models.bits, [count, place])) {
      coded |= 1 << c;
      k++;
    }
  }
  return coded;
}

/** Coordinates of the occupied cells of an octree of height 21, as three arrays; at most `most` of them. */
export function readNearPoints(stream, most) {
  const models = new Models();
  let nodes = [[0], [0], [0]];
  for (let height = 21; height > 0; height--) {
    const places = new Places(...nodes);
    const children = new Uint8Array(nodes[0].length);
    const next = [[], [], []];
    for (let i = 0; i < nodes[0].length; i++) {
      const at = nodes.map((of) => of[i]);
      const beside = (step) => places.of(at[0] + step[0], at[1] + step[1], at[2] + step[2]);
      const below = [0, 0, 0];
      const edge = [0, 0, 0];
      const above = [0, 0, 0];
      let m = 0;
      for (let a = 0; a < 3; a++) {
        const step = [0, 0, 0];
        step[a] = 1;
        if (beside(step) >= 0) above[a] = 1;
        step[a] = -1;
        const down = beside(step);
        if (down >= 0) below[a] = children[down];
        m += above[a] + (down >= 0 ? 1 : 0);
        const corner = beside([-1, -1, -1].map((s, b) => (b === a ? 0 : s)));
        if (corner >= 0) edge[a] = children[corner];
      }
      const around = { below, edge, above, m: Math.min(m, 3) };
      children[i] = readChildren(stream, models, Math.min(height, 4) - 1, around);
      for (let c = 0; c < 8; c++) {
        if ((children[i] >> c) & 1) next.forEach((of, a) => of.push(2 * at[a] + ((c >> a) & 1)));
      }
      if (next[0].length > most) fail("PNTS", `more than ${most} points`);
    }
    nodes = next;
  }
  return nodes;
}
