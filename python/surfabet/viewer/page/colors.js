// Colours of points by what they show.

/** Blue over green to red, in equal steps of lightness about. */
const RAMP = [
  [48, 18, 59], [70, 107, 227], [40, 188, 235], [50, 242, 152], [164, 252, 60], [238, 207, 58], [251, 126, 33], [208, 47, 5],
];

/** Of points without a value. */
const UNKNOWN = [120, 120, 120];

function ramp(share, into, at) {
  const place = Math.min(Math.max(share, 0), 1) * (RAMP.length - 1);
  const low = Math.min(Math.floor(place), RAMP.length - 2);
  for (let c = 0; c < 3; c++) {
    into[at + c] = RAMP[low][c] + (place - low) * (RAMP[low + 1][c] - RAMP[low][c]);
  }
}

/** A colour of its own for a number: hues at the golden angle. */
function ownColor(number) {
  const hue = (number * 0.6180339887) % 1;
  const light = 0.55 + 0.25 * ((number * 0.7548776662) % 1);
  return [0, 1, 2].map((c) => {
    const wave = Math.abs(((hue * 6 + [0, 4, 2][c]) % 6) - 3) - 1;
    return 255 * (light + 0.35 * (Math.min(Math.max(wave, 0), 1) - 0.5));
  });
}

/** The values between which all but a hundredth at each end lie, from a sample. */
export function limits(values, stride = 1, first = 0) {
  const sample = [];
  const n = Math.floor(values.length / stride);
  const step = Math.max(1, Math.floor(n / 5000));
  for (let i = 0; i < n; i += step) {
    const value = Number(values[stride * i + first]);
    if (!Number.isNaN(value)) sample.push(value);
  }
  sample.sort((a, b) => a - b);
  const low = sample[Math.floor(0.01 * (sample.length - 1))] ?? 0;
  const high = sample[Math.ceil(0.99 * (sample.length - 1))] ?? 1;
  return high > low ? [low, high] : [low, low + 1];
}

function byValue(count, value, [low, high]) {
  const colors = new Uint8Array(3 * count);
  for (let i = 0; i < count; i++) {
    const share = (value(i) - low) / (high - low);
    if (Number.isNaN(share)) colors.set(UNKNOWN, 3 * i);
    else ramp(share, colors, 3 * i);
  }
  return colors;
}

/** The values at both ends of the colours, for colourings by a number; null for others. */
export function rangeOf(points, mode) {
  if (mode === "height") return limits(points.positions, 3, 2);
  const attribute = points.attributes.find(({ name }) => mode === `attribute ${name}`);
  return attribute && !attribute.labels ? limits(attribute.values) : null;
}

/** The colours of a range, as CSS has gradients. */
export const GRADIENT = `linear-gradient(to right, ${RAMP.map((color) => `rgb(${color.join(" ")})`).join(", ")})`;

/** The ways in which points of a model can be coloured: names that `colorsOf` takes. */
export function colorModes(points, part) {
  const modes = [];
  if (points.colors) modes.push(["color", "colour"]);
  for (const { name } of points.attributes) modes.push([`attribute ${name}`, name]);
  return [...modes, ["height", "height"], ["normal", "normal"], ["part", part]];
}

/** Three bytes per point. */
export function colorsOf(points, mode) {
  const { count, positions, normals, parts } = points;
  if (mode === "color" && points.colors) return points.colors;
  const range = rangeOf(points, mode);
  if (mode === "height") return byValue(count, (i) => positions[3 * i + 2], range);
  if (mode === "normal" && normals) {
    return Uint8Array.from(normals, (c) => 127.5 + 127.5 * c);
  }
  const attribute = points.attributes.find(({ name }) => mode === `attribute ${name}`);
  if (range) return byValue(count, (i) => attribute.values[i], range);
  const colors = new Uint8Array(3 * count);
  const numbers = attribute ? attribute.values : mode === "part" ? parts : null;
  const known = new Map();
  for (let i = 0; i < count; i++) {
    let color = [150, 155, 160];
    if (numbers) {
      const number = numbers[i];
      color = known.get(number);
      if (color === undefined) known.set(number, (color = number === 0xffffffff ? [120, 120, 120] : ownColor(number + 1)));
    }
    colors.set(color, 3 * i);
  }
  return colors;
}

/** The same colours with all parts but some greyed. */
export function highlighted(colors, parts, wanted) {
  const set = new Set(wanted);
  const result = new Uint8Array(colors.length);
  for (let i = 0; i < parts.length; i++) {
    const isWanted = set.has(parts[i]);
    for (let c = 0; c < 3; c++) {
      result[3 * i + c] = isWanted ? [255, 170, 20][c] * 0.6 + 0.4 * colors[3 * i + c] : 60 + 0.2 * colors[3 * i + c];
    }
  }
  return result;
}
