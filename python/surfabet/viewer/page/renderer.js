// Points and lines by WebGL2, with eye-dome lighting.

const POINT_VERTEX = `#version 300 es
uniform mat4 matrix;
uniform vec3 low;
uniform vec3 high;
uniform float size;
uniform float least;
uniform float most;
uniform vec4 eye;
in vec3 position;
in vec3 color;
in vec3 normal;
flat out vec3 shade;
flat out int number;
void main() {
  gl_Position = matrix * vec4(position, 1.0);
  if (any(lessThan(position, low)) || any(greaterThan(position, high))) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  // What is seen from behind is left out where that is wanted.
  if (eye.w > 0.0 && dot(normal, eye.xyz - position) < 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = clamp(size / gl_Position.w, least, most);
  shade = color;
  number = gl_VertexID;
}`;

const POINT_FRAGMENT = `#version 300 es
precision highp float;
flat in vec3 shade;
out vec4 result;
void main() { result = vec4(shade, 1.0); }`;

const NUMBER_FRAGMENT = `#version 300 es
precision highp float;
flat in highp int number;
out vec4 result;
void main() {
  int n = number + 1;
  result = vec4(float(n & 255), float((n >> 8) & 255), float((n >> 16) & 255), float((n >> 24) & 255)) / 255.0;
}`;

const LINE_VERTEX = `#version 300 es
uniform mat4 matrix;
uniform vec3 low;
uniform vec3 high;
in vec3 position;
out vec3 place;
void main() {
  gl_Position = matrix * vec4(position, 1.0);
  // A little nearer than the surface that it lies on.
  gl_Position.z -= 0.0005 * gl_Position.w;
  place = position;
}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 low;
uniform vec3 high;
uniform vec3 tint;
in vec3 place;
out vec4 result;
void main() {
  if (any(lessThan(place, low)) || any(greaterThan(place, high))) discard;
  result = vec4(tint, 1.0);
}`;

const SCREEN_VERTEX = `#version 300 es
void main() {
  vec2 corner = vec2(float((gl_VertexID & 1) * 4 - 1), float((gl_VertexID >> 1) * 4 - 1));
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

// Neighbours nearer to the eye shade a pixel (C. Boucheny: Interactive scientific visualization of large datasets, 2009).
const SCREEN_FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D colors;
uniform highp sampler2D depths;
uniform float near;
uniform float far;
uniform float strength;
uniform vec3 background;
uniform ivec2 last;
out vec4 result;
// Depth over that of the far plane; as far as that where nothing is drawn.
float depthAt(ivec2 at) {
  float d = texelFetch(depths, at, 0).r;
  return d >= 1.0 ? 1.0 : 2.0 * near / (far + near - (2.0 * d - 1.0) * (far - near));
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 drawn = texelFetch(colors, at, 0);
  vec3 color = drawn.a > 0.0 ? drawn.rgb : background;
  if (strength > 0.0) {
    float own = depthAt(at);
    int reach = drawn.a > 0.0 ? 2 : 1;
    vec4 beside = vec4(
      depthAt(max(at - ivec2(reach, 0), 0)), depthAt(max(at - ivec2(0, reach), 0)),
      depthAt(min(at + ivec2(reach, 0), last)), depthAt(min(at + ivec2(0, reach), last)));
    // The difference of the logarithms, about, and no more of each than of a step at an edge.
    vec4 nearer = clamp(1.44 * (1.0 - beside / own), 0.0, 0.4);
    color *= exp(-strength * (nearer.x + nearer.y + nearer.z + nearer.w));
  }
  result = vec4(color, 1.0);
}`;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.bindAttribLocation(made, 0, "position");
  gl.bindAttribLocation(made, 1, "color");
  gl.bindAttribLocation(made, 2, "normal");
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const uniforms = {};
  const count = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS);
  for (let i = 0; i < count; i++) {
    const { name } = gl.getActiveUniform(made, i);
    uniforms[name] = gl.getUniformLocation(made, name);
  }
  return { made, uniforms };
}

/** An array on the graphics card. */
class VertexData {
  constructor(gl) {
    this.gl = gl;
    this.array = gl.createVertexArray();
    this.buffers = [gl.createBuffer(), gl.createBuffer(), gl.createBuffer()];
    this.count = 0;
  }

  set(index, values, type, isNormalized) {
    const { gl } = this;
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[index]);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, 3, type, isNormalized, 0, 0);
    gl.bindVertexArray(null);
  }

  setPositions(values) {
    this.count = values.length / 3;
    this.set(0, values, this.gl.FLOAT, false);
  }

  setColors(values) {
    this.set(1, values, this.gl.UNSIGNED_BYTE, true);
  }

  /** Normals, or none. */
  setNormals(values) {
    if (values) {
      this.set(2, values, this.gl.FLOAT, false);
      return;
    }
    this.gl.bindVertexArray(this.array);
    this.gl.disableVertexAttribArray(2);
    this.gl.bindVertexArray(null);
  }
}

/** Colours and depths that are drawn to before they come on the screen. */
class Target {
  constructor(gl) {
    this.gl = gl;
    this.frame = gl.createFramebuffer();
    this.textures = [gl.createTexture(), gl.createTexture()];
    this.width = 0;
    this.height = 0;
  }

  resize(width, height) {
    if (width === this.width && height === this.height) return;
    [this.width, this.height] = [width, height];
    const { gl } = this;
    const formats = [
      [gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, gl.COLOR_ATTACHMENT0],
      [gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT, gl.DEPTH_ATTACHMENT],
    ];
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    this.textures.forEach((texture, i) => {
      const [format, layout, type, attachment] = formats[i];
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, format, width, height, 0, layout, type, null);
      for (const name of ["TEXTURE_MIN_FILTER", "TEXTURE_MAG_FILTER"]) {
        gl.texParameteri(gl.TEXTURE_2D, gl[name], gl.NEAREST);
      }
      gl.framebufferTexture2D(gl.FRAMEBUFFER, attachment, gl.TEXTURE_2D, texture, 0);
    });
  }
}

export class Renderer {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
    if (!gl) throw new Error("this browser has no WebGL2; a current Firefox, Chrome, Edge or Safari has");
    this.canvas = canvas;
    this.gl = gl;
    this.pointProgram = program(gl, POINT_VERTEX, POINT_FRAGMENT);
    this.numberProgram = program(gl, POINT_VERTEX, NUMBER_FRAGMENT);
    this.lineProgram = program(gl, LINE_VERTEX, LINE_FRAGMENT);
    this.screenProgram = program(gl, SCREEN_VERTEX, SCREEN_FRAGMENT);
    this.points = new VertexData(gl);
    this.lines = new VertexData(gl);
    this.box = new VertexData(gl);
    this.empty = gl.createVertexArray();
    this.target = new Target(gl);
    this.numbers = new Target(gl);
  }

  /** Sets the uniforms that points and lines share. */
  use({ made, uniforms }, { matrix, low, high }) {
    const { gl } = this;
    gl.useProgram(made);
    gl.uniformMatrix4fv(uniforms.matrix, false, matrix);
    gl.uniform3fv(uniforms.low, low);
    gl.uniform3fv(uniforms.high, high);
    return uniforms;
  }

  drawPoints(chosen, scene, count) {
    const { gl } = this;
    const uniforms = this.use(chosen, scene);
    gl.uniform1f(uniforms.size, scene.size);
    gl.uniform1f(uniforms.least, scene.least);
    gl.uniform1f(uniforms.most, 24);
    gl.uniform4fv(uniforms.eye, scene.eye);
    gl.bindVertexArray(this.points.array);
    gl.drawArrays(gl.POINTS, 0, Math.min(count, this.points.count));
  }

  drawLines(data, scene, tint) {
    if (data.count === 0) return;
    const { gl } = this;
    const uniforms = this.use(this.lineProgram, scene);
    gl.uniform3fv(uniforms.tint, tint);
    gl.bindVertexArray(data.array);
    gl.drawArrays(gl.LINES, 0, data.count);
  }

  clear(target, width, height) {
    const { gl } = this;
    target.resize(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  /** Draws a scene: matrix, low and high of the crop, size of points, numbers of points, light, what lines. */
  draw(scene) {
    const { gl, canvas } = this;
    this.clear(this.target, canvas.width, canvas.height);
    this.drawPoints(this.pointProgram, scene, scene.count);
    if (scene.showLines) this.drawLines(this.lines, scene, [1, 0.82, 0.25]);
    if (scene.showBox) this.drawLines(this.box, { ...scene, low: [-1e30, -1e30, -1e30], high: [1e30, 1e30, 1e30] }, [0.4, 0.8, 1]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.disable(gl.DEPTH_TEST);
    const { made, uniforms } = this.screenProgram;
    gl.useProgram(made);
    this.target.textures.forEach((texture, i) => {
      gl.activeTexture(gl.TEXTURE0 + i);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform1i(uniforms.colors, 0);
    gl.uniform1i(uniforms.depths, 1);
    gl.uniform1f(uniforms.near, scene.near);
    gl.uniform1f(uniforms.far, scene.far);
    gl.uniform1f(uniforms.strength, scene.light);
    gl.uniform3fv(uniforms.background, scene.background);
    gl.uniform2i(uniforms.last, canvas.width - 1, canvas.height - 1);
    gl.bindVertexArray(this.empty);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
  }

  /** Number of the point drawn nearest to a place on the canvas, within some pixels of it; -1 where there is none. */
  pick(scene, x, y, reach) {
    const { gl, canvas } = this;
    this.clear(this.numbers, canvas.width, canvas.height);
    const side = 2 * reach + 1;
    const [left, bottom] = [Math.round(x) - reach, canvas.height - 1 - Math.round(y) - reach];
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(left, bottom, side, side);
    this.drawPoints(this.numberProgram, scene, scene.count);
    gl.disable(gl.SCISSOR_TEST);
    const pixels = new Uint8Array(4 * side * side);
    gl.readPixels(left, bottom, side, side, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.bindVertexArray(null);
    let best = -1;
    let least = Infinity;
    for (let i = 0; i < side * side; i++) {
      const number = (pixels[4 * i] | (pixels[4 * i + 1] << 8) | (pixels[4 * i + 2] << 16) | (pixels[4 * i + 3] << 24)) - 1;
      const squared = ((i % side) - reach) ** 2 + (Math.floor(i / side) - reach) ** 2;
      if (number >= 0 && squared < least) [best, least] = [number, squared];
    }
    return best;
  }
}
