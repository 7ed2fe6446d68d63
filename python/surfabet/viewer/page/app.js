// The page: a model on the screen, and what its user may do with it.

import { Camera, UPS } from "./camera.js";
import { GRADIENT, colorModes, colorsOf, highlighted, limits, rangeOf } from "./colors.js";
import { controlCamera } from "./controls.js";
import { Decoding } from "./decoding.js";
import { Renderer } from "./renderer.js";
import { lengthText } from "../decoder/lengths.js";

const BACKGROUND = [0.086, 0.094, 0.11];
/** Milliseconds that a picture may take while the camera moves: 30 pictures per second, with room for the rest of the page. */
const FRAME = 26;
const MOVING = 250;
/** Fewest points while moving, drawn as large squares. */
const FEWEST = 15_000;
/** Points of the first picture, which is to be there at once. */
const FIRST = 150_000;

const element = (id) => document.getElementById(id);

class Viewer {
  constructor(source, name, decoding, against) {
    /** The bytes of the model, or the URL of its file. */
    this.source = source;
    /** Distances to a second cloud, packed, or null. */
    this.against = against;
    this.name = name;
    this.canvas = element("view");
    this.renderer = new Renderer(this.canvas);
    this.camera = new Camera();
    this.decoding = decoding;
    this.points = null;
    /** The colouring that the user chose. */
    this.mode = null;
    this.picked = null;
    this.found = null;
    this.isMeasuring = false;
    this.ends = [];
    this.low = [-1e30, -1e30, -1e30];
    this.high = [1e30, 1e30, 1e30];
    this.moving = { until: 0, count: 300_000, scale: 1, light: true };
    this.stats = { frames: 0, drawn: 0, milliseconds: 0 };
    this.lastDecode = 0;
    this.isDecoding = false;
  }

  async start() {
    this.listen();
    const isLinked = typeof this.source === "string";
    const request = isLinked ? { url: this.source } : { bytes: this.source };
    this.info = await this.decoding.ask(isLinked ? "link" : "open", { ...request, against: this.against });
    if (this.info.against) this.mode = `attribute ${this.info.against}`;
    this.setUp();
    // The shape first; colours of a large map take a while.
    await this.decode(FIRST, true);
    this.drawNow();
    this.firstPicture = performance.now();
    if (!this.info.isComplete) await this.decoding.ask("complete");
    this.info.isComplete = true;
    await this.decode();
  }

  setUp() {
    const { info } = this;
    element("title").textContent = this.name;
    const count = (n, word) => `${n.toLocaleString("en")} ${word}${n === 1 ? "" : word.endsWith("ch") ? "es" : "s"}`;
    element("about").textContent =
      `${info.method.replace("_", " ")}: ${info.nTiles ? count(info.nTiles, "tile") : count(info.nParts, info.part)}, made from ${count(info.nPoints, "point")}, ` +
      `${info.bytes.toLocaleString("en")} bytes`;
    if (info.note) element("about").title = info.note;
    element("measuredRow").hidden = !info.keepsThickness;
    element("measuredRow").style.display = info.keepsThickness ? "" : "none";
    const linesName = info.nTiles ? "outlines of the tiles" : { planes: "outlines of the planes", gas: "edges" }[info.method];
    element("linesRow").style.display = linesName ? "" : "none";
    element("linesName").textContent = linesName ?? "";
    if (info.nTiles) {
      element("lines").checked = true;
      this.toggleLines().catch(showError);
    }
    this.resize();
  }

  /** A length of the map, for people. */
  length(value) {
    return lengthText(value, this.info.unit);
  }

  /** The same to three places behind the point. */
  exact(value) {
    return `${value.toFixed(3)} ${this.info.unit}`;
  }

  get spacing() {
    return this.info.spacing * 2 ** Number(element("spacing").value);
  }

  /** Of a map in tiles those nearest to this place are shown. */
  get place() {
    const [low, high] = this.info.bounds ?? [[0, 0, 0], [0, 0, 0]];
    return this.points ? this.camera.target : low.map((c, a) => (c + high[a]) / 2);
  }

  /** Shows other tiles where the camera has come to another place. */
  follow() {
    if (!this.info?.nTiles || !this.points || this.points.nShown === this.info.nTiles) return;
    const moved = Math.hypot(...this.place.map((c, a) => c - this.shownAbout[a]));
    if (moved > 0.05 * this.camera.distance) this.decode().catch(showError);
  }

  /** Decodes at the chosen spacing; of several wishes the last counts. */
  async decode(budget = Number(element("budget").value), isFirst = false) {
    const number = ++this.lastDecode;
    this.isDecoding = true;
    element("status").textContent = "decoding ...";
    const began = performance.now();
    const request = {
      spacing: this.spacing, asMeasured: element("measured").checked, budget,
      normals: element("mode").value === "normal" || element("facing").checked,
      place: this.place,
    };
    this.shownAbout = request.place;
    const points = await this.decoding.ask("decode", request);
    if (number !== this.lastDecode) return;
    this.isDecoding = isFirst;
    const isNew = this.points === null;
    this.points = points;
    this.decodeMilliseconds = performance.now() - began;
    this.renderer.points.setPositions(points.positions);
    this.renderer.points.setNormals(points.normals);
    if (isNew) this.frameAll();
    this.fillModes();
    this.picked = null;
    this.recolor();
    const isCoarser = points.spacing > this.spacing * 1.001;
    element("spacingText").textContent = this.length(points.spacing);
    element("status").textContent = isFirst
      ? "decoding all points ..."
      : (points.nShown < this.info.nTiles ? `${points.nShown} of ${this.info.nTiles} tiles, ` : "") +
        `${points.count.toLocaleString("en")} points` + (isCoarser ? "; closer together they are more than allowed below" : "");
    this.draw();
  }

  frameAll() {
    const { positions, count } = this.points;
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < 3 * count; i++) {
      const a = i % 3;
      if (positions[i] < low[a]) low[a] = positions[i];
      if (positions[i] > high[a]) high[a] = positions[i];
    }
    if (count === 0) {
      low.fill(0);
      high.fill(1);
    }
    this.bounds = this.info.bounds ?? [low, high];
    // A few points far away do not make the map small.
    const inner = [0, 1, 2].map((a) => limits(positions, 3, a));
    const margin = inner.map(([from, to]) => 0.04 * (to - from));
    this.camera.frame(
      inner.map(([from], a) => Math.max(from - margin[a], low[a])), inner.map(([, to], a) => Math.min(to + margin[a], high[a])));
    const [least, most] = this.bounds;
    this.camera.reach = Math.hypot(...least.map((c, a) => Math.max(Math.abs(c - this.camera.middle[a]), Math.abs(most[a] - this.camera.middle[a]))));
    this.fillCrop();
  }

  fillModes() {
    const select = element("mode");
    const wanted = this.mode ?? (this.info.isComplete ? null : "plain");
    const modes = colorModes(this.points, this.info.part);
    if (wanted === "plain") modes.unshift(["plain", "one colour"]);
    select.replaceChildren(...modes.map(([value, text]) => new Option(text, value)));
    select.value = modes.some(([value]) => value === wanted) ? wanted : modes[0][0];
  }

  recolor() {
    let colors = colorsOf(this.points, element("mode").value);
    if (this.found) colors = highlighted(colors, this.points.parts, this.found);
    this.renderer.points.setColors(colors);
    this.showScale();
    this.draw();
  }

  /** What the colours at both ends stand for. */
  showScale() {
    const mode = element("mode").value;
    const range = rangeOf(this.points, mode);
    element("scale").hidden = range === null;
    if (range === null) return;
    const above = mode === "height" ? this.info.origin[2] : 0;
    const isLength = mode === "height" || mode === `attribute ${this.info.against}`;
    const text = (value) => (isLength ? this.length(above + value) : String(Number(value.toPrecision(3))));
    element("scaleEnds").replaceChildren(...range.map((value) => Object.assign(document.createElement("span"), { textContent: text(value) })));
    element("scaleBar").style.background = GRADIENT;
  }

  async toggleLines() {
    if (element("lines").checked && this.renderer.lines.count === 0) {
      const lines = await this.decoding.ask("lines");
      if (lines) this.renderer.lines.setPositions(lines.positions);
    }
    this.draw();
  }

  // Drawing

  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2) * (this.isMoving ? this.moving.scale : 1);
    this.camera.width = Math.max(this.canvas.clientWidth, 1);
    this.camera.height = Math.max(this.canvas.clientHeight, 1);
    const width = Math.max(1, Math.round(this.camera.width * ratio));
    const height = Math.max(1, Math.round(this.camera.height * ratio));
    if (this.canvas.width !== width || this.canvas.height !== height) [this.canvas.width, this.canvas.height] = [width, height];
    this.ratio = ratio;
  }

  get isMoving() {
    return performance.now() < this.moving.until;
  }

  moved() {
    this.moving.until = performance.now() + MOVING;
    this.draw();
    clearTimeout(this.settle);
    this.settle = setTimeout(() => {
      this.draw();
      this.follow();
    }, MOVING + 20);
  }

  draw() {
    this.asked ??= requestAnimationFrame(() => {
      this.asked = undefined;
      this.drawNow();
    });
  }

  scene(count) {
    const { camera, points } = this;
    // Fewer points are drawn larger, so that surfaces stay closed.
    const growth = Math.min(Math.sqrt(points.count / Math.max(count, 1)), 4);
    const perPixel = camera.pixel * (camera.height / this.canvas.height);
    return {
      matrix: camera.matrix(), eye: [...camera.eye, element("facing").checked && points.normals ? 1 : 0], near: camera.near, far: camera.far, low: this.low, high: this.high, count,
      size: (Number(element("size").value) * points.spacing * growth) / perPixel, least: Math.max(1, this.ratio),
      light: this.isMoving && !this.moving.light ? 0 : Number(element("light").value), background: BACKGROUND,
      showLines: element("lines").checked, showBox: element("crop").open,
    };
  }

  drawNow() {
    if (!this.points) return;
    this.resize();
    const { moving } = this;
    const isMoving = this.isMoving;
    const count = isMoving ? Math.min(moving.count, this.points.count) : this.points.count;
    const began = performance.now();
    this.renderer.draw(this.scene(count));
    this.drawOverlay();
    if (isMoving) {
      // Reading a pixel waits for the picture.
      const { gl } = this.renderer;
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
      this.adapt(performance.now() - began);
    }
    this.stats = { frames: this.stats.frames + 1, drawn: count, milliseconds: performance.now() - began };
  }

  /**
   * While moving, where there is no time for all: a quarter of the pixels, then fewer points, then no lighting, then a
   * sixteenth of the pixels. Back in the other order; more pixels only where four times the time is left.
   */
  adapt(milliseconds) {
    const { moving } = this;
    const share = milliseconds / FRAME;
    if (share > 1) {
      if (moving.scale === 1) moving.scale = 0.5;
      else if (moving.count > FEWEST) moving.count = Math.max(FEWEST, Math.round(moving.count * Math.max(0.2, 0.9 / share)));
      else if (moving.light) moving.light = false;
      else moving.scale = 0.25;
    } else if (moving.scale < 0.5) {
      if (share < 0.2) moving.scale = 0.5;
    } else if (!moving.light) {
      moving.light = share < 0.7;
    } else if (moving.count < this.points.count) {
      if (share < 0.7) moving.count = Math.round(moving.count * 1.15);
    } else if (share < 0.2) {
      moving.scale = 1;
    }
  }

  position(i) {
    return [...this.points.positions.subarray(3 * i, 3 * i + 3)];
  }

  /** Coordinates in the file's own frame. */
  world(p) {
    return p.map((c, a) => this.info.origin[a] + c);
  }

  drawOverlay() {
    const parts = [];
    const place = (p) => this.camera.project(p);
    const dot = (p) => {
      const at = place(p);
      if (at) parts.push(`<circle cx="${at[0]}" cy="${at[1]}" r="4"/>`);
    };
    if (this.picked) dot(this.picked.position);
    this.ends.forEach(dot);
    for (let i = 0; i + 1 < this.ends.length; i += 2) {
      const [p, q] = [this.ends[i], this.ends[i + 1]];
      const [a, b] = [place(p), place(q)];
      if (!a || !b) continue;
      parts.push(`<line x1="${a[0]}" y1="${a[1]}" x2="${b[0]}" y2="${b[1]}"/>`);
      const text = this.length(Math.hypot(...p.map((c, k) => c - q[k])));
      parts.push(`<text x="${(a[0] + b[0]) / 2 + 8}" y="${(a[1] + b[1]) / 2 - 6}">${text}</text>`);
    }
    element("overlay").innerHTML = parts.join("");
  }

  // Points under the pointer

  /** Number of the point drawn at a place of the page, or -1. */
  pointAt(x, y) {
    if (!this.points) return -1;
    this.resize();
    const count = this.isMoving ? Math.min(this.moving.count, this.points.count) : this.points.count;
    return this.renderer.pick(this.scene(count), x * this.ratio, y * this.ratio, Math.ceil(5 * this.ratio));
  }

  under(x, y) {
    const i = this.pointAt(x, y);
    return i < 0 ? null : this.position(i);
  }

  async clicked(x, y) {
    const i = this.pointAt(x, y);
    if (this.isMeasuring) {
      if (i >= 0) this.ends.push(this.position(i));
      this.showMeasured();
    } else if (i < 0) {
      this.forget();
    } else {
      const { parts } = this.points;
      this.picked = { position: this.position(i), part: parts[i], number: i };
      const isPart = parts[i] !== 0xffffffff;
      const facts = isPart ? await this.decoding.ask("describe", { part: parts[i] }) : {};
      this.showCard(facts, isPart);
    }
    this.draw();
  }

  showCard(facts, isPart) {
    const { number, position, part } = this.picked;
    const rows = this.world(position).map((c, a) => ["xyz"[a], this.exact(c)]);
    const { colors, attributes } = this.points;
    if (colors) rows.push(["colour", [...colors.subarray(3 * number, 3 * number + 3)].join(", ")]);
    for (const { name, labels, values } of attributes) {
      const value = values[number];
      rows.push([name, labels ? labels[value] : Number.isNaN(value) ? "unknown" : Number(value.toPrecision(6))]);
    }
    rows.push([this.info.part, isPart ? part : "none: a point of its own"], ...Object.entries(facts));
    this.fillCard(rows);
    if (this.info.hasWords) {
      const button = document.createElement("button");
      button.id = "findAll";
      button.textContent = "find all like this (F)";
      button.onclick = () => this.findAll();
      element("card").append(button);
    }
  }

  fillCard(rows) {
    const table = document.createElement("table");
    for (const row of rows) {
      const line = table.insertRow();
      for (const text of row) line.insertCell().textContent = text;
    }
    element("card").replaceChildren(table);
    element("card").hidden = false;
  }

  showMeasured() {
    const n = this.ends.length;
    const rows = [["measure", n % 2 ? "click the other end" : "click one end"]];
    if (n >= 2 && n % 2 === 0) {
      const [p, q] = this.ends.slice(-2);
      const off = q.map((c, a) => c - p[a]);
      rows.unshift(["distance", this.exact(Math.hypot(...off))], ["level", this.exact(Math.hypot(off[0], off[1]))],
        ...off.map((c, a) => [`d${"xyz"[a]}`, this.exact(c)]));
    }
    this.fillCard(rows);
  }

  setMeasuring(isOn) {
    this.isMeasuring = isOn;
    element("measure").setAttribute("aria-pressed", String(isOn));
    this.canvas.classList.toggle("measuring", isOn);
    if (isOn) this.showMeasured();
    else {
      this.ends = [];
      element("card").hidden = true;
    }
    this.draw();
  }

  /** Shows all occurrences of the word that was clicked; all words again when it is asked twice. */
  async findAll() {
    if (!this.info.hasWords || (!this.picked && !this.found)) return;
    this.found = this.found ? null : await this.decoding.ask("sameAs", { part: this.picked.part });
    if (this.found) element("status").textContent = `${this.found.length.toLocaleString("en")} occurrences of this word`;
    this.recolor();
  }

  forget() {
    const hadFound = this.found !== null;
    this.picked = null;
    this.found = null;
    element("card").hidden = true;
    if (hadFound) this.recolor();
    this.draw();
  }

  // Cropping

  fillCrop() {
    const rows = [];
    const [low, high] = this.bounds;
    for (let a = 0; a < 3; a++) {
      for (const [end, start] of [["low", 0], ["high", 1000]]) {
        const label = document.createElement("label");
        const input = Object.assign(document.createElement("input"), { type: "range", min: 0, max: 1000, value: start });
        input.id = `crop-${"xyz"[a]}-${end}`;
        const output = document.createElement("output");
        const show = () => (output.textContent = (this.info.origin[a] + low[a] + (input.value / 1000) * (high[a] - low[a])).toFixed(2));
        input.oninput = () => {
          show();
          // Ends of the slider keep all, whatever rounding does.
          const isEnd = Number(input.value) === start;
          this[end][a] = isEnd ? (end === "low" ? -1e30 : 1e30) : low[a] + (input.value / 1000) * (high[a] - low[a]);
          this.drawBox();
        };
        show();
        label.append(`${"xyz"[a]} ${end === "low" ? "from" : "to"} `, output, input);
        rows.push(label);
      }
    }
    element("cropRows").replaceChildren(...rows);
    this.drawBox();
  }

  drawBox() {
    const [low, high] = this.bounds;
    const ends = [0, 1, 2].map((a) => [Math.max(low[a], this.low[a]), Math.min(high[a], this.high[a])]);
    const lines = [];
    for (let a = 0; a < 3; a++) {
      const [b, c] = [(a + 1) % 3, (a + 2) % 3];
      for (let k = 0; k < 4; k++) {
        for (let end = 0; end < 2; end++) {
          const p = [0, 0, 0];
          [p[a], p[b], p[c]] = [ends[a][end], ends[b][k & 1], ends[c][k >> 1]];
          lines.push(...p);
        }
      }
    }
    this.renderer.box.setPositions(Float32Array.from(lines));
    this.draw();
  }

  cropReset() {
    [this.low, this.high] = [[-1e30, -1e30, -1e30], [1e30, 1e30, 1e30]];
    this.fillCrop();
  }

  // What stands beside the map

  screenshot() {
    this.drawNow();
    this.canvas.toBlob((blob) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob);
      link.download = `${this.name.replace(/\.sfb$/, "")}.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    });
  }

  listen() {
    const redecode = () => {
      clearTimeout(this.wish);
      this.wish = setTimeout(() => this.decode().catch(showError), 120);
    };
    element("spacing").oninput = () => {
      if (this.info) element("spacingText").textContent = this.length(this.spacing);
      redecode();
    };
    element("measured").onchange = redecode;
    element("budget").onchange = redecode;
    element("mode").onchange = () => {
      this.mode = element("mode").value;
      if (element("mode").value === "normal" && !this.points.normals) redecode();
      else this.recolor();
    };
    const show = (id) => (element(`${id}Text`).textContent = Number(element(id).value).toFixed(1));
    for (const id of ["size", "light"]) {
      show(id);
      element(id).oninput = () => {
        show(id);
        this.draw();
      };
    }
    element("upwards").replaceChildren(...Object.keys(UPS).map((name) => new Option(name, name)));
    element("upwards").onchange = () => {
      this.camera.upwards = element("upwards").value;
      this.moved();
    };
    element("facing").onchange = () => {
      if (this.points.normals) this.draw();
      else redecode();
    };
    element("lines").onchange = () => this.toggleLines();
    element("crop").ontoggle = () => this.draw();
    element("cropReset").onclick = () => this.cropReset();
    element("measure").onclick = () => this.setMeasuring(!this.isMeasuring);
    element("reset").onclick = () => this.reset();
    element("shot").onclick = () => this.screenshot();
    element("keys").onclick = () => element("help").showModal();
    element("fold").onclick = () => this.fold();
    window.addEventListener("resize", () => this.draw());
    this.canvas.addEventListener("webglcontextlost", () => showError(new Error("the graphics driver stopped; load the page again")));
    const cameraKey = controlCamera(this.canvas, this.camera, {
      moved: () => this.moved(),
      clicked: (x, y) => this.clicked(x, y).catch(showError),
      doubleClicked: (x, y) => this.turnAbout(x, y),
      under: (x, y) => this.under(x, y),
    });
    window.addEventListener("keydown", (event) => this.key(event, cameraKey));
  }

  reset() {
    this.camera.reset();
    this.moved();
  }

  turnAbout(x, y) {
    const point = this.under(x, y);
    if (point) this.camera.target = point;
    this.moved();
  }

  fold() {
    const isFolded = element("panel").classList.toggle("folded");
    element("fold").setAttribute("aria-expanded", String(!isFolded));
  }

  key(event, cameraKey) {
    if (event.ctrlKey || event.metaKey || event.altKey || element("help").open) return;
    const isInput = ["INPUT", "SELECT", "TEXTAREA"].includes(event.target.tagName);
    if (isInput && event.key.startsWith("Arrow")) return;
    if (event.target.tagName === "SELECT" && /^[a-z]$/i.test(event.key)) return;
    const step = (id, by) => {
      element(id).value = Number(element(id).value) + by;
      element(id).dispatchEvent(new Event("input"));
    };
    const next = (id) => {
      const select = element(id);
      select.selectedIndex = (select.selectedIndex + 1) % select.length;
      select.dispatchEvent(new Event("change"));
    };
    const check = (id) => element(id).offsetParent && element(id).click();
    const keys = {
      m: () => this.setMeasuring(!this.isMeasuring), r: () => this.reset(), s: () => this.screenshot(), p: () => this.fold(),
      b: () => (element("crop").open = !element("crop").open), "?": () => element("help").showModal(),
      t: () => check("measured"), l: () => check("lines"), h: () => check("facing"), f: () => this.findAll(),
      e: () => {
        element("light").value = Number(element("light").value) > 0 ? 0 : 1;
        element("light").dispatchEvent(new Event("input"));
      },
      c: () => next("mode"), u: () => next("upwards"),
      "[": () => step("spacing", -0.5), "]": () => step("spacing", 0.5),
      ",": () => step("size", -0.2), ".": () => step("size", 0.2),
      escape: () => {
        this.setMeasuring(false);
        this.forget();
      },
    };
    const found = keys[event.key.toLowerCase()];
    if (found) found();
    else if (!this.points || !cameraKey(event)) return;
    event.preventDefault();
  }
}

/** Says what is wrong, for people. */
function showError(error) {
  element("message").textContent = error.message;
  element("message").hidden = false;
  element("status").textContent = "";
}

function bytesOf(text) {
  const binary = atob(text.trim());
  return Uint8Array.from(binary, (character) => character.charCodeAt(0));
}

/**
 * Opens the model that the page holds; `decoder` is the source of the decoder, `script` runs a source on the page,
 * `against` is null or the bytes of the distances to a second cloud. Where there is a link, it opens what that leads to.
 */
export function run(decoder, script, against) {
  try {
    const decoding = new Decoding(decoder, script);
    const link = element("link").textContent;
    const source = link ? new URL(link, location.href).href : bytesOf(element("model").textContent);
    const viewer = new Viewer(source, document.title, decoding, against);
    window.surfabet = viewer;
    viewer.ready = viewer.start().then(() => true, (error) => {
      showError(error);
      return false;
    });
  } catch (error) {
    showError(error);
  }
}
