// Section 5.5 of docs/format.md with feature bit 9: points beside patches, level by level, given those around.

import { Bits, Mixers } from "./entropy.js";
import { readLevels } from "./point_levels.js";

const COUNT = Uint8Array.of(0, 1, 1, 2, 1, 2, 2, 3);

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
  return readLevels(most, ({ h, places, children }, _, at) => {
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
    return readChildren(stream, models, h, { below, edge, above, m: Math.min(m, 3) });
  });
}
