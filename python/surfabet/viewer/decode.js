#!/usr/bin/env node
// Decodes .sfb files in Node: one line of JSON about each, and the points as raw little-endian numbers.
//
// node viewer/decode.js room.sfb out [resolution|-] [measured] writes out.json, out.positions, out.colors ...

import { readFileSync, writeFileSync } from "node:fs";
import { openModel } from "./decoder/model.js";

const [path, out, resolution = "-", measured = ""] = process.argv.slice(2);

try {
  const began = process.cpuUsage();
  const model = openModel(new Uint8Array(readFileSync(path)));
  const opened = process.cpuUsage(began);
  const points = model.decode({
    resolution: resolution === "-" ? null : Number(resolution),
    asMeasured: measured === "measured",
    normals: true,
    maxPoints: 100e6,
  });
  const decoded = process.cpuUsage(began);
  const attributes = points.attributes.map(({ name, labels }) => ({ name, labels }));
  const about = {
    method: model.name, origin: model.origin, nPoints: model.nPoints, nParts: model.nParts, spacing: model.spacing,
    keepsThickness: model.keepsThickness, note: model.note, points: points.positions.length / 3, attributes,
    columns: Object.keys(points).filter((name) => ArrayBuffer.isView(points[name])),
    seconds: { open: opened.user / 1e6, decode: (decoded.user - opened.user) / 1e6 },
  };
  writeFileSync(`${out}.json`, JSON.stringify(about));
  for (const name of about.columns) writeFileSync(`${out}.${name}`, points[name]);
  const lines = model.lines();
  if (lines) writeFileSync(`${out}.lines`, lines.positions);
  points.attributes.forEach(({ values }, i) => writeFileSync(`${out}.attribute${i}`, values));
} catch (error) {
  console.error(`${path}: ${error.name}: ${error.message}`);
  if (error.name !== "SfbError") console.error(error.stack);
  process.exit(error.name === "SfbError" ? 1 : 3);
}
