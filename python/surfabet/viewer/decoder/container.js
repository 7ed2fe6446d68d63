// Section 1 of docs/format.md: magic, versions, family, required features, checked sections.

import { Fields, SfbError, crc32c, fail } from "./bytes.js";

const MAGIC = [0x89, 0x53, 0x46, 0x42];
const MAX_SECTIONS = 256;
/** Longest note, bytes. */
export const MAX_NOTE = 1024;

export const ALPHABET = 1;
export const PATCHES = 2;
export const PLANES = 3;
export const GAS = 4;

export const SHARED_DICTIONARY = 1;
export const LATTICE = 2;
export const BIC_ALPHABET = 4;
export const ATTRIBUTES = 8;
export const UNBLENDED = 16;
export const HIERARCHY = 32;
export const BESIDE = 64;
export const TILES = 128;
export const FORWARD_BOUND = 256;
export const NEAR_POINTS = 512;
export const INSTANCES = 1024;
export const WHOLE_FIELDS = 2048;
export const BORDERS = 4096;
export const POINT_PATTERNS = 8192;
export const ESTIMATES = 32768;

/** Set by development states before the first release, whose estimates were others. */
const RETIRED = 16384n;

/** All features that this decoder knows. A new one is refused by name of the release until it is added here. */
const KNOWN =
  SHARED_DICTIONARY | LATTICE | BIC_ALPHABET | ATTRIBUTES | UNBLENDED | HIERARCHY | BESIDE | TILES |
  FORWARD_BOUND | NEAR_POINTS | INSTANCES | WHOLE_FIELDS | BORDERS | POINT_PATTERNS |
  ESTIMATES;

function newer(what, [major, minor]) {
  return new SfbError(
    `the file was made by a newer version: it has ${what}, and needs surfabet ${major}.${minor} or a ` +
      "later one. Write the page again with `surfabet view` of that version",
  );
}

/** No header is longer. */
export const HEADER_BYTES = 8192;

/** What a file begins with: `{family, features, table, end}`; `table` has tag, length and checksum of each section. */
export function openHeader(bytes) {
  const begins = Math.min(4, bytes.length);
  for (let i = 0; i < begins; i++) {
    if (bytes[i] !== MAGIC[i]) throw new SfbError("this is no .sfb file: it does not begin as one");
  }
  const fields = new Fields(bytes, "HEAD");
  fields.take(4);
  const version = fields.u8();
  const needed = [fields.u8(), fields.u8()];
  if (version !== 1) throw newer(`version ${version} of the container`, needed);
  const family = fields.u8();
  const features = fields.big();
  const table = [];
  const count = fields.varint(MAX_SECTIONS, "a number of sections");
  for (let i = 0; i < count; i++) {
    const tag = String.fromCharCode(...fields.raw(4));
    table.push({ tag, length: fields.varint(), checksum: fields.u32() });
  }
  const end = fields.at;
  if (crc32c(bytes.subarray(0, end)) !== fields.u32()) {
    fail("HEAD", "its checksum does not match");
  }
  if (features & RETIRED) {
    throw new SfbError(
      "the file was made by a development state before surfabet 0.1, with estimates that no release reads: " +
        "encode its cloud again",
    );
  }
  const unknown = features & ~BigInt(KNOWN);
  if (unknown !== 0n) throw newer(`features unknown here (bits ${unknown.toString(2)})`, needed);
  if (family < ALPHABET || family > GAS) throw newer(`family ${family}`, needed);
  return { family, features: Number(features), table, end: fields.at };
}

/** The bytes of a file as `{family, features, sections, note}`; `sections` maps tags to bytes, in order. */
export function openContainer(bytes) {
  const { family, features, table, end } = openHeader(bytes);
  const fields = new Fields(bytes, "HEAD");
  fields.take(end);
  return { family, features, ...readSections(bytes, fields, table) };
}

function readSections(bytes, fields, table) {
  const total = table.reduce((sum, { length }) => sum + length, 0);
  const left = bytes.length - fields.at;
  if (total > left) fail("HEAD", `the file is cut short: ${total - left} bytes are missing`);
  if (total < left) fail("HEAD", `${left - total} bytes too many at the end of the file`);
  const sections = new Map();
  let note = "";
  for (const { tag, length, checksum } of table) {
    if (!/^[!-~]{4}$/.test(tag)) fail("HEAD", "a section's tag that is not four printable characters");
    if (tag === "HEAD" || sections.has(tag)) fail("HEAD", `section ${tag} occurs twice`);
    const content = fields.raw(length);
    if (crc32c(content) !== checksum) fail(tag, "its checksum does not match");
    sections.set(tag, content);
  }
  if (sections.has("note")) note = new TextDecoder().decode(sections.get("note"));
  for (const tag of [...sections.keys()]) if (/^[a-z]/.test(tag)) sections.delete(tag);
  return { sections, note };
}

/** The sections of these tags, each of which must be there, and no others. */
export function expectSections(sections, tags) {
  for (const tag of sections.keys()) {
    if (!tags.includes(tag)) fail(tag, "a section that this kind of model does not have");
  }
  return tags.map((tag) => {
    const content = sections.get(tag);
    if (content === undefined) fail(tag, "the section is missing");
    return content;
  });
}

/** Refuses features that this kind of model does not have. */
export function expectFeatures(features, allowed) {
  if (features & ~allowed) {
    fail("HEAD", `required features ${features.toString(2)} that do not belong to this kind of model`);
  }
}

/** Refuses files that name their vocabulary by its hash. */
export function expectOwnVocabulary(features, hash, what) {
  if (!(features & SHARED_DICTIONARY)) return;
  const text = Array.from(hash, (byte) => byte.toString(16).padStart(2, "0")).join("");
  throw new SfbError(
    `the file has no ${what} of its own: it names that of another file, ${text}. A page needs both: ` +
      "learn the model without a given vocabulary",
  );
}
