// Section 8 of docs/format.md: words of an alphabet and their occurrences.

import { Fields, checkCount, fail, mostBits } from "./bytes.js";
import { colorOfCode } from "./codes.js";
import {
  ALPHABET, SHARED_DICTIONARY, expectFeatures, expectOwnVocabulary, expectSections,
} from "./container.js";
import { Bits, Signed, Stream, Symbols, Unsigned } from "./entropy.js";
import { PointList, byte, dot, round, uprightFrame } from "./geometry.js";
import { middleText } from "./lengths.js";
import { withIntensities } from "./planes.js";

const UNITS = 256;
const MAX_SLOPE = 255;
const MAX_OFFSET = 2 ** 20;
const MAX_TREE = 24;
const MAX_PER_CELL = 128;
const MAX_PREDICTIONS = 6;
const PIXELS = 8;

function readMeta(bytes) {
  const fields = new Fields(bytes, "META");
  const meta = { radius: fields.positive() };
  meta.scales = fields.varint(8, "a number of scales");
  if (meta.scales < 1) fail("META", "no scales");
  meta.nWords = fields.varint(4096, "a number of words");
  if (meta.nWords < 1) fail("META", "no words: the plane counts as one");
  meta.nPoints = fields.varint();
  meta.nOccurrences = fields.varint();
  meta.origin = fields.vector();
  meta.spacing = fields.f32();
  if (!(meta.spacing >= 0.25 && meta.spacing <= 4)) fail("META", `a spacing of ${meta.spacing} sigma`);
  for (let i = 0; i < 3; i++) fields.f32();
  meta.perRange = fields.big();
  meta.constant = fields.big();
  const sensors = fields.varint(65535, "a number of sensors");
  meta.sensors = Array.from({ length: sensors }, () =>
    [0, 1, 2].map(() => fields.signed(2 ** 41, "the place of a sensor")));
  meta.colorStep = fields.varint(255, "a colour step");
  const hasIntensity = fields.u8();
  if (hasIntensity > 1) fail("META", `${hasIntensity} where 0 or 1 belongs`);
  meta.intensities = hasIntensity ? [fields.f32(), fields.f32()] : null;
  fields.end();
  return meta;
}

const bigMin = (a, b) => (a < b ? a : b);

/** Level of sigma at a point, seen from a sensor (8.1). */
function sigmaLevel(meta, point, sensor) {
  let squared = 0n;
  if (sensor) {
    for (let a = 0; a < 3; a++) squared += BigInt(point[a] - sensor[a]) ** 2n;
  }
  const grown = (bigMin(squared, 1n << 83n) * bigMin(meta.perRange, 1n << 44n)) >> 40n;
  const sum = bigMin(grown + meta.constant, 1n << 62n);
  return sum < 1n ? 0 : sum.toString(2).length - 1;
}

/** Sigma of a level, rounded down to whole units. */
const wholeSigma = (level) => Math.floor(Math.sqrt(2 ** level));
const offsetStep = (level) => Math.max(1, Math.floor(wholeSigma(level) / 2));

/** Steps of a normal from an axis to the diagonal. */
function slopeSteps(scale, level) {
  const w = wholeSigma(level);
  const steps = Math.floor((UNITS * 2 ** scale * 100 + Math.floor((70 * w) / 2)) / (70 * w));
  return Math.min(Math.max(steps, 1), MAX_SLOPE);
}

function cellMiddle(cell, scale) {
  const side = UNITS * 2 ** scale;
  return cell.map((c) => c * side + side / 2);
}

/** Length of an integer vector times 2^8, rounded down. */
const length8 = (v) => Math.floor(Math.sqrt(65536 * dot(v, v)));

function exact(value) {
  if (!Number.isSafeInteger(value)) fail("OCCR", "a plane so far away that its numbers are not exact");
  return value;
}

/** The integer normal of an occurrence. */
function normalOf({ scale, axis, slopes }, level) {
  const normal = [0, 0, 0];
  normal[axis] = slopeSteps(scale, level);
  normal[(axis + 1) % 3] = slopes[0];
  normal[(axis + 2) % 3] = slopes[1];
  return normal;
}

/** Items of the occurrences coded so far, by coarsest cell. */
class CoarseCells {
  constructor(scales) {
    this.scales = scales;
    this.items = new Map();
  }

  coarsest(cell, scale) {
    const side = 2 ** (this.scales - 1 - scale);
    return cell.map((c) => Math.floor(c / side));
  }

  insert(cell, scale, item) {
    const key = this.coarsest(cell, scale).join();
    const here = this.items.get(key);
    if (here === undefined) this.items.set(key, [item]);
    else here.push(item);
  }

  /** Those in the cell and in the 26 around it, of each cell the last 128. */
  around(cell, scale) {
    const [x, y, z] = this.coarsest(cell, scale);
    const found = [];
    for (let n = 0; n < 27; n++) {
      const key = `${x + (n % 3) - 1},${y + (Math.floor(n / 3) % 3) - 1},${z + Math.floor(n / 9) - 1}`;
      const here = this.items.get(key);
      if (here === undefined) continue;
      for (let i = Math.max(0, here.length - MAX_PER_CELL); i < here.length; i++) found.push(here[i]);
    }
    return found;
  }
}

/** Order of occurrences: scale, cell, axis, slopes, offset, word, sensor. */
function comparePlacements(a, b) {
  const key = (p) => [p.scale, ...p.cell, p.axis, ...p.slopes, p.offset, p.word, p.view];
  const [p, q] = [key(a), key(b)];
  for (let i = 0; i < p.length; i++) if (p[i] !== q[i]) return p[i] - q[i];
  return 0;
}

/** Planes of the occurrences so far, and which of them go on in a cell. */
class PlanePredictor {
  constructor(scales) {
    this.planes = new CoarseCells(scales);
  }

  insert(placement, level) {
    const normal = normalOf(placement, level);
    const middle = cellMiddle(placement.cell, placement.scale);
    const alongNormal = exact(placement.offset * offsetStep(level));
    const constant = exact(exact(dot(normal, middle) * 256) + exact(alongNormal * length8(normal)));
    this.planes.insert(placement.cell, placement.scale, {
      placement, normal, constant, middle, length: length8(normal),
    });
  }

  /** The planes suggested for a cell, at most six, each with its slopes there. */
  suggest(cell, scale, level) {
    const middle = cellMiddle(cell, scale);
    const side = UNITS * 2 ** scale;
    const near = [];
    for (const plane of this.planes.around(cell, scale)) {
      const off = plane.constant - exact(dot(plane.normal, middle) * 256);
      if (Math.abs(off) <= plane.length * side) {
        const apart = plane.middle.map((c, a) => c - middle[a]);
        near.push({ apart: dot(apart, apart), plane });
      }
    }
    near.sort((a, b) => a.apart - b.apart || comparePlacements(a.plane.placement, b.plane.placement));
    const found = [];
    for (const { plane } of near) {
      const slopes = suggestedSlopes(plane, scale, level);
      const { axis } = plane.placement;
      const offset = suggestedOffset(plane, { scale, cell, axis, slopes }, level);
      const isNew = found.every((f) =>
        f.axis !== axis || f.slopes[0] !== slopes[0] || f.slopes[1] !== slopes[1] || f.offset !== offset);
      if (isNew) found.push({ plane, axis, slopes, offset });
      if (found.length === MAX_PREDICTIONS) break;
    }
    return found;
  }
}

function suggestedSlopes({ placement: { axis }, normal }, scale, level) {
  const n = slopeSteps(scale, level);
  return [1, 2].map((k) =>
    Math.floor((2 * normal[(axis + k) % 3] * n + normal[axis]) / (2 * normal[axis])));
}

/** Offset of a plane along the normal of an occurrence whose axis and slopes are known, in its steps. */
function suggestedOffset(plane, placement, level) {
  const v = normalOf(placement, level);
  const middle = cellMiddle(placement.cell, placement.scale);
  const rest = plane.constant - exact(dot(plane.normal, middle) * 256);
  const p = BigInt(rest) * BigInt(length8(v));
  const q = BigInt(dot(plane.normal, v) * offsetStep(level)) * 65536n;
  if (q === 0n) return 0;
  const [over, under] = q > 0n ? [2n * p + q, 2n * q] : [-2n * p - q, -2n * q];
  const floored = over >= 0n ? over / under : -((-over + under - 1n) / under);
  const limit = BigInt(MAX_OFFSET);
  return Number(floored > limit ? limit : floored < -limit ? -limit : floored);
}

/** Reads the stream OCCR (8.3). */
class OccurrenceReader {
  constructor(bytes, meta) {
    const { scales, sensors, nWords } = meta;
    this.meta = meta;
    this.stream = new Stream(bytes, "OCCR");
    this.predictor = new PlanePredictor(scales);
    this.coded = [];
    this.models = {
      count: new Unsigned(8), children: new Bits(8), octree: new Bits(64 * scales),
      sameView: new Bits(1), view: new Symbols(Math.max(sensors.length, 1)),
      suggestion: Array.from({ length: MAX_PREDICTIONS + 1 }, (_, m) => new Symbols(m + 1)),
      axis: new Symbols(3), slope: new Signed(2), offset: new Signed(),
      slopeChange: new Signed(2), offsetChange: new Signed(2),
      plane: new Bits(8), word: new Symbols(Math.max(nWords - 1, 1)),
    };
  }

  read() {
    const height = this.stream.bypass(5);
    if (height > MAX_TREE) fail("OCCR", `an octree of height ${height}`);
    if (this.meta.nOccurrences > 0) this.node([0, 0, 0], Math.max(height, this.meta.scales - 1));
    this.stream.end();
    if (this.coded.length !== this.meta.nOccurrences) {
      fail("OCCR", `${this.coded.length} occurrences, not ${this.meta.nOccurrences}`);
    }
    return this.coded;
  }

  node(cell, level) {
    const { stream, models } = this;
    const { scales } = this.meta;
    let n = 0;
    if (level < scales) {
      n = stream.unsigned(models.count, level) + (level === 0 ? 1 : 0);
      if (n > this.meta.nOccurrences - this.coded.length) {
        fail("OCCR", `more than ${this.meta.nOccurrences} occurrences`);
      }
    }
    for (let i = 0; i < n; i++) this.occurrence(cell, level);
    if (level === 0) return;
    if (n > 0 && !stream.bit(models.children, level)) return;
    const first = 64 * (Math.min(level, scales) - 1);
    let k = 0;
    for (let c = 0; c < 8; c++) {
      const certain = c === 7 && k === 0;
      if (certain || stream.bit(models.octree, first + 8 * c + k)) {
        k++;
        this.node(cell.map((x, a) => 2 * x + ((c >> a) & 1)), level - 1);
      }
    }
  }

  occurrence(cell, scale) {
    const { stream, models, meta } = this;
    const p = { scale, cell, axis: 0, slopes: [0, 0], offset: 0, word: 0, view: this.readView() };
    p.level = sigmaLevel(meta, cellMiddle(cell, scale), meta.sensors[p.view]);
    const suggested = this.predictor.suggest(cell, scale, p.level);
    const choice = stream.symbol(models.suggestion[suggested.length]);
    if (choice < suggested.length) this.readContinued(p, suggested[choice]);
    else this.readPose(p);
    if (Math.abs(p.offset) > MAX_OFFSET) fail("OCCR", `an offset of ${p.offset} steps`);
    if (meta.nWords > 1 && stream.bit(models.plane, scale)) p.word = 1 + stream.symbol(models.word);
    this.predictor.insert(p, p.level);
    this.coded.push(p);
  }

  readView() {
    const { stream, models, meta } = this;
    if (meta.sensors.length < 2) return 0;
    const last = this.coded.length > 0 ? this.coded[this.coded.length - 1].view : 0;
    return stream.bit(models.sameView, 0) ? last : stream.symbol(models.view);
  }

  readContinued(p, { plane, axis, slopes }) {
    const { stream, models } = this;
    p.axis = axis;
    p.slopes = [0, 1].map((a) => stream.from(slopes[a], -MAX_SLOPE, MAX_SLOPE, models.slopeChange, a));
    const isSame = p.slopes[0] === slopes[0] && p.slopes[1] === slopes[1] ? 1 : 0;
    p.offset = suggestedOffset(plane, p, p.level) + stream.signed(models.offsetChange, isSame);
  }

  readPose(p) {
    const { stream, models } = this;
    p.axis = stream.symbol(models.axis);
    p.slopes = [0, 1].map((a) => stream.from(0, -MAX_SLOPE, MAX_SLOPE, models.slope, a));
    p.offset = stream.signed(models.offset);
  }
}

/** Words as masks and heights; number 0 is the plane (8.2). */
function readWords(bytes, nWords) {
  const stream = new Stream(bytes, "WORD");
  const flat = new Bits(1);
  const pixels = new Bits(16);
  const heights = new Signed(2);
  const words = [{ mask: new Uint8Array(64).fill(1), heights: new Int8Array(64), isFlat: true }];
  for (let w = 1; w < nWords; w++) {
    const word = { mask: new Uint8Array(64), heights: new Int8Array(64), isFlat: stream.bit(flat, 0) === 1 };
    const at = (row, column) => (row >= 0 && column >= 0 && column < PIXELS ? word.mask[PIXELS * row + column] : 0);
    for (let row = 0; row < PIXELS; row++) {
      for (let column = 0; column < PIXELS; column++) {
        const p = PIXELS * row + column;
        const left = at(row, column - 1);
        const below = at(row - 1, column);
        const context = 8 * left + 4 * below + 2 * at(row - 1, column - 1) + at(row - 1, column + 1);
        word.mask[p] = stream.bit(pixels, context);
        if (!word.mask[p] || word.isFlat) continue;
        const count = left + below;
        const sum = (left ? word.heights[p - 1] : 0) + (below ? word.heights[p - PIXELS] : 0);
        const mean = count > 0 ? Math.floor(sum / count) : 0;
        word.heights[p] = stream.from(mean, -16, 16, heights, count > 0 ? 1 : 0);
      }
    }
    word.isFlat = word.heights.every((h) => h === 0);
    words.push(word);
  }
  stream.end();
  return words;
}

/** Channels of all occurrences (8.4). */
function readChannels(bytes, { scales }, placements, channels) {
  const stream = new Stream(bytes, "CHAN");
  const models = new Signed(channels);
  const cells = new CoarseCells(scales);
  const coded = [];
  placements.forEach((p, k) => {
    let nearest = k - 1;
    let least = Infinity;
    const middle = cellMiddle(p.cell, p.scale);
    for (const j of cells.around(p.cell, p.scale)) {
      const off = cellMiddle(placements[j].cell, placements[j].scale).map((c, a) => c - middle[a]);
      const squared = dot(off, off);
      if (squared < least || (squared === least && j < nearest)) [least, nearest] = [squared, j];
    }
    const values = [];
    for (let c = 0; c < channels; c++) {
      const from = nearest >= 0 ? coded[nearest][c] : 0;
      values.push(stream.from(from, -1024, 1024, models, c));
    }
    coded.push(values);
    cells.insert(p.cell, p.scale, k);
  });
  stream.end();
  return coded;
}

/** Reads a model of `learn_alphabet`. */
export function readAlphabet({ family, features, sections }) {
  expectFeatures(features, SHARED_DICTIONARY);
  if (family !== ALPHABET || !sections.has("META")) fail("META", "the section is missing");
  if (features & SHARED_DICTIONARY) expectOwnVocabulary(features, sections.get("WREF") ?? [], "alphabet");
  const meta = readMeta(sections.get("META"));
  const channels = (meta.colorStep > 0 ? 3 : 0) + (meta.intensities ? 1 : 0);
  expectSections(sections, ["META", "WORD", "OCCR", ...(channels > 0 ? ["CHAN"] : [])]);
  checkCount("META", "occurrences", meta.nOccurrences, mostBits(sections.get("OCCR")));
  const words = readWords(sections.get("WORD"), meta.nWords);
  const occurrences = new OccurrenceReader(sections.get("OCCR"), meta).read();
  const values = channels > 0 ? readChannels(sections.get("CHAN"), meta, occurrences, channels) : null;
  return { method: "alphabet", meta, words, occurrences, values };
}

/** Centre, right, up and normal of an occurrence in units (8.5). */
function poseOf(meta, p) {
  const towards = normalOf(p, p.level);
  const length = Math.sqrt(dot(towards, towards));
  const along = towards.map((c) => c / length);
  const offset = p.offset * offsetStep(p.level);
  const center = cellMiddle(p.cell, p.scale).map((c, a) => c + offset * along[a]);
  const sensor = meta.sensors[p.view];
  const isAway = sensor && dot(along, sensor.map((c, a) => c - center[a])) < 0;
  const normal = isAway ? along.map((c) => -c) : along;
  return { center, rows: uprightFrame(normal, [1, 0, 0]), radius: UNITS * 2 ** p.scale };
}

/** Samples per side of an occurrence, at a spacing in metres or at the model's own. */
function samplesOf({ meta }, p, resolution) {
  const side = 2 * UNITS * 2 ** p.scale;
  const spacing = resolution === null ? meta.spacing * 2 ** (p.level / 2) : (resolution * UNITS) / meta.radius;
  return Math.max(1, round(side / spacing));
}

/** Height of a word in radii at a place in radii; null where there is a hole. */
function heightAt({ mask, heights, isFlat }, right, up) {
  const [x, y] = [right, up].map((c) => (c + 1) * (PIXELS / 2) - 0.5);
  const [column, row] = [x, y].map((c) => Math.min(Math.max(round(c), 0), PIXELS - 1));
  if (!mask[PIXELS * row + column]) return null;
  if (isFlat) return 0;
  const [cx, cy] = [x, y].map((c) => Math.min(Math.max(c, 0), PIXELS - 1));
  const [left, below] = [cx, cy].map((c) => Math.min(Math.floor(c), PIXELS - 2));
  let [sum, total] = [0, 0];
  for (let k = 0; k < 4; k++) {
    const p = PIXELS * (below + (k >> 1)) + left + (k & 1);
    if (!mask[p]) continue;
    const w = (k & 1 ? cx - left : 1 - cx + left) * (k >> 1 ? cy - below : 1 - cy + below);
    sum += w * heights[p];
    total += w;
  }
  return sum / total / 32;
}

function decodeAlphabet(model, { resolution, isOwn, normals, maxPoints }) {
  const { meta, words, occurrences, values } = model;
  const types = { positions: [Float32Array, 3], parts: [Uint32Array, 1] };
  if (normals) types.normals = [Float32Array, 3];
  if (meta.colorStep > 0) types.colors = [Uint8Array, 3];
  if (meta.intensities) types.intensities = [Float64Array, 1];
  const points = new PointList(types, maxPoints);
  const unitLength = meta.radius / UNITS;
  occurrences.forEach((p, number) => {
    const { center, rows, radius } = poseOf(meta, p);
    const n = samplesOf(model, p, isOwn ? null : resolution);
    const step = (2 * radius) / n;
    const color = meta.colorStep > 0 ? colorOfCode(values[number], meta.colorStep).map(byte) : null;
    for (let i = 0; i < n * n; i++) {
      const right = ((i % n) + 0.5) * step - radius;
      const up = (Math.floor(i / n) + 0.5) * step - radius;
      const height = heightAt(words[p.word], right / radius, up / radius);
      if (height === null) continue;
      const k = points.add();
      const c = points.columns;
      for (let a = 0; a < 3; a++) {
        const at = center[a] + right * rows[0][a] + up * rows[1][a] + height * radius * rows[2][a];
        c.positions[3 * k + a] = at * unitLength;
      }
      c.parts[k] = number;
      if (c.normals) c.normals.set(rows[2], 3 * k);
      if (c.colors) c.colors.set(color, 3 * k);
      if (c.intensities) {
        const [low, high] = meta.intensities;
        c.intensities[k] = Math.fround(low + (values[number][values[number].length - 1] / 63) * (high - low));
      }
    }
  });
  return withIntensities(points.finish());
}

function mostPoints(model, resolution) {
  return model.occurrences.reduce((sum, p) => sum + samplesOf(model, p, resolution) ** 2, 0);
}

/** The finest spacing that an occurrence has at the model's own. */
function ownSpacing({ meta, occurrences }) {
  const least = occurrences.reduce((level, p) => Math.min(level, p.level), 62);
  return occurrences.length > 0 ? (meta.spacing * 2 ** (least / 2) * meta.radius) / UNITS : meta.radius;
}

function describe({ meta, occurrences, words }, number, unit) {
  const { word, scale } = occurrences[number];
  const times = occurrences.reduce((sum, other) => sum + (other.word === word ? 1 : 0), 0);
  return {
    "word": word === 0 ? "0, the plane" : `${word} of ${words.length - 1}`,
    "radius": middleText(meta.radius * 2 ** scale, unit),
    "occurs": `${times} times`,
  };
}

/** Numbers of the occurrences of the same word. */
function sameAs({ occurrences }, number) {
  const { word } = occurrences[number];
  return occurrences.flatMap((other, i) => (other.word === word ? [i] : []));
}

export const alphabetMethod = {
  part: "occurrence",
  keepsThickness: false,
  spacing: ownSpacing,
  parts: ({ occurrences }) => occurrences.length,
  mostPoints,
  decode: decodeAlphabet,
  describe,
  sameAs,
};
