'use strict';
(() => {
  const canvas = document.getElementById('scene');
  if (!canvas) return;
  const scene = JSON.parse(document.getElementById('scene-data').textContent);
  const pen = canvas.getContext('2d');
  let yaw = 0.6, pitch = 0.45, zoom = 1;

  // The plot turns about the middle between the focus, at the origin, and the film's path.
  const middle = [0, 0, 0];
  scene.path.forEach((v, i) => middle[i % 3] += 1.5 * v / scene.path.length);

  // Orthographic view of z-up coordinates: [right, down, towards the eye] in pixels around the canvas centre.
  function project(px, py, pz) {
    const x = px - middle[0], y = py - middle[1], z = pz - middle[2];
    const scale = zoom * 0.44 * Math.min(canvas.width, canvas.height);
    const side = x * Math.cos(yaw) - y * Math.sin(yaw), away = x * Math.sin(yaw) + y * Math.cos(yaw);
    const up = z * Math.cos(pitch) + away * Math.sin(pitch), near = z * Math.sin(pitch) - away * Math.cos(pitch);
    return [canvas.width / 2 + scale * side, canvas.height / 2 - scale * up, near];
  }

  function line(points, closed) {
    pen.beginPath();
    points.forEach(([x, y], i) => i ? pen.lineTo(x, y) : pen.moveTo(x, y));
    if (closed) pen.closePath();
    pen.stroke();
  }

  function drawCamera(outline, color) {
    const corners = [];
    for (let i = 0; i < outline.length; i += 3) corners.push(project(outline[i], outline[i + 1], outline[i + 2]));
    pen.strokeStyle = color;
    line(corners.slice(1), true);
    for (const corner of corners.slice(1)) line([corners[0], corner], false);
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
    canvas.width = Math.max(1, Math.round(box.width * ratio));
    canvas.height = Math.max(1, Math.round(box.height * ratio));
    const style = getComputedStyle(document.documentElement);
    const blue = style.getPropertyValue('--blue'), orange = style.getPropertyValue('--orange');
    const dots = [];
    for (let i = 0; i < scene.points.length; i += 6) {
      const [x, y, depth] = project(scene.points[i], scene.points[i + 1], scene.points[i + 2]);
      dots.push([depth, x, y, i]);
    }
    dots.sort((a, b) => a[0] - b[0]);
    const size = 1.6 * ratio;
    for (const [, x, y, i] of dots) {
      pen.fillStyle = `rgb(${scene.points[i + 3]},${scene.points[i + 4]},${scene.points[i + 5]})`;
      pen.fillRect(x - size / 2, y - size / 2, size, size);
    }
    pen.lineWidth = ratio;
    for (const outline of scene.train) drawCamera(outline, blue);
    for (const outline of scene.test || []) drawCamera(outline, orange);
    const path = [];
    for (let i = 0; i < scene.path.length; i += 3)
      path.push(project(scene.path[i], scene.path[i + 1], scene.path[i + 2]));
    pen.strokeStyle = style.getPropertyValue('--soft');
    pen.setLineDash([5 * ratio, 4 * ratio]);
    line(path, true);
    pen.setLineDash([]);
  }

  let last = null;
  canvas.addEventListener('pointerdown', event => {
    last = event;
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', event => {
    if (!last) return;
    yaw += 0.008 * (event.clientX - last.clientX);
    pitch = Math.max(-1.57, Math.min(1.57, pitch + 0.008 * (event.clientY - last.clientY)));
    last = event;
    draw();
  });
  for (const name of ['pointerup', 'pointercancel']) canvas.addEventListener(name, () => last = null);
  canvas.addEventListener('wheel', event => {
    event.preventDefault();
    zoom = Math.max(0.3, Math.min(12, zoom * Math.exp(-0.0015 * event.deltaY)));
    draw();
  }, {passive: false});
  window.addEventListener('resize', draw);
  window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
  draw();
})();
