// Section 5.4 of docs/format.md: the cells that the surface passes through, and what they carry: colours, scalars, labels.

import { checkCount, fail } from "./bytes.js";
import { Bits, Signed, Symbols } from "./entropy.js";
import { CellIndex, byte } from "./geometry.js";

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

/** The pyramid over cells: each level has coordinates, weights, an index, and the first child of each cell. */
function pyramid(cells) {
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

/** Reads means of cells, channel after channel within each cell (5.4); `steps[channel]` are whole steps. */
class FieldReader {
  constructor(stream, cells, steps, beside) {
    this.stream = stream;
    this.levels = pyramid(cells);
    this.steps = steps;
    this.channels = steps.length;
    this.beside = beside;
    this.shares = beside ? [1.15, 1, 0.9, 0.8] : [1.25, 1, 0.85, 0.7];
    this.any = new Bits(12 * 49, 1023);
    this.coefficient = new Signed(this.channels * 36);
    // Of one parent: predictions of its children, its coefficients, its pairs.
    this.changed = new Float64Array(8 * this.channels);
    this.coefficients = new Float64Array(7 * this.channels);
    this.haar = new HaarPairs();
    this.value = new Float64Array(8);
  }

  read() {
    const { levels, channels, stream } = this;
    const models = new Signed(channels);
    let means = new Float64Array(channels);
    for (let c = 0; c < channels; c++) means[c] = stream.signed(models, c);
    let activity = new Uint8Array(1);
    for (let j = levels.length - 2; j >= 0; j--) {
      const now = new Uint8Array(levels[j + 1].n);
      means = this.readLevel(j, means, activity, now);
      activity = new Uint8Array(levels[j].n);
      const { first, n } = levels[j + 1];
      for (let p = 0; p < n; p++) activity.fill(now[p], first[p], first[p + 1]);
    }
    stream.end();
    return means;
  }

  /** Predictions of all cells of level j from the means of the level above. */
  predictions(j, means) {
    const level = this.levels[j];
    const above = this.levels[j + 1];
    const C = this.channels;
    const share = this.beside ? 0.26 : 0.32;
    const weights = Float64Array.from({ length: 8 }, (_, k) =>
      [0, 1, 2].reduce((product, a) => product * ((k >> a) & 1 ? share : 1 - share), 1));
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
        for (let c = 0; c < C; c++) predicted[C * i + c] /= total;
      }
    }
    return predicted;
  }

  readLevel(j, parentMeans, activity, now) {
    const level = this.levels[j];
    const above = this.levels[j + 1];
    const C = this.channels;
    const predicted = this.predictions(j, parentMeans);
    const means = new Float64Array(C * level.n);
    const missed = this.beside ? new Float64Array(C * level.n) : null;
    for (let p = 0; p < above.n; p++) {
      const from = above.first[p];
      const to = above.first[p + 1];
      if (to - from === 1) {
        for (let c = 0; c < C; c++) means[C * from + c] = parentMeans[C * p + c];
        now[p] = Math.max(activity[p] - 1, 0);
      } else {
        for (let i = from; i < to; i++) this.change(level, i, predicted, missed, i - from);
        this.readCoefficients(j, p, to - from, activity, now);
        this.transform(j, p, parentMeans, means);
      }
      if (missed) {
        for (let i = C * from; i < C * to; i++) missed[i] = means[i] - predicted[i];
      }
    }
    return means;
  }

  /** The prediction of a child with what was missed beside it (feature bit 6), as child `at` of `this.changed`. */
  change(level, i, predicted, missed, at) {
    const C = this.channels;
    const { changed } = this;
    for (let c = 0; c < C; c++) changed[C * at + c] = predicted[C * i + c];
    if (!missed) return;
    const x = level.x[i];
    const y = level.y[i];
    const z = level.z[i];
    for (let a = 0; a < 3; a++) {
      const own = a === 0 ? x : a === 1 ? y : z;
      if (own & 1) continue;
      const q = level.index.find(x - (a === 0 ? 1 : 0), y - (a === 1 ? 1 : 0), z - (a === 2 ? 1 : 0));
      if (q < 0) continue;
      for (let c = 0; c < C; c++) changed[C * at + c] += 0.3 * missed[C * q + c];
    }
  }

  /** Coefficients of a parent with m children into `this.coefficients`: m - 1 per channel, channel by channel within each. */
  readCoefficients(j, p, m, activity, now) {
    const { stream, channels, coefficients } = this;
    const { x, y, z, index } = this.levels[j + 1];
    const context = Math.min(j, 11);
    let up = 0;
    let down = 0;
    for (let a = 0; a < 3; a++) {
      const dx = a === 0 ? 1 : 0;
      const dy = a === 1 ? 1 : 0;
      const dz = a === 2 ? 1 : 0;
      const higher = index.find(x[p] + dx, y[p] + dy, z[p] + dz);
      if (higher >= 0) up += activity[higher];
      const lower = index.find(x[p] - dx, y[p] - dy, z[p] - dz);
      if (lower >= 0) down += now[lower];
    }
    const a = Math.min(6, activity[p] + Math.ceil(up / 2));
    const b = Math.min(6, down);
    coefficients.fill(0);
    if (!stream.bit(this.any, 49 * context + 7 * a + b)) return;
    let r = 0;
    let size = 0;
    for (let i = 0; i < m - 1; i++) {
      for (let c = 0; c < channels; c++) {
        const model = 36 * c + 3 * context + Math.min(r, 2);
        const value = stream.from(0, -(2 ** 24), 2 ** 24, this.coefficient, model);
        coefficients[channels * i + c] = value;
        r += Math.min(Math.abs(value), 2);
        size += Math.min(Math.abs(value), 4);
      }
    }
    now[p] = Math.min(4, size);
  }

  /** Means of the children of p from their predictions and coefficients. */
  transform(j, p, parentMeans, means) {
    const level = this.levels[j];
    const above = this.levels[j + 1];
    const C = this.channels;
    const { changed: predicted, coefficients, haar, value } = this;
    const from = above.first[p];
    const to = above.first[p + 1];
    haar.begin();
    for (let i = from; i < to; i++) {
      haar.weight[(level.x[i] & 1) | ((level.y[i] & 1) << 1) | ((level.z[i] & 1) << 2)] = level.weight[i];
    }
    haar.pair();
    const total = above.weight[p];
    const { n, first, second, A, B } = haar;
    for (let c = 0; c < C; c++) {
      const step = this.steps[c] * this.shares[Math.min(j, 3)];
      let mean = 0;
      for (let i = from; i < to; i++) mean += level.weight[i] * predicted[C * (i - from) + c];
      for (let i = 0; i < n; i++) value[second[i]] = coefficients[C * i + c] * step;
      value[first[n - 1]] = Math.sqrt(total) * (parentMeans[C * p + c] - mean / total);
      for (let i = n - 1; i >= 0; i--) {
        const x = value[first[i]];
        const y = value[second[i]];
        value[first[i]] = A[i] * x - B[i] * y;
        value[second[i]] = B[i] * x + A[i] * y;
      }
      for (let i = from; i < to; i++) {
        const octant = (level.x[i] & 1) | ((level.y[i] & 1) << 1) | ((level.z[i] & 1) << 2);
        means[C * i + c] = predicted[C * (i - from) + c] + value[octant] / Math.sqrt(level.weight[i]);
      }
    }
  }
}

/** Pairs of slots that meet, with their shares; made once and used for all parents. */
class HaarPairs {
  constructor() {
    this.weight = new Float64Array(8);
    this.slot = new Uint8Array(8);
    this.first = new Uint8Array(7);
    this.second = new Uint8Array(7);
    this.A = new Float64Array(7);
    this.B = new Float64Array(7);
  }

  begin() {
    this.n = 0;
    this.weight.fill(0);
    for (let o = 0; o < 8; o++) this.slot[o] = o;
  }

  pair() {
    const { weight, slot } = this;
    for (let stride = 1; stride < 8; stride *= 2) {
      for (let o = 0; o < 8; o += 2 * stride) {
        const a = slot[o];
        const b = slot[o + stride];
        if (weight[a] > 0 && weight[b] > 0) {
          const sum = weight[a] + weight[b];
          this.first[this.n] = a;
          this.second[this.n] = b;
          this.A[this.n] = Math.sqrt(weight[a] / sum);
          this.B[this.n++] = Math.sqrt(weight[b] / sum);
          weight[a] = sum;
        } else if (weight[b] > 0) {
          slot[o] = b;
        }
      }
    }
  }
}

/** Red, green and blue of each cell. */
export function readColors(stream, { cells, meta }, beside) {
  if (cells.n === 0) {
    if (stream.length > 0) fail(stream.section, "colours without cells");
    return new Uint8Array(0);
  }
  const steps = [meta.lumaStep, meta.chromaStep, meta.chromaStep];
  const means = new FieldReader(stream, cells, steps, beside).read();
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
export function readScalar(stream, cells, beside) {
  if (cells.n === 0) {
    if (stream.length > 0) fail(stream.section, "values without cells");
    return new Float64Array(0);
  }
  return new FieldReader(stream, cells, [1], beside).read();
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
