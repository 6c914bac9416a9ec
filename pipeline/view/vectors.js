'use strict';
// Vectors are arrays of three; a view is {x, y, z: camera axes in the scene (OpenGL: z looks back), at: place, fov}.
const byId = (id) => document.getElementById(id);
const picture = byId('picture');

const add = (a, b, s = 1) => a.map((v, i) => v + s * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const n = Math.hypot(...a); return a.map((v) => v / n); };
const turned = (v, axis, angle) => {  // Rodrigues
  const c = Math.cos(angle), s = Math.sin(angle), k = dot(axis, v) * (1 - c), w = cross(axis, v);
  return v.map((value, i) => value * c + w[i] * s + axis[i] * k);
};

let scene = null, view = null, home = null, pivot = null;
const keyActions = {};  // by key, beside those that move the view

const pause = (ms) => new Promise((done) => setTimeout(done, ms));

// camera: {pose: matrix by rows, height and focal: pixels}
function viewOf(camera) {
  const m = camera.pose;
  return { x: [m[0], m[4], m[8]], y: [m[1], m[5], m[9]], z: [m[2], m[6], m[10]], at: [m[3], m[7], m[11]],
    fov: 2 * Math.atan(camera.height / 2 / camera.focal) };
}
