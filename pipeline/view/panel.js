// What stands beside the picture: photos, the camera path, and how training goes.

// ---- photos

function click(event) {
  if (!scene || !byId('cameras').checked) return;
  const ratio = window.devicePixelRatio || 1, box = picture.getBoundingClientRect();
  const at = [(event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio];
  let best = -1, nearest = 24 * ratio;
  scene.cameras.forEach((camera, i) => {
    const eye = project(viewOf(camera).at);
    const distance = eye ? Math.hypot(eye[0] - at[0], eye[1] - at[1]) : Infinity;
    if (distance < nearest) nearest = distance, best = i;
  });
  if (best >= 0) showPhoto(best);
}

async function showPhoto(index) {
  const camera = scene.cameras[index];
  byId('photo').value = index;
  show(viewOf(camera));
  const answer = await request('photo?index=' + index);
  if (!answer.ok) return;
  photo = { index, camera, bitmap: await createImageBitmap(await answer.blob()) };
  byId('compare').hidden = false;
  draw();
}

function leavePhoto() {
  if (!photo) return;
  photo = null;
  byId('photo').value = '';
  byId('compare').hidden = true;
}
byId('slider').addEventListener('input', draw);
byId('photo').addEventListener('change', (event) =>
  event.target.value === '' ? (leavePhoto(), draw()) : showPhoto(Number(event.target.value)));

// ---- camera path

function pathBody() {
  const rows = (v) => [0, 1, 2].flatMap((r) => [v.x[r], v.y[r], v.z[r], v.at[r]]).concat([0, 0, 0, 1]);
  const aspect = home.aspect, even = (side) => 2 * Math.round(side / 2);
  const size = aspect >= 1 ? [1280, even(1280 / aspect)] : [even(1280 * aspect), 1280];
  return JSON.stringify({ camera_type: 'perspective', render_width: size[0], render_height: size[1], fps: 30,
    seconds: Math.min(600, Math.max(1, Number(byId('seconds').value) || 6)), is_cycle: byId('loop').checked,
    crop: byId('crop').checked ? cropJson() : null,
    keyframes: keys.map((key) => ({ matrix: rows(key), fov: key.fov * 180 / Math.PI, aspect })) });
}

async function postPath(save) {
  if (keys.length === 0 && !(save && byId('crop').checked)) {
    byId('saved').textContent = 'Add a view first.';
    return null;
  }
  const answer = await request('path?save=' + (save ? 1 : 0), { method: 'POST', body: pathBody() });
  if (!answer.ok) { byId('saved').textContent = await answer.text(); return null; }
  return answer.json();
}

function addKey() {
  keys.push({ ...view });
  listKeys();
}

function listKeys() {
  byId('keys').replaceChildren(...keys.map((key, i) => {
    const item = document.createElement('li');
    const button = (text, act) => {
      const element = document.createElement('button');
      element.textContent = text;
      element.addEventListener('click', act);
      return element;
    };
    item.append('view ', button('show', () => { leavePhoto(); show(key); }),
      button('set', () => { keys[i] = { ...view }; listKeys(); }),
      button('remove', () => { keys.splice(i, 1); listKeys(); }));
    return item;
  }));
  drawOverlay();
}

async function play() {
  if (path) { path = null; byId('play').textContent = 'Play'; return; }
  const answer = await postPath(false);
  if (!answer) return;
  leavePhoto();
  path = answer.frames;
  byId('play').textContent = 'Stop';
  const began = performance.now(), mine = path;
  for (let at = 0; at < mine.length && path === mine; at = Math.floor((performance.now() - began) / 1000 * 30)) {
    if (!dirty) show({ ...viewOf({ pose: mine[at].pose, height: 2, focal: 1 }), fov: mine[at].fov });
    await pause(10);
  }
  if (path !== mine) return;
  path = null;
  byId('play').textContent = 'Play';
}

Object.assign(keyActions, { k: addKey, p: play });
byId('add').addEventListener('click', addKey);
byId('play').addEventListener('click', play);
byId('save').addEventListener('click', async () => {
  const answer = await postPath(true);
  if (answer) byId('saved').textContent =
    'Saved as camera_path.json. Film: pipeline render --out RUN ' +
    `--${keys.length > 0 ? 'path' : 'crop'} RUN/camera_path.json`;
});
async function loadPath() {
  const answer = await request('path'), file = answer.ok ? await answer.json() : {};
  if (file.crop) loadCrop(file.crop);
  if (!Array.isArray(file.keyframes)) return;
  keys = file.keyframes.map((key) =>
    ({ ...viewOf({ pose: key.matrix, height: 2, focal: 1 }), fov: key.fov * Math.PI / 180 }));
  byId('loop').checked = Boolean(file.is_cycle);
  if (file.seconds) byId('seconds').value = Math.round(file.seconds);
  listKeys();
}

// ---- state

function duration(seconds) {
  return seconds < 90 ? `${seconds.toFixed(0)} s` : `${Math.floor(seconds / 60)} min ${Math.round(seconds % 60)} s`;
}

function drawCurve(rows) {
  byId('curve-section').hidden = rows.length < 2;
  if (rows.length < 2) return;
  const canvas = byId('curve'), context = canvas.getContext('2d');
  const values = rows.flatMap((row) => [row[1], row[2]]).filter((value) => Number.isFinite(value) && value > 0);
  const low = Math.floor(Math.min(...values) / 5) * 5, high = Math.ceil(Math.max(...values) / 5) * 5 || low + 5;
  const end = rows[rows.length - 1][0], left = 44, bottom = canvas.height - 26;
  const x = (seconds) => left + (canvas.width - left - 8) * seconds / end;
  const y = (value) => bottom - (bottom - 8) * (value - low) / Math.max(5, high - low);
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.font = '18px system-ui'; context.fillStyle = '#9aa0a8'; context.strokeStyle = '#33373d';
  for (let value = low; value <= high; value += 5) {
    context.fillText(value, 4, y(value) + 6);
    context.beginPath(); context.moveTo(left, y(value)); context.lineTo(canvas.width - 8, y(value)); context.stroke();
  }
  context.fillText('0', left, canvas.height - 4);
  context.textAlign = 'right';
  context.fillText(duration(end), canvas.width - 8, canvas.height - 4);
  context.textAlign = 'left';
  context.lineWidth = 2.5;
  [[1, '#eba368'], [2, '#7fb2ec']].forEach(([column, colour]) => {
    context.strokeStyle = colour;
    context.beginPath();
    rows.filter((row) => row[column] > 0).forEach((row, i) =>
      i ? context.lineTo(x(row[0]), y(row[column])) : context.moveTo(x(row[0]), y(row[column])));
    context.stroke();
  });
}

function tellTraining(news) {
  byId('training').hidden = !news;
  if (!news) return;
  byId('progress').value = news.progress;
  const psnr = news.heldout_psnr > 0 ? `, held-out ${news.heldout_psnr.toFixed(2)} dB` : '';
  byId('news').textContent = `step ${news.step}, ${duration(news.left_s)} left, ` +
    `training ${news.train_psnr.toFixed(2)} dB${psnr}`;
}

async function loadScene() {
  const answer = await request('scene');
  if (!answer.ok) return;
  scene = await answer.json();
  byId('name').textContent = scene.name;
  byId('waiting').hidden = true;
  byId('photo').replaceChildren(new Option('none', ''), ...scene.cameras.map((c, i) => new Option(c.name, i)));
  const first = scene.cameras[0];
  home = { ...viewOf(first), aspect: first.width / first.height };
  await loadPath();
  if (!view) show(home);
}

async function follow() {
  if (!document.hidden) {
    try {
      const answer = await request('state');
      if (!answer.ok) throw new Error(await answer.text());
      state = await answer.json();
      byId('fault').hidden = !state.fault;
      byId('fault').textContent = state.fault;
      byId('layer').options[2].disabled = !state.support;
      tellTraining(state.training);
      drawCurve(state.curve);
      if (!scene && state.shows !== 'nothing') await loadScene();
      if (view && !refreshing && state.version !== shownVersion) {
        level = 0;
        refresh();
      }
    } catch (error) {
      byId('status').textContent = String(error.message || error);
    }
  }
  setTimeout(follow, 1000);
}

byId('end').addEventListener('click', async () => {
  byId('end').disabled = true;
  await request('end', { method: 'POST' });
  byId('end').textContent = 'Training ends';
});
byId('home').addEventListener('click', () => { leavePhoto(); if (home) show(home); });
for (const id of ['layer', 'cameras']) byId(id).addEventListener('change', () => view && moved());
byId('fov').addEventListener('input', (event) => {
  if (!view) return;
  leavePhoto();
  view = { ...view, fov: event.target.value * Math.PI / 180 };
  byId('fov-value').textContent = event.target.value + '°';
  moved();
});
new ResizeObserver(() => view && moved()).observe(picture);
follow();
