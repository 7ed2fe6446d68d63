// Section 5 of docs/format.md: patches on a lattice. Header and geometry; cells with their attributes are in field.js,
// points in patch_points.js.

import { Fields, checkCount, fail, mostBits, readScale } from "./bytes.js";
import {
  ATTRIBUTES, BESIDE, ESTIMATES, FORWARD_BOUND, INSTANCES, LATTICE, NEAR_POINTS, POINT_PATTERNS, UNBLENDED, WHOLE_FIELDS, expectFeatures,
  expectSections,
} from "./container.js";
import { Bits, Signed, Stream, Symbols, Unsigned, readOctree } from "./entropy.js";
import { attributeCells, readColors, readLabels, readScalar } from "./field.js";
import { readInstanceCount, readInstances } from "./instances.js";
import { readNearPoints } from "./near_points.js";
import { readPointPatterns } from "./point_patterns.js";
import { decodePatches, mostPatchPoints } from "./patch_points.js";
import { Basis } from "./shapes.js";

const MAX_DEPTH = 2 ** 24;
const MAX_TILE = 2 ** 20;
const MAX_SHEETS = 1024;
const MAX_CANDIDATES = 12;
const DTYPES = ["u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64"];
const RESERVED = [
  "points", "local_points", "origin", "colors", "normals", "ranges", "viewpoints", "viewpoint_index", "crs",
];

/** The fields of 5.1. */
export function readMeta(fields, features) {
  const meta = { nPoints: fields.varint(), origin: fields.vector() };
  meta.quaternion = Array.from({ length: 4 }, () => fields.signed(2 ** 19 + 1, "the quaternion"));
  if (meta.quaternion.reduce((sum, c) => sum + c * c, 0) < 2 ** 36) fail("META", "no rotation");
  meta.pixel = fields.positive();
  meta.levels = fields.varint(4, "a number of levels");
  meta.step = fields.varint(256, "a depth step");
  if (meta.levels < 1 || meta.step < 1) fail("META", "no levels, or a depth step of 0");
  meta.nPatches = fields.varint();
  meta.lumaStep = fields.varint(4096, "a colour step");
  meta.chromaStep = fields.varint(4096, "a colour step");
  if ((meta.lumaStep === 0) !== (meta.chromaStep === 0)) fail("META", "one colour step of two");
  meta.nExtra = fields.varint();
  meta.extraCell = fields.positive();
  meta.maxError = fields.f64();
  if (meta.maxError < 0) fail("META", `a bound of ${meta.maxError} m`);
  if (features & FORWARD_BOUND) meta.maxErrorForward = fields.positive();
  meta.nInstances = features & INSTANCES ? readInstanceCount(fields) : 0;
  meta.attributes = features & ATTRIBUTES ? readAttributeHeaders(fields) : [];
  return meta;
}

function readAttributeHeaders(fields) {
  const count = fields.varint(16, "a number of attributes");
  if (count < 1) fail("META", "no attributes");
  const names = new Set(RESERVED);
  return Array.from({ length: count }, () => {
    const length = fields.varint(255, "the length of a name");
    const bytes = Uint8Array.from({ length }, () => fields.varint(255, "a byte of a name"));
    let name = "";
    try {
      name = new TextDecoder("utf-8", { fatal: true }).decode(bytes);
    } catch {
      fail("META", "an attribute's name is not UTF-8");
    }
    if (length === 0 || names.has(name)) fail("META", `an attribute named "${name}"`);
    names.add(name);
    const dtype = DTYPES[fields.varint(9, "a type")];
    const nLabels = fields.varint(256, "a number of labels");
    if (nLabels === 0) return { name, dtype, scale: readScale(fields) };
    const labels = Array.from({ length: nLabels }, () => fields.signedBig());
    for (let i = 1; i < nLabels; i++) if (labels[i] <= labels[i - 1]) fail("META", "labels do not ascend");
    return { name, dtype, labels };
  });
}

/** Reads the stream GEOM (5.3). */
class GeometryReader {
  constructor(stream, meta) {
    this.stream = stream;
    this.meta = meta;
    this.patches = [];
    this.bases = Array.from({ length: meta.levels }, (_, l) => new Basis(8 << l));
    this.tileWidth = 8 << (meta.levels - 1);
    this.reach = Math.floor(2 ** 19 / meta.step);
    this.lastBase = 0;
    this.lastThickness = 4;
    this.sheet = 0;
    this.models = {
      corner: new Signed(), base: new Signed(), sheets: new Unsigned(), candidate: new Unsigned(),
      tiles: new Bits(48), empty: new Bits(36), full: new Bits(36), split: new Bits(24),
      mask: new Bits(324, 1023), depth: new Signed(12), last: new Symbols(21, 4),
      shape: new Signed(84), lastShape: new Unsigned(4), thickness: new Signed(2),
    };
  }

  read() {
    for (let side = 0; side < 6; side++) if (this.stream.bypass(1)) this.readSide(side);
    this.stream.end();
    if (this.patches.length !== this.meta.nPatches) {
      fail("GEOM", `${this.patches.length} patches, not ${this.meta.nPatches}`);
    }
    return this.patches;
  }

  readSide(side) {
    this.side = side;
    this.blocks = new Map();
    this.finished = new Set();
    const { stream, models } = this;
    const low = [0, 1].map(() => stream.from(0, -MAX_TILE, MAX_TILE, models.corner));
    const height = stream.bypass(5);
    if (height > 21) fail("GEOM", `a quadtree of height ${height}`);
    const node = (h, a, b) => {
      if (h === 0) {
        this.readTile(low[0] + a, low[1] + b);
        return;
      }
      const first = 16 * (Math.min(h, 3) - 1);
      let k = 0;
      for (let c = 0; c < 4; c++) {
        const certain = c === 3 && k === 0;
        if (certain || stream.bit(models.tiles, first + 4 * c + k)) {
          k++;
          node(h - 1, 2 * a + (c & 1), 2 * b + (c >> 1));
        }
      }
    };
    node(height, 0, 0);
  }

  readTile(a, b) {
    if (Math.max(Math.abs(a), Math.abs(b)) > MAX_TILE) fail("GEOM", "a tile is out of range");
    this.tile = [a, b];
    const [u, v] = [a * this.tileWidth, b * this.tileWidth];
    const sheets = this.stream.unsigned(this.models.sheets) + 1;
    if (sheets > MAX_SHEETS) fail("GEOM", `${sheets} sheets over one tile`);
    for (let i = 0; i < sheets; i++) {
      this.sheet++;
      this.base = this.readBase(u, v);
      if (!this.readNode(this.meta.levels - 1, u, v)) fail("GEOM", "a sheet without a patch");
    }
    this.finished.add(this.placeKey(a, b));
  }

  placeKey(a, b) {
    return (a + 2 ** 24) * 2 ** 25 + b + 2 ** 24;
  }

  /** Patches of this side whose square contains a finest pixel, in the order read. */
  patchesAt(u, v) {
    return this.blocks.get(this.placeKey(Math.floor(u / 8), Math.floor(v / 8)));
  }

  depthAt(patch, g, h) {
    return this.bases[patch.level].depth(patch, g - 2 * patch.u, h - 2 * patch.v);
  }

  readBase(u, v) {
    const w = this.tileWidth;
    const found = [];
    for (let m = 4; m < w; m += 8) {
      for (const [x, y] of [[u - 1, v + m], [u + m, v - 1], [u + w, v + m], [u + m, v + w]]) {
        for (const patch of this.patchesAt(x, y) ?? []) {
          const depth = Math.floor(this.depthAt(patch, 2 * x + 1, 2 * y + 1) / 4096);
          const f = Math.min(Math.max(depth, -MAX_DEPTH), MAX_DEPTH);
          const far = found.every((e) => 8192 * Math.abs(f - e) > this.reach);
          if (found.length < MAX_CANDIDATES && far) found.push(f);
        }
      }
    }
    if (found.length > 0) {
      const number = this.stream.unsigned(this.models.candidate);
      if (number > found.length) fail("GEOM", `candidate ${number} of ${found.length}`);
      if (number > 0) return found[number - 1];
    }
    const base = this.lastBase + 4 * this.stream.signed(this.models.base) + 2;
    this.lastBase = Math.min(Math.max(base, -MAX_DEPTH), MAX_DEPTH);
    return this.lastBase;
  }

  holder(u, v) {
    const here = this.patchesAt(u, v);
    if (here === undefined) return undefined;
    let best;
    let least = this.reach + 1;
    for (const patch of here) {
      if (patch.sheet === this.sheet) return patch;
      const off = Math.abs(this.depthAt(patch, 2 * u + 1, 2 * v + 1) - 4096 * this.base);
      if (off < least) [best, least] = [patch, off];
    }
    return best;
  }

  state(u, v) {
    const holder = this.holder(u, v);
    if (holder !== undefined) {
      const pixel = 8 * ((v - holder.v) >> holder.level) + ((u - holder.u) >> holder.level);
      return holder.mask[pixel];
    }
    const a = Math.floor(u / this.tileWidth);
    const b = Math.floor(v / this.tileWidth);
    if (a === this.tile[0] && b === this.tile[1]) return 0;
    return this.finished.has(this.placeKey(a, b)) ? 0 : 2;
  }

  /** Reads a square; true when there is a patch in it. */
  readNode(level, u, v) {
    const { stream, models } = this;
    const w = 8 << level;
    const west = this.state(u - 1, v + w / 2);
    const north = this.state(u + w / 2, v - 1);
    const context = 9 * level + 3 * west + north;
    if (level < this.meta.levels - 1 && stream.bit(models.empty, context)) return false;
    const prediction = this.predict(level, u, v, w);
    if (level > 0) {
      const model = 6 * level + 2 * prediction.neighbours + prediction.finer;
      if (stream.bit(models.split, model)) {
        let any = false;
        for (let c = 0; c < 4; c++) {
          const inside = this.readNode(level - 1, u + (c & 1) * (w / 2), v + (c >> 1) * (w / 2));
          any = any || inside;
        }
        if (!any) fail("GEOM", "a square is split and empty");
        return true;
      }
    }
    this.readPatch(level, u, v, w, context, prediction);
    return true;
  }

  predict(level, u, v, w) {
    const beside = [[u - 1, v + w / 2], [u + w / 2, v - 1], [u + w, v + w / 2], [u + w / 2, v + w]];
    let [depth, thickness, n, finer] = [0, 0, 0, 0];
    for (const [x, y] of beside) {
      const holder = this.holder(x, y);
      if (holder === undefined) continue;
      depth += this.depthAt(holder, 2 * u + w, 2 * v + w);
      thickness += holder.thickness;
      n++;
      if (holder.level < level) finer = 1;
    }
    if (n === 0) return { depth: this.base, thickness: this.lastThickness, neighbours: 0, finer };
    const mean = Math.floor((depth + 2048 * n) / (4096 * n));
    return {
      depth: Math.min(Math.max(mean, -MAX_DEPTH), MAX_DEPTH),
      thickness: Math.floor((2 * thickness + n) / (2 * n)),
      neighbours: Math.min(n, 2),
      finer,
    };
  }

  readMask(level, u, v, w, context) {
    const { stream, models } = this;
    const mask = new Uint8Array(64);
    if (stream.bit(models.full, context)) return mask.fill(1);
    // States with a border: row -1 and column -1 to 8 outside of the square.
    const at = (x) => (x < 0 ? -1 : x > 7 ? w : (x << level) + ((1 << level) >> 1));
    const states = new Uint8Array(90);
    for (let x = -1; x <= 8; x++) states[x + 1] = this.state(u + at(x), v - 1);
    for (let y = 0; y < 8; y++) {
      states[10 * (y + 1)] = this.state(u - 1, v + at(y));
      if (y < 7) states[10 * (y + 1) + 9] = this.state(u + w, v + at(y));
    }
    let any = 0;
    for (let y = 0; y < 8; y++) {
      for (let x = 0; x < 8; x++) {
        const i = 10 * (y + 1) + x + 1;
        const c = 27 * states[i - 1] + 9 * states[i - 10] + 3 * states[i - 11] + states[i - 9];
        const bit = stream.bit(models.mask, 81 * level + c);
        states[i] = bit;
        mask[8 * y + x] = bit;
        any |= bit;
      }
    }
    if (!any) fail("GEOM", "a patch without a pixel");
    return mask;
  }

  readPatch(level, u, v, w, context, prediction) {
    const { stream, models } = this;
    if (this.patches.length >= this.meta.nPatches) fail("GEOM", `more than ${this.meta.nPatches} patches`);
    const mask = this.readMask(level, u, v, w, context);
    const c0 = stream.from(
      prediction.depth, -MAX_DEPTH, MAX_DEPTH, models.depth, 3 * level + prediction.neighbours);
    const last = stream.symbol(models.last, level);
    const coefficients = [c0];
    for (let k = 1; k < last; k++) {
      coefficients.push(stream.from(0, -MAX_DEPTH, MAX_DEPTH, models.shape, 21 * level + k));
    }
    if (last > 0) {
      const size = stream.unsigned(models.lastShape, level) + 1;
      if (size > MAX_DEPTH) fail("GEOM", `a coefficient of ${size} steps`);
      coefficients.push(stream.bypass(1) ? -size : size);
    }
    const model = Math.min(prediction.neighbours, 1);
    const thickness = stream.from(prediction.thickness, 0, 63, models.thickness, model);
    this.lastThickness = thickness;
    const patch = { side: this.side, level, u, v, sheet: this.sheet, mask, coefficients, thickness };
    this.patches.push(patch);
    for (let y = Math.floor(v / 8); y < (v + w) / 8; y++) {
      for (let x = Math.floor(u / 8); x < (u + w) / 8; x++) {
        const key = this.placeKey(x, y);
        const here = this.blocks.get(key);
        if (here === undefined) this.blocks.set(key, [patch]);
        else here.push(patch);
      }
    }
  }
}

/** Points beside the patches, as middles of cells in metres from the lattice's zero (5.5). */
function readExtraPoints(bytes, meta, features) {
  const stream = new Stream(bytes, "PNTS");
  checkCount("PNTS", "points beside the patches", meta.nExtra, mostBits(bytes));
  if (stream.bypass(1) !== 1) fail("PNTS", "its first bit is 0");
  const points = [];
  const add = (...cell) => {
    for (const c of cell) points.push((c - MAX_TILE + 0.5) * meta.extraCell);
  };
  const both = NEAR_POINTS | POINT_PATTERNS;
  if ((features & both) === both) fail("META", "two ways to code points at once");
  if (features & both) {
    const read = features & NEAR_POINTS ? readNearPoints : readPointPatterns;
    const [xs, ys, zs] = read(stream, meta.nExtra);
    xs.forEach((x, i) => add(x, ys[i], zs[i]));
  } else {
    readOctree(stream, 21, 4, meta.nExtra, add);
  }
  stream.end();
  if (points.length !== 3 * meta.nExtra) fail("PNTS", `${points.length / 3} points, not ${meta.nExtra}`);
  return points;
}

/** All features of patches. */
export const FEATURES =
  LATTICE | ATTRIBUTES | UNBLENDED | BESIDE | FORWARD_BOUND | NEAR_POINTS | INSTANCES | WHOLE_FIELDS |
  POINT_PATTERNS | ESTIMATES;

/** Reads a model of `learn_patches`. */
export function readPatches({ features, sections }) {
  expectFeatures(features, FEATURES);
  if (!sections.has("META")) fail("META", "the section is missing");
  const fields = new Fields(sections.get("META"), "META");
  const meta = readMeta(fields, features);
  fields.end();
  expectSections(sections, ["META", ...streamsOf(meta)]);
  return readStreams(meta, features, sections);
}

/** Tags of the streams of a model, in the order of the file. */
export function streamsOf(meta) {
  const colorTags = meta.lumaStep > 0 ? ["COLR"] : [];
  const pointTags = meta.nExtra > 0 ? ["PNTS"] : [];
  const instanceTags = meta.nInstances > 0 ? ["INST"] : [];
  return ["GEOM", ...colorTags, ...pointTags, ...instanceTags, ...attributeTags(meta)];
}

function attributeTags(meta) {
  return meta.attributes.map((_, i) => `AT${String(i).padStart(2, "0")}`);
}

/** A model from its header and the bytes of its streams by tag. */
export function readStreams(meta, features, streams) {
  const geometry = streams.get("GEOM");
  checkCount("META", "patches", meta.nPatches, mostBits(geometry));
  const reader = new GeometryReader(new Stream(geometry, "GEOM"), meta);
  const patches = reader.read();
  const extra = meta.nExtra > 0 ? readExtraPoints(streams.get("PNTS"), meta, features) : [];
  const instances = meta.nInstances > 0 ? readInstances(streams.get("INST"), meta, patches, extra) : [];
  const model = {
    method: "patches", meta, patches, extra, instances,
    bases: reader.bases, unblended: (features & UNBLENDED) !== 0,
    cells: null, colors: null, attributes: [],
  };
  if (meta.lumaStep > 0 || meta.attributes.length > 0) {
    const ways = [BESIDE, WHOLE_FIELDS, ESTIMATES].filter((way) => features & way);
    if (ways.length > 1) fail("META", "two ways to code attributes at once");
    model.complete = () => readAttributes(model, streams, attributeTags(meta), ways[0] ?? 0);
  }
  return model;
}

/** Reads what the cells carry, which takes most of the time of reading. */
function readAttributes(model, sections, tags, coding) {
  const { meta } = model;
  const cells = attributeCells(model);
  if (meta.lumaStep > 0) {
    model.colors = readColors(new Stream(sections.get("COLR"), "COLR"), { meta, cells, border: meta.border }, coding);
  }
  model.attributes = meta.attributes.map((attribute, i) => {
    const stream = new Stream(sections.get(tags[i]), tags[i]);
    const values = attribute.labels
      ? readLabels(stream, cells, attribute.labels.length)
      : readScalar(stream, { cells, border: meta.border }, coding);
    return { ...attribute, values };
  });
  model.cells = cells;
}

/** What the page asks of every kind of model. */
export const patchesMethod = {
  part: "patch",
  keepsThickness: true,
  spacing: (model) => 0.5 * model.meta.pixel,
  parts: (model) => model.patches.length,
  mostPoints: mostPatchPoints,
  decode: decodePatches,
};
