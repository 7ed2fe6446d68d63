// A camera that orbits a target.

const FIELD_OF_VIEW = (50 * Math.PI) / 180;

const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Directions that may be up, each as the rows that take x, y and z of a frame with z up to it. */
export const UPS = {
  "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  "y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
  "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
  "x": [[0, 1, 0], [0, 0, 1], [1, 0, 0]],
  "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
};

/** The product of two matrices in columns. */
function multiply(a, b) {
  const result = new Float32Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + row] * b[4 * column + k];
      result[4 * column + row] = sum;
    }
  }
  return result;
}

export class Camera {
  constructor() {
    this.target = [0, 0, 0];
    this.distance = 1;
    this.yaw = 0.8;
    this.pitch = 0.5;
    this.width = 1;
    this.height = 1;
    this.middle = [0, 0, 0];
    this.radius = 1;
    /** Distance of the farthest point from the middle. */
    this.reach = 1;
    this.upwards = "z";
  }

  /** A direction of a frame with z up. */
  turned(v) {
    const rows = UPS[this.upwards];
    return [0, 1, 2].map((a) => v[0] * rows[0][a] + v[1] * rows[1][a] + v[2] * rows[2][a]);
  }

  /** Shows a box as a whole. */
  frame(low, high) {
    this.middle = low.map((c, a) => (c + high[a]) / 2);
    this.radius = Math.max(Math.hypot(...subtract(high, low)) / 2, 1e-6);
    this.reset();
  }

  reset() {
    this.target = [...this.middle];
    const aspect = Math.min(1, this.width / this.height);
    this.distance = (0.9 * this.radius) / Math.tan(FIELD_OF_VIEW / 2) / aspect;
    this.yaw = 0.8;
    this.pitch = 0.5;
  }

  /** Direction from the target to the eye. */
  get back() {
    const [c, s] = [Math.cos(this.pitch), Math.sin(this.pitch)];
    return this.turned([c * Math.cos(this.yaw), c * Math.sin(this.yaw), s]);
  }

  get right() {
    return this.turned([-Math.sin(this.yaw), Math.cos(this.yaw), 0]);
  }

  get up() {
    const [c, s] = [Math.cos(this.pitch), Math.sin(this.pitch)];
    return this.turned([-s * Math.cos(this.yaw), -s * Math.sin(this.yaw), c]);
  }

  get eye() {
    return this.back.map((c, a) => this.target[a] + this.distance * c);
  }

  /** Height of a pixel at a distance of one. */
  get pixel() {
    return (2 * Math.tan(FIELD_OF_VIEW / 2)) / this.height;
  }

  orbit(dx, dy) {
    this.yaw -= dx * 0.006;
    this.pitch = Math.min(Math.max(this.pitch + dy * 0.006, -1.5707), 1.5707);
  }

  pan(dx, dy) {
    const scale = this.pixel * this.distance;
    this.target = this.target.map((c, a) => c + scale * (dy * this.up[a] - dx * this.right[a]));
  }

  /** Comes nearer (factor below one) so that `at` stays where it is on the screen. */
  zoom(factor, at) {
    const limited = Math.min(Math.max(this.distance * factor, this.radius * 1e-4), this.radius * 30);
    const share = limited / this.distance;
    this.distance = limited;
    this.target = this.target.map((c, a) => at[a] + share * (c - at[a]));
  }

  /** The point under a place of the screen at the depth of the target. */
  onTargetPlane(x, y) {
    const scale = this.pixel * this.distance;
    const [dx, dy] = [(x - this.width / 2) * scale, (this.height / 2 - y) * scale];
    return this.target.map((c, a) => c + dx * this.right[a] + dy * this.up[a]);
  }

  get near() {
    return this.far / 8000;
  }

  get far() {
    return Math.hypot(...subtract(this.eye, this.middle)) + 1.05 * Math.max(this.reach, this.radius);
  }

  /** From positions about the model's origin to clip space. */
  matrix() {
    const { eye, near, far } = this;
    const [x, y, z] = [this.right, this.up, this.back];
    const view = [
      x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1,
    ];
    const f = 1 / Math.tan(FIELD_OF_VIEW / 2);
    const range = 1 / (near - far);
    const projection = [
      (f * this.height) / this.width, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) * range, -1, 0, 0, 2 * near * far * range, 0,
    ];
    return multiply(projection, view);
  }

  /** Place on the screen of a position about the origin, in CSS pixels; null behind the eye. */
  project(p) {
    const off = subtract(p, this.eye);
    const depth = -dot(off, this.back);
    if (depth < this.near) return null;
    const scale = 1 / (this.pixel * depth);
    return [this.width / 2 + dot(off, this.right) * scale, this.height / 2 - dot(off, this.up) * scale];
  }
}
