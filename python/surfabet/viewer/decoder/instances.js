// Section 5.8 of docs/format.md: instances, patches and points beside them that the model gives once more
// at other places.

import { checkCount, fail, mostBits } from "./bytes.js";
import { Bits, Signed, Stream, Unsigned } from "./entropy.js";
import { axesOf } from "./shapes.js";

const fround = Math.fround;
const BLOCK = 16;
const MAX_INSTANCES = 4096;
const MAX_BLOCK = 2 ** 27;
const MAX_SHIFT = 2 ** 28;
const MAX_ANGLE = 2048;

/** Patches and points that may be decided about, of all instances together. */
const MOST_COPIES = 2 ** 27;

/** The number of instances of 5.1. */
export function readInstanceCount(fields) {
  const count = fields.varint(MAX_INSTANCES, "a number of instances");
  if (count < 1) fail("META", "no instances");
  return count;
}

/** The instances of a model: numbers of patches and of points, rows of the linear part, shift in finest pixels. */
export function readInstances(bytes, meta, patches, points) {
  checkCount("META", "instances", meta.nInstances, mostBits(bytes));
  const stream = new Stream(bytes, "INST");
  const axis = stream.bypass(2);
  if (axis > 2) fail("INST", "an axis of number 3");
  const models = {
    angle: new Signed(1), shift: new Signed(3), low: new Signed(3), size: new Unsigned(3), patch: new Bits(2),
    point: new Bits(2),
  };
  const blocks = patches.map((patch) => blockOf(patch, meta.step));
  const pointBlocks = [];
  for (let p = 0; p < points.length; p += 3) {
    pointBlocks.push([0, 1, 2].map((a) => Math.floor(points[p + a] / meta.pixel / BLOCK)));
  }
  let left = MOST_COPIES;
  const kept = (all, box, model) => {
    const numbers = [];
    let before = 1;
    all.forEach((block, number) => {
      if (!block.every((c, a) => box[a][0] <= c && c <= box[a][1])) return;
      if (left-- === 0) fail("INST", `more than ${MOST_COPIES} patches and points of instances`);
      before = stream.bit(model, before);
      if (before) numbers.push(number);
    });
    return numbers;
  };
  const instances = [];
  for (let i = 0; i < meta.nInstances; i++) {
    const quarters = stream.bypass(2);
    const mirrored = stream.bypass(1);
    const angle = stream.from(0, -MAX_ANGLE, MAX_ANGLE, models.angle);
    const shift = [0, 1, 2].map((a) => stream.from(0, -MAX_SHIFT, MAX_SHIFT, models.shift, a) / 8);
    const box = [];
    for (let a = 0; a < 3; a++) {
      const low = stream.from(0, -MAX_BLOCK, MAX_BLOCK, models.low, a);
      box.push([low, low + stream.unsigned(models.size, a)]);
    }
    const numbers = kept(blocks, box, models.patch);
    const pointNumbers = kept(pointBlocks, box, models.point);
    if (numbers.length === 0) fail("INST", "an instance without patches");
    instances.push({ numbers, points: pointNumbers, shift, rows: rowsOf(axis, quarters, mirrored, angle) });
  }
  stream.end();
  return instances;
}

/** The block that the middle of a patch lies in. */
function blockOf(patch, step) {
  const [d, u, v] = axesOf(patch.side);
  const half = 4 << patch.level;
  const block = [0, 0, 0];
  block[d] = Math.floor((patch.coefficients[0] * step) / (16 * BLOCK));
  block[u] = Math.floor((patch.u + half) / BLOCK);
  block[v] = Math.floor((patch.v + half) / BLOCK);
  return block;
}

/** The linear part of a motion. */
function rowsOf(axis, quarters, mirrored, angle) {
  const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
  const radians = (angle / 16384) * 2 * Math.PI;
  let [cos, sin] = angle === 0 ? [1, 0] : [Math.cos(radians), Math.sin(radians)];
  for (let i = 0; i < quarters; i++) [cos, sin] = [-sin, cos];
  const facing = mirrored ? -1 : 1;
  const rows = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  rows[axis][axis] = 1;
  rows[u][u] = fround(facing * cos);
  rows[u][v] = fround(-sin);
  rows[v][u] = fround(facing * sin);
  rows[v][v] = fround(cos);
  return rows;
}

/** Writes where a direction is moved to into `to`. */
export function moveDirection({ rows }, x, y, z, to) {
  for (let a = 0; a < 3; a++) {
    const r = rows[a];
    to[a] = fround(fround(fround(r[0] * x) + fround(r[1] * y)) + fround(r[2] * z));
  }
}

/** Writes where a position is moved to into `to`. */
export function movePosition(instance, x, y, z, to) {
  moveDirection(instance, x, y, z, to);
  for (let a = 0; a < 3; a++) to[a] = fround(to[a] + instance.shift[a]);
}

/** Writes the position that is moved to `(x, y, z)` into `to`. */
export function moveBack({ rows, shift }, x, y, z, to) {
  const back = [x - shift[0], y - shift[1], z - shift[2]];
  for (let a = 0; a < 3; a++) {
    to[a] = fround(rows[0][a] * back[0] + rows[1][a] * back[1] + rows[2][a] * back[2]);
  }
}
