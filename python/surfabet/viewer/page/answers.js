// What the page asks of the decoder, beside it or in a worker.

import { openModel } from "../decoder/model.js";
import { DistanceField } from "./distance.js";

let model = null;
/** Distances to a second cloud, if there is one. */
let field = null;

/** The finest spacing from `wanted` on that makes no more points than the budget. */
function affordable(wanted, asMeasured, budget) {
  let spacing = wanted;
  for (let i = 0; i < 200 && model.mostPoints(spacing, asMeasured) > budget; i++) spacing *= 1.1;
  return spacing;
}

/** The same order for all, in which every beginning is spread over the whole scene. */
function shuffled(count) {
  const order = new Uint32Array(count);
  let state = 1;
  for (let i = 0; i < count; i++) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    const j = Math.floor((state / 4294967296) * (i + 1));
    order[i] = order[j];
    order[j] = i;
  }
  return order;
}

function reordered(array, order) {
  const width = array.length / order.length;
  const result = new array.constructor(array.length);
  for (let i = 0; i < order.length; i++) {
    for (let k = 0; k < width; k++) result[width * i + k] = array[width * order[i] + k];
  }
  return result;
}

/** Takes a model; what the page says of it. */
function opened(found, size, against) {
  model = found;
  field = against ? new DistanceField(against) : null;
  return {
    method: model.name, part: model.part, origin: model.origin, nPoints: model.nPoints, nParts: model.nParts,
    spacing: model.spacing, keepsThickness: model.keepsThickness, note: model.note, unit: model.unit, bytes: size,
    hasWords: model.method.sameAs !== undefined, isComplete: model.isComplete,
    against: field && `distance to ${field.name} (${model.unit})`,
  };
}

/** Points at the spacing that was asked for, in an order of which every beginning is spread over the scene. */
function decoded({ spacing, asMeasured, normals, budget }) {
  const used = affordable(spacing, asMeasured, budget);
  // One spacing for all: words would have their own, and a gas its neurons alone.
  const points = model.decode({ resolution: used, asMeasured, normals, maxPoints: 2 * budget });
  const order = shuffled(points.positions.length / 3);
  const result = { spacing: used, count: order.length, attributes: [] };
  for (const name of ["positions", "parts", "colors", "normals"]) {
    result[name] = points[name] ? reordered(points[name], order) : null;
  }
  for (const attribute of points.attributes) {
    result.attributes.push({ ...attribute, values: reordered(attribute.values, order) });
  }
  if (field) {
    result.attributes.unshift({ name: `distance to ${field.name} (${model.unit})`, labels: null, values: field.at(result.positions) });
  }
  return result;
}

const answers = {
  open({ bytes, against }) {
    return opened(openModel(bytes, { isGeometryOnly: true }), bytes.length, against);
  },

  complete: () => model.complete(),

  decode(request) {
    if (!model.choose) return decoded(request);
    const { place, spacing, asMeasured, budget } = request;
    return model.choose({ place, resolution: spacing, asMeasured, budget }).then((tiles) => {
      model.content.tiles = tiles;
      return { ...decoded(request), nShown: tiles.length };
    });
  },

  lines: () => model.lines(),
  describe: ({ part }) => model.describe(part),
  sameAs: ({ part }) => model.sameAs(part),
};

/** Opens a file of which there is only a URL; `open(url)` gives its model and size. */
export function openBy(open) {
  answers.link = async ({ url, against }) => {
    const { found, size } = await open(url);
    return { ...opened(found, size, against), nTiles: found.index?.length, bounds: found.bounds };
  };
}

/** Answers one message of the page, at once or by a promise. */
export function answer({ id, kind, ...request }) {
  const failed = (error) => ({ id, error: error.message, name: error.name });
  try {
    const result = answers[kind](request);
    return result instanceof Promise ? result.then((result) => ({ id, result }), failed) : { id, result };
  } catch (error) {
    return failed(error);
  }
}

/** In a worker: answers all messages of the page. */
export function listen(scope) {
  const post = (message, kind) => {
    const { result } = message;
    const buffers = ["positions", "parts", "colors", "normals"].flatMap((name) => result?.[name]?.buffer ?? []);
    scope.postMessage(message, kind === "decode" ? buffers : []);
  };
  scope.onmessage = ({ data }) => {
    const found = answer(data);
    if (found instanceof Promise) found.then((message) => post(message, data.kind));
    else post(found, data.kind);
  };
}
