// The scene's splats in WebGL 2, sorted for each view and blended from the farthest to the nearest, and their mixture
// with the field's picture.

const kDepthSteps = 1 << 16;
// As RenderSplats in nerf/rendering/splat_mixing.h: pictures of less than this share of the size that the splats were
// fitted to are that picture, shrunk, up to so many times.
const kLeastZoom = 0.8, kMostShrink = 4;

// Splats in front of the camera from the farthest on: a counting sort of their depths' logarithms.
function sortByDepth(places, origin, forward, nearest, order) {
  const n = places.length / 3, steps = new Uint16Array(n), begins = new Uint32Array(kDepthSteps + 1);
  const depths = new Float32Array(n);
  let farthest = nearest;
  for (let i = 0; i < n; ++i) {
    depths[i] = (places[3 * i] - origin[0]) * forward[0] + (places[3 * i + 1] - origin[1]) * forward[1] +
      (places[3 * i + 2] - origin[2]) * forward[2];
    farthest = Math.max(farthest, depths[i]);
  }
  const scale = (kDepthSteps - 1) / Math.max(1e-9, Math.log(farthest / nearest));
  for (let i = 0; i < n; ++i) {
    if (!(depths[i] > nearest)) continue;
    steps[i] = scale * Math.log(farthest / depths[i]);
    ++begins[steps[i] + 1];
  }
  for (let k = 0; k < kDepthSteps; ++k) begins[k + 1] += begins[k];
  for (let i = 0; i < n; ++i) if (depths[i] > nearest) order[begins[steps[i]]++] = i;
  return begins[kDepthSteps - 1];
}

function magnified(camera, times) {
  const [width, height] = [camera.width, camera.height].map((side) => Math.ceil(times * side));
  const scale = [width / camera.width, height / camera.height];
  return { ...camera, width, height, focal: camera.focal.map((value, i) => scale[i] * value),
    centre: camera.centre.map((value, i) => scale[i] * value) };
}

class Splats {
  constructor({ description, texels }) {
    Object.assign(this, description);  // see splat_payload.h
    const constants = { SPLAT_WIDTH: kTableWidth };
    for (const [name, value] of Object.entries(description.constants)) constants[name] = real(value);
    this.program = makeProgram(constants, 'splat-vertex', 'splat-fragment');
    this.mixing = makeProgram({}, 'cover', 'mixing');
    this.n = texels.length / 8;
    this.places = new Float32Array(3 * this.n);
    const values = new Float32Array(texels.buffer, texels.byteOffset, texels.length);
    for (let i = 0; i < this.n; ++i) this.places.set(values.subarray(8 * i, 8 * i + 3), 3 * i);
    this.upload(texels);
    this.order = new Uint32Array(this.n);
    this.array = gl.createVertexArray();
    this.buffer = gl.createBuffer();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.order, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(0, 1);
    gl.bindVertexArray(null);
    this.picture = makeTarget(blendsHalfFloats ? gl.RGBA16F : gl.RGBA8, 2);  // colours, and nearness
    this.mixed = makeTarget();
    this.rate = 20;  // pixels per millisecond, as far as is known
    this.took = Infinity;  // the last picture [ms]
    this.drawnFor = '';
    gl.useProgram(this.program);
    gl.uniform1i(gl.getUniformLocation(this.program, 'splats'), kSplatUnit);
    this.drawQuads(1);  // out of sight; compiles what else would count as the first picture's time
  }

  // Whether there is time for splats while a hand moves; not where a processor stands in for a graphics card.
  get areQuick() { return this.took <= kSlowFrameMs; }

  upload(texels) {
    const rows = Math.ceil(texels.length / 4 / kTableWidth), all = new Uint32Array(rows * kTableWidth * 4);
    all.set(texels);
    bindTexture(kSplatUnit, gl.TEXTURE_2D);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32UI, kTableWidth, rows);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, kTableWidth, rows, gl.RGBA_INTEGER, gl.UNSIGNED_INT, all);
  }

  // The share of a picture's pixels that the field needs: of the pictures that the splats were fitted to.
  fieldShare(camera) { return Math.min(1, (this.focal_px / camera.focal[0]) ** 2); }

  aim(camera) {
    const { focal, centre, width, height } = camera, at = (name) => gl.getUniformLocation(this.program, name);
    const margin = this.slope_margin * width, zoom = focal[0] / this.focal_px;
    gl.uniform3fv(at('origin'), camera.at);
    gl.uniformMatrix3fv(at('rotation'), false, [...camera.x, ...camera.y, ...camera.z]);
    gl.uniform4f(at('projection'), ...focal, ...centre);
    gl.uniform2f(at('size'), width, height);
    gl.uniform1f(at('low_pass'), zoom * zoom * this.low_pass);
    gl.uniform4f(at('slopes'), (-centre[0] - margin) / focal[0], (-centre[1] - margin) / focal[1],
      (width - centre[0] + margin) / focal[0], (height - centre[1] + margin) / focal[1]);
  }

  drawQuads(n) {
    gl.useProgram(this.program);
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, this.order, 0, n);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, n);
    gl.disable(gl.BLEND);
    gl.bindVertexArray(null);
  }

  async draw(camera) {
    const view = JSON.stringify([camera.at, camera.x, camera.y, camera.focal, camera.centre, camera.width, camera.height]);
    if (view === this.drawnFor) return;
    this.drawnFor = view;
    this.size = [camera.width, camera.height];
    const zoom = camera.focal[0] / this.focal_px;
    this.isShrunk = zoom < kLeastZoom;
    if (this.isShrunk) camera = magnified(camera, Math.min(kMostShrink, 1 / zoom));
    const began = performance.now(), forward = camera.z.map((value) => -value);
    const n = sortByDepth(this.places, camera.at, forward, this.nearest, this.order);
    resizeTarget(this.picture, camera.width, camera.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.picture.frame);
    gl.viewport(0, 0, camera.width, camera.height);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.useProgram(this.program);
    this.aim(camera);
    this.drawQuads(n);
    this.bindPictures();
    await drawn();
    this.took = performance.now() - began;
    const rate = camera.width * camera.height / Math.max(1, this.took);
    this.rate *= Math.min(2, Math.max(0.25, rate / this.rate));
  }

  // Where the field's shader and the mixing one look for them.
  bindPictures() {
    this.picture.textures.forEach((texture, i) => {
      gl.activeTexture(gl.TEXTURE0 + [kMixedSplatsUnit, kNearnessUnit][i]);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, this.isShrunk ? gl.LINEAR_MIPMAP_LINEAR : gl.LINEAR);
      if (this.isShrunk) gl.generateMipmap(gl.TEXTURE_2D);
    });
  }

  // The mixture with a field's picture of the same view, which may have fewer pixels.
  mix(field) {
    const [width, height] = this.size;
    resizeTarget(this.mixed, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.mixed.frame);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.SCISSOR_TEST);
    gl.useProgram(this.mixing);
    const at = (name) => gl.getUniformLocation(this.mixing, name);
    gl.activeTexture(gl.TEXTURE0 + kMixedFieldUnit);
    gl.bindTexture(gl.TEXTURE_2D, field.textures[0]);
    gl.uniform1i(at('field'), kMixedFieldUnit);
    gl.uniform1i(at('splats'), kMixedSplatsUnit);
    gl.uniform2f(at('size'), width, height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    return this.mixed;
  }
}
