// Section 4 of docs/format.md: sparse-coded surface patches on several levels.

import { Fields, checkCount, fail, mostBits } from "./bytes.js";
import {
  ATTRIBUTES, HIERARCHY, SHARED_DICTIONARY, expectFeatures, expectOwnVocabulary, expectSections,
} from "./container.js";
import { Bits, Signed, Stream, Symbols, Unsigned, readOctree } from "./entropy.js";
import { PointList, byte, cross, round, unitOfCode } from "./geometry.js";
import { middleText } from "./lengths.js";
import { withIntensities } from "./planes.js";

const fround = Math.fround;
const MAX_POSITION = 2 ** 28;
const NORMAL_BITS = 7;
const MAX_CODE = 64;

function readMeta(bytes, features) {
  const fields = new Fields(bytes, "META");
  const meta = { origin: fields.vector(), nPoints: fields.varint() };
  const count = fields.varint(16, "a number of levels");
  meta.levels = Array.from({ length: count }, () => {
    const level = { pixel: fields.positive(), n: fields.varint(32, "pixels per side") };
    if (level.n < 2) fail("META", `${level.n} pixels per side`);
    const names = ["position", "depthMean", "depthCode", "colorMean", "colorCode"];
    level.steps = Object.fromEntries(names.map((name) => [name, fields.positive()]));
    level.m = fields.varint();
    level.depthEntries = fields.varint(65536, "a number of entries");
    level.colorEntries = fields.varint(65537, "a number of entries") - 1;
    level.g = 0;
    return level;
  });
  meta.kind = features & HIERARCHY ? fields.varint(7, "a kind of dictionaries") : 0;
  if (features & HIERARCHY) {
    for (const level of meta.levels) {
      level.g = fields.varint(7, "mask pixels");
      const pixels = level.m * (level.n << level.g) ** 2;
      if (fields.varint() !== pixels) fail("META", "a number of mask pixels contradicts the patches");
    }
  }
  meta.limits = features & ATTRIBUTES ? [fields.f64(), fields.f64()] : null;
  if (meta.limits && meta.limits[0] > meta.limits[1]) fail("META", "limits of intensities");
  fields.end();
  return meta;
}

/** Positions and normals of the patches of a level (4.2). */
function readPoses(stream, level) {
  const poses = { positions: new Int32Array(3 * level.m), normals: new Int8Array(2 * level.m) };
  if (level.m === 0) return poses;
  const side = Math.min(Math.max(round((level.pixel * level.n) / level.steps.position), 1), 4096);
  const corner = new Signed();
  const limit = Math.floor(MAX_POSITION / side) + 2;
  const low = [0, 1, 2].map(() => stream.from(0, -limit, limit, corner));
  const height = stream.bypass(6);
  if (height > 30) fail("POSE", `an octree of height ${height}`);
  const cells = [];
  readOctree(stream, height, 3, level.m, (...cell) => cells.push(cell));
  const models = { count: new Unsigned(), offset: new Symbols(side, 3), normal: new Signed(2) };
  const position = [0, 0, 0];
  const code = [0, 0];
  let i = 0;
  for (const cell of cells) {
    const count = stream.unsigned(models.count) + 1;
    if (count > level.m - i) fail("POSE", `more than ${level.m} patches`);
    for (let k = 0; k < count; k++, i++) {
      for (let a = 0; a < 3; a++) {
        const before = ((position[a] % side) + side) % side;
        const offset = (before + stream.symbol(models.offset, a)) % side;
        position[a] = (low[a] + cell[a]) * side + offset;
        if (Math.abs(position[a]) > MAX_POSITION) fail("POSE", "a position is out of range");
        poses.positions[3 * i + a] = position[a];
      }
      for (let a = 0; a < 2; a++) {
        code[a] = stream.from(code[a], -63, 63, models.normal, a);
        poses.normals[2 * i + a] = code[a];
      }
    }
  }
  if (i !== level.m) fail("POSE", `${i} patches, not ${level.m}`);
  return poses;
}

/** Mask pixels of the patches of a level (4.3). */
function readMasks(stream, { m, n, g }) {
  const side = n << g;
  checkCount("MASK", "mask pixels", m * side * side, 2 ** 28);
  const masks = new Uint8Array(m * side * side);
  const full = new Bits(1);
  const pixels = new Bits(256, 1023);
  const any = new Bits(9);
  const all = new Bits(9);
  const blocks = new Uint8Array(n * n);
  for (let i = 0; i < m; i++) {
    const mask = masks.subarray(i * side * side, (i + 1) * side * side);
    if (stream.bit(full, 0)) {
      mask.fill(1);
      continue;
    }
    blocks.fill(1);
    if (g > 0) readBlocks(stream, blocks, n, any, all);
    const at = (row, column) => (row >= 0 && column >= 0 && column < side ? mask[row * side + column] : 0);
    for (let row = 0; row < side; row++) {
      for (let column = 0; column < side; column++) {
        const block = blocks[(row >> g) * n + (column >> g)];
        if (block !== 1) {
          mask[row * side + column] = block >> 1;
          continue;
        }
        const context =
          ((column === 0 ? 1 : 0) << 7) | ((row === 0 ? 1 : 0) << 6) | (at(row, column - 1) << 5) |
          (at(row - 1, column) << 4) | (at(row - 1, column - 1) << 3) | (at(row - 1, column + 1) << 2) |
          (at(row, column - 2) << 1) | at(row - 2, column);
        mask[row * side + column] = stream.bit(pixels, context);
      }
    }
  }
  return masks;
}

/** 0 where a pixel has no set mask pixel, 2 where all are set, else 1. */
function readBlocks(stream, blocks, n, any, all) {
  for (let p = 0; p < n * n; p++) {
    const left = p % n > 0 ? blocks[p - 1] : 0;
    const above = p >= n ? blocks[p - n] : 0;
    const k = 3 * left + above;
    blocks[p] = stream.bit(any, k) ? 1 + stream.bit(all, k) : 0;
  }
}

/** Entries of a dictionary at unit length (4.4). */
function readDictionary(stream, entries, planes, n, isWide) {
  checkCount("DICT", "values of a dictionary", entries * planes * n * n);
  const models = new Signed(25);
  const area = n * n;
  const [limit, e] = isWide ? [32768, 8] : [128, 0];
  const atoms = new Float32Array(entries * planes * area);
  const values = new Int32Array(planes * area);
  for (let entry = 0; entry < entries; entry++) {
    let squared = 0;
    for (let p = 0; p < planes * area; p++) {
      const left = p % n > 0 ? values[p - 1] : 0;
      const above = p % area >= n ? values[p - n] : 0;
      const context = Math.min(Math.max((left + above) >> e, -12), 12) + 12;
      values[p] = stream.from(0, -limit, limit - 1, models, context);
      squared += values[p] * values[p];
    }
    if (squared === 0) fail("DICT", `entry ${entry} has zeros only`);
    const length = Math.sqrt(squared);
    for (let p = 0; p < planes * area; p++) atoms[entry * planes * area + p] = values[p] / length;
  }
  return atoms;
}

/** Means and codes of a channel of a level (4.5). */
function readChannel(stream, m, entries, planes) {
  const models = {
    mean: new Signed(planes), count: new Unsigned(4),
    atom: new Symbols(Math.max(entries, 1)), coefficient: new Signed(4),
  };
  const means = new Int32Array(planes * m);
  const codes = [];
  let size = 0;
  for (let i = 0; i < m; i++) {
    for (let p = 0; p < planes; p++) {
      const before = i > 0 ? means[planes * (i - 1) + p] : 0;
      means[planes * i + p] = before + stream.signed(models.mean, p);
    }
    size = stream.unsigned(models.count, Math.min(size, 3));
    if (size > Math.min(MAX_CODE, entries)) fail(stream.section, `a code of ${size} entries`);
    const code = [];
    for (let k = 0; k < size; k++) {
      const entry = stream.symbol(models.atom);
      code.push([entry, stream.signed(models.coefficient, Math.min(size - 1, 3))]);
    }
    codes.push(code);
  }
  return { means, codes };
}

/** Reads a model of `learn_hscsm`. */
export function readHscsm({ features, sections }) {
  expectFeatures(features, SHARED_DICTIONARY | ATTRIBUTES | HIERARCHY);
  if (features & SHARED_DICTIONARY) expectOwnVocabulary(features, sections.get("DREF") ?? [], "dictionary");
  expectSections(sections, ["META", "POSE", "MASK", "DICT", "DPTH", "COLR"]);
  const meta = readMeta(sections.get("META"), features);
  const patches = meta.levels.reduce((sum, level) => sum + level.m, 0);
  for (const tag of ["POSE", "MASK", "DPTH"]) {
    checkCount("META", "patches", patches, mostBits(sections.get(tag)));
  }
  const [poses, masks, dictionaries, depths, colors] = ["POSE", "MASK", "DICT", "DPTH", "COLR"].map(
    (tag) => new Stream(sections.get(tag), tag));
  const planes = meta.kind & 4 ? 1 : 3;
  const levels = meta.levels.map((level) => ({ ...level, ...readPoses(poses, level) }));
  for (const level of levels) level.masks = readMasks(masks, level);
  readDictionaries(dictionaries, levels, meta.kind, planes);
  for (const level of levels) level.depth = readChannel(depths, level.m, level.depthEntries, 1);
  for (const level of levels) {
    level.planes = planes;
    if (level.colorEntries >= 0) level.color = readChannel(colors, level.m, level.colorEntries, planes);
  }
  for (const stream of [poses, masks, dictionaries, depths, colors]) stream.end();
  const hasColor = levels.length > 0 && levels.every((level) => level.color);
  if (levels.some((level) => level.color) && !hasColor) fail("META", "some levels have colour, others none");
  if (meta.limits && !hasColor) fail("META", "intensities without their images");
  return { method: "hscsm", meta, levels, hasColor };
}

function readDictionaries(stream, levels, kind, planes) {
  const isCommon = (kind & 1) !== 0;
  levels.forEach((level, l) => {
    const [first] = levels;
    if (isCommon && l > 0) {
      for (const key of ["n", "depthEntries", "colorEntries"]) {
        if (level[key] !== first[key]) fail("META", "levels with one dictionary differ");
      }
      level.depthAtoms = first.depthAtoms;
      level.colorAtoms = first.colorAtoms;
      return;
    }
    level.depthAtoms = readDictionary(stream, level.depthEntries, 1, level.n, (kind & 2) !== 0);
    if (level.colorEntries >= 0) {
      level.colorAtoms = readDictionary(stream, level.colorEntries, planes, level.n, (kind & 2) !== 0);
    }
  });
}

/** Centre and axes of patch i of a level (4.2). */
function frameOf(level, i) {
  const step = fround(level.steps.position);
  const center = [0, 1, 2].map((a) => fround(level.positions[3 * i + a] * step));
  const z = unitOfCode([level.normals[2 * i], level.normals[2 * i + 1]], NORMAL_BITS);
  let nearest = 0;
  for (const a of [1, 2]) if (Math.abs(z[a]) > Math.abs(z[nearest])) nearest = a;
  const first = nearest === 0 ? 1 : 0;
  const along = [0, 0, 0].map((_, a) => (a === first ? 1 : 0) - z[first] * z[a]);
  const length = Math.hypot(...along);
  const x = along.map((c) => c / length);
  return { center, x, y: cross(z, x), z };
}

const maskPixel = (level) => level.pixel / 2 ** level.g;

/** How a level is sampled: points per mask pixel, or cells per patch where the spacing is coarser. */
function sampling(level, resolution) {
  const pixel = maskPixel(level);
  if (resolution <= pixel * (1 + 1e-9)) {
    return { perPixel: Math.max(1, Math.ceil(pixel / resolution - 1e-9)), perPatch: 0 };
  }
  const size = level.pixel * level.n;
  return { perPixel: 0, perPatch: Math.max(1, Math.ceil(size / resolution - 1e-9)) };
}

function mostPoints({ levels }, resolution) {
  let most = 0;
  for (const level of levels) {
    const { perPixel } = sampling(level, resolution);
    const each = Math.max(perPixel, 1);
    level.nSet ??= level.masks.reduce((sum, m) => sum + m, 0);
    most += level.nSet * each * each;
  }
  return most;
}

/** Decodes the patches of one level into `points`. */
class LevelDecoder {
  constructor(level, limits, resolution, points, firstPart) {
    Object.assign(this, { level, limits, points, firstPart });
    this.sampling = sampling(level, resolution);
  }

  /** Depth and colour at the pixels of patch i (4.6). */
  images(i) {
    const { level } = this;
    const area = level.n * level.n;
    const depth = new Float32Array(area).fill(level.depth.means[i] * level.steps.depthMean);
    this.addCode(depth, level.depth.codes[i], level.depthAtoms, level.steps.depthCode);
    const side = level.n << level.g;
    const mask = level.masks.subarray(i * side * side, (i + 1) * side * side);
    const set = new Uint8Array(area);
    mask.forEach((m, p) => {
      if (m) set[(Math.floor(p / side) >> level.g) * level.n + ((p % side) >> level.g)] = 1;
    });
    return { depth, color: level.color ? this.colorImage(i, area) : null, set, mask };
  }

  colorImage(i, area) {
    const { level } = this;
    const { planes } = level;
    const means = Array.from({ length: planes }, (_, p) => fround(level.color.means[planes * i + p] * level.steps.colorMean));
    let values = means;
    if (planes === 3) {
      const t = means[0] - means[2] / 2;
      const blue = t - means[1] / 2;
      values = [blue + means[1], means[2] + t, blue];
    }
    const color = new Float32Array(planes * area);
    values.forEach((value, p) => color.fill(value, p * area, (p + 1) * area));
    this.addCode(color, level.color.codes[i], level.colorAtoms, level.steps.colorCode);
    return color;
  }

  addCode(image, code, atoms, step) {
    for (const [entry, coefficient] of code) {
      const lambda = fround(coefficient * step);
      const first = entry * image.length;
      for (let p = 0; p < image.length; p++) image[p] += fround(lambda * atoms[first + p]);
    }
  }

  addPatch(i) {
    const { level } = this;
    const images = this.images(i);
    const frame = frameOf(level, i);
    const scale = 1 << level.g;
    const side = level.n * scale;
    // Pixel coordinates of mask coordinates.
    const ofMask = (at) => (at + 0.5) / scale - 0.5;
    const { perPixel: m, perPatch } = this.sampling;
    if (m > 0) {
      const at = (whole, part) => ofMask(whole + (part + 0.5) / m - 0.5);
      images.mask.forEach((isSet, p) => {
        if (!isSet) return;
        const [row, column] = [Math.floor(p / side), p % side];
        for (let sub = 0; sub < m * m; sub++) {
          this.emit(i, images, frame, at(column, sub % m), at(row, Math.floor(sub / m)));
        }
      });
      return;
    }
    // One point per coarse cell that has a set pixel, at the mean of its set pixels.
    const cellOf = (c) => Math.min(Math.floor((c * perPatch) / side), perPatch - 1);
    const sums = new Float64Array(3 * perPatch * perPatch);
    images.mask.forEach((isSet, p) => {
      if (!isSet) return;
      const [row, column] = [Math.floor(p / side), p % side];
      const cell = 3 * (cellOf(row) * perPatch + cellOf(column));
      sums[cell] += column;
      sums[cell + 1] += row;
      sums[cell + 2] += 1;
    });
    for (let cell = 0; cell < sums.length; cell += 3) {
      const count = sums[cell + 2];
      if (count > 0) this.emit(i, images, frame, ofMask(sums[cell] / count), ofMask(sums[cell + 1] / count));
    }
  }

  /** One point at pixel coordinates (0 is the centre of the first pixel). */
  emit(i, images, frame, x, y) {
    const { level } = this;
    const { n, pixel } = level;
    const corners = around(images.set, n, x, y);
    const depth = corners.mean(images.depth, 0);
    const [X, Y] = [(x - (n - 1) / 2) * pixel, (y - (n - 1) / 2) * pixel];
    const k = this.points.add();
    const c = this.points.columns;
    for (let a = 0; a < 3; a++) {
      c.positions[3 * k + a] = frame.center[a] + X * frame.x[a] + Y * frame.y[a] + depth * frame.z[a];
    }
    c.parts[k] = this.firstPart + i;
    if (images.color) {
      const last = images.color.length / (n * n) - 1;
      const rgb = [0, 1, 2].map((p) => corners.mean(images.color, Math.min(p, last) * n * n));
      if (this.limits) c.intensities[k] = this.intensityOf(rgb);
      else c.colors.set(rgb.map((value) => byte(fround(value))), 3 * k);
    }
    if (c.normals) c.normals.set(this.normalOf(images, frame, corners.low), 3 * k);
  }

  intensityOf([r, g, b]) {
    const [low, high] = this.limits;
    const grey = Math.min(Math.max((r + g + b) / 3, 0), 255);
    return fround(Math.min(Math.max(low + ((high - low) * grey) / 255, low), high));
  }

  normalOf({ set, depth }, frame, [x, y]) {
    const { n, pixel } = this.level;
    const difference = (p, q) => (set[p] && set[q] ? depth[q] - depth[p] : null);
    const mean = (pairs) => {
      const known = pairs.filter((d) => d !== null);
      return known.reduce((sum, d) => sum + d, 0) / Math.max(known.length, 1);
    };
    const p = y * n + x;
    const slope = [
      mean([difference(p, p + 1), difference(p + n, p + n + 1)]),
      mean([difference(p, p + n), difference(p + 1, p + n + 1)]),
    ];
    const length = Math.hypot(slope[0], slope[1], pixel);
    return [0, 1, 2].map((a) => (pixel * frame.z[a] - slope[0] * frame.x[a] - slope[1] * frame.y[a]) / length);
  }
}

/** The set pixels about a position and their bilinear weights, scaled to sum to one. */
function around(set, n, x, y) {
  const clamped = [x, y].map((c) => Math.min(Math.max(c, 0), n - 1));
  const low = clamped.map((c) => Math.min(Math.floor(c), n - 2));
  const [fx, fy] = [clamped[0] - low[0], clamped[1] - low[1]];
  const pixels = [];
  let weights = [];
  let total = 0;
  for (let k = 0; k < 4; k++) {
    const [dx, dy] = [k & 1, k >> 1];
    const pixel = (low[1] + dy) * n + low[0] + dx;
    const weight = set[pixel] ? (dx ? fx : 1 - fx) * (dy ? fy : 1 - fy) : 0;
    pixels.push(pixel);
    weights.push(weight);
    total += weight;
  }
  if (total > 0) {
    weights = weights.map((w) => w / total);
  } else {
    // Only a mean over a coarse cell can fall between pixels that are not set: the nearest set one.
    let best = Infinity;
    set.forEach((isSet, p) => {
      const squared = ((p % n) - x) ** 2 + (Math.floor(p / n) - y) ** 2;
      if (isSet && squared < best) [best, pixels[0]] = [squared, p];
    });
    weights = [1, 0, 0, 0];
  }
  const mean = (image, first) => {
    let sum = 0;
    for (let k = 0; k < 4; k++) sum += weights[k] * image[first + pixels[k]];
    return sum;
  };
  return { low, mean };
}

function decodeHscsm({ meta, levels, hasColor }, { resolution, normals, maxPoints }) {
  const types = { positions: [Float32Array, 3], parts: [Uint32Array, 1] };
  if (normals) types.normals = [Float32Array, 3];
  if (meta.limits) types.intensities = [Float64Array, 1];
  else if (hasColor) types.colors = [Uint8Array, 3];
  const points = new PointList(types, maxPoints);
  let first = 0;
  for (const level of levels) {
    const decoder = new LevelDecoder(level, meta.limits, resolution, points, first);
    for (let i = 0; i < level.m; i++) decoder.addPatch(i);
    first += level.m;
  }
  return withIntensities(points.finish());
}

function describe({ levels }, part, unit) {
  let i = part;
  for (const [l, level] of levels.entries()) {
    if (i < level.m) {
      const entries = level.depth.codes[i].map(([entry]) => entry);
      return {
        "level": `${l} (side ${middleText(level.n * level.pixel, unit)})`,
        "depth entries": entries.length > 0 ? entries.join(", ") : "none: flat",
      };
    }
    i -= level.m;
  }
  return {};
}

export const hscsmMethod = {
  part: "patch",
  keepsThickness: false,
  spacing: ({ levels }) => (levels.length > 0 ? 0.5 * Math.min(...levels.map(maskPixel)) : 1),
  parts: ({ levels }) => levels.reduce((sum, level) => sum + level.m, 0),
  mostPoints,
  decode: decodeHscsm,
  describe,
};
