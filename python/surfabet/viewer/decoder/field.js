// Section 5.4 of docs/format.md: the cells that the surface passes through, and what they carry: colours, scalars, labels.

import { checkCount, fail } from "./bytes.js";
import { BESIDE, ESTIMATES, WHOLE_FIELDS } from "./container.js";
import { Bits, Symbols } from "./entropy.js";
import { BorderBlocks } from "./borders.js";
import { CellIndex, byte } from "./geometry.js";
import { OlderFieldReader } from "./older_field.js";
import { WholeFieldReader } from "./whole_field.js";

const OFFSET = 2 ** 20;
const MAX_CELLS = 2 ** 26;

/** Spreads ten bits to every third. */
function spread(v) {
  v = (v | (v << 16)) & 0x030000ff;
  v = (v | (v << 8)) & 0x0300f00f;
  v = (v | (v << 4)) & 0x030c30c3;
  return (v | (v << 2)) & 0x09249249;
}

/** Gathers every third of 30 bits. */
function gather(v) {
  v &= 0x09249249;
  v = (v | (v >>> 2)) & 0x030c30c3;
  v = (v | (v >>> 4)) & 0x0300f00f;
  v = (v | (v >>> 8)) & 0x030000ff;
  return (v | (v >>> 16)) & 0x3ff;
}

/** Calls `visit(column, row, depth)` for each set finest pixel of a patch; depth in quarters of a pixel. */
export function eachPixel({ meta, bases }, patch, visit) {
  const w = 8 << patch.level;
  const basis = bases[patch.level];
  for (let row = 0; row < w; row++) {
    const line = 8 * (row >> patch.level);
    for (let column = 0; column < w; column++) {
      if (patch.mask[line + (column >> patch.level)]) {
        const depth = basis.depth(patch, 2 * column + 1, 2 * row + 1);
        visit(column, row, Math.floor((depth * meta.step) / 2 ** 14));
      }
    }
  }
}

/** The cells that the surface passes through, sorted by key: coordinates from -2^20 as typed arrays. */
export function attributeCells(model) {
  let bound = 0;
  for (const { mask, level, thickness } of model.patches) {
    bound += mask.reduce((sum, m) => sum + m, 0) * 4 ** level * (Math.floor(thickness / 2) + 2);
  }
  checkCount("META", "cells with attributes", bound, MAX_CELLS);
  // Keys of 63 bits as pairs of words, which sort as one number each; browsers run on little-endian machines.
  const keys = new BigUint64Array(bound);
  const words = new Uint32Array(keys.buffer);
  let count = 0;
  for (const patch of model.patches) {
    const d = patch.side >> 1;
    const at = [0, 0, 0];
    const t = patch.thickness;
    eachPixel(model, patch, (column, row, q) => {
      at[(d + 1) % 3] = patch.u + column;
      at[(d + 2) % 3] = patch.v + row;
      const last = Math.floor((q + t - (t > 0 ? 1 : 0)) / 4);
      for (let depth = Math.floor((q - t) / 4); depth <= last; depth++) {
        at[d] = depth;
        let m0 = 0;
        let m1 = 0;
        let m2 = 0;
        for (let a = 0; a < 3; a++) {
          const c = Math.min(Math.max(at[a], -OFFSET), OFFSET - 1) + OFFSET;
          m0 |= spread(c & 1023) << a;
          m1 |= spread((c >> 10) & 1023) << a;
          m2 |= (c >> 20) << a;
        }
        words[2 * count] = m0 | (m1 << 30);
        words[2 * count + 1] = (m1 >>> 2) | (m2 << 28);
        count++;
      }
    });
  }
  keys.subarray(0, count).sort();
  return uniqueCells(words, count);
}

function uniqueCells(words, count) {
  const xyz = [0, 1, 2].map(() => new Int32Array(count));
  let n = 0;
  for (let i = 0; i < count; i++) {
    const low = words[2 * i];
    const high = words[2 * i + 1];
    if (i > 0 && low === words[2 * i - 2] && high === words[2 * i - 1]) continue;
    const m1 = ((low >>> 30) | (high << 2)) & 0x3fffffff;
    for (let a = 0; a < 3; a++) {
      const top = (high >>> (28 + a)) & 1;
      xyz[a][n] = gather(low >>> a) | (gather(m1 >>> a) << 10) | (top << 20);
    }
    n++;
  }
  const [x, y, z] = xyz.map((c) => c.slice(0, n));
  return { n, x, y, z, index: new CellIndex(x, y, z) };
}

/** Means of cells, channel after channel within each, from a whole stream; `coding` is a feature or 0, `border` the cube of a tile. */
function readField(stream, { cells, border }, steps, coding) {
  const whole = (of, estimated) => new WholeFieldReader(stream, of, steps, estimated).read();
  const means = coding === WHOLE_FIELDS || coding === ESTIMATES
    ? whole(cells, coding === ESTIMATES)
    : new OlderFieldReader(stream, cells, steps, coding === BESIDE).read();
  if (border) {
    const corrected = new BorderBlocks(border, cells);
    if (corrected.blocks.n > 0) corrected.add(whole(corrected.blocks, false), means, steps.length);
  }
  stream.end();
  return means;
}

/** Red, green and blue of each cell. */
export function readColors(stream, { cells, border, meta }, coding) {
  if (cells.n === 0) {
    if (stream.length > 0) fail(stream.section, "colours without cells");
    return new Uint8Array(0);
  }
  const steps = [meta.lumaStep, meta.chromaStep, meta.chromaStep];
  const means = readField(stream, { cells, border }, steps, coding);
  const colors = new Uint8Array(3 * cells.n);
  const [T, Q, R] = [1 / Math.sqrt(3), 1 / Math.SQRT2, 1 / Math.sqrt(6)];
  for (let i = 0; i < cells.n; i++) {
    const [Y, O, G] = [means[3 * i], means[3 * i + 1], means[3 * i + 2]];
    colors[3 * i] = byte(T * Y + Q * O - R * G);
    colors[3 * i + 1] = byte(T * Y + 2 * R * G);
    colors[3 * i + 2] = byte(T * Y - Q * O - R * G);
  }
  return colors;
}

/** Steps of a scalar of each cell. */
export function readScalar(stream, { cells, border }, coding) {
  if (cells.n === 0) {
    if (stream.length > 0) fail(stream.section, "values without cells");
    return new Float64Array(0);
  }
  return readField(stream, { cells, border }, [1], coding);
}

/** Displacements of the cells that vote for a label, with their votes: those with a smaller key. */
const VOTERS = [];
for (let place = 0; place < 27; place++) {
  const at = [(place % 3) - 1, (Math.floor(place / 3) % 3) - 1, Math.floor(place / 9) - 1];
  const apart = at.filter((c) => c !== 0).length;
  if (apart === 1 || apart === 2) VOTERS.push({ at, votes: 3 - apart });
}

/** Number of the label of each cell. */
export function readLabels(stream, cells, n) {
  const labels = new Uint16Array(cells.n);
  if (n === 1 || cells.n === 0) {
    if (stream.length > 0) fail(stream.section, "labels where none are told apart");
    return labels;
  }
  const firstBits = new Bits(144, 1023);
  const secondBits = new Bits(12);
  const symbols = new Symbols(n, n);
  const votes = new Uint32Array(n);
  for (let i = 0; i < cells.n; i++) {
    const voted = [];
    for (const { at, votes: of } of VOTERS) {
      const q = cells.index.find(cells.x[i] + at[0], cells.y[i] + at[1], cells.z[i] + at[2]);
      if (q < 0 || q >= i) continue;
      if (votes[labels[q]] === 0) voted.push(labels[q]);
      votes[labels[q]] += of;
    }
    voted.sort((a, b) => votes[b] - votes[a] || a - b);
    const F = voted.length > 0 ? voted[0] : i > 0 ? labels[i - 1] : 0;
    const f = voted.length > 0 ? votes[F] : 0;
    const others = voted.reduce((sum, label) => sum + votes[label], 0) - f;
    const S = voted[1];
    const s = S === undefined ? 0 : votes[S];
    for (const label of voted) votes[label] = 0;
    if (stream.bit(firstBits, 12 * Math.min(f, 11) + Math.min(others, 11))) labels[i] = F;
    else if (S !== undefined && stream.bit(secondBits, Math.min(s, 11))) labels[i] = S;
    else labels[i] = stream.symbol(symbols, F);
  }
  stream.end();
  return labels;
}
