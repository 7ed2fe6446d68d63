// Section 7 of docs/format.md: growing neural gas.

import { Fields, checkCount, fail, mostBits, readScale } from "./bytes.js";
import { colorOfCode, sizeOfCode } from "./codes.js";
import { ATTRIBUTES, expectFeatures, expectSections } from "./container.js";
import { Bits, Signed, Stream, Unsigned } from "./entropy.js";
import { KdTree, PointList, across, byte, codeDirection, cross, dot, leastAxis, scaleValue, unitOfCode } from "./geometry.js";
import { smallText } from "./lengths.js";
import { withIntensities } from "./planes.js";

const MAX_COORDINATE = 2 ** 23;
const MAX_NEURONS = 2 ** 26;
const NORMAL_BITS = 8;
const MOST_NEIGHBOURS = 32;
const MOST_PAIRS = 512;
const MOST_CANDIDATES = 32;

/** Of decoding, beside the format: docs/methods/gas.md. */
const DISC_REACH = 1.15;
const LEAST_BLEND_COSINE = 0.7;
const BLEND_WIDTH = 2;

function readMeta(bytes, features) {
  const fields = new Fields(bytes, "META");
  const meta = { nPoints: fields.varint(), origin: fields.vector() };
  meta.step = 2 ** fields.signed(60, "an exponent");
  meta.colorStep = fields.varint(64, "a colour step");
  meta.meanError = fields.f64();
  if (meta.meanError < 0) fail("META", `a mean error of ${meta.meanError} m`);
  meta.nNeurons = fields.varint(MAX_NEURONS, "a number of neurons");
  meta.nEdges = fields.varint();
  const n = meta.nNeurons;
  if (n < 2 || meta.nEdges < Math.ceil(n / 2) || meta.nEdges > (n * (n - 1)) / 2) {
    fail("META", `${meta.nEdges} edges between ${n} neurons`);
  }
  meta.scale = features & ATTRIBUTES ? readScale(fields) : null;
  fields.end();
  return meta;
}

/** Half the number of bits of a squared length, rounded up. */
function lengthClass(squared) {
  let bits = 0;
  while (2 ** bits <= squared) bits++;
  return Math.min(Math.ceil(bits / 2), 25);
}

/** Reads all streams in step (7.2). */
class GasReader {
  constructor(meta, sections) {
    this.meta = meta;
    const stream = (tag) => new Stream(sections.get(tag), tag);
    this.topology = stream("TOPO");
    this.position = stream("POSN");
    this.normal = stream("NORM");
    this.size = stream("SIZE");
    this.color = meta.colorStep > 0 ? stream("COLR") : null;
    this.intensity = meta.scale ? stream("INTS") : null;
    this.neurons = [];
    this.nEdges = 0;
    this.lastAlone = [0, 0, 0];
    this.models = {
      alone: new Signed(), offset: new Signed(78), hasNormal: new Bits(3), normal: new Signed(2),
      size: new Signed(6), luma: new Signed(2), chroma: new Signed(6), intensity: new Signed(2),
      joined: new Bits(8 * 3 * 4 * 4, 1023), others: new Unsigned(), ahead: new Unsigned(), children: new Unsigned(8),
    };
  }

  read() {
    const { neurons, meta } = this;
    for (let v = 0; v < meta.nNeurons; v++) {
      if (v === neurons.length) {
        this.lastAlone = this.lastAlone.map((c) =>
          this.position.from(c, -MAX_COORDINATE, MAX_COORDINATE, this.models.alone));
        this.add(this.lastAlone, -1);
      }
      this.readNeuron(v);
      this.readKnown(v);
      this.readChildren(v);
    }
    const streams = [this.topology, this.position, this.normal, this.size, this.color, this.intensity];
    for (const stream of streams) stream?.end();
    if (this.nEdges !== meta.nEdges) fail("TOPO", `${this.nEdges} edges, not ${meta.nEdges}`);
    return neurons;
  }

  add(position, parent) {
    if (this.neurons.length >= this.meta.nNeurons) fail("TOPO", `more than ${this.meta.nNeurons} neurons`);
    this.neurons.push({ position, parent, near: [], normal: null });
  }

  join(a, b) {
    if (++this.nEdges > this.meta.nEdges) fail("TOPO", `more than ${this.meta.nEdges} edges`);
    this.neurons[a].near.push(b);
    this.neurons[b].near.push(a);
  }

  /** Normal, sizes, colour and intensity, predicted from the neighbours so far (7.4). */
  readNeuron(v) {
    const neuron = this.neurons[v];
    const near = neuron.near.slice(0, MOST_NEIGHBOURS).map((i) => this.neurons[i]);
    const known = near.length > 0 ? 1 : 0;
    const mean = (of, value) => {
      if (of.length === 0) return 0;
      const sum = of.reduce((total, other) => total + value(other), 0);
      return Math.floor((2 * sum + of.length) / (2 * of.length));
    };
    const withNormal = near.filter((other) => other.normal);
    const context = withNormal.length > 0 ? 2 : known;
    if (this.normal.bit(this.models.hasNormal, context)) {
      neuron.normal = [0, 1].map((a) =>
        this.normal.from(mean(withNormal, (other) => other.normal[a]), -127, 127, this.models.normal, a));
    }
    neuron.sizes = [0, 1, 2].map((i) =>
      this.size.from(mean(near, (other) => other.sizes[i]), 0, 255, this.models.size, 2 * i + known));
    if (this.color) neuron.color = this.readColor((c) => mean(near, (other) => other.color[c]), known);
    if (this.intensity) {
      const limit = 2 ** 20 + 1;
      const from = mean(near, (other) => other.intensity);
      neuron.intensity = this.intensity.from(from, -limit, limit, this.models.intensity, known);
    }
  }

  readColor(predicted, known) {
    const color = [];
    let off = 0;
    for (let c = 0; c < 3; c++) {
      const model = c === 0 ? this.models.luma : this.models.chroma;
      const number = c === 0 ? known : 3 * (c - 1) + (known ? 1 + off : 0);
      const from = predicted(c);
      color.push(this.color.from(from, -512, 512, model, number));
      off = Math.abs(color[c] - from) > 1 ? 1 : 0;
    }
    return color;
  }

  squared(a, b) {
    const [p, q] = [this.neurons[a].position, this.neurons[b].position];
    return (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2;
  }

  candidates(v) {
    const { near } = this.neurons[v];
    const joined = new Set(near);
    const found = new Map();
    let pairs = 0;
    search: for (const w of near) {
      for (const u of this.neurons[w].near) {
        if (u <= v) continue;
        if (pairs++ === MOST_PAIRS) break search;
        if (!joined.has(u)) found.set(u, (found.get(u) ?? 0) + 1);
      }
    }
    const all = [...found].map(([u, times]) => ({ u, times, squared: this.squared(u, v) }));
    all.sort((a, b) => a.squared - b.squared || a.u - b.u);
    return all.slice(0, MOST_CANDIDATES);
  }

  /** Edges to neurons that are known and follow v (7.5). */
  readKnown(v) {
    const { topology, models } = this;
    const before = this.neurons[v].near.slice(0, MOST_NEIGHBOURS);
    const k = before.length;
    const S = before.reduce((sum, w) => sum + this.squared(v, w), 0);
    let s = 0;
    this.candidates(v).forEach(({ u, times, squared: D }, place) => {
      const l = 2 * k * D < S ? 0 : k * D < S ? 1 : k * D < 2 * S ? 2 : 3;
      const context = ((3 * Math.min(place, 7) + Math.min(times, 3) - 1) * 4 + Math.min(s, 3)) * 4 + l;
      if (topology.bit(models.joined, context)) {
        this.join(v, u);
        s++;
      }
    });
    const others = topology.unsigned(models.others);
    let u = v;
    for (let i = 0; i < others; i++) {
      u += topology.unsigned(models.ahead) + 1;
      if (u >= this.neurons.length) fail("TOPO", `an edge to neuron ${u}, which is not known`);
      if (this.neurons[v].near.includes(u)) fail("TOPO", `an edge from ${v} to ${u} occurs twice`);
      this.join(v, u);
    }
  }

  /** New neurons that v leads to (7.3, 7.6). */
  readChildren(v) {
    const neuron = this.neurons[v];
    const count = this.topology.unsigned(this.models.children, Math.min(neuron.near.length, 7));
    if (count > this.meta.nNeurons - this.neurons.length) fail("TOPO", `more than ${this.meta.nNeurons} neurons`);
    if (neuron.near.length === 0 && count === 0) fail("TOPO", `neuron ${v} has no edge`);
    const p = neuron.position;
    const q = neuron.parent < 0 ? p : this.neurons[neuron.parent].position;
    const ahead = p.map((c, a) => c + Math.floor((c - q[a]) / 2));
    const L = lengthClass(p.reduce((sum, c, a) => sum + (c - q[a]) ** 2, 0));
    const N = neuron.normal ? codeDirection(neuron.normal, NORMAL_BITS) : [0, 0, 1];
    let c = 0;
    for (const a of [1, 2]) if (Math.abs(N[a]) > Math.abs(N[c])) c = a;
    for (let i = 0; i < count; i++) {
      const at = [0, 0, 0];
      let rise = 0;
      for (const a of [(c + 1) % 3, (c + 2) % 3]) {
        at[a] = this.coordinate(ahead[a], L);
        rise += N[a] * (at[a] - p[a]);
      }
      at[c] = neuron.normal
        ? this.coordinate(p[c] - Math.trunc(rise / N[c]), 52 + L)
        : this.coordinate(ahead[c], 26 + L);
      this.add(at, v);
      this.join(v, this.neurons.length - 1);
    }
  }

  coordinate(from, model) {
    return this.position.from(from, -MAX_COORDINATE, MAX_COORDINATE, this.models.offset, model);
  }
}

/** Reads a model of `learn_gas`. */
export function readGas({ features, sections }) {
  expectFeatures(features, ATTRIBUTES);
  if (!sections.has("META")) fail("META", "the section is missing");
  const meta = readMeta(sections.get("META"), features);
  const tags = ["META", "TOPO", "POSN", "NORM", "SIZE"];
  if (meta.colorStep > 0) tags.push("COLR");
  if (meta.scale) tags.push("INTS");
  expectSections(sections, tags);
  checkCount("META", "neurons", meta.nNeurons, mostBits(sections.get("TOPO")));
  checkCount("META", "neurons", meta.nNeurons, mostBits(sections.get("SIZE")));
  const neurons = new GasReader(meta, sections).read();
  for (const neuron of neurons) place(neuron, meta);
  const edges = [];
  neurons.forEach(({ near }, v) => {
    for (const u of near.sort((a, b) => a - b)) if (u > v) edges.push([v, u]);
  });
  return { method: "gas", meta, neurons, edges };
}

/** Adds what follows from the integers of a neuron: metres, colours. */
function place(neuron, { step, colorStep, scale }) {
  neuron.at = neuron.position.map((c) => Math.fround(c * step));
  neuron.unit = neuron.normal ? unitOfCode(neuron.normal, NORMAL_BITS) : [0, 0, 0];
  neuron.radius = 0.125 * step * sizeOfCode(neuron.sizes[1]);
  neuron.thickness = 0.125 * step * sizeOfCode(neuron.sizes[2]);
  neuron.reach = neuron.normal ? DISC_REACH * neuron.radius : 0;
  neuron.rgb = colorStep > 0 ? colorOfCode(neuron.color, colorStep) : [127, 127, 127];
  neuron.value = scale ? Math.fround(scaleValue(scale, neuron.intensity)) : 0;
}

function edgeLength({ neurons }, [a, b]) {
  return Math.hypot(...neurons[a].at.map((c, i) => c - neurons[b].at[i]));
}

/** A third of the mean edge. */
function ownSpacing(model) {
  const mean = model.edges.reduce((sum, edge) => sum + edgeLength(model, edge), 0) / model.edges.length;
  return mean > 0 ? mean / 3 : model.meta.step;
}

function mostPoints(model, spacing) {
  let most = 0;
  for (const { reach } of model.neurons) most += ((2 * reach) / spacing + 1) ** 2;
  for (const edge of model.edges) most += edgeLength(model, edge) / spacing;
  return most;
}

/** Discs filled with points, and edges where discs do not meet. */
class GasDecoder {
  constructor(model, { resolution, asMeasured, normals, maxPoints }) {
    this.model = model;
    this.spacing = resolution;
    this.asMeasured = asMeasured;
    const types = { positions: [Float32Array, 3], parts: [Uint32Array, 1] };
    if (normals) types.normals = [Float32Array, 3];
    if (model.meta.colorStep > 0) types.colors = [Uint8Array, 3];
    if (model.meta.scale) types.intensities = [Float64Array, 1];
    this.points = new PointList(types, maxPoints);
  }

  add(part, position, normal, color, value) {
    const i = this.points.add();
    const c = this.points.columns;
    c.positions.set(position, 3 * i);
    c.parts[i] = part;
    if (c.normals) c.normals.set(normal, 3 * i);
    if (c.colors) c.colors.set(color.map(byte), 3 * i);
    if (c.intensities) c.intensities[i] = value;
  }

  addNeuron(number) {
    const { at, unit, rgb, value } = this.model.neurons[number];
    this.add(number, at, unit, rgb, value);
  }

  addDisc(number, tree) {
    const neuron = this.model.neurons[number];
    const { reach } = neuron;
    const spacing = this.spacing;
    const before = this.points.length;
    if (reach >= 0.5 * spacing) {
      const normal = neuron.unit;
      const [u, v] = tangents(normal);
      const thickness = this.asMeasured ? neuron.thickness : 0;
      const n = Math.floor(reach / spacing);
      for (let row = -n; row <= n; row++) {
        for (let column = -n; column <= n; column++) {
          const [a, b] = [column * spacing, row * spacing];
          if (a * a + b * b > reach * reach) continue;
          const on = neuron.at.map((c, i) => c + a * u[i] + b * v[i]);
          if (tree.nearest(...on.map(Math.fround)) !== number) continue;
          const { height, color, value } = this.blend(number, on, normal);
          const depth = height + across(thickness, this.points.length - before);
          this.add(number, on.map((c, i) => c + depth * normal[i]), normal, color, value);
        }
      }
    }
    if (this.points.length === before) this.addNeuron(number);
  }

  /** Height of the surface above a place on a neuron's plane, its colour and intensity: means over the neighbours. */
  blend(number, on, normal) {
    const { neurons } = this.model;
    const own = neurons[number];
    const width = BLEND_WIDTH / own.radius ** 2;
    let [height, planes, total, value] = [0, 0, 0, 0];
    const color = [0, 0, 0];
    for (const j of [number, ...own.near]) {
      const other = neurons[j];
      const off = other.at.map((c, i) => c - on[i]);
      const weight = Math.exp(-width * dot(off, off));
      for (let c = 0; c < 3; c++) color[c] += weight * other.rgb[c];
      value += weight * other.value;
      total += weight;
      const cosine = dot(other.unit, normal);
      if (cosine > LEAST_BLEND_COSINE) {
        height += (weight * dot(off, other.unit)) / cosine;
        planes += weight;
      }
    }
    height = planes > 0 ? height / planes : 0;
    if (!(total > 0)) return { height, color: own.rgb, value: own.value };
    return { height, color: color.map((c) => Math.fround(c / total)), value: Math.fround(value / total) };
  }

  addLink(edge) {
    const [a, b] = edge;
    const [i, j] = edge.map((k) => this.model.neurons[k]);
    const length = edgeLength(this.model, edge);
    const from = i.reach;
    const to = length - j.reach;
    const n = Math.ceil((to - from) / this.spacing) - 1;
    for (let k = 1; k <= n; k++) {
      const share = (from + ((to - from) * k) / (n + 1)) / length;
      const mix = (p, q) => p + share * (q - p);
      const near = share < 0.5 ? a : b;
      const position = i.at.map((c, x) => mix(c, j.at[x]));
      const color = i.rgb.map((c, x) => mix(c, j.rgb[x]));
      this.add(near, position, this.model.neurons[near].unit, color, mix(i.value, j.value));
    }
  }
}

/** Two unit vectors at right angles to a unit normal and each other. */
function tangents(n) {
  const axis = leastAxis(n);
  const u = cross(n, axis);
  const length = Math.sqrt(dot(u, u));
  const first = length > 0 ? u.map((c) => c / length) : axis;
  return [first, cross(n, first)];
}

function decodeGas(model, options) {
  const decoder = new GasDecoder(model, options);
  if (options.isOwn && !options.asMeasured) {
    model.neurons.forEach((_, number) => decoder.addNeuron(number));
  } else {
    const tree = new KdTree(Float32Array.from(model.neurons.flatMap(({ at }) => at)));
    model.neurons.forEach((_, number) => decoder.addDisc(number, tree));
    for (const edge of model.edges) decoder.addLink(edge);
  }
  return withIntensities(decoder.points.finish());
}

/** All edges as pairs of points about the origin. */
function gasLines({ neurons, edges }) {
  const lines = [];
  for (const [a, b] of edges) lines.push(...neurons[a].at, ...neurons[b].at);
  return { positions: Float32Array.from(lines), owners: edges.map(([a]) => a) };
}

function describe({ neurons }, number, unit) {
  const { near, radius, thickness, sizes, normal } = neurons[number];
  const facts = { "edges": near.length, "points of the scan": `about ${Math.round(sizeOfCode(sizes[0]))}` };
  if (normal) {
    facts["radius"] = smallText(radius, unit);
    facts["thickness"] = smallText(thickness, unit);
  }
  return facts;
}

export const gasMethod = {
  part: "neuron",
  keepsThickness: true,
  spacing: ownSpacing,
  parts: ({ neurons }) => neurons.length,
  mostPoints,
  decode: decodeGas,
  lines: gasLines,
  describe,
};
