// Sizes and colours as several kinds of models store them (7.4 of docs/format.md).

/** The size of a code, in units. */
export function sizeOfCode(code) {
  return code === 0 ? 0 : 2 ** ((code - 1) / 4);
}

/** Red, green and blue of luma, orange and green chroma in steps, not rounded. */
export function colorOfCode([Y, O, G], step) {
  const low = (Y - G / 2) * step;
  return [low + (O / 2) * step, (Y + G / 2) * step, low - (O / 2) * step];
}
