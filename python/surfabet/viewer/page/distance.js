// Distances of a map's surface to a second cloud, in cells, as `_distance_field.py` packs them.

/** Rings of cells around that of a point in which the nearest cell of the surface is looked for. */
const REACH = 2;

export class DistanceField {
  /** `bytes`: a line of JSON, gaps between the numbers of cells, codes of distances. */
  constructor(bytes) {
    const end = bytes.indexOf(10);
    Object.assign(this, JSON.parse(new TextDecoder().decode(bytes.subarray(0, end))));
    let at = end + 1;
    let key = 0;
    this.codes = new Map();
    const first = bytes.length - this.count;
    for (let i = 0; i < this.count; i++) {
      let unit = 1;
      let byte;
      do {
        byte = bytes[at++];
        key += (byte & 127) * unit;
        unit *= 128;
      } while (byte & 128);
      this.codes.set(key, bytes[first + i]);
    }
    this.values = Float32Array.from({ length: 256 }, (_, code) => (code ? this.least * this.ratio ** (code - 1) : 0));
    this.offsets = [];
    for (let z = -REACH; z <= REACH; z++) {
      for (let y = -REACH; y <= REACH; y++) {
        for (let x = -REACH; x <= REACH; x++) this.offsets.push([x, y, z]);
      }
    }
    this.offsets.sort((a, b) => Math.hypot(...a) - Math.hypot(...b));
  }

  /** Metres of each point; not a number where no surface is near, as for points far off the thin surface. */
  at(positions) {
    const { low, side, dimensions: [nx, ny, nz], codes, offsets, values } = this;
    const found = new Float32Array(positions.length / 3);
    for (let i = 0; i < found.length; i++) {
      const [x, y, z] = [0, 1, 2].map((a) => Math.floor((positions[3 * i + a] - low[a]) / side));
      found[i] = NaN;
      for (const [dx, dy, dz] of offsets) {
        const [u, v, w] = [x + dx, y + dy, z + dz];
        if (u < 0 || v < 0 || w < 0 || u >= nx || v >= ny || w >= nz) continue;
        const code = codes.get((w * ny + v) * nx + u);
        if (code === undefined) continue;
        found[i] = values[code];
        break;
      }
    }
    return found;
  }
}
