// Section 2 of docs/format.md: the range coder and its adaptive models.
//
// 64-bit integers are two doubles, the upper 48 bits and the lower 16: all products and quotients below stay exact.
// `offset` is point - lower of the format.

import { fail } from "./bytes.js";

const TWO_16 = 65536;
const TWO_24 = 16777216;
const TWO_32 = 4294967296;

/** Adaptive bits (2.3), each a probability and a number of updates. */
export class Bits {
  constructor(size, memory = 255) {
    this.one = new Uint32Array(size).fill(0x80000000);
    this.updates = new Uint16Array(size);
    this.memory = memory;
  }
}

/** `count` adaptive unsigned integers (2.4): per model 32 bits of exponents and 32 x 3 of mantissas. */
export class Unsigned {
  constructor(count = 1) {
    this.bits = new Bits(128 * count);
  }
}

/** `count` adaptive signed integers (2.5). */
export class Signed {
  constructor(count = 1) {
    this.nonzero = new Bits(count);
    this.negative = new Bits(count);
    this.magnitude = new Unsigned(count);
  }
}

/** `count` adaptive symbols of one size (2.6). */
export class Symbols {
  constructor(size, count = 1) {
    this.size = size;
    this.depth = size > 1 ? 32 - Math.clz32(size - 1) : 0;
    this.bits = new Bits(count << this.depth);
  }
}

/** Rates of adaptation by the number of updates. */
const RATES = Float64Array.from({ length: 1025 }, (_, n) => Math.floor(TWO_24 / (n + 2)));

/** Adaptive bit number `i` of `model` after it coded `bit` (2.3). */
function adapt(model, i, bit) {
  const one = model.one[i];
  const updates = model.updates[i];
  const rate = RATES[updates];
  if (updates < model.memory) model.updates[i] = updates + 1;
  const difference = bit ? 4294967295 - one : -one;
  if (updates < 8) {
    // The product has more than 53 bits.
    const upper = Math.floor(difference / TWO_16);
    const lower = (difference - upper * TWO_16) * rate;
    model.one[i] = one + Math.floor((upper * rate + Math.floor(lower / TWO_16)) / 256);
  } else {
    model.one[i] = one + Math.floor((difference * rate) / TWO_24);
  }
}

/** `L(i)` of 2.8. */
const COSTS = Int32Array.from({ length: 4097 }, (_, i) => Math.round(2048 * (12 - Math.log2(i || 1))));

/** `T(k)` of 2.8. */
const PROBABILITIES = Int32Array.from({ length: 386 }, (_, k) =>
  Math.round(65536 / (1 + 2 ** (-Math.min(k, 384) / 32))),
);

/** Log-odds of adaptive bit number `i` of `model` (2.8). */
function logOdds(model, i) {
  const w = Math.min(Math.max(model.one[i] >>> 16, 16), 65520);
  const z = (TWO_16 - w + 8) >> 4;
  return COSTS[z] - COSTS[4096 - z];
}

/** The probability of log-odds, in units of 2^-16 (2.8). */
function probability(sum) {
  const size = Math.min(Math.abs(sum), 12 * 2048);
  const k = size >> 6;
  const P = PROBABILITIES[k] + (((PROBABILITIES[k + 1] - PROBABILITIES[k]) * (size & 63)) >> 6);
  return sum < 0 ? TWO_16 - P : P;
}

/** `count` sets of weights of some adaptive bits (2.8), each at first `weight`, and of log-odds that are given beside them. */
export class Mixers {
  constructor(count, bits = 2, weight = 32768, given = 0) {
    this.bits = bits;
    this.weights = new Float64Array(bits * count).fill(weight);
    this.given = new Float64Array(count).fill(given);
    this.odds = new Float64Array(bits);
    this.mixed = new Bits(1);
  }
}

/** A stream of symbols (2.1). */
export class Stream {
  constructor(bytes, section) {
    this.bytes = bytes;
    this.section = section;
    this.next = 8;
    this.rangeHigh = 2 ** 48 - 1;
    this.rangeLow = TWO_16 - 1;
    this.offsetHigh = this.word(0) * TWO_16 + Math.floor(this.word(4) / TWO_16);
    this.offsetLow = this.word(4) % TWO_16;
  }

  get length() {
    return this.bytes.length;
  }

  /** Four bytes at `at`, the highest first; zeros follow the stream. */
  word(at) {
    const b = this.bytes;
    if (at + 4 <= b.length) {
      return ((b[at] << 24) | (b[at + 1] << 16) | (b[at + 2] << 8) | b[at + 3]) >>> 0;
    }
    let value = 0;
    for (let i = 0; i < 4; i++) value = value * 256 + (at + i < b.length ? b[at + i] : 0);
    return value;
  }

  /** Takes the part that begins at `high`, `low` and is `width` shares of `scale` wide. */
  take(high, low, scale, width) {
    this.offsetHigh -= high;
    this.offsetLow -= low;
    if (this.offsetLow < 0) {
      this.offsetLow += TWO_16;
      this.offsetHigh -= 1;
    }
    // The product scale * width in both parts.
    const top = Math.floor(scale / TWO_24);
    const rest = (scale - top * TWO_24) * width;
    const carried = Math.floor(rest / TWO_16);
    this.rangeHigh = top * width * 256 + carried;
    if (this.rangeHigh < TWO_16) {
      const rangeLow = rest - carried * TWO_16;
      if (this.next >= this.bytes.length - (this.bytes.length % 4) + 8) {
        fail(this.section, "the stream ends before its symbols do");
      }
      const word = this.word(this.next);
      this.next += 4;
      this.rangeHigh = this.rangeHigh * TWO_32 + rangeLow * TWO_16;
      this.offsetHigh =
        (this.offsetHigh * TWO_16 + this.offsetLow) * TWO_16 + Math.floor(word / TWO_16);
      this.offsetLow = word % TWO_16;
    }
  }

  /** One adaptive bit (2.3): model number `i` of `model`. */
  bit(model, i) {
    const one = model.one[i];
    let w = one >>> 16;
    if (w < 16) w = 16;
    else if (w > 65520) w = 65520;
    const scale = this.rangeHigh;
    if (this.offsetHigh >= scale) fail(this.section, "no symbol has this code");
    const zero = TWO_16 - w;
    // The product scale * zero, where the part of 1 begins.
    const top = Math.floor(scale / TWO_24);
    const rest = (scale - top * TWO_24) * zero;
    const carried = Math.floor(rest / TWO_16);
    const high = top * zero * 256 + carried;
    const low = rest - carried * TWO_16;
    const isOne = this.offsetHigh > high || (this.offsetHigh === high && this.offsetLow >= low);
    if (isOne) this.take(high, low, scale, w);
    else this.take(0, 0, scale, zero);
    const bit = isOne ? 1 : 0;
    adapt(model, i, bit);
    return bit;
  }

  /** Bits number `at[k]` of `models[k]` at once, with the weights of `mixers` number `m`, and log-odds that are given (2.8). */
  mixedBit(mixers, m, models, at, given = 0) {
    const { weights, odds, mixed, bits } = mixers;
    let sum = mixers.given[m] * given;
    for (let k = 0; k < bits; k++) {
      odds[k] = logOdds(models[k], at[k]);
      sum += weights[bits * m + k] * odds[k];
    }
    const P = probability(Math.floor(sum / TWO_16));
    mixed.one[0] = P * TWO_16;
    const bit = this.bit(mixed, 0);
    const error = bit * TWO_16 - P;
    const moved = (weight, odds) =>
      Math.min(Math.max(weight + Math.floor((error * odds + 131072) / 262144), -524288), 524288);
    mixers.given[m] = moved(mixers.given[m], given);
    for (let k = 0; k < bits; k++) {
      weights[bits * m + k] = moved(weights[bits * m + k], odds[k]);
      adapt(models[k], at[k], bit);
    }
    return bit;
  }

  /** `m` bits at one bit each, at most 16 (2.2). */
  piece(m) {
    const scale = this.rangeHigh;
    if (this.offsetHigh >= scale) fail(this.section, "no symbol has this code");
    const width = 2 ** (16 - m);
    let x = Math.floor((this.offsetHigh * TWO_16 + this.offsetLow) / scale / width);
    // The quotient of rounded numbers may be one off.
    for (; ; x += this.before(scale, x * width) ? -1 : 1) {
      if (!this.before(scale, x * width) && this.before(scale, (x + 1) * width)) break;
    }
    const top = Math.floor(scale / TWO_24);
    const rest = (scale - top * TWO_24) * x * width;
    const carried = Math.floor(rest / TWO_16);
    this.take(top * x * width * 256 + carried, rest - carried * TWO_16, scale, width);
    return x;
  }

  /** True when the offset is below `share` times `scale`. */
  before(scale, share) {
    const top = Math.floor(scale / TWO_24);
    const rest = (scale - top * TWO_24) * share;
    const carried = Math.floor(rest / TWO_16);
    const high = top * share * 256 + carried;
    if (this.offsetHigh !== high) return this.offsetHigh < high;
    return this.offsetLow < rest - carried * TWO_16;
  }

  /** `n` bits at one bit each (2.2). */
  bypass(n) {
    let value = 0;
    for (; n > 0; n -= 16) {
      const m = Math.min(n, 16);
      value = value * 2 ** m + this.piece(m);
    }
    return value;
  }

  /** An unsigned integer (2.4): model number `i`. */
  unsigned(model, i = 0) {
    const bits = model.bits;
    const first = 128 * i;
    let e = 0;
    while (e < 32 && this.bit(bits, first + e)) e++;
    if (e === 32) return TWO_32 - 1;
    if (e === 0) return 0;
    const mantissa = first + 32 + 3 * e;
    let m = this.bit(bits, mantissa);
    if (e >= 2) {
      m = 2 * m + this.bit(bits, mantissa + 1 + m);
      if (e > 2) m = m * 2 ** (e - 2) + this.bypass(e - 2);
    }
    return 2 ** e + m - 1;
  }

  /** A signed integer (2.5): model number `i`. */
  signed(model, i = 0) {
    if (!this.bit(model.nonzero, i)) return 0;
    const negative = this.bit(model.negative, i);
    const magnitude = this.unsigned(model.magnitude, i) + 1;
    if (magnitude > 2 ** 31 - (negative ? 0 : 1)) fail(this.section, "an integer beyond 32 bits");
    return negative ? -magnitude : magnitude;
  }

  /** A symbol (2.6): model number `i`. */
  symbol(model, i = 0) {
    const first = i << model.depth;
    let prefix = 0;
    for (let below = model.depth - 1; below >= 0; below--) {
      let bit = 0;
      if ((2 * prefix + 1) * 2 ** below < model.size) {
        bit = this.bit(model.bits, first + (2 ** (model.depth - 1 - below) | prefix));
      }
      prefix = 2 * prefix + bit;
    }
    return prefix;
  }

  /** A signed integer added to `from`, within `low .. high`. */
  from(from, low, high, model, i = 0) {
    const value = from + this.signed(model, i);
    if (!(value >= low && value <= high)) fail(this.section, `${value} is not within ${low} .. ${high}`);
    return value;
  }

  /** All bytes must have been read. */
  end() {
    if (this.next < this.bytes.length) {
      fail(this.section, `${this.bytes.length - this.next} bytes too many at its end`);
    }
  }
}

/**
 * Cells of an octree of three axes in Morton order, as x, y, z; children share models by height, number and
 * occupied ones before (`contexts` heights have models of their own). At most `most` cells.
 */
export function readOctree(stream, height, contexts, most, visit) {
  const bits = new Bits(contexts * 64);
  let count = 0;
  const node = (h, x, y, z) => {
    if (h === 0) {
      if (++count > most) fail(stream.section, `more than ${most} occupied cells`);
      visit(x, y, z);
      return;
    }
    const context = 64 * (Math.min(h, contexts) - 1);
    let k = 0;
    for (let c = 0; c < 8; c++) {
      const certain = c === 7 && k === 0;
      if (certain || stream.bit(bits, context + 8 * c + k)) {
        k++;
        node(h - 1, 2 * x + (c & 1), 2 * y + ((c >> 1) & 1), 2 * z + (c >> 2));
      }
    }
  };
  node(height, 0, 0, 0);
  return count;
}
