// Section 5.4 of docs/format.md: colours and scalars without feature bit 11.

import { Bits, Signed } from "./entropy.js";
import { SlotPairs, interpolated, pyramid } from "./pyramid.js";

/** Reads means of cells, channel after channel within each cell (5.4); `steps[channel]` are whole steps. */
export class OlderFieldReader {
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

  /** Reads on; the stream need not end here. */
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
    return means;
  }

  /** Predictions of all cells of level j from the means of the level above. */
  predictions(j, means) {
    const share = this.beside ? 0.26 : 0.32;
    const weights = Float64Array.from({ length: 8 }, (_, k) =>
      [0, 1, 2].reduce((product, a) => product * ((k >> a) & 1 ? share : 1 - share), 1));
    const { levels, channels } = this;
    return interpolated(levels[j], levels[j + 1], weights, means, channels, (sum, total) => sum / total);
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

/** Pairs with their shares. */
class HaarPairs extends SlotPairs {
  constructor() {
    super();
    this.A = new Float64Array(7);
    this.B = new Float64Array(7);
  }

  meet(a, b) {
    const { weight, n } = this;
    const sum = weight[a] + weight[b];
    this.A[n] = Math.sqrt(weight[a] / sum);
    this.B[n] = Math.sqrt(weight[b] / sum);
  }
}
