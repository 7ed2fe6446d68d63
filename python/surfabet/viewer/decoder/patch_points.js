// Section 5.6 of docs/format.md: from patches to points, as a surface or as measured.

import { eachPixel } from "./field.js";
import { KdTree, PointList, byte, round, scaleValue } from "./geometry.js";
import { moveBack, moveDirection, movePosition } from "./instances.js";
import { DEGREES, axesOf, shapeSlope, shapeValue } from "./shapes.js";

const fround = Math.fround;
const OFFSET = 2 ** 20;

/** A fragment has at most so many finest pixels, and stands so far off a larger piece (docs/methods/patches.md, 9). */
const LARGEST_FRAGMENT = 16;
const FRAGMENT_GAP = 1.5;
const FRAGMENT_REACH = 10;

/** Samples along a side of a patch; spacing in pixels. */
function samples(width, spacing) {
  return Math.max(1, Math.ceil(width / spacing - 1e-9));
}

function layers(patch, spacing, asMeasured) {
  return asMeasured ? Math.max(1, round((0.5 * patch.thickness) / spacing)) : 1;
}

function pixelsSet(patch) {
  return patch.mask.reduce((sum, m) => sum + m, 0);
}

/** Most points at a spacing in metres. */
export function mostPatchPoints(model, resolution, asMeasured) {
  const spacing = resolution / model.meta.pixel;
  const of = (patch) => {
    const perPixel = Math.ceil(samples(8 << patch.level, spacing) / 8);
    return pixelsSet(patch) * perPixel * perPixel * layers(patch, spacing, asMeasured);
  };
  const own = model.patches.map(of);
  let most = own.reduce((sum, n) => sum + n, model.meta.nExtra);
  for (const { numbers, points } of model.instances) {
    most += numbers.reduce((sum, i) => sum + own[i], points.length);
  }
  return most;
}

/** Calls `visit(x, y, z)` for the middles of the set finest pixels of a patch, in pixels of the lattice. */
function eachMiddle(model, patch, visit) {
  const [d, u, v] = axesOf(patch.side);
  const at = [0, 0, 0];
  eachPixel(model, patch, (column, row, depth) => {
    at[d] = depth / 4;
    at[u] = patch.u + column + 0.5;
    at[v] = patch.v + row + 0.5;
    visit(at[0], at[1], at[2]);
  });
}

/** Middles of the set finest pixels of a patch, x, y, z each. */
function pixelMiddles(model, patch) {
  const points = [];
  eachMiddle(model, patch, (x, y, z) => points.push(x, y, z));
  return points;
}

/** Whether each patch is a fragment, which the thin surface leaves out. */
function fragments(model) {
  const { patches } = model;
  const found = new Uint8Array(patches.length);
  const area = patches.map((patch) => pixelsSet(patch) * 4 ** patch.level);
  const small = patches.map((_, i) => i).filter((i) => area[i] <= LARGEST_FRAGMENT);
  if (small.length === 0 || small.length === patches.length) return found;
  const pixels = small.map((i) => pixelMiddles(model, patches[i]));
  const rootOf = pieces(pixels);
  const pieceArea = new Float64Array(small.length);
  small.forEach((i, k) => (pieceArea[rootOf(k)] += area[i]));
  const isLarge = (i) => area[i] > LARGEST_FRAGMENT;
  const gap = new Float64Array(small.length).fill(Infinity);
  gapsTo(model, isLarge, pixels).forEach((squared, k) => {
    gap[rootOf(k)] = Math.min(gap[rootOf(k)], Math.sqrt(squared));
  });
  small.forEach((i, k) => {
    const root = rootOf(k);
    const isNear = gap[root] >= FRAGMENT_GAP && gap[root] < FRAGMENT_REACH;
    found[i] = pieceArea[root] <= LARGEST_FRAGMENT && isNear ? 1 : 0;
  });
  return found;
}

/** Small patches that touch make one piece: a function that gives the patch that stands for all that one was joined to. */
function pieces(pixels) {
  const joined = pixels.map((_, k) => k);
  const rootOf = (k) => {
    while (joined[k] !== k) k = joined[k];
    return k;
  };
  const places = new Map();
  const key = (x, y, z) => `${x},${y},${z}`;
  pixels.forEach((points, k) => {
    for (let p = 0; p < points.length; p += 3) {
      const [x, y, z] = [0, 1, 2].map((a) => Math.floor(points[p + a]));
      for (let n = 0; n < 27; n++) {
        const beside = key(x + (n % 3) - 1, y + (Math.floor(n / 3) % 3) - 1, z + Math.floor(n / 9) - 1);
        const other = places.get(beside);
        if (other === undefined) continue;
        const [a, b] = [rootOf(k), rootOf(other)];
        joined[Math.max(a, b)] = Math.min(a, b);
      }
      places.set(key(x, y, z), k);
    }
  });
  return rootOf;
}

/** Least squared distance of the pixels of each small patch to those of large ones, where it is below the reach of fragments. */
function gapsTo(model, isLarge, pixels) {
  const side = FRAGMENT_REACH;
  // Each pixel of a small patch stands in its own cell and in those around it. Cells that share a key only bring farther points along.
  const key = (x, y, z) => Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791);
  const cells = new Map();
  pixels.forEach((points, k) => {
    for (let p = 0; p < points.length; p += 3) {
      const [x, y, z] = [0, 1, 2].map((a) => Math.floor(points[p + a] / side));
      for (let n = 0; n < 27; n++) {
        const at = key(x + (n % 3) - 1, y + (Math.floor(n / 3) % 3) - 1, z + Math.floor(n / 9) - 1);
        const here = cells.get(at);
        if (here === undefined) cells.set(at, [k, p]);
        else here.push(k, p);
      }
    }
  });
  const least = new Float64Array(pixels.length).fill(Infinity);
  model.patches.forEach((patch, i) => {
    if (!isLarge(i)) return;
    eachMiddle(model, patch, (x, y, z) => {
      const here = cells.get(key(Math.floor(x / side), Math.floor(y / side), Math.floor(z / side)));
      if (here === undefined) return;
      for (let e = 0; e < here.length; e += 2) {
        const points = pixels[here[e]];
        const p = here[e + 1];
        const dx = points[p] - x;
        const dy = points[p + 1] - y;
        const dz = points[p + 2] - z;
        const squared = dx * dx + dy * dy + dz * dz;
        if (squared < least[here[e]]) least[here[e]] = squared;
      }
    });
  });
  return least;
}

/** Samples along a side of the patches of a level. */
function sampleGrid(width, spacing) {
  const n = samples(width, spacing);
  const grid = { n, at: [], cell: [], values: [], slopes: [] };
  for (let i = 0; i < n; i++) {
    const part = (i + 0.5) / n;
    const x = 2 * part - 1;
    grid.at.push(fround(part * width));
    grid.cell.push(Math.floor(8 * part));
    grid.values.push(Array.from({ length: 6 }, (_, k) => fround(shapeValue(k, x))));
    grid.slopes.push(Array.from({ length: 6 }, (_, k) => fround((shapeSlope(k, x) * 2) / width)));
  }
  return grid;
}

/** Unit normal of a surface of a side whose depth has this slope. */
function normalOf(side, slopeU, slopeV) {
  const [d, u, v] = axesOf(side);
  const facing = side % 2 ? -1 : 1;
  const length = Math.sqrt(1 + slopeU * slopeU + slopeV * slopeV);
  const normal = [0, 0, 0];
  normal[d] = facing / length;
  normal[u] = (-facing * slopeU) / length;
  normal[v] = (-facing * slopeV) / length;
  return normal;
}

/** Rows of the rotation from the lattice to the world. */
export function latticeRows(quaternion) {
  const length = Math.hypot(...quaternion);
  const [w, x, y, z] = quaternion.map((c) => c / length);
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}

/** Points of one model at one spacing. */
class PatchDecoder {
  constructor(model, { resolution, asMeasured, normals, maxPoints }) {
    this.model = model;
    this.spacing = resolution / model.meta.pixel;
    this.asMeasured = asMeasured;
    this.grids = model.bases.map((_, level) => sampleGrid(8 << level, this.spacing));
    this.step = fround(model.meta.step / 16);
    const columns = { positions: [Float32Array, 3], parts: [Uint32Array, 1] };
    if (normals) columns.normals = [Float32Array, 3];
    this.points = new PointList(columns, maxPoints);
    this.withNormals = normals;
    this.moved = [];
    this.sources = null;
  }

  addPatch(patch, number) {
    const grid = this.grids[patch.level];
    const { n } = grid;
    const before = this.points.length;
    for (let row = 0; row < n; row++) {
      for (let column = 0; column < n; column++) {
        if (patch.mask[8 * grid.cell[row] + grid.cell[column]]) this.addSample(patch, number, grid, column, row);
      }
    }
    if (this.points.length === before) {
      // A spacing coarser than the set pixels stepped over them all: the sample nearest to the first one.
      const pixel = patch.mask.indexOf(1);
      const nearest = (p) => Math.min(Math.floor((p * n + Math.floor(n / 2)) / 8), n - 1);
      this.addSample(patch, number, grid, nearest(pixel % 8), nearest(pixel >> 3));
    }
  }

  addSample(patch, number, grid, column, row) {
    const [d, u, v] = axesOf(patch.side);
    const [x, y] = [grid.values[column], grid.values[row]];
    const [dx, dy] = [grid.slopes[column], grid.slopes[row]];
    const { coefficients } = patch;
    let [depth, slopeU, slopeV] = [0, 0, 0];
    for (let k = 0; k < coefficients.length; k++) {
      if (coefficients[k] === 0) continue;
      const [i, j] = DEGREES[k];
      const c = fround(coefficients[k] * this.step);
      depth = fround(depth + fround(fround(c * x[i]) * y[j]));
      if (this.withNormals) {
        slopeU += c * dx[i] * y[j];
        slopeV += c * x[i] * dy[j];
      }
    }
    const count = layers(patch, this.spacing, this.asMeasured);
    const half = patch.thickness / 4;
    for (let layer = 0; layer < count; layer++) {
      const offset = fround(fround((2 * layer + 1) / count) - 1);
      const i = this.points.add();
      const { positions, parts, normals } = this.points.columns;
      positions[3 * i + u] = patch.u + grid.at[column];
      positions[3 * i + v] = patch.v + grid.at[row];
      positions[3 * i + d] = count > 1 ? depth + fround(half * offset) : depth;
      parts[i] = number;
      if (normals) normals.set(normalOf(patch.side, slopeU, slopeV), 3 * i);
    }
  }

  /** Points beside the patches, with the normal of the nearest patch. */
  addExtra(kept) {
    const { meta, extra } = this.model;
    const pixel = fround(meta.pixel);
    const first = this.points.length;
    const add = (p) => {
      const i = this.points.add();
      for (let a = 0; a < 3; a++) this.points.columns.positions[3 * i + a] = fround(extra[p + a]) / pixel;
      this.points.columns.parts[i] = 0xffffffff;
    };
    for (let p = 0; p < extra.length; p += 3) add(p);
    for (const instance of this.model.instances) {
      const from = this.points.length;
      instance.points.forEach((i) => add(3 * i));
      this.moved.push([from, this.points.length, instance]);
    }
    const hasInstances = this.model.instances.length > 0;
    if ((this.withNormals || hasInstances) && extra.length > 0) this.addFromNearest(first, kept);
  }

  /** Normals of the points from `first` on, and where they have their attributes from: both of the nearest patch. */
  addFromNearest(first, kept) {
    const middles = [];
    const places = [];
    const owner = [];
    for (const [patch, instance] of kept) {
      eachMiddle(this.model, patch, (x, y, z) => {
        middles.push(x, y, z);
        const at = [x, y, z];
        if (instance) movePosition(instance, x, y, z, at);
        places.push(...at);
        owner.push([patch, instance]);
      });
    }
    const tree = new KdTree(Float32Array.from(places));
    const { positions, normals } = this.points.columns;
    this.sources = positions.slice(0, 3 * this.points.length);
    for (let i = first; i < this.points.length; i++) {
      const at = positions.subarray(3 * i, 3 * i + 3);
      const nearest = tree.nearest(...at);
      if (nearest < 0) continue;
      const [patch, instance] = owner[nearest];
      if (instance) moveBack(instance, ...at, this.sources.subarray(3 * i, 3 * i + 3));
      if (!normals) continue;
      const [, u, v] = axesOf(patch.side);
      const w = 8 << patch.level;
      const x = (2 * (middles[3 * nearest + u] - patch.u)) / w - 1;
      const y = (2 * (middles[3 * nearest + v] - patch.v)) / w - 1;
      let [slopeU, slopeV] = [0, 0];
      patch.coefficients.forEach((coefficient, k) => {
        const [i0, j0] = DEGREES[k];
        const c = (coefficient * this.step * 2) / w;
        slopeU += c * shapeSlope(i0, x) * shapeValue(j0, y);
        slopeV += c * shapeValue(i0, x) * shapeSlope(j0, y);
      });
      const normal = normalOf(patch.side, slopeU, slopeV);
      if (instance) moveDirection(instance, ...normal, normal);
      normals.set(normal, 3 * i);
    }
  }

  /** Points of an instance, still where they are coded; `leftOut` tells fragments. */
  addInstance(instance, leftOut) {
    const from = this.points.length;
    for (const i of instance.numbers) if (!leftOut?.[i]) this.addPatch(this.model.patches[i], i);
    this.moved.push([from, this.points.length, instance]);
  }

  /** Moves the points of instances to where they stand. */
  moveInstances({ positions, normals }) {
    const at = [0, 0, 0];
    for (const [from, to, instance] of this.moved) {
      for (let i = 3 * from; i < 3 * to; i += 3) {
        movePosition(instance, positions[i], positions[i + 1], positions[i + 2], at);
        positions.set(at, i);
        if (!normals) continue;
        moveDirection(instance, normals[i], normals[i + 1], normals[i + 2], at);
        normals.set(at, i);
      }
    }
  }

  /** From pixels of the lattice to metres about the origin. */
  rotate(columns) {
    // In single precision, as surfabet does.
    const rows = latticeRows(this.model.meta.quaternion).map((row) => row.map(fround));
    const turn = (array, scale) => {
      for (let i = 0; i < array.length; i += 3) {
        const x = fround(array[i] * scale);
        const y = fround(array[i + 1] * scale);
        const z = fround(array[i + 2] * scale);
        for (let a = 0; a < 3; a++) {
          const r = rows[a];
          array[i + a] = fround(fround(fround(r[0] * x) + fround(r[1] * y)) + fround(r[2] * z));
        }
      }
    };
    turn(columns.positions, fround(this.model.meta.pixel));
    if (columns.normals) turn(columns.normals, 1);
  }
}

/** Colours and other attributes of positions in pixels, from the cells around them. */
class Sampler {
  constructor(model) {
    this.model = model;
    this.cells = model.cells;
    this.found = new Int32Array(8);
    this.weights = new Float64Array(8);
    // The cells at the corners of cubes that were looked up last.
    this.cached = new Int32Array(3 * 4096).fill(0x7fffffff);
    this.corners = new Int32Array(8 * 4096);
  }

  /** Fills `found` and `weights`; gives their number. */
  around(x, y, z) {
    if (this.model.unblended) {
      const own = this.cells.index.find(Math.floor(x) + OFFSET, Math.floor(y) + OFFSET, Math.floor(z) + OFFSET);
      return this.single(own, x, y, z);
    }
    const [sx, sy, sz] = [fround(x - 0.5), fround(y - 0.5), fround(z - 0.5)];
    const [lx, ly, lz] = [Math.floor(sx), Math.floor(sy), Math.floor(sz)];
    const [fx, fy, fz] = [sx - lx, sy - ly, sz - lz];
    const first = this.lookUp(lx + OFFSET, ly + OFFSET, lz + OFFSET);
    let [n, total] = [0, 0];
    for (let k = 0; k < 8; k++) {
      const cell = this.corners[first + k];
      if (cell < 0) continue;
      const w = (k & 1 ? fx : 1 - fx) * (k & 2 ? fy : 1 - fy) * (k & 4 ? fz : 1 - fz);
      this.found[n] = cell;
      this.weights[n++] = w;
      total += w;
    }
    if (total <= 1e-6) return this.single(-1, x, y, z);
    for (let k = 0; k < n; k++) this.weights[k] /= total;
    return n;
  }

  lookUp(x, y, z) {
    const slot = (x ^ Math.imul(y, 31) ^ Math.imul(z, 977)) & 4095;
    const { cached, corners } = this;
    if (cached[3 * slot] !== x || cached[3 * slot + 1] !== y || cached[3 * slot + 2] !== z) {
      [cached[3 * slot], cached[3 * slot + 1], cached[3 * slot + 2]] = [x, y, z];
      for (let k = 0; k < 8; k++) {
        corners[8 * slot + k] = this.cells.index.find(x + (k & 1), y + ((k >> 1) & 1), z + (k >> 2));
      }
    }
    return 8 * slot;
  }

  /** One cell alone: the given one, or the nearest of all. */
  single(cell, x, y, z) {
    if (cell < 0) {
      if (this.cells.n === 0) return 0;
      this.tree ??= new KdTree(this.middles());
      cell = this.tree.nearest(x, y, z);
    }
    this.found[0] = cell;
    this.weights[0] = 1;
    return 1;
  }

  middles() {
    const { n, x, y, z } = this.cells;
    const points = new Float32Array(3 * n);
    for (let i = 0; i < n; i++) {
      points[3 * i] = x[i] - OFFSET + 0.5;
      points[3 * i + 1] = y[i] - OFFSET + 0.5;
      points[3 * i + 2] = z[i] - OFFSET + 0.5;
    }
    return points;
  }

  /** All attributes at positions in pixels. */
  sample(positions) {
    const { model, found, weights } = this;
    const count = positions.length / 3;
    const colors = model.colors ? new Uint8Array(3 * count) : null;
    const attributes = model.attributes.map((attribute) => ({
      name: attribute.name,
      labels: attribute.labels?.map(String),
      values: attribute.labels ? new Uint16Array(count) : new Float64Array(count),
    }));
    for (let i = 0; i < count; i++) {
      const n = this.around(positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]);
      if (colors) {
        for (let c = 0; c < 3; c++) {
          let sum = 0;
          for (let k = 0; k < n; k++) sum += weights[k] * model.colors[3 * found[k] + c];
          colors[3 * i + c] = byte(fround(sum));
        }
      }
      model.attributes.forEach((attribute, a) => {
        attributes[a].values[i] = attribute.labels
          ? heaviest(found, weights, n, attribute.values)
          : numberOf(attribute, found, weights, n);
      });
    }
    return { colors, attributes };
  }
}

function heaviest(found, weights, n, values) {
  let best = 0;
  for (let k = 1; k < n; k++) if (weights[k] > weights[best]) best = k;
  return n === 0 ? 0 : values[found[best]];
}

function numberOf({ scale, dtype, values }, found, weights, n) {
  let sum = 0;
  for (let k = 0; k < n; k++) sum += weights[k] * values[found[k]];
  const value = scaleValue(scale, sum);
  return dtype[0] === "f" ? value : round(value);
}

/** The model as points about its origin. */
export function decodePatches(model, options) {
  const decoder = new PatchDecoder(model, options);
  const leftOut = options.asMeasured ? null : (model.fragments ??= fragments(model));
  const kept = [];
  model.patches.forEach((patch, i) => {
    if (leftOut?.[i]) return;
    kept.push([patch, null]);
    decoder.addPatch(patch, i);
  });
  for (const instance of model.instances) {
    for (const i of instance.numbers) if (!leftOut?.[i]) kept.push([model.patches[i], instance]);
    decoder.addInstance(instance, leftOut);
  }
  decoder.addExtra(kept);
  const columns = decoder.points.finish();
  const sources = decoder.sources ?? columns.positions;
  const sampled = model.cells ? new Sampler(model).sample(sources) : { colors: null, attributes: [] };
  decoder.moveInstances(columns);
  decoder.rotate(columns);
  return { ...columns, ...sampled };
}
