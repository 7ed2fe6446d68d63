// Section 5.2 of docs/format.md: sides, shapes, and depths in integers.

/** The pairs (i, j) of the shapes. */
export const DEGREES = [];
for (let order = 0; order <= 5; order++) for (let j = 0; j <= order; j++) DEGREES.push([order - j, j]);

/** P_k at x in [-1, 1]. */
export function shapeValue(k, x) {
  if (k === 0) return 1;
  return k === 1 ? Math.sqrt(3) * x : Math.SQRT2 * Math.cos((k * Math.PI * (x + 1)) / 2);
}

/** Derivative of P_k at x. */
export function shapeSlope(k, x) {
  if (k === 0) return 0;
  if (k === 1) return Math.sqrt(3);
  return (-Math.SQRT2 * k * Math.PI * Math.sin((k * Math.PI * (x + 1)) / 2)) / 2;
}

/** Depth axis, columns' axis and rows' axis of a side. */
export function axesOf(side) {
  const d = side >> 1;
  return [d, (d + 1) % 3, (d + 2) % 3];
}

/** Integer values of the shapes at the half pixels of patches of each level (5.2). */
export class Basis {
  constructor(width) {
    this.half = 2 * width;
    this.values = [];
    for (let h = 0; h <= this.half; h++) {
      const x = (2 * h) / this.half - 1;
      this.values.push(Array.from({ length: 6 }, (_, k) => Math.round(4096 * shapeValue(k, x))));
    }
  }

  /** D of a patch at a half-pixel position from its first corner, in depth steps times 4096. */
  depth(patch, g, h) {
    const c = patch.coefficients;
    const H = this.half;
    if (g < 0 || g > H || h < 0 || h > H) {
      const A = (at) => Math.trunc(((2 * at - H) * 7094) / H);
      return 4096 * c[0] + (c.length > 1 ? c[1] * A(g) : 0) + (c.length > 2 ? c[2] * A(h) : 0);
    }
    const x = this.values[g];
    const y = this.values[h];
    let depth = 4096 * c[0];
    for (let k = 1; k < c.length; k++) {
      if (c[k] !== 0) {
        const [i, j] = DEGREES[k];
        depth += c[k] * Math.floor((x[i] * y[j]) / 4096);
      }
    }
    return depth;
  }
}
