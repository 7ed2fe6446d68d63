// Section 5.5 of docs/format.md with feature bit 13: points beside patches, given the pattern of the cells around.

import { Bits, Mixers } from "./entropy.js";
import { readLevels } from "./point_levels.js";

const FACES = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

const NEAR = [
  [-1, 0, 0], [0, -1, 0], [0, 0, -1], [0, -1, -1], [-1, 0, -1], [-1, -1, 0],
  [-1, 1, 0], [-1, 0, 1], [0, -1, 1], [1, -1, 0], [1, 0, -1], [0, 1, -1],
];

const FAR = [
  [-2, 0, 0], [0, -2, 0], [0, 0, -2], [-2, -1, 0], [-1, -2, 0], [-2, 0, -1],
  [-1, 0, -2], [0, -2, -1], [0, -1, -2], [-2, 1, 0], [-2, 0, 1], [0, -2, 1],
];

const AROUND = Array.from({ length: 27 }, (_, j) => [(j % 3) - 1, (Math.floor(j / 3) % 3) - 1, Math.floor(j / 9) - 1]);

/** What is known of a cell. */
const EMPTY = 0;
const OCCUPIED = 1;
const UNKNOWN = 2;

/** The models of all nodes. */
class Models {
  constructor() {
    this.bits = [4 << 14, 4 << 10, 1 << 17, 1 << 18, 1 << 17].map((n) => new Bits(n));
    this.mixers = new Mixers(4 << 6, 5, 22938);
  }
}

function hash(low, high) {
  return (Math.imul(low, 0x9e3779b1) ^ Math.imul(high, 0x85ebca6b)) >>> 15;
}

/** Place of a cell in the block of 6 x 6 x 6 that the children of 27 nodes make; those of the node in the middle are at 2 and 3. */
function place(x, y, z) {
  return x + 6 * (y + 6 * z);
}

/** Place of child `c` of the node in the middle. */
function placeOf(c) {
  return place(2 + (c & 1), 2 + ((c >> 1) & 1), 2 + (c >> 2));
}

const step = ([x, y, z]) => place(x, y, z);
const [NEAR_STEPS, FAR_STEPS, AROUND_STEPS] = [NEAR, FAR, AROUND].map((steps) => steps.map(step));

/** Bits of the cells that are occupied, the first as the highest. */
function pattern(block, at, steps) {
  let bits = 0;
  for (const step of steps) bits = (bits << 1) | (block[at + step] === OCCUPIED ? 1 : 0);
  return bits;
}

/** The children of a node as bits. */
function readChildren(stream, models, h, block, nodes) {
  const beside = FACES.reduce((bits, [x, y, z], i) => bits | (((nodes >> (13 + x + 3 * y + 9 * z)) & 1) << i), 0);
  let coded = 0;
  let k = 0;
  for (let c = 0; c < 8; c++) {
    const at = placeOf(c);
    let bit = 1;
    if (c < 7 || k > 0) {
      const count = [0, 0, 0];
      for (const step of AROUND_STEPS) if (step !== 0) count[block[at + step]]++;
      const occupied = Math.min(count[OCCUPIED], 7);
      const near = pattern(block, at, NEAR_STEPS);
      const far = pattern(block, at, FAR_STEPS);
      const siblings = (1 << c) | coded;
      const contexts = [
        (((h << 6) | beside) << 8) | siblings,
        (((((h << 3) | occupied) << 4) | Math.min(count[UNKNOWN], 15)) << 3) | k,
        hash((far << 6) | (near >> 6), (h << 3) | c),
        (((c << 12) | near) << 3) | k,
        hash(nodes, (h << 8) | siblings),
      ];
      bit = stream.mixedBit(models.mixers, (((h << 3) | k) << 3) | occupied, models.bits, contexts);
    }
    block[at] = bit ? OCCUPIED : EMPTY;
    coded |= bit << c;
    k += bit;
  }
  return coded;
}

/** Coordinates of the occupied cells of an octree of height 21, as three arrays; at most `most` of them. */
export function readPointPatterns(stream, most) {
  const models = new Models();
  const block = new Uint8Array(216);
  return readLevels(most, ({ h, places, children }, number, [x, y, z]) => {
    let nodes = 0;
    block.fill(EMPTY);
    AROUND.forEach(([dx, dy, dz], j) => {
      const other = places.of(x + dx, y + dy, z + dz);
      if (other < 0) return;
      nodes |= 1 << j;
      const corner = place(2 + 2 * dx, 2 + 2 * dy, 2 + 2 * dz);
      for (let c = 0; c < 8; c++) {
        const state = other < number ? (children[other] >> c) & 1 : UNKNOWN;
        block[corner + place(c & 1, (c >> 1) & 1, c >> 2)] = state;
      }
    });
    return readChildren(stream, models, h, block, nodes);
  });
}
