// The field in WebGL 2, and splats over it: pictures of a view. The field is drawn tile by tile, so that no draw call holds
// the graphics card up.

// Quality 0 while the view moves, 1 at rest, 2 as the program renders. Samples share colours until they weigh
// least_weight together.
const kQualities = [
  { least_transmittance: 1e-2, least_weight: 2, step_scale: () => 1, rays: () => 1 },
  { least_transmittance: 1e-4, least_weight: 0.25, step_scale: () => 1, rays: () => 1 },
  { least_transmittance: 1e-4, least_weight: 0.01, step_scale: (space) => space.step_scale,
    rays: (space) => space.rays_per_pixel },
];
const kTileMs = 60, kLeastTile = 32;  // [ms], [px]; smaller tiles are mostly overhead
const kPresentMs = 100;
// Texture units. The first three and the one after them, for any work, are given by number.
const kSplatUnit = 4, kMixedFieldUnit = 5, kMixedSplatsUnit = 6, kSharesUnit = 7, kNearnessUnit = 8;
const kTableWidth = 2048;  // every WebGL 2 has textures of that size

const gl = picture.getContext('webgl2', { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true });

// Without, 8 bits per blended splat leave some noise, and distances are too coarse to compare.
const blendsHalfFloats = Boolean(gl.getExtension('EXT_color_buffer_float') ||
  gl.getExtension('EXT_color_buffer_half_float'));

const real = (value) => { const text = String(value); return /[.e]/.test(text) ? text : text + '.0'; };

function fieldConstants({ space, grid_resolution, trained_resolution, kept_levels, splats }) {
  return { TABLE_WIDTH: kTableWidth, TABLE_SHIFT: Math.log2(kTableWidth), TRAINED: trained_resolution,
    KEPT_LEVELS: kept_levels, GRID: grid_resolution, NEAR: real(space.near), FAR: real(space.far),
    CENTRE: `vec3(${space.centre.map(real)})`, HALF: real(space.half), UNBOUNDED: space.unbounded,
    ENDS_AT_INFINITY: space.ends_at_infinity, STEP_SIZE: real(space.step_size), CONE_ANGLE: real(space.cone_angle),
    BACKGROUND: `vec3(${space.background.map(real)})`, HAS_UNKNOWN_SPACE: space.has_unknown_space,
    UNSEEN: `vec3(${space.unseen.map(real)})`, HAS_SPLATS: Boolean(splats), SHARE: real(splats?.share ?? 0),
    SHARE_BEHIND: real(blendsHalfFloats && splats ? splats.share_behind : 0),
    NEARLY_AS_FAR: real(splats?.nearly_as_far ?? 1), WELL_BEFORE: real(splats?.well_before ?? 0) };
}

// Of two shaders in the page, with constants by name.
function makeProgram(constants, vertex, fragment) {
  const program = gl.createProgram();
  const head = Object.entries(constants).map(([name, value]) => `#define ${name} ${value}\n`).join('');
  const attach = (kind, id) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, '#version 300 es\n' + head + byId(id).textContent);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    return shader;
  };
  const shaders = [attach(gl.VERTEX_SHADER, vertex), attach(gl.FRAGMENT_SHADER, fragment)];
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
    throw new Error(shaders.map((shader) => gl.getShaderInfoLog(shader)).join('') || gl.getProgramInfoLog(program));
  return program;
}

function uploadWeights(program, field) {
  const levels = field.description.levels;
  const density = new Float32Array(2112 + 8 * 8), words = new Uint32Array(density.buffer);
  density.set(field.weights.subarray(0, 2112));
  levels.forEach((level, i) => {
    words.set([level.resolution, level.hash_mask, level.first_entry, 0], 2112 + 4 * i);
    density.set(level.scale, 2144 + 4 * i);
  });
  const blocks = { Density: density, Features: field.weights.subarray(2112, 2112 + 3328),
    Colour: field.weights.subarray(5440, 5440 + 4096) };
  Object.entries(blocks).forEach(([name, values], i) => {
    gl.bindBufferBase(gl.UNIFORM_BUFFER, i, gl.createBuffer());
    gl.bufferData(gl.UNIFORM_BUFFER, values, gl.STATIC_DRAW);
    gl.uniformBlockBinding(program, gl.getUniformBlockIndex(program, name), i);
  });
}

function bindTexture(unit, kind, between = gl.NEAREST) {
  gl.activeTexture(gl.TEXTURE0 + unit);
  const texture = gl.createTexture();
  gl.bindTexture(kind, texture);
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(kind, filter, between);
  for (const edge of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(kind, edge, gl.CLAMP_TO_EDGE);
  return texture;
}

function uploadTextures(program, field) {
  const place = (name, unit) => gl.uniform1i(gl.getUniformLocation(program, name), unit);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  bindTexture(0, gl.TEXTURE_2D);
  const rows = Math.ceil(field.table.length / 4 / kTableWidth), texels = new Uint8Array(rows * kTableWidth * 4);
  texels.set(field.table);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, kTableWidth, rows);
  gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, kTableWidth, rows, gl.RGBA, gl.UNSIGNED_BYTE, texels);
  place('table', 0);
  const cells = (name, unit, n, kind, format, between) => {
    bindTexture(unit, gl.TEXTURE_3D, between);
    gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_WRAP_R, gl.CLAMP_TO_EDGE);
    gl.texStorage3D(gl.TEXTURE_3D, 1, kind, n, n, n);
    gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, 0, n, n, n, format, gl.UNSIGNED_BYTE, field[name]);
    place(name, unit);
  };
  cells('march', 1, field.description.grid_resolution, gl.R8UI, gl.RED_INTEGER, gl.NEAREST);
  cells('trained', 2, field.description.trained_resolution, gl.R8, gl.RED, gl.LINEAR);
  if (field.splats)
    cells('shares', kSharesUnit, field.description.splats.shares_resolution, gl.R8, gl.RED, gl.LINEAR);
  // Without splats as well: samplers of different kinds must not share a unit.
  place('shares', kSharesUnit);
  place('splats', kMixedSplatsUnit);
  place('nearness', kNearnessUnit);
}

// A picture on the graphics card, or n of the same size that are drawn at once.
function makeTarget(format = gl.RGBA8, n = 1) {
  const textures = Array.from({ length: n }, () => bindTexture(3, gl.TEXTURE_2D, gl.LINEAR));
  return { frame: gl.createFramebuffer(), textures, format, width: 0, height: 0 };
}

function resizeTarget(target, width, height) {
  if (target.width === width && target.height === height) return;
  gl.activeTexture(gl.TEXTURE3);
  gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
  const kind = target.format === gl.RGBA8 ? gl.UNSIGNED_BYTE : gl.HALF_FLOAT;
  const places = target.textures.map((texture, i) => {
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, target.format, width, height, 0, gl.RGBA, kind, null);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture, 0);
    return gl.COLOR_ATTACHMENT0 + i;
  });
  gl.drawBuffers(places);
  Object.assign(target, { width, height });
}

function copyTarget(from, to) {
  gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from.frame);
  gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to.frame);
  gl.disable(gl.SCISSOR_TEST);
  gl.blitFramebuffer(0, 0, from.width, from.height, 0, 0, to.width, to.height, gl.COLOR_BUFFER_BIT, gl.LINEAR);
}

// When the graphics card has done what it was told.
function drawn() {
  const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  return new Promise((done) => {
    const look = () => {
      if (!gl.isContextLost() && gl.getSyncParameter(sync, gl.SYNC_STATUS) === gl.UNSIGNALED) return setTimeout(look, 1);
      gl.deleteSync(sync);
      done();
    };
    setTimeout(look, 0);
  });
}

class Renderer {
  constructor(field) {
    this.space = field.description.space;
    this.program = makeProgram(fieldConstants(field.description), 'cover', 'shader');
    gl.useProgram(this.program);
    this.uniform = (name) => gl.getUniformLocation(this.program, name);
    uploadWeights(this.program, field);
    uploadTextures(this.program, field);
    this.isMixed = false;
    this.splats = field.splats ? new Splats(field.splats) : null;
    this.presented = 0;
    this.shown = makeTarget();
    this.next = makeTarget();
    this.rates = kQualities.map(() => 4);  // pixels per millisecond, as far as is known: slow at first
  }

  // camera: {x, y, z, at, focal: [x, y], centre: [x, y], width, height} with lengths in pixels
  aim(camera, quality) {
    const { least_transmittance, least_weight, step_scale, rays } = kQualities[quality];
    gl.useProgram(this.program);
    gl.uniform3fv(this.uniform('origin'), camera.at);
    gl.uniformMatrix3fv(this.uniform('rotation'), false, [...camera.x, ...camera.y, ...camera.z]);
    gl.uniform4f(this.uniform('intrinsics'), 1 / camera.focal[0], 1 / camera.focal[1], ...camera.centre);
    gl.uniform2f(this.uniform('size'), camera.width, camera.height);
    gl.uniform1f(this.uniform('step_scale'), step_scale(this.space));
    gl.uniform1f(this.uniform('least_transmittance'), least_transmittance);
    gl.uniform1f(this.uniform('least_weight'), least_weight);
    gl.uniform1i(this.uniform('rays_per_side'), Math.sqrt(rays(this.space)));
  }

  async drawTile(x, y, width, height, quality) {
    gl.useProgram(this.program);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.next.frame);
    gl.viewport(0, 0, this.next.width, this.next.height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(x, y, width, height);
    const began = performance.now();
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    await drawn();
    const rate = width * height / Math.max(1, performance.now() - began), before = this.rates[quality];
    this.rates[quality] = before * Math.min(2, Math.max(0.25, rate / before));
  }

  // The field in tiles in reading order from the top, shown as they are done, as long as isWanted(); while the view
  // moves, a tile for all, whose size the caller bounds. Whether all were drawn. Splats lie over it as `over` sees them,
  // the same view with as many pixels or more; null: none.
  async draw(camera, over, quality, isWanted) {
    const { width, height } = camera;
    this.isMixed = this.splats !== null && over !== null;
    if (this.isMixed) await this.splats.draw(over);
    resizeTarget(this.next, width, height);
    if (this.shown.width > 0) copyTarget(this.shown, this.next);
    this.aim(camera, quality);
    for (let top = 0, side; top < height; top += side) {
      side = Math.max(kLeastTile, Math.round(Math.sqrt(this.rates[quality] * kTileMs)));
      if (quality === 0 || side * side > width * height / 2) side = Math.max(width, height);
      for (let left = 0; left < width; left += side) {
        const rows = Math.min(side, height - top), columns = Math.min(side, width - left);
        await this.drawTile(left, height - top - rows, columns, rows, quality);
        if (!isWanted()) return false;
        if (quality > 0 && performance.now() - this.presented > kPresentMs) this.present(this.next);
      }
    }
    [this.shown, this.next] = [this.next, this.shown];
    this.present();
    return !gl.isContextLost();
  }

  // What is presented, on the graphics card.
  get picture() { return this.isMixed ? this.splats.mixed : this.shown; }

  present(target = this.shown) {
    if (target.width === 0) return;
    this.presented = performance.now();
    if (this.isMixed) target = this.splats.mix(target);
    copyTarget(target, { frame: null, width: gl.drawingBufferWidth, height: gl.drawingBufferHeight });
  }
}
