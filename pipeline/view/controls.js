// How hands move the view: mouse, touch, wheel and keys. The page around it says what follows, by moved(), leavePhoto()
// and click(event), and has a slider for the angle of view.

function orbit(dx, dy) {
  leavePhoto();
  const up = scene.up, tilt = Math.acos(Math.max(-1, Math.min(1, dot(view.z, up))));
  const pitch = Math.max(0.05 - tilt, Math.min(Math.PI - 0.05 - tilt, dy));
  const right = unit(view.x);
  const apply = (v) => turned(turned(v, right, pitch), up, dx);
  view = { ...view, x: unit(apply(view.x)), z: unit(apply(view.z)), at: add(pivot, apply(add(view.at, pivot, -1))) };
  square();
  moved();
}

function look(dx, dy) {
  leavePhoto();
  const apply = (v) => turned(turned(v, view.x, dy), scene.up, dx);
  view = { ...view, x: unit(apply(view.x)), z: unit(apply(view.z)) };
  square();
  movePivot();
  moved();
}

// Rounding must not skew the axes.
function square() {
  view.y = unit(cross(view.z, view.x));
  view.x = cross(view.y, view.z);
}

const reach = () => Math.max(0.02 * scene.depth, Math.hypot(...add(view.at, pivot, -1)));

// What is turned around lies straight ahead, as far away as before.
function movePivot(distance = reach()) { pivot = add(view.at, view.z, -distance); }

function shift(dx, dy, dz) {
  leavePhoto();
  const step = add(add(add([0, 0, 0], view.x, dx), view.y, dy), view.z, dz);
  view = { ...view, at: add(view.at, step) };
  pivot = add(pivot, step);
  moved();
}

function zoom(factor) {
  leavePhoto();
  const before = reach(), after = Math.max(0.02 * scene.depth, before * factor);
  view = { ...view, at: add(view.at, view.z, after - before) };
  moved();
}

function show(target) {
  view = { ...target };
  const ahead = -dot(add(scene.focus, view.at, -1), view.z);
  movePivot(ahead > 0.05 * scene.depth ? ahead : scene.depth);
  byId('fov').value = Math.round(view.fov * 180 / Math.PI);
  byId('fov-value').textContent = byId('fov').value + '°';
  moved();
}

const pointers = new Map();
picture.addEventListener('pointerdown', (event) => {
  picture.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, shifts: event.button === 2 || event.shiftKey,
    began: [event.clientX, event.clientY] });
  picture.focus();
});
picture.addEventListener('pointermove', (event) => {
  const last = pointers.get(event.pointerId);
  if (!last || !view) return;
  const dx = event.clientX - last.x, dy = event.clientY - last.y;
  const others = [...pointers.entries()].filter(([id]) => id !== event.pointerId).map(([, p]) => p);
  const unitsPerPixel = 2 * Math.tan(view.fov / 2) * reach() / picture.clientHeight;
  if (others.length > 0) {
    const spread = (p) => Math.hypot(p.x - others[0].x, p.y - others[0].y);
    const before = spread(last), after = spread({ x: event.clientX, y: event.clientY });
    shift(-dx / 2 * unitsPerPixel, dy / 2 * unitsPerPixel, 0);
    if (before > 0 && after > 0) zoom(before / after);
  } else if (last.shifts) {
    shift(-dx * unitsPerPixel, dy * unitsPerPixel, 0);
  } else {
    orbit(-dx * 0.006, -dy * 0.006);
  }
  last.x = event.clientX; last.y = event.clientY;
});
for (const kind of ['pointerup', 'pointercancel']) {
  picture.addEventListener(kind, (event) => {
    const last = pointers.get(event.pointerId);
    pointers.delete(event.pointerId);
    if (kind === 'pointerup' && last && Math.hypot(event.clientX - last.began[0], event.clientY - last.began[1]) < 4)
      click(event);
  });
}
picture.addEventListener('contextmenu', (event) => event.preventDefault());
picture.addEventListener('wheel', (event) => {
  event.preventDefault();
  if (view) zoom(Math.exp(Math.max(-0.4, Math.min(0.4, event.deltaY * 0.0015))));
}, { passive: false });

const held = new Set();
const flies = { w: [0, 0, -1], s: [0, 0, 1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, -1, 0], e: [0, 1, 0] };
const turns = { arrowleft: [1, 0], arrowright: [-1, 0], arrowup: [0, 1], arrowdown: [0, -1] };
picture.addEventListener('keydown', (event) => {
  const key = event.key.toLowerCase();
  if (event.ctrlKey || event.metaKey || !view) return;
  if (key in flies || key in turns) {
    event.preventDefault();
    held.add(key);
    fly();
  } else if (key === 'r') show(home);
  else keyActions[key]?.();
});
picture.addEventListener('keyup', (event) => held.delete(event.key.toLowerCase()));
picture.addEventListener('blur', () => held.clear());
let flying = false;
async function fly() {
  if (flying) return;
  flying = true;
  for (let last = performance.now(); held.size > 0;) {
    await pause(15);
    const now = performance.now(), seconds = Math.min(0.1, (now - last) / 1000);
    last = now;
    for (const key of held) {
      if (key in flies) shift(...flies[key].map((v) => v * 0.4 * scene.depth * seconds));
      else look(...turns[key].map((v) => v * 0.8 * seconds));
    }
  }
  flying = false;
}
