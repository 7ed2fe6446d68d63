// Section 6 of docs/format.md: local scans as words, chosen by BIC.

import { Fields, checkCount, fail, mostBits } from "./bytes.js";
import {
  BIC_ALPHABET, SHARED_DICTIONARY, expectFeatures, expectOwnVocabulary, expectSections,
} from "./container.js";
import { Bits, Signed, Stream, Symbols, Unsigned, readOctree } from "./entropy.js";
import { PointList, unitOfCode, uprightFrame } from "./geometry.js";
import { middleText } from "./lengths.js";

const fround = Math.fround;
const NORMAL_BITS = 8;
const VIEW_DIRECTION = 2;
const MASK_64 = (1n << 64n) - 1n;

function readMeta(bytes) {
  const fields = new Fields(bytes, "META");
  const meta = { nPoints: fields.varint(), origin: fields.vector() };
  const limited = (what, low) => {
    const value = fields.f64();
    if (!(value >= low && value < 1e6)) fail("META", `${what} of ${value} m`);
    return value;
  };
  meta.radius = limited("a radius", 1e-6);
  meta.pixels = fields.varint(32, "pixels per side");
  if (meta.pixels < 2) fail("META", `${meta.pixels} pixels per side`);
  meta.upright = fields.varint(2, "an upright rule");
  meta.nWords = fields.varint(65536, "a number of words");
  meta.epsilon = limited("epsilon", 1e-9);
  meta.low = [0, 1, 2].map(() => fields.signed(2 ** 20, "the lowest cell"));
  meta.nOccurrences = fields.varint();
  fields.end();
  return meta;
}

/** Points of the words, in steps; descriptors are read for what follows them (6.2). */
function readWords(bytes, { nWords, pixels }) {
  const stream = new Stream(bytes, "WORD");
  checkCount("META", "words", nWords, mostBits(bytes));
  const models = {
    count: new Unsigned(), point: new Signed(3), empty: new Bits(2), height: new Signed(),
  };
  const words = [];
  for (let w = 0; w < nWords; w++) {
    const count = stream.unsigned(models.count) + 1;
    if (count > 65536) fail("WORD", `a word of ${count} points`);
    const points = [];
    let before = [0, 0, 0];
    for (let i = 0; i < count; i++) {
      before = before.map((c, a) => stream.from(c, -128, 127, models.point, a));
      points.push(before);
    }
    readDescriptor(stream, models, pixels);
    words.push(points);
  }
  stream.end();
  return words;
}

function readDescriptor(stream, models, n) {
  let afterEmpty = 0;
  let height = 0;
  for (let j = 0; j < n; j++) {
    for (let i = 0; i < n; i++) {
      // Twice n times the centre, in integers.
      const [x, y] = [2 * i + 1 - n, 2 * j + 1 - n];
      if (x * x + y * y > n * n) continue;
      afterEmpty = stream.bit(models.empty, afterEmpty);
      if (!afterEmpty) height = stream.from(height, -127, 127, models.height);
    }
  }
}

/** Poses and words of all occurrences (6.3). */
function readOccurrences(bytes, meta) {
  const found = [];
  if (meta.nOccurrences === 0) {
    if (bytes.length > 0) fail("POSE", "poses of no occurrences");
    return found;
  }
  if (meta.nWords === 0) fail("META", "occurrences without words");
  const stream = new Stream(bytes, "POSE");
  const height = stream.bypass(5);
  if (height > 21) fail("POSE", `an octree of height ${height}`);
  const cells = [];
  readOctree(stream, height, 4, meta.nOccurrences, (...cell) => cells.push(cell));
  const models = {
    count: new Unsigned(), word: new Symbols(meta.nWords), normal: new Signed(2),
    roll: new Symbols(256), position: new Symbols(32, 6),
  };
  let [normal, roll, position] = [[0, 0], 0, [0, 0, 0]];
  for (const cell of cells) {
    const count = stream.unsigned(models.count) + 1;
    if (count > meta.nOccurrences - found.length) fail("POSE", `more than ${meta.nOccurrences} occurrences`);
    for (let i = 0; i < count; i++) {
      const word = stream.symbol(models.word);
      normal = normal.map((c, a) => stream.from(c, -127, 127, models.normal, a));
      if (meta.upright === VIEW_DIRECTION) roll = (roll + stream.symbol(models.roll)) % 256;
      const main = mainAxis(normal);
      position = position.map((c, a) =>
        (((c % 32) + 32) % 32 + stream.symbol(models.position, 2 * a + (a === main ? 1 : 0))) % 32);
      const at = position.map((c, a) => 32 * (meta.low[a] + cell[a]) + c);
      found.push({ word, normal, roll, position: at });
    }
  }
  stream.end();
  if (found.length !== meta.nOccurrences) fail("POSE", `${found.length} occurrences, not ${meta.nOccurrences}`);
  return found;
}

/** The axis that a normal is nearest to, by its code. */
function mainAxis([u, v]) {
  const [x, y] = [Math.abs(u), Math.abs(v)];
  const w = Math.abs(127 - x - y);
  if (w >= x && w >= y) return 2;
  return x >= y ? 0 : 1;
}

/** Reads a model of `learn_bic_alphabet`. */
export function readBicAlphabet({ features, sections }) {
  expectFeatures(features, BIC_ALPHABET | SHARED_DICTIONARY);
  if (features & SHARED_DICTIONARY) expectOwnVocabulary(features, sections.get("WREF") ?? [], "alphabet");
  expectSections(sections, ["META", "WORD", "POSE"]);
  const meta = readMeta(sections.get("META"));
  checkCount("META", "occurrences", meta.nOccurrences, mostBits(sections.get("POSE")));
  const words = readWords(sections.get("WORD"), meta);
  return { method: "bic_alphabet", meta, words, occurrences: readOccurrences(sections.get("POSE"), meta) };
}

/** Position and axes of an occurrence in single precision (6.4). */
function frameOf({ radius, upright }, { normal, roll, position }) {
  const step = radius / 32;
  const other = upright === 1 ? [0, 0, 1] : [1, 0, 0];
  const [right, up, n] = uprightFrame(unitOfCode(normal, NORMAL_BITS), other);
  const angle = (2 * Math.PI * roll) / 256;
  const [sine, cosine] = [Math.sin(angle), Math.cos(angle)];
  const turn = (a, b, s) => a.map((c, i) => fround(cosine * c + s * b[i]));
  return {
    origin: position.map((c) => fround(c * step)),
    rows: [turn(right, up, -sine), turn(up, right, sine), n.map(fround)],
  };
}

function mix(value) {
  let z = (value + 0x9e3779b97f4a7c15n) & MASK_64;
  z = ((z ^ (z >> 30n)) * 0xbf58476d1ce4e5b9n) & MASK_64;
  z = ((z ^ (z >> 27n)) * 0x94d049bb133111ebn) & MASK_64;
  return z ^ (z >> 31n);
}

/** The lower goes first where occurrences are thinned. */
function precedence({ position, normal, roll }) {
  let h = 0n;
  for (const v of [...position, ...normal, roll]) h = mix(h ^ BigInt.asUintN(64, BigInt(v)));
  return h;
}

/** Points of a word in metres, from the middle outwards. */
function stampOf(word, radius) {
  const squared = (p) => p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
  const order = word.map((_, k) => k).sort((a, b) => squared(word[a]) - squared(word[b]) || a - b);
  return order.map((k) => word[k].map((c) => fround(c * (radius / 64))));
}

/** Kept points by cells of about epsilon: is there one nearer than that? */
class KeptPoints {
  constructor(epsilon) {
    this.limit = fround(fround(epsilon) * fround(epsilon));
    // A little more, for rounding.
    this.side = 1.001 * epsilon;
    this.cells = new Map();
  }

  /** Cells that share a key only bring farther points along. */
  key(x, y, z) {
    return Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791);
  }

  isClear(p) {
    const [x, y, z] = p.map((c) => Math.floor(c / this.side));
    for (let n = 0; n < 27; n++) {
      const here = this.cells.get(this.key(x + (n % 3) - 1, y + (Math.floor(n / 3) % 3) - 1, z + Math.floor(n / 9) - 1));
      if (here === undefined) continue;
      for (const q of here) {
        const [dx, dy, dz] = [fround(q[0] - p[0]), fround(q[1] - p[1]), fround(q[2] - p[2])];
        const squared = fround(fround(fround(dx * dx) + fround(dy * dy)) + fround(dz * dz));
        if (squared < this.limit) return false;
      }
    }
    return true;
  }

  add(p) {
    const key = this.key(...p.map((c) => Math.floor(c / this.side)));
    const here = this.cells.get(key);
    if (here === undefined) this.cells.set(key, [p]);
    else here.push(p);
  }
}

function decodeBicAlphabet({ meta, words, occurrences }, { resolution, normals, maxPoints }) {
  const types = { positions: [Float32Array, 3], parts: [Uint32Array, 1] };
  if (normals) types.normals = [Float32Array, 3];
  const points = new PointList(types, maxPoints);
  const stamps = words.map((word) => stampOf(word, meta.radius));
  const order = occurrences.map((occurrence, k) => ({ k, h: precedence(occurrence) }));
  order.sort((a, b) => (a.h < b.h ? -1 : a.h > b.h ? 1 : a.k - b.k));
  const grid = new KeptPoints(resolution);
  const kept = occurrences.map(() => []);
  const frames = occurrences.map((occurrence) => frameOf(meta, occurrence));
  for (const { k } of order) {
    const { origin, rows } = frames[k];
    for (const q of stamps[occurrences[k].word]) {
      const p = origin.map((o, a) => {
        const sum = fround(fround(rows[0][a] * q[0]) + fround(rows[1][a] * q[1]));
        return fround(o + fround(sum + fround(rows[2][a] * q[2])));
      });
      if (!grid.isClear(p)) continue;
      grid.add(p);
      kept[k].push(p);
    }
  }
  kept.forEach((list, k) => {
    for (const p of list) {
      const i = points.add();
      points.columns.positions.set(p, 3 * i);
      points.columns.parts[i] = k;
      if (normals) points.columns.normals.set(frames[k].rows[2], 3 * i);
    }
  });
  return { colors: null, attributes: [], ...points.finish() };
}

function describe({ words, occurrences, meta }, number, unit) {
  const { word } = occurrences[number];
  const times = occurrences.reduce((sum, other) => sum + (other.word === word ? 1 : 0), 0);
  return {
    "word": `${word} of ${words.length}`,
    "points of the word": words[word].length,
    "radius": middleText(meta.radius, unit),
    "occurs": `${times} times`,
  };
}

function sameAs({ occurrences }, number) {
  const { word } = occurrences[number];
  return occurrences.flatMap((other, i) => (other.word === word ? [i] : []));
}

export const bicAlphabetMethod = {
  part: "occurrence",
  keepsThickness: false,
  spacing: ({ meta }) => meta.epsilon,
  parts: ({ occurrences }) => occurrences.length,
  mostPoints: ({ words, occurrences }) => occurrences.reduce((sum, { word }) => sum + words[word].length, 0),
  decode: decodeBicAlphabet,
  describe,
  sameAs,
};
