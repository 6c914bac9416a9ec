// The crop box, set by the places of its six sides and a turn about what is up.

let box = null;  // {axes: [right, up, back], centre, size}
const sides = ['left', 'right', 'bottom', 'top', 'back', 'front', 'turn'];

function startBox() {
  const up = unit(scene.up), back = unit(add(home.z, up, -dot(home.z, up)));
  const side = 0.8 * scene.depth;
  box = { axes: [cross(up, back), up, back], centre: [...scene.focus], size: [side, side, side] };
}

// Where a side stands along its axis, from the middle of what the cameras look at; of the turn, degrees.
function placeOf(side) {
  const axis = side >> 1;
  return dot(add(box.centre, scene.focus, -1), box.axes[axis]) + (side & 1 ? 0.5 : -0.5) * box.size[axis];
}

function moveSide(side, place) {
  const axis = side >> 1, other = placeOf(side ^ 1), least = 0.01 * scene.depth;
  const at = side & 1 ? Math.max(place, other + least) : Math.min(place, other - least);
  box.size[axis] = Math.abs(at - other);
  const middle = dot(add(box.centre, scene.focus, -1), box.axes[axis]);
  box.centre = add(box.centre, box.axes[axis], (at + other) / 2 - middle);
}

function listSides() {
  const reach = 2 * scene.depth;
  byId('crop-sides').replaceChildren(...sides.map((name, side) => {
    const label = document.createElement('label'), input = document.createElement('input');
    const turns = name === 'turn';
    Object.assign(input, { type: 'range', min: turns ? -90 : -reach, max: turns ? 90 : reach, step: 'any',
      value: turns ? 0 : placeOf(side) });
    let turned_by = 0;
    input.addEventListener('input', () => {
      if (turns) {
        const angle = (input.value - turned_by) * Math.PI / 180;
        box.axes = box.axes.map((axis) => turned(axis, box.axes[1], angle));
        turned_by = Number(input.value);
      } else {
        moveSide(side, Number(input.value));
        input.value = placeOf(side);
      }
      moved();
    });
    label.append(name, input);
    return label;
  }));
}

// As nerfstudio has it: the turns about x, y and z lead from the box's axes to the scene's.
function cropJson() {
  const [x, y, z] = box.axes;
  return { crop_center: box.centre, crop_scale: box.size,
    crop_rot: [Math.atan2(y[2], z[2]), Math.asin(Math.max(-1, Math.min(1, -x[2]))), Math.atan2(x[1], x[0])],
    crop_bg_color: { r: 22, g: 24, b: 27 } };
}

function loadCrop(crop) {
  const [roll, pitch, yaw] = crop.crop_rot || [0, 0, 0];
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) =>
    turned(turned(turned(axis, [1, 0, 0], roll), [0, 1, 0], pitch), [0, 0, 1], yaw));
  box = { axes, centre: crop.crop_center, size: crop.crop_scale };
  byId('crop').checked = true;
  showSides();
}

function showSides() {
  const shows = byId('crop').checked;
  byId('crop-sides').hidden = !shows;
  if (!shows) return;
  if (!box) startBox();
  listSides();
}

byId('crop').addEventListener('change', () => {
  if (!scene) return;
  showSides();
  moved();
});
