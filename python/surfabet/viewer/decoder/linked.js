// Section 5.7 of docs/format.md, read in parts: header, index, and those tiles that are wanted.

import { SfbError, crc32c, fail } from "./bytes.js";
import { HEADER_BYTES, LATTICE, MAX_NOTE, TILES, PATCHES, openHeader } from "./container.js";
import { latticeRows } from "./patch_points.js";
import { Model, openModel } from "./model.js";
import { boxOf, openTiles, readTile, tilesMethod } from "./tiles.js";

/** Tiles that are kept beside those that are shown, as a multiple of them. */
const KEPT = 3;

/** The corners of a box from its lowest and its highest. */
function cornersOf([low, high]) {
  return Array.from({ length: 8 }, (_, k) => [0, 1, 2].map((a) => (k >> a & 1 ? high[a] : low[a])));
}

/** Distance of a place to a box, squared. */
function away(place, [low, high]) {
  return place.reduce((sum, c, a) => sum + Math.max(low[a] - c, c - high[a], 0) ** 2, 0);
}

/** A map in tiles, of which some are in memory; it decodes to those of `content.tiles`, which `choose` gives. */
class LinkedModel extends Model {
  /** `read(start, end)` gives bytes of the file; tiles begin at `start`. */
  constructor(head, start, read, features, note) {
    const level = head.levels[head.levels.length - 1];
    super({ method: "patches", meta: level, tiles: [] }, tilesMethod, note);
    Object.assign(this, { head, read, features, level });
    this.rows = latticeRows(level.quaternion);
    this.index = head.index[head.index.length - 1];
    let at = start + head.index.slice(0, -1).flat().reduce((sum, { length }) => sum + length, 0);
    for (const tile of this.index) {
      Object.assign(tile, { start: at, box: boxOf(head, level, tile) });
      at += tile.length;
    }
    if (this.index.length === 0) throw new SfbError("a map without tiles");
    this.loaded = new Map();
  }

  /** Of all tiles, in metres about the origin: lowest and highest corner. */
  get bounds() {
    const corners = this.index.flatMap(({ box }) => cornersOf(box).map((corner) => this.toWorld(corner)));
    return [Math.min, Math.max].map((of) => [0, 1, 2].map((a) => corners.reduce((found, corner) => of(found, corner[a]), corners[0][a])));
  }

  toWorld(place) {
    return this.rows.map((row) => row.reduce((sum, c, a) => sum + c * place[a] * this.level.pixel, 0));
  }

  toLattice(place) {
    return [0, 1, 2].map((a) => this.rows.reduce((sum, row, b) => sum + row[a] * place[b], 0) / this.level.pixel);
  }

  async load(tile) {
    if (!this.loaded.has(tile)) {
      const bytes = await this.read(tile.start, tile.start + tile.length);
      const content = readTile(bytes, tile, this.head, this.features);
      content.complete?.();
      content.complete = undefined;
      this.loaded.set(tile, content);
    }
    return this.loaded.get(tile);
  }

  /** Reads the tiles nearest to a place, as many as make no more points than `budget`. */
  async choose({ place, resolution, asMeasured, budget }) {
    const at = this.toLattice(place);
    const order = [...this.index].sort((a, b) => away(at, a.box) - away(at, b.box));
    const chosen = new Set();
    let points = 0;
    for (const tile of order) {
      const content = await this.load(tile);
      points += tilesMethod.mostPoints({ tiles: [content] }, resolution, asMeasured);
      if (chosen.size > 0 && points > budget) break;
      chosen.add(tile);
    }
    for (const tile of this.loaded.keys()) {
      if (this.loaded.size <= (1 + KEPT) * chosen.size) break;
      if (!chosen.has(tile)) this.loaded.delete(tile);
    }
    // In the order of the file, whatever the place.
    return this.index.filter((tile) => chosen.has(tile)).map((tile) => this.loaded.get(tile));
  }

  /** Outlines of all tiles: of each the side of its box that is lowest. */
  lines() {
    const vertical = [0, 1, 2].reduce((best, a) => (Math.abs(this.rows[2][a]) > Math.abs(this.rows[2][best]) ? a : best));
    const lowest = this.rows[2][vertical] > 0 ? 0 : 1;
    const [a, b] = [0, 1, 2].filter((axis) => axis !== vertical);
    const positions = [];
    for (const { box } of this.index) {
      const corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(([u, v]) => {
        const corner = [];
        [corner[a], corner[b], corner[vertical]] = [box[u][a], box[v][b], box[lowest][vertical]];
        return this.toWorld(corner);
      });
      corners.forEach((corner, k) => positions.push(...corner, ...corners[(k + 1) % 4]));
    }
    return { positions: Float32Array.from(positions) };
  }
}

/**
 * Opens a file of which `fetchRange(start, end)` gives `{ bytes, size }`, fewer bytes at its end: of a map in tiles the header
 * and the index, of any other all. Gives `found`, the model, and `size`.
 */
export async function openLinked(fetchRange) {
  const { bytes: first, size } = await fetchRange(0, HEADER_BYTES);
  const { family, features, table, end } = openHeader(first);
  const read = async (from, to) => {
    const { bytes } = await fetchRange(from, to);
    if (bytes.length !== to - from) throw new SfbError(`the file is cut short: ${to - from} bytes wanted at ${from}, ${bytes.length} there`);
    return bytes;
  };
  if (family !== PATCHES || (features & (LATTICE | TILES)) !== (LATTICE | TILES)) return { found: openModel(await read(0, size)), size };
  const sections = new Map();
  let at = end;
  for (const { tag, length, checksum } of table) {
    sections.set(tag, { at, length, checksum });
    at += length;
  }
  if (at !== size) fail("HEAD", `sections of ${at} bytes in a file of ${size}`);
  const content = async (tag) => {
    const section = sections.get(tag);
    if (!section) fail(tag, "the section is missing");
    const bytes = await read(section.at, section.at + section.length);
    if (crc32c(bytes) !== section.checksum) fail(tag, "its checksum does not match");
    return bytes;
  };
  const head = openTiles(features, await content("META"), await content("TIDX"));
  const tiles = sections.get("TILE") ?? fail("TILE", "the section is missing");
  const hasNote = sections.get("note")?.length <= MAX_NOTE;
  const note = hasNote ? new TextDecoder().decode(await content("note")) : "";
  return { found: new LinkedModel(head, tiles.at, read, features, note), size };
}
