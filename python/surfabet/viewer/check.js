// Checks of the decoder that need no other decoder: the stream of docs/format.md 2.7, and hostile files.
//
// node viewer/check.js stream
// node viewer/check.js hostile FILE... truncates files and changes single bits, with checksums mended

import { readFileSync } from "node:fs";
import { Fields, SfbError, crc32c } from "./decoder/bytes.js";
import { Bits, Signed, Stream, Symbols, Unsigned } from "./decoder/entropy.js";
import { openModel } from "./decoder/model.js";

const BYTES = [
  0x72, 0x54, 0x01, 0x49, 0x65, 0xc1, 0x9c, 0x61, 0x5c, 0x8a, 0x24, 0x87, 0xcf, 0x50, 0x49, 0x27, 0x5b, 0x8e, 0x55,
  0x33, 0x59, 0xaf, 0x6b, 0xa1, 0x4b, 0xff, 0x27, 0x92, 0xc1, 0x46, 0x84,
];

function checkStream() {
  let state = 12345;
  const next = () => {
    state = (Math.imul(1664525, state) + 1013904223) >>> 0;
    return state >>> 16;
  };
  const stream = new Stream(Uint8Array.from(BYTES), "TEST");
  const models = { bit: new Bits(1), unsigned: new Unsigned(), signed: new Signed(), symbol: new Symbols(11) };
  for (let i = 0; i < 60; i++) {
    const [wanted, found] = [
      () => [next() % 8 === 0 ? 1 : 0, stream.bit(models.bit, 0)],
      () => [next() % 32, stream.bypass(5)],
      () => [(next() % 1000) >> (next() % 10), stream.unsigned(models.unsigned)],
      () => [(next() % 7) - 3, stream.signed(models.signed)],
      () => [next() % 11, stream.symbol(models.symbol)],
    ][i % 5]();
    if (wanted !== found) throw new Error(`symbol ${i} is ${found}, not ${wanted}`);
  }
  stream.end();
  console.log("60 symbols");
}

/** Where the sections of a file begin, their lengths and the places of their checksums. */
function layout(bytes) {
  const fields = new Fields(bytes, "HEAD");
  fields.take(8);
  fields.big();
  const table = Array.from({ length: fields.varint() }, () => {
    fields.take(4);
    const length = fields.varint();
    return { length, checksum: fields.take(4) };
  });
  const end = fields.at;
  let at = end + 4;
  for (const section of table) {
    section.at = at;
    at += section.length;
  }
  return { table, end };
}

/** Opens and decodes; true when the file is refused with a clear error. Any other error is passed on. */
function isRefused(bytes) {
  try {
    const model = openModel(bytes);
    const spacing = model.spacing;
    if (model.mostPoints(spacing) < 1e5) model.decode();
    model.lines();
    return false;
  } catch (error) {
    if (error instanceof SfbError && error.message.length > 10) return true;
    throw error;
  }
}

function checkHostile(path) {
  const bytes = new Uint8Array(readFileSync(path));
  let refused = 0;
  for (let length = 0; length < bytes.length; length++) {
    if (!isRefused(bytes.slice(0, length))) throw new Error(`${path} cut to ${length} bytes is accepted`);
  }
  for (let bit = 0; bit < 8 * bytes.length; bit += 5) {
    const changed = bytes.slice();
    changed[bit >> 3] ^= 1 << (bit & 7);
    if (!isRefused(changed)) throw new Error(`${path} with bit ${bit} changed is accepted`);
  }
  const { table, end } = layout(bytes);
  let mended = 0;
  for (const { at, length, checksum } of table) {
    const stride = Math.max(1, Math.floor(length / 12));
    for (let i = 0; i < length; i += stride) {
      const changed = bytes.slice();
      changed[at + i] ^= 1 << (i % 8);
      const view = new DataView(changed.buffer);
      view.setUint32(checksum, crc32c(changed.subarray(at, at + length)), true);
      view.setUint32(end, crc32c(changed.subarray(0, end)), true);
      refused += isRefused(changed) ? 1 : 0;
      mended++;
    }
  }
  console.log(`${path}: of ${mended} changed files with right checksums ${refused} are refused`);
}

const [what, ...paths] = process.argv.slice(2);
if (what === "stream") checkStream();
else if (what === "hostile") paths.forEach(checkHostile);
else throw new Error("node viewer/check.js stream | hostile FILE...");
