// A scene that plays in the browser alone: looks around in it as `pipeline view` does, without a server.

// Time between two pictures while a hand moves [ms]; longer where the picture had fewer pixels else.
const kFrameMs = 80, kSlowFrameMs = 350, kLeastArea = 12000;
const kRestMs = 120;  // without motion, before the picture is sharpened
let renderer = null, interrupted = false, dirty = false, refreshing = false, movedAt = 0, sharpness = 0;

// There are no photos here.
const leavePhoto = () => {}, click = () => {};

function moved() {
  dirty = true;
  movedAt = performance.now();
  refresh();
}

function fullSize() {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const size = [picture.clientWidth * ratio, picture.clientHeight * ratio];
  const scale = Math.min(1, 1920 / Math.max(...size));
  return size.map((side) => Math.max(8, Math.round(side * scale)));
}

function cameraOf(v, width, height) {
  const focal = height / 2 / Math.tan(v.fov / 2);
  return { ...v, focal: [focal, focal], centre: [width / 2, height / 2], width, height };
}

function resized(size, share) { return size.map((side) => Math.max(8, Math.round(side * Math.sqrt(share)))); }

// Small pictures while the view moves; at rest four times as many pixels from picture to picture, and at last
// the finest. Splats have the detail: the field under them needs no more pixels than the pictures it learned from.
async function drawNext() {
  const [width, height] = fullSize(), area = width * height;
  if (picture.width !== width || picture.height !== height) {
    Object.assign(picture, { width, height });
    renderer.present();  // what was shown, until there is better
  }
  const splats = renderer.splats, most = splats ? splats.fieldShare(cameraOf(view, width, height)) : 1;
  const moving = dirty, quality = moving ? 0 : sharpness >= most ? 2 : 1;
  const shows = splats && (splats.areQuick || quality === 2);  // else they come last
  const part = shows ? 0.5 : 1;                                // of the time
  const within = (rate) =>
    Math.min(1, Math.max(rate * kFrameMs * part, Math.min(kLeastArea, rate * kSlowFrameMs * part)) / area);
  const share = Math.min(most, moving ? within(renderer.rates[0]) : sharpness >= most ? most : sharpness * 4);
  const size = resized([width, height], share);
  const whole = shows ? resized([width, height], moving ? Math.max(share, within(splats.rate)) : 1) : size;
  dirty = false;
  const began = performance.now();
  const wanted = () => !interrupted && (moving || !dirty);
  const over = shows ? cameraOf(view, ...whole) : null;
  if (!await renderer.draw(cameraOf(view, ...size), over, quality, wanted)) return;
  sharpness = quality === 2 ? 2 : share;
  byId('status').textContent = `${whole.join('x')}, ${(performance.now() - began).toFixed(0)} ms`;
}

async function refresh() {
  if (refreshing || !renderer || !view) return;
  refreshing = true;
  while (!interrupted && !document.hidden && !gl.isContextLost() && (dirty || sharpness < 2)) {
    if (!dirty && performance.now() - movedAt < kRestMs) await pause(20);
    else await drawNext();
  }
  refreshing = false;
}
document.addEventListener('visibilitychange', refresh);

// ---- addresses

// #pose=12 numbers, rows of world_from_camera&fov=degrees&size=WIDTHxHEIGHT, each of which may be missing.
function readAddress() {
  const values = new URLSearchParams(location.hash.slice(1));
  const pose = (values.get('pose') || '').split(',').map(Number), fov = Number(values.get('fov'));
  const size = /^(\d+)x(\d+)$/.exec(values.get('size') || '');
  document.body.classList.toggle('fixed', Boolean(size));
  for (const [side, value] of [['width', size?.[1]], ['height', size?.[2]]])
    picture.style[side] = size ? `${value / (window.devicePixelRatio || 1)}px` : '';
  let target = view || home;
  if (pose.length >= 12 && pose.every(Number.isFinite))
    target = { ...viewOf({ pose, height: 2, focal: 1 }), fov: target.fov };
  if (fov > 0 && fov < 170) target = { ...target, fov: fov * Math.PI / 180 };
  show(target);
}
window.addEventListener('hashchange', () => home && readAddress());

// A camera's picture at its exact size, as PNG in a data address. camera: {pose, width, height, focal: [x, y],
// centre: [x, y]}
async function snapshot(camera, quality = 2) {
  interrupted = true;
  while (refreshing) await pause(5);
  refreshing = true;
  const { width, height } = camera;
  const whole = { ...viewOf({ pose: camera.pose, height, focal: 1 }), ...camera };
  await renderer.draw(whole, whole, quality, () => true);
  const pixels = new Uint8ClampedArray(4 * width * height), image = new ImageData(width, height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, renderer.picture.frame);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  for (let y = 0; y < height; ++y)
    image.data.set(pixels.subarray(4 * width * y, 4 * width * (y + 1)), 4 * width * (height - 1 - y));
  for (let i = 3; i < image.data.length; i += 4) image.data[i] = 255;  // the splats' share is there
  const canvas = Object.assign(document.createElement('canvas'), { width, height });
  canvas.getContext('2d').putImageData(image, 0, 0);
  refreshing = interrupted = false;
  moved();
  return canvas.toDataURL('image/png');
}

// ---- the page

function fail(text) {
  byId('waiting').hidden = false;
  byId('waiting').textContent = text;
}

async function start() {
  if (!gl) return fail('This browser has no WebGL 2. A newer one, or another, shows the scene.');
  if (!window.DecompressionStream) return fail('This browser is too old; one of 2023 or later shows the scene.');
  picture.addEventListener('webglcontextlost', () => fail('The graphics card gave up. Load the page again.'));
  scene = JSON.parse(byId('scene').textContent);
  byId('name').textContent = document.title = scene.name;
  renderer = new Renderer(await loadField());
  byId('waiting').hidden = true;
  byId('photo').append(...scene.cameras.map((camera, i) => new Option(camera.name, i)));
  home = viewOf(scene.cameras[0]);
  readAddress();
  picture.focus();
}

byId('photo').addEventListener('change', (event) =>
  event.target.value !== '' && show(viewOf(scene.cameras[Number(event.target.value)])));
byId('home').addEventListener('click', () => home && show(home));
byId('fov').addEventListener('input', (event) => {
  if (!view) return;
  view = { ...view, fov: event.target.value * Math.PI / 180 };
  byId('fov-value').textContent = event.target.value + '°';
  moved();
});
new ResizeObserver(() => view && moved()).observe(picture);
start().catch((error) => fail('The scene cannot be shown: ' + error.message));
