// Turns the mesh of the page. Without WebGL 2 the picture in its place stays.
"use strict";

const ZOOM = 1.8; // 58 degrees of vertical angle
const ASPECT = 3 / 2; // of the place that the page has for it

/** The camera: where it looks, from how far and from which side, and the axes of that side. At first it sees all. */
function startingView(mesh) {
  const up = mesh.up;
  const middle = mesh.low.map((low, i) => (low + mesh.high[i]) / 2);
  const half = mesh.low.map((low, i) => (mesh.high[i] - low) / 2);
  // Two axes perpendicular to up, from which the azimuth is measured.
  const smallest = up.map(Math.abs).indexOf(Math.min(...up.map(Math.abs)));
  const east = unit(cross([0, 1, 2].map((i) => Number(i === smallest)), up));
  const north = cross(up, east);
  const view = {
    target: middle, distance: 0, diagonal: 2 * Math.hypot(...half), up, east, north,
    azimuth: Math.atan2(dot(mesh.forward, north), dot(mesh.forward, east)),
    elevation: -Math.asin(Math.max(-1, Math.min(1, dot(mesh.forward, up)))),
  };
  const { right, upward, forward } = axesOf(view);
  for (let corner = 0; corner < 8; corner += 1) {
    const at = half.map((x, i) => (corner >> i & 1 ? x : -x));
    const aside = Math.max(Math.abs(dot(at, right)) / ASPECT, Math.abs(dot(at, upward)));
    view.distance = Math.max(view.distance, ZOOM * aside - dot(at, forward));
  }
  return view;
}

/** Right, up and forward of a view, unit vectors in the world. */
function axesOf(view) {
  const level = combine([Math.cos(view.azimuth), view.east], [Math.sin(view.azimuth), view.north]);
  const forward = combine([Math.cos(view.elevation), level], [-Math.sin(view.elevation), view.up]);
  const right = cross(level, view.up);
  return { right, upward: cross(right, forward), forward };
}

/** World to clip space, column after column. */
function clipFromWorld(view, aspect) {
  const { right, upward, forward } = axesOf(view);
  const eye = combine([1, view.target], [-view.distance, forward]);
  const near = view.distance / 200, far = view.distance + 2 * view.diagonal;
  const rows = [
    [...right.map((x) => x * ZOOM / aspect), -dot(right, eye) * ZOOM / aspect],
    [...upward.map((x) => x * ZOOM), -dot(upward, eye) * ZOOM],
    [...forward.map((x) => x * (far + near) / (far - near)),
     -dot(forward, eye) * (far + near) / (far - near) - 2 * far * near / (far - near)],
    [...forward, -dot(forward, eye)],
  ];
  return new Float32Array([0, 1, 2, 3].flatMap((column) => rows.map((row) => row[column])));
}

function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
function cross(a, b) { return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]; }
function unit(a) { const length = Math.hypot(...a); return a.map((x) => x / length); }
function combine(...terms) { return [0, 1, 2].map((i) => terms.reduce((sum, [factor, v]) => sum + factor * v[i], 0)); }

const VERTEX_SHADER = `#version 300 es
uniform mat4 clip_from_world;
uniform vec3 low;
uniform float step_size;
in vec3 position;
in vec3 normal;
in vec3 colour;
out vec3 world_normal;
out vec3 front;
void main() {
  world_normal = normal;
  front = colour;
  gl_Position = clip_from_world * vec4(low + step_size * position, 1.0);
}`;

// Lambert's law wrapped round, as in the other pictures: grazing surfaces keep some light.
const FRAGMENT_SHADER = `#version 300 es
precision highp float;
uniform vec3 light;
uniform vec3 back;
in vec3 world_normal;
in vec3 front;
out vec4 shade;
void main() {
  vec3 normal = normalize(gl_FrontFacing ? world_normal : -world_normal);
  float brightness = pow((1.0 + dot(normal, light)) / 2.0, 1.2);
  shade = vec4((gl_FrontFacing ? front : back) * brightness, 1.0);
}`;

/** A program with its shaders; what the compiler says is an error. */
function compiled(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return program;
}

function decoded(base64) { return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0)); }

/** Send the mesh to the card; how many corners there are to draw. */
function upload(gl, program, mesh) {
  const attribute = (name, base64, type, normalized, stride) => {
    const place = gl.getAttribLocation(program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, decoded(base64), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, type, normalized, stride, 0);
  };
  attribute("position", mesh.positions, gl.UNSIGNED_SHORT, false, 8);
  attribute("normal", mesh.normals, gl.BYTE, true, 4);
  if (mesh.colours) attribute("colour", mesh.colours, gl.UNSIGNED_BYTE, true, 4);
  else gl.vertexAttrib3fv(gl.getAttribLocation(program, "colour"), mesh.front.map((x) => x / 255));
  const faces = decoded(mesh.faces);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
  return faces.length / 4;
}

function show(mesh, canvas, picture, hideBacks) {
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) return;
  const program = compiled(gl);
  gl.useProgram(program);
  const corners = upload(gl, program, mesh);
  const uniform = (name) => gl.getUniformLocation(program, name);
  gl.uniform3fv(uniform("low"), mesh.low);
  gl.uniform1f(uniform("step_size"), mesh.step);
  gl.uniform3fv(uniform("back"), mesh.back.map((x) => x / 255));
  const places = { matrix: uniform("clip_from_world"), light: uniform("light") };
  gl.enable(gl.DEPTH_TEST);
  gl.cullFace(gl.BACK);
  gl.clearColor(1, 1, 1, 1);

  let view = startingView(mesh);
  let asked = false;
  const draw = () => {
    asked = false;
    canvas.width = Math.round(canvas.clientWidth * window.devicePixelRatio);
    canvas.height = Math.round(canvas.clientHeight * window.devicePixelRatio);
    gl.viewport(0, 0, canvas.width, canvas.height);
    (hideBacks.checked ? gl.enable : gl.disable).call(gl, gl.CULL_FACE);
    gl.uniformMatrix4fv(places.matrix, false, clipFromWorld(view, canvas.width / canvas.height));
    // A headlight a little above and to the left.
    const { right, upward, forward } = axesOf(view);
    gl.uniform3fv(places.light, unit(combine([-0.33, right], [0.25, upward], [-0.91, forward])));
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.drawElements(gl.TRIANGLES, corners, gl.UNSIGNED_INT, 0);
  };
  const ask = () => { if (!asked) { asked = true; requestAnimationFrame(draw); } };
  const turn = (x, y) => {
    view.azimuth += x;
    view.elevation = Math.max(-1.55, Math.min(1.55, view.elevation + y));
    ask();
  };
  const move = (x, y) => {
    const { right, upward } = axesOf(view);
    view.target = combine([1, view.target], [-x * view.distance, right], [y * view.distance, upward]);
    ask();
  };
  const zoom = (factor) => {
    view.distance = Math.max(0.01 * view.diagonal, Math.min(4 * view.diagonal, view.distance * factor));
    ask();
  };
  const reset = () => { view = startingView(mesh); ask(); };

  let last = [0, 0];
  canvas.addEventListener("pointerdown", (event) => {
    last = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    const [x, y] = [event.clientX - last[0], event.clientY - last[1]].map((pixels) => pixels / canvas.clientHeight);
    last = [event.clientX, event.clientY];
    if (event.buttons === 2 || event.shiftKey) move(x, y);
    else turn(-3 * x, 3 * y);
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(0.001 * event.deltaY)); },
    { passive: false });
  canvas.addEventListener("dblclick", reset);
  const keys = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0),
    ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
    "+": () => zoom(0.9), "-": () => zoom(1.1), Home: reset,
  };
  canvas.addEventListener("keydown", (event) => {
    if (event.key in keys) { event.preventDefault(); keys[event.key](); }
  });
  hideBacks.addEventListener("change", ask);
  new ResizeObserver(ask).observe(canvas);
  picture.hidden = true;
  canvas.hidden = false;
  ask();
}

if (typeof document !== "undefined") {
  const part = (name) => document.getElementById(name);
  show(JSON.parse(part("mesh").textContent), part("surface"), part("picture"), part("hide-backs"));
}
