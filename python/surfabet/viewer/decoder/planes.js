// Section 9 of docs/format.md: planes.

import { Fields, checkCount, fail, mostBits, readScale } from "./bytes.js";
import { ATTRIBUTES, expectFeatures, expectSections } from "./container.js";
import { Bits, Signed, Stream, Unsigned } from "./entropy.js";
import { PointList, across, byte, cross, leastAxis, scaleValue, unit, unitOfCode } from "./geometry.js";
import { colorOfCode, sizeOfCode } from "./codes.js";
import { middleText, smallText } from "./lengths.js";

const MAX_TILES = 2 ** 25;
const MAX_COORDINATE = 2 ** 23;
const NORMAL_BITS = 16;
const HALF = 2 ** 15 - 1;

function readMeta(bytes, features) {
  const fields = new Fields(bytes, "META");
  const meta = { nPoints: fields.varint() };
  meta.nOutliers = fields.varint(meta.nPoints, "a number of outliers");
  meta.origin = fields.vector();
  meta.step = 2 ** fields.signed(60, "an exponent");
  meta.gridSize = fields.f64();
  if (!(meta.gridSize >= meta.step && meta.gridSize <= MAX_COORDINATE * meta.step)) {
    fail("META", `a grid size of ${meta.gridSize} m at steps of ${meta.step} m`);
  }
  meta.colorStep = fields.varint(64, "a colour step");
  meta.nPatches = fields.varint(2 ** 20, "a number of planes");
  meta.scale = features & ATTRIBUTES ? readScale(fields) : null;
  fields.end();
  return meta;
}

/** Reads middles, normals and directions (9.2). */
class PoseReader {
  constructor(bytes) {
    this.stream = new Stream(bytes, "POSE");
    this.position = new Signed(3);
    this.reference = new Unsigned();
    this.normal = new Signed(4);
    this.quarter = new Bits(6);
    this.turn = new Signed(2);
    this.references = [];
  }

  next() {
    const { stream } = this;
    const position = [0, 1, 2].map((a) => stream.from(0, -MAX_COORDINATE, MAX_COORDINATE, this.position, a));
    const k = stream.unsigned(this.reference);
    let predicted = { normal: [0, 0], direction: 0 };
    if (k > 0) {
      const number = Math.floor((k - 1) / 2);
      if (number >= this.references.length) fail("POSE", `direction ${number} of ${this.references.length}`);
      const [moved] = this.references.splice(number, 1);
      this.references.unshift(moved);
      predicted = k % 2 === 1 ? moved : opposite(moved);
    }
    const near = k > 0 ? 1 : 0;
    const normal = [0, 1].map((a) => stream.from(predicted.normal[a], -HALF, HALF, this.normal, 2 * near + a));
    const high = stream.bit(this.quarter, 3 * near);
    const low = stream.bit(this.quarter, 3 * near + 1 + high);
    const rest = stream.from(0, -512, 511, this.turn, near);
    const direction = (predicted.direction + 1024 * (2 * high + low) + rest + 4096) % 4096;
    if (k === 0) {
      this.references.unshift({ normal, direction });
      this.references.length = Math.min(this.references.length, 16);
    }
    return { position, normal, direction };
  }
}

/** The same plane from its other side. */
function opposite({ normal: [u, v], direction }) {
  const away = (size, side) => (side > 0 ? -size : size);
  const normal = [away(HALF - Math.abs(v), u), away(HALF - Math.abs(u), v)];
  return { normal, direction: (2048 - direction + 4096) % 4096 };
}

/** Reads numbers and sizes of tiles, standard deviations, numbers of points (9.3). */
class SizeReader {
  constructor(bytes, mostTiles) {
    this.stream = new Stream(bytes, "SIZE");
    this.doublings = new Unsigned();
    this.shape = new Unsigned(2);
    this.last = new Unsigned(2);
    this.before = [0, 0];
    this.code = new Signed(2);
    this.tiles = 0;
    this.mostTiles = mostTiles;
  }

  next() {
    const { stream } = this;
    const doublings = stream.unsigned(this.doublings);
    if (doublings > 40) fail("SIZE", `tiles of 2^${doublings} grid sizes`);
    const shape = [0, 1].map((a) => stream.unsigned(this.shape, a) + 1);
    this.tiles += shape[0] * shape[1];
    if (this.tiles > this.mostTiles) fail("SIZE", `more than ${this.mostTiles} tiles`);
    const last = [0, 1].map((a) => {
      const less = stream.unsigned(this.last, a);
      if (less > 7) fail("SIZE", `a last tile less ${less} eighths`);
      return 8 - less;
    });
    this.before = this.before.map((code, i) => stream.from(code, 0, 255, this.code, i));
    return { doublings, shape, last, deviation: this.before[0], count: this.before[1] };
  }
}

/** Supported tiles of a plane, along the first axis first (9.4). */
function readTiles(stream, models, [nx, ny]) {
  const tiles = new Uint8Array(nx * ny);
  const at = (x, y) => (x >= 0 && x < nx && y >= 0 ? tiles[y * nx + x] : 0);
  let any = 0;
  for (let y = 0; y < ny; y++) {
    for (let x = 0; x < nx; x++) {
      const context =
        32 * at(x - 1, y) + 16 * at(x, y - 1) + 8 * at(x - 1, y - 1) + 4 * at(x + 1, y - 1) + 2 * at(x - 2, y) + at(x, y - 2);
      any |= tiles[y * nx + x] = stream.bit(models, context);
    }
  }
  if (!any) fail("MASK", "a plane without a supported tile");
  return tiles;
}

/** Numbers of supported tiles, each predicted from those beside it (9.5); `model(channel, neighbours, off)` chooses. */
class TileValues {
  constructor(stream, channels, limit, models, model) {
    Object.assign(this, { stream, channels, limit, models, model });
    this.last = new Array(channels).fill(0);
  }

  next({ tiles, shape: [nx] }) {
    const C = this.channels;
    const place = new Int32Array(tiles.length).fill(-1);
    const values = [];
    for (let t = 0, n = 0; t < tiles.length; t++) {
      if (!tiles[t]) continue;
      const beside = [t % nx > 0 ? place[t - 1] : -1, t >= nx ? place[t - nx] : -1].filter((i) => i >= 0);
      let off = 0;
      for (let c = 0; c < C; c++) {
        let from = this.last[c];
        if (beside.length === 1) from = values[C * beside[0] + c];
        if (beside.length === 2) {
          from = Math.floor((values[C * beside[0] + c] + values[C * beside[1] + c] + 1) / 2);
        }
        const value = this.stream.from(from, -this.limit, this.limit, this.models, this.model(c, beside.length, off));
        off = Math.abs(value - from) > 1 ? 1 : 0;
        values.push(value);
      }
      place[t] = n++;
      this.last = values.slice(-C);
    }
    return values;
  }
}

/** Middle, axes and rectangle of a plane in metres. */
function placePlane(plane, { step, gridSize }) {
  const normal = unitOfCode(plane.normal, NORMAL_BITS);
  const u0 = unit(cross(leastAxis(normal), normal));
  const v0 = cross(normal, u0);
  const turn = (2 * Math.PI * plane.direction) / 4096;
  const u = u0.map((c, a) => Math.cos(turn) * c + Math.sin(turn) * v0[a]);
  const edge = gridSize * 2 ** plane.doublings;
  const size = plane.shape.map((n, a) => edge * (n - 1 + plane.last[a] / 8));
  return {
    ...plane,
    center: plane.position.map((c) => c * step),
    normal, u, v: cross(normal, u), edge, size,
    low: size.map((s) => -0.5 * s),
    deviation: 0.125 * step * sizeOfCode(plane.deviation),
    nPoints: sizeOfCode(plane.count),
  };
}

/** Reads a model of `learn_planes`. */
export function readPlanes({ features, sections }) {
  expectFeatures(features, ATTRIBUTES);
  if (!sections.has("META")) fail("META", "the section is missing");
  const meta = readMeta(sections.get("META"), features);
  const tags = ["META", "POSE", "MASK", "SIZE"];
  if (meta.colorStep > 0) tags.push("COLR");
  if (meta.scale) tags.push("INTS");
  expectSections(sections, tags);
  checkCount("META", "planes", meta.nPatches, mostBits(sections.get("POSE")));
  const poses = new PoseReader(sections.get("POSE"));
  const sizes = new SizeReader(sections.get("SIZE"), Math.min(MAX_TILES, mostBits(sections.get("MASK"))));
  const masks = new Stream(sections.get("MASK"), "MASK");
  const supported = new Bits(64, 1023);
  const colorModel = (c, n, off) => (c === 0 ? n : 3 + 2 * (c - 1) + off);
  const color = meta.colorStep > 0
    ? new TileValues(new Stream(sections.get("COLR"), "COLR"), 3, 512, new Signed(7), colorModel) : null;
  const limit = 2 ** 20 + 1;
  const intensity = meta.scale
    ? new TileValues(new Stream(sections.get("INTS"), "INTS"), 1, limit, new Signed(3), (_, n) => n) : null;
  const planes = [];
  for (let i = 0; i < meta.nPatches; i++) {
    const plane = { ...poses.next(), ...sizes.next() };
    plane.tiles = readTiles(masks, supported, plane.shape);
    plane.colors = color?.next(plane);
    plane.intensities = intensity?.next(plane);
    planes.push(placePlane(plane, meta));
  }
  for (const part of [poses.stream, sizes.stream, masks, color?.stream, intensity?.stream]) part?.end();
  return { method: "planes", meta, planes };
}

/** Lower and upper corner of tile number t. */
function tileBounds({ low, size, edge, shape: [nx] }, t) {
  const at = [t % nx, Math.floor(t / nx)];
  return [
    at.map((n, a) => low[a] + edge * n),
    at.map((n, a) => Math.min(low[a] + edge * (n + 1), low[a] + size[a])),
  ];
}

function eachTile(plane, visit) {
  for (let t = 0, k = 0; t < plane.tiles.length; t++) {
    if (plane.tiles[t]) visit(...tileBounds(plane, t), k++);
  }
}

const along = (extent, spacing) => Math.max(1, Math.ceil(extent / spacing));

function mostPoints({ planes }, spacing) {
  let most = 0;
  for (const plane of planes) {
    eachTile(plane, (low, high) => {
      most += along(high[0] - low[0], spacing) * along(high[1] - low[1], spacing);
    });
  }
  return most;
}

/** Position of a point of a plane. */
function onPlane({ center, u, v }, x, y) {
  return center.map((c, a) => c + x * u[a] + y * v[a]);
}

function decodePlanes({ meta, planes }, { resolution, asMeasured, normals, maxPoints }) {
  const types = { positions: [Float32Array, 3], parts: [Uint32Array, 1] };
  if (normals) types.normals = [Float32Array, 3];
  if (meta.colorStep > 0) types.colors = [Uint8Array, 3];
  if (meta.scale) types.intensities = [Float64Array, 1];
  const points = new PointList(types, maxPoints);
  planes.forEach((plane, number) => {
    let ofPlane = 0;
    eachTile(plane, (low, high, k) => {
      const n = [0, 1].map((a) => along(high[a] - low[a], resolution));
      const color = plane.colors && colorOfCode(plane.colors.slice(3 * k, 3 * k + 3), meta.colorStep).map(byte);
      const value = plane.intensities && Math.fround(scaleValue(meta.scale, plane.intensities[k]));
      for (let row = 0; row < n[1]; row++) {
        for (let column = 0; column < n[0]; column++) {
          const x = low[0] + ((column + 0.5) / n[0]) * (high[0] - low[0]);
          const y = low[1] + ((row + 0.5) / n[1]) * (high[1] - low[1]);
          const p = onPlane(plane, x, y);
          const depth = across(asMeasured ? plane.deviation : 0, ofPlane++);
          const i = points.add();
          const c = points.columns;
          for (let a = 0; a < 3; a++) c.positions[3 * i + a] = p[a] + depth * plane.normal[a];
          c.parts[i] = number;
          if (c.normals) c.normals.set(plane.normal, 3 * i);
          if (c.colors) c.colors.set(color, 3 * i);
          if (c.intensities) c.intensities[i] = value;
        }
      }
    });
  });
  return withIntensities(points.finish());
}

/** Intensities as an attribute, as the page wants them. */
export function withIntensities({ intensities, ...columns }) {
  const attributes = intensities ? [{ name: "intensities", values: intensities }] : [];
  return { colors: null, ...columns, attributes };
}

/** Outlines of the supported tiles as pairs of points, about the origin: sides with no supported tile beyond. */
function planeLines({ planes }) {
  const lines = [];
  const owners = [];
  planes.forEach((plane, number) => {
    const [nx, ny] = plane.shape;
    const on = (x, y) => x >= 0 && y >= 0 && x < nx && y < ny && plane.tiles[y * nx + x] === 1;
    const corner = (x, y) => onPlane(plane, ...[x, y].map((n, a) => plane.low[a] + Math.min(plane.edge * n, plane.size[a])));
    const add = (from, to) => {
      lines.push(...corner(...from), ...corner(...to));
      owners.push(number);
    };
    // Runs of sides along one line become one line.
    const runs = (count, length, open, place) => {
      for (let line = 0; line <= count; line++) {
        let start = -1;
        for (let k = 0; k <= length; k++) {
          const isOpen = k < length && open(line, k);
          if (isOpen && start < 0) start = k;
          if (!isOpen && start >= 0) {
            add(place(line, start), place(line, k));
            start = -1;
          }
        }
      }
    };
    runs(ny, nx, (y, x) => on(x, y) !== on(x, y - 1), (y, x) => [x, y]);
    runs(nx, ny, (x, y) => on(x, y) !== on(x - 1, y), (x, y) => [x, y]);
  });
  return { positions: Float32Array.from(lines), owners };
}

/** What is known of one plane, for people. */
function describe({ planes }, number, unit) {
  const { normal, deviation, nPoints, tiles, edge } = planes[number];
  return {
    "normal": normal.map((c) => c.toFixed(3)).join(", "),
    "supported tiles": `${tiles.reduce((sum, t) => sum + t, 0)} of ${middleText(edge, unit)}`,
    "standard deviation": smallText(deviation, unit),
    "points of the scan": `about ${Math.round(nPoints)}`,
  };
}

export const planesMethod = {
  part: "plane",
  keepsThickness: true,
  spacing: ({ meta }) => 0.5 * meta.gridSize,
  parts: ({ planes }) => planes.length,
  mostPoints,
  decode: decodePlanes,
  lines: planeLines,
  describe,
};
