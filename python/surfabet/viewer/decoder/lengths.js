// Lengths for people, in the unit that the note of a file names.

/** The unit of lengths that a note ends in; `m` where it names none. Only what is safe in a page counts as a name. */
export function unitIn(note) {
  return /lengths in ([\w.-]+)$/.exec(note ?? "")?.[1] ?? "m";
}

/** A small length: metres as `8.3 mm`, others as `0.0273 ft`. */
export function smallText(length, unit) {
  return unit === "m" ? `${(1000 * length).toFixed(1)} mm` : `${Number(length.toPrecision(3))} ${unit}`;
}

/** A length of some size: metres as `12.5 cm`, others as `0.41 ft`. */
export function middleText(length, unit) {
  return unit === "m" ? `${(100 * length).toFixed(1)} cm` : `${Number(length.toPrecision(3))} ${unit}`;
}

/** Any length: metres in a unit that suits it, others in their own. */
export function lengthText(length, unit) {
  const size = Math.abs(length);
  if (size >= 1 || unit !== "m") return `${size < 1 ? Number(length.toPrecision(3)) : length.toFixed(3)} ${unit}`;
  return size < 0.01 ? `${(1000 * length).toPrecision(2)} mm` : `${(100 * length).toPrecision(3)} cm`;
}
