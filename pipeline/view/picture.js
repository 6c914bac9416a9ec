// What is shown, and how it comes from the server.
const token = new URLSearchParams(location.search).get('token') || '';
const overlay = byId('overlay');
const viewer = Math.random().toString(36).slice(2);

let state = null;
let sequence = 0, shown = null, shownVersion = -1;
let area = 2500;  // pixels that a frame may have while the view moves: few at first, for a young field is slow
let level = 2, dirty = false, refreshing = false, restAbort = null, movedAt = 0;
let photo = null, keys = [], path = null, pathSaved = false;

const request = (address, options = {}) =>
  fetch(address, { ...options, headers: { 'X-Token': token, ...(options.headers || {}) } });

// ---- pictures

function poseOf(v) {
  return [0, 1, 2].map((r) => [v.x[r], v.y[r], v.z[r], v.at[r]].join(',')).join(',');
}

// Levels: 0 while the view moves; 1 as many pixels as the screen has; 2 the same, sampled more finely.
function sizeFor(level) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const full = [picture.clientWidth * ratio, picture.clientHeight * ratio];
  const fit = Math.min(1, 1920 / Math.max(...full), Math.sqrt(8e6 / (full[0] * full[1])));
  let scale = fit;
  // A training keeps most of the machine to itself: small pictures often rather than large ones late.
  if (level > 0 && state?.training) scale = Math.min(scale, Math.sqrt(Math.min(1e5, 10 * area) / (full[0] * full[1])));
  if (level === 0) scale = Math.min(scale, Math.sqrt(area / (full[0] * full[1])));
  return full.map((side) => Math.max(8, Math.round(side * scale)));
}

// Whether the frame was shown.
async function fetchFrame(quality) {
  const [width, height] = sizeFor(quality);
  const began = performance.now();
  const query = new URLSearchParams({ viewer, sequence: ++sequence, pose: poseOf(view), fov: view.fov, width, height,
    layer: byId('layer').value, quality });
  if (byId('crop').checked) query.set('crop', JSON.stringify(cropJson()));
  restAbort = quality > 0 ? new AbortController() : null;
  try {
    const answer = await request('frame?' + query, { signal: restAbort?.signal });
    if (answer.status !== 200) return false;
    shown = await createImageBitmap(await answer.blob());
    shownVersion = Number(answer.headers.get('X-Version'));
    const took = performance.now() - began;
    if (quality === 0) area = Math.min(2e6, Math.max(1600, area * Math.min(1.5, Math.max(0.2, budget() / took))));
    byId('status').textContent = `${width}x${height}, ${took.toFixed(0)} ms`;
    draw();
    return true;
  } catch (error) {
    if (error.name !== 'AbortError') byId('status').textContent = 'no answer from pipeline view';
    return false;
  } finally {
    restAbort = null;
  }
}

const budget = () => (state ? state.budget_ms : 80);

function moved() {
  dirty = true;
  movedAt = performance.now();
  restAbort?.abort();  // the server gives it up when the next request comes
  draw();
  refresh();
}

// Small frames while the view moves, sharper ones once it rests; one at a time.
async function refresh() {
  if (refreshing) return;
  refreshing = true;
  while (view && !document.hidden && (dirty || level < (state?.training ? 1 : 2))) {
    if (dirty) {
      dirty = false;
      level = 0;
      if (!await fetchFrame(0)) await pause(200);
    } else if (performance.now() - movedAt < 120) {
      await pause(20);
    } else if (await fetchFrame(level + 1)) {
      ++level;
    } else if (!dirty) {
      break;
    }
  }
  refreshing = false;
}

// ---- drawing

function fit(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
}

function draw() {
  fit(picture); fit(overlay);
  const context = picture.getContext('2d');
  if (shown) context.drawImage(shown, 0, 0, picture.width, picture.height);
  drawPhoto(context);
  drawOverlay();
}

function drawPhoto(context) {
  if (!photo) return;
  const focal = picture.height / 2 / Math.tan(view.fov / 2), scale = focal / photo.camera.focal;
  const left = picture.width / 2 - photo.camera.cx * scale, top = picture.height / 2 - photo.camera.cy * scale;
  const width = photo.camera.width * scale, share = byId('slider').value / 100;
  context.save();
  context.beginPath();
  context.rect(left, 0, width * share, picture.height);
  context.clip();
  context.drawImage(photo.bitmap, left, top, width, photo.camera.height * scale);
  context.restore();
  context.fillStyle = '#fff';
  context.fillRect(left + width * share - 1, top, 2, photo.camera.height * scale);
}

function project(point) {
  const d = add(point, view.at, -1), z = -dot(d, view.z);
  if (z <= 1e-3) return null;
  const focal = overlay.height / 2 / Math.tan(view.fov / 2);
  return [overlay.width / 2 + focal * dot(d, view.x) / z, overlay.height / 2 - focal * dot(d, view.y) / z];
}

function drawOverlay() {
  const context = overlay.getContext('2d');
  context.clearRect(0, 0, overlay.width, overlay.height);
  if (!scene || !view) return;
  if (byId('cameras').checked)
    scene.cameras.forEach((camera, i) => frustum(context, viewOf(camera), camera.width / camera.height,
      photo && photo.index === i ? '#eba368' : '#7fb2ec'));
  if (byId('crop').checked) drawBox(context);
  keys.forEach((key) => frustum(context, key, overlay.width / overlay.height, '#8fd694'));
}

function drawBox(context) {
  const corner = (i) => project(box.axes.reduce((at, axis, k) =>
    add(at, axis, (i >> k & 1 ? 0.5 : -0.5) * box.size[k]), box.centre));
  context.strokeStyle = '#e7e8ea';
  context.lineWidth = window.devicePixelRatio || 1;
  context.beginPath();
  for (let i = 0; i < 8; ++i) for (const bit of [1, 2, 4]) {
    const [a, b] = i & bit ? [null, null] : [corner(i), corner(i | bit)];
    if (a && b) { context.moveTo(...a); context.lineTo(...b); }
  }
  context.stroke();
}

function frustum(context, v, aspect, colour) {
  const size = 0.06 * scene.depth, h = size * Math.tan(v.fov / 2), w = h * aspect;
  const corners = [[-w, -h], [w, -h], [w, h], [-w, h]].map(([a, b]) =>
    project(add(add(add(v.at, v.x, a), v.y, b), v.z, -size)));
  const eye = project(v.at);
  if (!eye || corners.includes(null)) return;
  context.strokeStyle = colour;
  context.lineWidth = window.devicePixelRatio || 1;
  context.beginPath();
  corners.forEach((corner, i) => {
    context.moveTo(...eye); context.lineTo(...corner); context.lineTo(...corners[(i + 1) % 4]);
  });
  context.stroke();
}
