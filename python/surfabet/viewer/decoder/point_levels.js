// Section 5.5 of docs/format.md with feature bit 9 or 13: an octree that is read level by level.

import { fail } from "./bytes.js";

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

/**
 * Coordinates of the occupied cells of an octree of height 21, as three arrays; at most `most` of them. `readNode` gives the children
 * of a node as bits: of number `i` at `x`, `y`, `z` of a level `{ h, places, children }`, whose nodes before it have their children.
 */
export function readLevels(most, readNode) {
  let nodes = [[0], [0], [0]];
  for (let height = 21; height > 0; height--) {
    const children = new Uint8Array(nodes[0].length);
    const level = { h: Math.min(height, 4) - 1, places: new Places(...nodes), children };
    const next = [[], [], []];
    for (let i = 0; i < children.length; i++) {
      const at = nodes.map((of) => of[i]);
      children[i] = readNode(level, i, at);
      for (let c = 0; c < 8; c++) {
        if ((children[i] >> c) & 1) next.forEach((of, a) => of.push(2 * at[a] + ((c >> a) & 1)));
      }
      if (next[0].length > most) fail("PNTS", `more than ${most} points`);
    }
    nodes = next;
  }
  return nodes;
}
