// Vectors, unit vectors of a code, nearest points, cells by their place.

const fround = Math.fround;

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

export function unit(v) {
  const length = Math.sqrt(dot(v, v));
  return v.map((c) => c / length);
}

/** The axis along which a vector is the smallest, of equal ones the first, as a unit vector. */
export function leastAxis(v) {
  let least = 0;
  for (const a of [1, 2]) if (Math.abs(v[a]) < Math.abs(v[least])) least = a;
  const axis = [0, 0, 0];
  axis[least] = 1;
  return axis;
}

/** The vector of a code of `bits` bits per coordinate, in integers before it is scaled to unit length (section 3). */
export function codeDirection([u, v], bits) {
  const half = 2 ** (bits - 1) - 1;
  const z = half - Math.abs(u) - Math.abs(v);
  if (z >= 0) return [u, v, z];
  const x = half - Math.abs(v);
  const y = half - Math.abs(u);
  return [u < 0 ? -x : x, v < 0 ? -y : y, z];
}

/** The unit vector of a code, rounded to single (section 3). */
export function unitOfCode(code, bits) {
  return unit(codeDirection(code, bits)).map(fround);
}

/** Right, up and normal about a unit normal: up is the part of world z, or near the vertical of `other`. */
export function uprightFrame(normal, other) {
  const projected = (v) => {
    const along = dot(v, normal);
    const rest = v.map((c, a) => c - along * normal[a]);
    const length = Math.sqrt(dot(rest, rest));
    return length > 1e-6 ? rest.map((c) => c / length) : null;
  };
  const wanted = Math.abs(normal[2]) <= 0.9 ? [0, 0, 1] : other;
  const up = projected(wanted) ?? projected([1, 0, 0]) ?? [0, 0, 1];
  return [cross(up, normal), up, normal];
}

/** Where across a depth of this standard deviation the k-th of some points lies that fill it evenly. */
export function across(deviation, k) {
  const turns = (k + 0.5) * 0.618033988749895;
  return Math.sqrt(3) * deviation * (2 * (turns - Math.floor(turns)) - 1);
}

/** The value of a number of steps of a scale (section 3). */
export function scaleValue({ low, high, step }, q) {
  return Math.min(Math.max(low + step * q, low), high);
}

/** A half rounds away from zero, as the format has it. */
export function round(value) {
  return value < 0 ? -Math.floor(0.5 - value) : Math.floor(value + 0.5);
}

/** A value as a byte: rounded and limited. */
export function byte(value) {
  return Math.min(Math.max(Math.floor(value + 0.5), 0), 255);
}

/** Points in a balanced tree: the nearest of all, of equally near ones that with the least number. */
export class KdTree {
  /** `points` has x, y, z of each. */
  constructor(points) {
    this.points = points;
    const n = points.length / 3;
    this.order = Uint32Array.from({ length: n }, (_, i) => i);
    this.build(0, n, 0);
  }

  build(from, to) {
    if (to - from <= 8) return;
    const middle = (from + to) >> 1;
    this.select(from, to, middle, this.widest(from, to));
    this.build(from, middle);
    this.build(middle + 1, to);
  }

  widest(from, to) {
    let best = 0;
    let extent = -1;
    for (let a = 0; a < 3; a++) {
      let low = Infinity;
      let high = -Infinity;
      // A sample tells the widest axis well enough.
      const stride = Math.max(1, (to - from) >> 6);
      for (let i = from; i < to; i += stride) {
        const c = this.points[3 * this.order[i] + a];
        if (c < low) low = c;
        if (c > high) high = c;
      }
      if (high - low > extent) [best, extent] = [a, high - low];
    }
    (this.axes ??= new Uint8Array(this.order.length))[(from + to) >> 1] = best;
    return best;
  }

  /** Puts the entry that belongs at `middle` there, smaller ones before it (quickselect). */
  select(from, to, middle, axis) {
    const { order, points } = this;
    let low = from;
    let high = to - 1;
    while (low < high) {
      const pivot = points[3 * order[(low + high) >> 1] + axis];
      let i = low;
      let j = high;
      while (i <= j) {
        while (points[3 * order[i] + axis] < pivot) i++;
        while (points[3 * order[j] + axis] > pivot) j--;
        if (i <= j) {
          const kept = order[i];
          order[i++] = order[j];
          order[j--] = kept;
        }
      }
      if (middle <= j) high = j;
      else if (middle >= i) low = i;
      else return;
    }
  }

  /** Number of the nearest point, or -1; `this.squared` is its squared distance in single precision. */
  nearest(x, y, z) {
    this.best = -1;
    this.squared = Infinity;
    if (this.order.length > 0) this.search(0, this.order.length, [x, y, z]);
    return this.best;
  }

  offer(entry, [x, y, z]) {
    const p = this.points;
    const i = this.order[entry];
    const dx = fround(p[3 * i] - x);
    const dy = fround(p[3 * i + 1] - y);
    const dz = fround(p[3 * i + 2] - z);
    const squared = fround(fround(fround(dx * dx) + fround(dy * dy)) + fround(dz * dz));
    if (squared < this.squared || (squared === this.squared && i < this.best)) {
      this.squared = squared;
      this.best = i;
    }
  }

  search(from, to, at) {
    if (to - from <= 8) {
      for (let entry = from; entry < to; entry++) this.offer(entry, at);
      return;
    }
    const middle = (from + to) >> 1;
    const axis = this.axes[middle];
    const off = at[axis] - this.points[3 * this.order[middle] + axis];
    if (off < 0) this.search(from, middle, at);
    else this.search(middle + 1, to, at);
    // A little more than the best, for rounding.
    if (off * off > this.squared * 1.00001) return;
    this.offer(middle, at);
    if (off < 0) this.search(middle + 1, to, at);
    else this.search(from, middle, at);
  }
}

/** Numbers of cells by their integer coordinates. */
export class CellIndex {
  /** Typed arrays of coordinates; each cell occurs once. */
  constructor(x, y, z) {
    let size = 16;
    while (size < 2 * x.length) size *= 2;
    this.mask = size - 1;
    // Coordinates and number of a cell stand together: a look-up touches one line of the cache.
    this.slots = new Int32Array(4 * size).fill(-1);
    const { slots, mask } = this;
    for (let i = 0; i < x.length; i++) {
      let slot = this.hash(x[i], y[i], z[i]);
      while (slots[4 * slot + 3] >= 0) slot = (slot + 1) & mask;
      slots[4 * slot] = x[i];
      slots[4 * slot + 1] = y[i];
      slots[4 * slot + 2] = z[i];
      slots[4 * slot + 3] = i;
    }
  }

  hash(x, y, z) {
    let h = Math.imul(x, 0x9e3779b1) ^ Math.imul(y, 0x85ebca77) ^ Math.imul(z, 0xc2b2ae3d);
    h ^= h >>> 15;
    h = Math.imul(h, 0x2c1b3c6d);
    return (h ^ (h >>> 12)) & this.mask;
  }

  /** Number of the cell, or -1. */
  find(x, y, z) {
    const { slots } = this;
    for (let slot = this.hash(x, y, z); ; slot = (slot + 1) & this.mask) {
      const at = 4 * slot;
      const i = slots[at + 3];
      if (i < 0 || (slots[at] === x && slots[at + 1] === y && slots[at + 2] === z)) return i;
    }
  }
}

/** Typed arrays of points that grow as they are made. */
export class PointList {
  /** `limit` is the most points; of `columns`, each is a type and its numbers per point. */
  constructor(columns, limit) {
    this.length = 0;
    this.limit = limit;
    this.room = 1024;
    this.columns = {};
    this.widths = {};
    for (const [name, [Type, width]] of Object.entries(columns)) {
      this.columns[name] = new Type(this.room * width);
      this.widths[name] = width;
    }
  }

  /** The number of a new point, for which there is room in all columns. */
  add() {
    if (this.length === this.room) this.grow();
    return this.length++;
  }

  grow() {
    if (this.room >= this.limit) throw new RangeError(`more than ${this.limit} points`);
    this.room = Math.min(2 * this.room, Math.max(this.limit, 2048));
    for (const [name, old] of Object.entries(this.columns)) {
      const more = new old.constructor(this.room * this.widths[name]);
      more.set(old);
      this.columns[name] = more;
    }
  }

  /** The columns, cut to the number of points. */
  finish() {
    for (const name of Object.keys(this.columns)) {
      this.columns[name] = this.columns[name].slice(0, this.length * this.widths[name]);
    }
    return this.columns;
  }
}
