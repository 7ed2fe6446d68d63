// Section 5.7 of docs/format.md: patches in tiles. All tiles of the finest level of detail, one after another.

import { Fields, SfbError, crc32c, fail } from "./bytes.js";
import {
  BORDERS, INSTANCES, NEAR_POINTS, POINT_PATTERNS, TILES, expectFeatures, expectSections,
} from "./container.js";
import { FEATURES, patchesMethod, readMeta, readStreams, streamsOf } from "./patches.js";

/** Features of a map in tiles. */
const TILE_FEATURES = (FEATURES & ~INSTANCES) | TILES | BORDERS;

const MAX_LEVELS = 8;
const MAX_SIDE = 2 ** 20;

function readLevels(bytes, features) {
  const fields = new Fields(bytes, "META");
  const count = fields.varint(MAX_LEVELS, "a number of levels of detail");
  if (count < 1) fail("META", "no levels of detail");
  const levels = Array.from({ length: count }, () => readMeta(fields, features));
  const side = fields.varint(MAX_SIDE, "a side of a cube");
  if (side < 1) fail("META", "cubes without a side");
  const corner = Array.from({ length: 3 }, () => fields.varint(side, "a corner of a cube"));
  fields.end();
  return { levels, side, corner };
}

/** Coordinates of the cube at a place of the index. */
function cubeAt(place, low) {
  return low.map((least, a) => {
    let coordinate = 0;
    for (let bit = 0; bit < 21; bit++) coordinate += Number((place >> BigInt(3 * bit + a)) & 1n) * 2 ** bit;
    return coordinate + least;
  });
}

/** Length, checksum and cube of every tile, and the box in it that it decodes to, level by level. */
function readIndex(bytes, levels) {
  const fields = new Fields(bytes, "TIDX");
  const index = levels.map(() => {
    // A tile takes at least 13 bytes here.
    const count = fields.varint(Math.floor(bytes.length / 13), "a number of tiles");
    const low = Array.from({ length: 3 }, () => fields.signed(MAX_SIDE, "a cube"));
    let place = -1n;
    return Array.from({ length: count }, () => {
      place += fields.big() + 1n;
      fields.varint();
      const length = fields.varint();
      const checksum = fields.u32();
      const from = Array.from({ length: 3 }, () => fields.signed(2 ** 31, "a corner of a box"));
      const sides = Array.from({ length: 3 }, () => fields.varint(2 ** 31, "a side of a box"));
      return { length, checksum, cube: cubeAt(place, low), from, sides };
    });
  });
  fields.end();
  return index;
}

/** Lowest corner of a cube, pixels of the last level. */
function lowest({ side, corner }, cube) {
  return cube.map((c, a) => c * side + corner[a]);
}

/** The box that a tile of the last level decodes to, in its pixels: lowest and highest corner. */
export function boxOf(head, level, { cube, from, sides }) {
  const square = 8 * 2 ** (level.levels - 1);
  const low = lowest(head, cube).map((c, a) => c + from[a] * square);
  return [low, low.map((c, a) => c + sides[a] * square)];
}

/** What stands before the tiles: levels of detail, cubes, and the index. */
export function openTiles(features, meta, index) {
  expectFeatures(features, TILE_FEATURES);
  const head = readLevels(meta, features);
  return { ...head, index: readIndex(index, head.levels) };
}

/** Reads a tile of the last level of `head`, which `openTiles` gives. */
export function readTile(bytes, { checksum, cube }, head, features) {
  if (crc32c(bytes) !== checksum) throw new SfbError("the file is damaged: the checksum of a tile does not match");
  const fields = new Fields(bytes, "TILE");
  const meta = { ...head.levels[head.levels.length - 1], nPatches: fields.varint(), nExtra: fields.varint() };
  if (features & BORDERS) meta.border = { low: lowest(head, cube), side: head.side };
  let patterns = false;
  if (meta.nExtra > 0) {
    const size = fields.f64();
    patterns = (features & POINT_PATTERNS) !== 0 && size < 0;
    meta.extraCell = patterns ? -size : size;
    if (!(meta.extraCell > 0)) fail("TILE", `${size} where a positive number belongs`);
  }
  const tags = streamsOf(meta);
  const lengths = tags.map(() => fields.varint());
  const streams = new Map(tags.map((tag, i) => [tag, fields.raw(lengths[i])]));
  fields.end();
  const coding = patterns ? POINT_PATTERNS : NEAR_POINTS;
  return readStreams(meta, (features & ~(POINT_PATTERNS | NEAR_POINTS)) | coding, streams);
}

/** Reads a map in tiles. */
export function readTiles({ features, sections }) {
  expectFeatures(features, TILE_FEATURES);
  expectSections(sections, ["META", "TIDX", "TILE"]);
  const head = readLevels(sections.get("META"), features);
  const { levels } = head;
  const index = readIndex(sections.get("TIDX"), levels);
  const all = new Fields(sections.get("TILE"), "TILE");
  const parts = index.map((of) => of.map((tile) => ({ bytes: all.raw(tile.length), tile })));
  all.end();
  const level = levels[levels.length - 1];
  const tiles = parts[parts.length - 1].map(({ bytes, tile }) => readTile(bytes, tile, head, features));
  const model = { method: "patches", meta: level, tiles };
  if (tiles.some((tile) => tile.complete)) model.complete = () => tiles.forEach((tile) => tile.complete?.());
  return model;
}

/** Typed arrays one after another. */
function joined(arrays) {
  const whole = new arrays[0].constructor(arrays.reduce((sum, array) => sum + array.length, 0));
  arrays.reduce((at, array) => {
    whole.set(array, at);
    return at + array.length;
  }, 0);
  return whole;
}

const sum = (model, of) => model.tiles.reduce((total, tile) => total + of(tile), 0);

function decodeTiles(model, options) {
  let first = 0;
  const decoded = model.tiles.map((tile) => {
    const points = patchesMethod.decode(tile, options);
    for (let i = 0; i < points.parts.length; i++) points.parts[i] += first;
    first += patchesMethod.parts(tile);
    return points;
  });
  if (decoded.length === 0) throw new SfbError("a map without tiles");
  const columns = Object.keys(decoded[0]).filter((name) => ArrayBuffer.isView(decoded[0][name]));
  const attributes = decoded[0].attributes.map((attribute, i) => ({
    ...attribute,
    values: joined(decoded.map((points) => points.attributes[i].values)),
  }));
  const of = (name) => joined(decoded.map((points) => points[name]));
  return { ...decoded[0], ...Object.fromEntries(columns.map((name) => [name, of(name)])), attributes };
}

/** What the page asks of every kind of model. */
export const tilesMethod = {
  part: patchesMethod.part,
  keepsThickness: true,
  spacing: patchesMethod.spacing,
  parts: (model) => sum(model, patchesMethod.parts),
  mostPoints: (model, resolution, asMeasured) =>
    sum(model, (tile) => patchesMethod.mostPoints(tile, resolution, asMeasured)),
  decode: decodeTiles,
};
