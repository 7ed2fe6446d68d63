// Section 5.4 of docs/format.md: colours and scalars in whole numbers (feature bits 11 and 15).
//
// All numbers are whole and below 2^53, so that doubles hold them.

import { Bits, Mixers, Signed } from "./entropy.js";
import { ANY, EXPONENT, NEGATIVE, NONZERO } from "./estimate_weights.js";
import { digits, estimate, oddEstimate } from "./estimates.js";
import { SlotPairs, interpolated, pyramid } from "./pyramid.js";

const MAX_VALUE = 2 ** 30 - 1;
const MAX_COEFFICIENT = 2 ** 24;
const SHARES = [37, 32, 29, 26];
const PARENT_WEIGHTS = Float64Array.from({ length: 8 }, (_, k) =>
  [0, 1, 2].reduce((product, a) => product * ((k >> a) & 1 ? 17 : 47), 1));
const MEMORY = 1023;

const bounded = (value) => Math.min(Math.max(value, -MAX_VALUE), MAX_VALUE);

/** Sizes and signs of coefficients along each axis, by channel: entry `channels * axis + channel`. */
class Along {
  constructor(channels) {
    this.channels = channels;
    this.sizes = new Int16Array(3 * channels);
    this.signs = new Int16Array(3 * channels);
    // With channels 0 and 1: entry `channels * k + channel`.
    this.agreements = new Int16Array(2 * channels);
  }

  clear() {
    this.sizes.fill(0);
    this.signs.fill(0);
    this.agreements.fill(0);
  }

  /** Adds a coefficient; `others` are those of the same pair in channels 0 and 1. */
  add(axis, c, value, others) {
    for (let k = 0; k < Math.min(c, 2); k++) {
      this.agreements[this.channels * k + c] += Math.sign(others[k]) * Math.sign(value);
    }
    this.sizes[this.channels * axis + c] += Math.min(Math.abs(value), 2);
    this.signs[this.channels * axis + c] += Math.sign(value);
  }

  /** Sum of the sizes of a channel. */
  sum(c) {
    return this.sizes[c] + this.sizes[this.channels + c] + this.sizes[2 * this.channels + c];
  }

  size(axis, c, most) {
    return Math.min(this.sizes[this.channels * axis + c], most);
  }

  sign(axis, c) {
    return Math.min(Math.max(this.signs[this.channels * axis + c], -2), 2) + 2;
  }
}

/** Pairs in whole numbers. */
class WholePairs extends SlotPairs {
  constructor() {
    super();
    this.axis = new Uint8Array(7);
    this.share = new Float64Array(7);
    this.F = new Float64Array(7);
    this.G = new Float64Array(7);
    this.weights = new Uint8Array(7);
  }

  meet(a, b, axis) {
    const { weight, n } = this;
    const [v, w] = [weight[a], weight[b]];
    const share = (of) => Math.floor((of * 2 ** 26) / (v + w));
    const factor = (of, by) => Math.floor(Math.sqrt(Math.floor((share(of) * 2 ** 14) / by)));
    this.axis[n] = axis;
    this.share[n] = Math.floor(share(w) / 1024);
    this.F[n] = factor(w, v);
    this.G[n] = factor(v, w);
    this.weights[n] = digits(Math.floor((v * w) / (v + w)));
  }

  /** Size class of a difference of two values in pair i, with its sign; `step` in 32nds. */
  changeClass(i, difference, step) {
    const size = Math.abs(difference) * 2 ** 19;
    const one = (this.F[i] + this.G[i]) * step;
    let k = 0;
    while (k < 6 && size >= one * 2 ** (k - 3)) k++;
    return difference < 0 ? -k : k;
  }
}

/** Reads means of cells, channel after channel within each cell; `steps[channel]` are whole steps. With estimates or without. */
export class WholeFieldReader {
  constructor(stream, cells, steps, estimated) {
    const C = steps.length;
    this.stream = stream;
    this.levels = pyramid(cells);
    this.steps = steps;
    this.channels = C;
    this.estimated = estimated;
    const given = estimated ? 52429 : 0;
    const [two, three, five] = estimated ? [13107, 13107, 6554] : [32768, 26214, 19661];
    const bits = (sizes) => sizes.map((size) => new Bits(size, MEMORY));
    this.any = bits([12 * 49, 12 * 49]);
    this.anyMixers = new Mixers(12, 2, two, given);
    this.nonzero = bits([C * 36, C * 105, C * 180, C * 60, C * 168]);
    this.nonzeroMixers = new Mixers(C * 3, 5, five, given);
    this.negative = bits([C * 13, C * 9, C * 25]);
    this.negativeMixers = new Mixers(C, 3, three, given);
    this.exponent = bits([C * 432, C * 336]);
    this.exponentMixers = new Mixers(C * 12, 2, two, given);
    this.mantissa = new Bits(25 * 3, MEMORY);
    // Of one parent: predictions of its children and their mean, how these change, its coefficients, its pairs.
    this.changed = new Float64Array(8 * C);
    this.mean = new Float64Array(C);
    this.changes = new Int8Array(7 * C);
    this.coefficients = new Float64Array(7 * C);
    this.pairs = new WholePairs();
    this.value = new Float64Array(8);
    // What estimates depend on beside: of all, of whether there is any coefficient, of a coefficient; what was missed beside.
    this.common = new Float64Array(9);
    this.ofAny = new Float64Array(18);
    this.ofCoefficient = new Float64Array(32);
    this.ofSign = new Float64Array(24);
    // What was missed beside each child, and how it differs in each pair.
    this.besideChild = new Float64Array(8 * C);
    this.pulls = new Int8Array(7 * C);
    this.missed = new Float64Array(C);
    this.sizes = new Float64Array(C);
    this.before = new Along(C);
    this.beside = new Along(C);
  }

  /** Reads on; the stream need not end here. */
  read() {
    const { levels, channels: C, stream } = this;
    const models = new Signed(C);
    let means = new Float64Array(C);
    for (let c = 0; c < C; c++) means[c] = bounded(stream.signed(models, c) * 64);
    let activity = new Uint8Array(1);
    for (let j = levels.length - 2; j >= 0; j--) {
      const now = new Uint8Array(levels[j + 1].n);
      means = this.readLevel(j, means, activity, now);
      activity = new Uint8Array(levels[j].n);
      const { first, n } = levels[j + 1];
      for (let p = 0; p < n; p++) activity.fill(now[p], first[p], first[p + 1]);
    }
    return means.map((mean) => mean / 64);
  }

  /** Predictions of all cells of level j from the means of the level above. */
  predictions(j, means) {
    const divide = (sum, total) => Math.floor((2 * sum + total) / (2 * total));
    const { levels, channels } = this;
    return interpolated(levels[j], levels[j + 1], PARENT_WEIGHTS, means, channels, divide);
  }

  readLevel(j, parentMeans, activity, now) {
    const level = this.levels[j];
    const above = this.levels[j + 1];
    const C = this.channels;
    const predicted = this.predictions(j, parentMeans);
    const means = new Float64Array(C * level.n);
    const missed = new Float64Array(C * level.n);
    // Sizes, then signs, of what each parent has along each axis; then agreements.
    const coded = new Int8Array(8 * C * above.n);
    for (let p = 0; p < above.n; p++) {
      const from = above.first[p];
      const to = above.first[p + 1];
      if (to - from === 1) {
        for (let c = 0; c < C; c++) means[C * from + c] = parentMeans[C * p + c];
        now[p] = Math.max(activity[p] - 1, 0);
      } else {
        for (let i = from; i < to; i++) this.change(level, i, predicted, missed, i - from);
        this.pairsOf(j, p);
        this.readCell(j, p, activity, now, coded, missed);
        this.transform(j, p, parentMeans, means);
      }
      for (let i = C * from; i < C * to; i++) missed[i] = means[i] - predicted[i];
    }
    return means;
  }

  /** The prediction of a child with what was missed beside it, as child `at` of `this.changed`. */
  change(level, i, predicted, missed, at) {
    const C = this.channels;
    const own = [level.x[i], level.y[i], level.z[i]];
    const sum = new Array(C).fill(0);
    for (let a = 0; a < 3; a++) {
      if (own[a] & 1) continue;
      const q = level.index.find(own[0] - (a === 0 ? 1 : 0), own[1] - (a === 1 ? 1 : 0), own[2] - (a === 2 ? 1 : 0));
      if (q < 0) continue;
      for (let c = 0; c < C; c++) sum[c] += missed[C * q + c];
    }
    for (let c = 0; c < C; c++) {
      this.besideChild[C * at + c] = bounded(sum[c]);
      this.changed[C * at + c] = bounded(predicted[C * i + c] + Math.floor((77 * sum[c] + 128) / 256));
    }
  }

  /** The pairs of a parent, the mean of its predictions, and how these change. */
  pairsOf(j, p) {
    const level = this.levels[j];
    const { first } = this.levels[j + 1];
    const { pairs, value, changed, channels: C } = this;
    const octants = [];
    pairs.begin();
    for (let i = first[p]; i < first[p + 1]; i++) {
      octants.push((level.x[i] & 1) | ((level.y[i] & 1) << 1) | ((level.z[i] & 1) << 2));
      pairs.weight[octants[octants.length - 1]] = level.weight[i];
    }
    pairs.pair();
    this.octants = octants;
    for (let c = 0; c < C; c++) {
      octants.forEach((o, at) => { value[o] = changed[C * at + c]; });
      const step = this.step(c, j);
      for (let i = 0; i < pairs.n; i++) {
        const [a, b] = [pairs.first[i], pairs.second[i]];
        const difference = value[b] - value[a];
        this.changes[C * i + c] = pairs.changeClass(i, difference, step);
        value[a] += Math.floor((difference * pairs.share[i] + 32768) / 65536);
      }
      this.mean[c] = value[pairs.first[pairs.n - 1]];
      if (this.estimated) this.pull(j, c);
    }
  }

  /** How what was missed beside the children differs in each pair. */
  pull(j, c) {
    const { pairs, value, besideChild, channels: C } = this;
    this.octants.forEach((o, at) => { value[o] = besideChild[C * at + c]; });
    for (let i = 0; i < pairs.n; i++) {
      const [a, b] = [pairs.first[i], pairs.second[i]];
      const d = value[b] - value[a];
      const size = Math.floor((Math.abs(d) * 2 ** (Math.min(j, 11) + 2)) / this.step(c, j));
      this.pulls[C * i + c] = Math.sign(d) * Math.min(digits(size), 12);
      value[a] += Math.floor((d * pairs.share[i] + 32768) / 65536);
    }
  }

  /** Step of a channel at a level, in 32nds. */
  step(c, j) {
    return this.steps[c] * SHARES[Math.min(j, 3)];
  }

  /** Coefficients of a parent into `this.coefficients`. */
  readCell(j, p, activity, now, coded, missed) {
    const { stream, channels: C, coefficients, before, beside } = this;
    const { x, y, z, index } = this.levels[j + 1];
    let up = 0;
    let down = 0;
    let behind = 0;
    beside.clear();
    this.missed.fill(0);
    for (let a = 0; a < 3; a++) {
      const [dx, dy, dz] = [a === 0 ? 1 : 0, a === 1 ? 1 : 0, a === 2 ? 1 : 0];
      const higher = index.find(x[p] + dx, y[p] + dy, z[p] + dz);
      if (higher >= 0) up += activity[higher];
      const lower = index.find(x[p] - dx, y[p] - dy, z[p] - dz);
      if (lower < 0) continue;
      down += now[lower];
      behind++;
      this.addMissed(j, lower, missed);
      for (let k = 0; k < 3 * C; k++) {
        if (Math.floor(k / C) === a) continue;
        beside.sizes[k] += coded[8 * C * lower + k];
        beside.signs[k] += coded[8 * C * lower + 3 * C + k];
      }
      for (let k = 0; k < 2 * C; k++) beside.agreements[k] += coded[8 * C * lower + 6 * C + k];
    }
    const level = Math.min(j, 11);
    const parent = Math.min(6, activity[p] + Math.ceil(up / 2));
    coefficients.fill(0);
    before.clear();
    const [luma, chroma] = this.largestChanges();
    const at = [(7 * level + parent) * 7 + Math.min(6, down), (7 * level + luma) * 7 + chroma];
    if (this.estimated) this.setCommon(j, p, activity[p], up, down);
    const given = this.estimated ? this.anyEstimate(behind) : 0;
    if (!stream.mixedBit(this.anyMixers, level, this.any, at, given)) return;
    this.size = 0;
    this.sizes.fill(0);
    let sum = 0;
    for (let i = 0; i < this.pairs.n; i++) {
      for (let c = 0; c < C; c++) {
        const value = this.readCoefficient(level, i, c);
        coefficients[C * i + c] = value;
        before.add(this.pairs.axis[i], c, value, [coefficients[C * i], coefficients[C * i + 1]]);
        this.size += Math.min(Math.abs(value), 2);
        this.sizes[c] += Math.abs(value);
        sum += Math.min(Math.abs(value), 4);
      }
    }
    now[p] = Math.min(4, sum);
    coded.set(before.sizes, 8 * C * p);
    coded.set(before.signs, 8 * C * p + 3 * C);
    coded.set(before.agreements, 8 * C * p + 6 * C);
  }

  /** Adds what was missed at the children of a parent beside. */
  addMissed(j, parent, missed) {
    const { channels: C } = this;
    const { first } = this.levels[j + 1];
    for (let i = C * first[parent]; i < C * first[parent + 1]; i++) this.missed[i % C] += Math.abs(missed[i]);
  }

  /** What all estimates of a parent depend on; and what was missed beside it as eighths of steps. */
  setCommon(j, p, activity, up, down) {
    const { common, missed } = this;
    for (let l = 0; l < 4; l++) common[l] = Math.min(j, 3) === l ? 1 : 0;
    common.set([activity, up, down, this.pairs.n, digits(this.levels[j + 1].weight[p])], 4);
    for (let c = 0; c < this.channels; c++) {
      missed[c] = Math.floor((missed[c] * 2 ** (Math.min(j, 11) + 2)) / this.step(c, j));
    }
  }

  /** Class of what was missed in the channels from `c` to before `end`. */
  missedClass(c, end) {
    let sum = 0;
    for (let k = c; k < end; k++) sum += this.missed[k];
    return Math.min(digits(sum), 12);
  }

  /** Largest size of change in the channels from `c` to before `end`, and the sum of all. */
  changesOf(c, end) {
    let [largest, sum] = [0, 0];
    for (let i = 0; i < this.pairs.n; i++) {
      for (let k = c; k < end; k++) {
        const size = Math.abs(this.changes[this.channels * i + k]);
        largest = Math.max(largest, size);
        sum += size;
      }
    }
    return [largest, sum];
  }

  anyEstimate(behind) {
    const { channels: C, ofAny, beside } = this;
    let chroma = 0;
    for (let c = 1; c < C; c++) chroma += beside.sum(c);
    ofAny.set(this.common);
    ofAny.set([
      behind, ...this.changesOf(0, 1), ...this.changesOf(1, C), this.missedClass(0, 1), this.missedClass(1, C),
      Math.min(beside.sum(0), 12), Math.min(chroma, 12),
    ], 9);
    return estimate(ANY, ofAny);
  }

  /** What the estimates of coefficient i of a channel depend on. */
  setInputs(i, c, axis, [u, v]) {
    const { beside, before, pairs, changes, channels: C } = this;
    let largest = 0;
    for (let k = 0; k < C; k++) largest = Math.max(largest, Math.abs(changes[C * i + k]));
    this.ofCoefficient.set(this.common);
    this.ofCoefficient.set([
      this.missedClass(0, 1), c === 1 ? 1 : 0, c === 2 ? 1 : 0, this.changesOf(c, c + 1)[1], Math.min(beside.sum(c), 12),
      this.missedClass(c, c + 1), C === 1 ? 1 : 0,
      axis === 1 ? 1 : 0, axis === 2 ? 1 : 0, i, pairs.weights[i],
      Math.abs(changes[C * i + c]), Math.abs(changes[C * i]), largest,
      beside.size(axis, c, 8), Math.min(this.size, 8), digits(this.sizes[c]), digits(this.sizes[0]), before.size(axis, c, 8),
      Math.min(Math.abs(u), 3), Math.min(Math.abs(v), 3), this.size === 0 && i + 1 === pairs.n ? 1 : 0, 0,
    ], 9);
  }

  /** The estimate of the sign of coefficient i of a channel. */
  signEstimate(i, c, axis, others) {
    const { beside, before, pairs, changes, common, ofSign, channels: C } = this;
    const [u, v] = others.map((q) => Math.min(Math.max(q, -4), 4));
    const agreement = (k) => Math.min(Math.max(beside.agreements[C * k + c], -8), 8);
    for (let l = 0; l < 4; l++) ofSign[l] = common[l];
    ofSign.set([
      axis === 1 ? 1 : 0, axis === 2 ? 1 : 0, c === 1 ? 1 : 0, c === 2 ? 1 : 0, C === 1 ? 1 : 0, pairs.weights[i],
      Math.abs(u), Math.abs(v), Math.abs(changes[C * i + c]), i, pairs.n,
      changes[C * i + c], changes[C * i], u, v, beside.signs[C * axis + c], before.signs[C * axis + c],
      this.pulls[C * i + c], Math.sign(u) * agreement(0), Math.sign(v) * agreement(1),
    ], 4);
    return oddEstimate(NEGATIVE, ofSign, 15);
  }

  largestChanges() {
    const { channels: C, changes, pairs } = this;
    const largest = [0, 0];
    for (let i = 0; i < pairs.n; i++) {
      for (let c = 0; c < C; c++) {
        const of = Math.min(c, 1);
        largest[of] = Math.max(largest[of], Math.abs(changes[C * i + c]));
      }
    }
    return largest;
  }

  /** Coefficient i of a channel. */
  readCoefficient(level, i, c) {
    const { stream, channels: C, coefficients, before, beside, pairs } = this;
    const axis = pairs.axis[i];
    const size = Math.min(this.size, 2);
    const change = this.changes[C * i + c];
    const steep = Math.abs(change);
    const few = Math.min(level, 4);
    const other = (k) => (k < c ? coefficients[C * i + k] : 0);
    const sizeOf = (k) => Math.min(Math.abs(other(k)), 2);
    const nonzero = [
      (12 * c + level) * 3 + size,
      ((5 * c + few) * 3 + axis) * 7 + steep,
      (((5 * c + few) * 3 + sizeOf(0)) * 3 + sizeOf(1)) * 4 + Math.min(this.size, 3),
      ((3 * c + axis) * 5 + beside.size(axis, c, 4)) * 4 + before.size(axis, c, 3),
      ((7 * c + pairs.n - 1 - i) * 8 + pairs.n) * 3 + size,
    ];
    if (this.estimated) this.setInputs(i, c, axis, [other(0), other(1)]);
    const given = this.estimated ? estimate(NONZERO, this.ofCoefficient) : 0;
    if (!stream.mixedBit(this.nonzeroMixers, 3 * c + size, this.nonzero, nonzero, given)) return 0;
    const negative = [
      13 * c + change + 6,
      (3 * c + Math.sign(other(0)) + 1) * 3 + Math.sign(other(1)) + 1,
      (5 * c + beside.sign(axis, c)) * 5 + before.sign(axis, c),
    ];
    const ofSign = this.estimated ? this.signEstimate(i, c, axis, [other(0), other(1)]) : 0;
    const sign = stream.mixedBit(this.negativeMixers, c, this.negative, negative, ofSign) ? -1 : 1;
    let e = 0;
    while (e < 24) {
      const k = Math.min(e, 11);
      const exponent = [
        ((12 * c + level) * 3 + size) * 12 + k,
        ((4 * c + Math.min(level, 3)) * 7 + steep) * 12 + k,
      ];
      this.ofCoefficient[31] = k;
      const above = this.estimated ? estimate(EXPONENT, this.ofCoefficient) : 0;
      if (!stream.mixedBit(this.exponentMixers, 12 * c + k, this.exponent, exponent, above)) break;
      e++;
    }
    let value = 1;
    if (e >= 1) {
      value = 2 * value + stream.bit(this.mantissa, 3 * e);
      if (e >= 2) {
        value = 2 * value + stream.bit(this.mantissa, 3 * e + (value & 1 ? 2 : 1));
        value = value * 2 ** (e - 2) + stream.bypass(e - 2);
      }
    }
    return sign * Math.min(value, MAX_COEFFICIENT);
  }

  /** Means of the children of p from their predictions and coefficients. */
  transform(j, p, parentMeans, means) {
    const { first: children } = this.levels[j + 1];
    const { changed, coefficients, pairs, value, octants, channels: C } = this;
    for (let c = 0; c < C; c++) {
      const step = this.step(c, j);
      value[pairs.first[pairs.n - 1]] = parentMeans[C * p + c] - this.mean[c];
      for (let i = pairs.n - 1; i >= 0; i--) {
        const scaled = Math.min(Math.max(coefficients[C * i + c] * step, -(2 ** 41)), 2 ** 41);
        const part = (factor) => {
          const product = Math.min(Math.max(scaled * factor, -(2 ** 51)), 2 ** 51);
          return Math.floor((product + 2 ** 18) / 2 ** 19);
        };
        const mean = value[pairs.first[i]];
        value[pairs.first[i]] = mean - part(pairs.F[i]);
        value[pairs.second[i]] = mean + part(pairs.G[i]);
      }
      octants.forEach((o, at) => {
        means[C * (children[p] + at) + c] = bounded(changed[C * at + c] + value[o]);
      });
    }
  }
}
