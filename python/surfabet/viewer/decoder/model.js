// Opens a file with the reader of its kind.

import { ALPHABET, BIC_ALPHABET, GAS, LATTICE, PATCHES, PLANES, TILES, openContainer } from "./container.js";
import { alphabetMethod, readAlphabet } from "./alphabet.js";
import { bicAlphabetMethod, readBicAlphabet } from "./bic_alphabet.js";
import { gasMethod, readGas } from "./gas.js";
import { hscsmMethod, readHscsm } from "./hscsm.js";
import { unitIn } from "./lengths.js";
import { patchesMethod, readPatches } from "./patches.js";
import { planesMethod, readPlanes } from "./planes.js";
import { readTiles, tilesMethod } from "./tiles.js";

function readerOf({ family, features }) {
  if (family === PATCHES && features & TILES) return [readTiles, tilesMethod];
  if (family === PATCHES) return features & LATTICE ? [readPatches, patchesMethod] : [readHscsm, hscsmMethod];
  if (family === ALPHABET) {
    return features & BIC_ALPHABET ? [readBicAlphabet, bicAlphabetMethod] : [readAlphabet, alphabetMethod];
  }
  return family === PLANES ? [readPlanes, planesMethod] : [readGas, gasMethod];
}

/** A model in memory; it decodes to points at any spacing. */
export class Model {
  constructor(content, method, note) {
    this.content = content;
    this.method = method;
    this.note = note;
  }

  /** Name of the method, as in `surfabet compress --model NAME`. */
  get name() {
    return this.content.method;
  }

  /** The unit of lengths, which the note names where it is not the metre. */
  get unit() {
    return unitIn(this.note);
  }

  /** World position that points are about, metres. */
  get origin() {
    return this.content.meta.origin;
  }

  /** Points of the cloud that was described. */
  get nPoints() {
    return this.content.meta.nPoints;
  }

  /** What the model is made of, for people: patch, plane, neuron, word. */
  get part() {
    return this.method.part;
  }

  get nParts() {
    return this.method.parts(this.content);
  }

  get keepsThickness() {
    return this.method.keepsThickness;
  }

  /** The spacing that the model was made for, metres. */
  get spacing() {
    return this.method.spacing(this.content);
  }

  /** Most points at a spacing. */
  mostPoints(resolution, asMeasured = false) {
    return this.method.mostPoints(this.content, resolution, asMeasured);
  }

  /**
   * The model as points: positions (about the origin), parts, colors or null, attributes, and normals if wanted.
   * Without a resolution at the spacing that the model was made for, as surfabet's own decode.
   */
  decode({ resolution = null, asMeasured = false, normals = false, maxPoints = 20e6 } = {}) {
    if (resolution !== null && !(resolution > 0 && Number.isFinite(resolution))) {
      throw new RangeError(`a spacing of ${resolution} m: it must be positive`);
    }
    if (asMeasured && !this.keepsThickness) {
      throw new RangeError("this kind of model does not keep how thick the scan was");
    }
    const most = this.mostPoints(resolution ?? this.spacing, asMeasured);
    if (most > 4 * maxPoints) {
      throw new RangeError(`up to ${most} points at a spacing of ${resolution ?? this.spacing} m, more than ${maxPoints}`);
    }
    const isOwn = resolution === null;
    return this.method.decode(this.content, {
      resolution: resolution ?? this.spacing, isOwn, asMeasured, normals, maxPoints,
    });
  }

  /** False while attributes of a model that was opened as geometry only are still to be read. */
  get isComplete() {
    return this.content.complete === undefined;
  }

  /** Reads what `openModel` with `isGeometryOnly` left aside. */
  complete() {
    this.content.complete?.();
    this.content.complete = undefined;
  }

  /** Lines that show the model's structure: outlines of planes, edges of a gas; null where there are none. */
  lines() {
    return this.method.lines?.(this.content) ?? null;
  }

  /** What is known of a part, as names and values. */
  describe(part) {
    return this.method.describe?.(this.content, part, this.unit) ?? {};
  }

  /** Numbers of the parts that are the same word as one of them; null where there are no words. */
  sameAs(part) {
    return this.method.sameAs?.(this.content, part) ?? null;
  }
}

/** The model in the bytes of an .sfb file; with `isGeometryOnly`, attributes may be left for `model.complete()`. */
export function openModel(bytes, { isGeometryOnly = false } = {}) {
  const container = openContainer(bytes);
  const [read, method] = readerOf(container);
  const model = new Model(read(container), method, container.note);
  if (!isGeometryOnly) model.complete();
  return model;
}
