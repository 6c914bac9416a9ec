// The field of nerf/fields/hash_field.h along the rays of a camera, as nerf/rendering/ray_renderer.cpp renders
// them. Constants in capitals are put before this text by renderer.js.
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler3D;
precision highp usampler3D;

// The networks of nerf/fields/hash_network.h as blocks of 4 x 4, block (i, j) at i * columns + j. A uniform
// block may have 16 kB.
layout(std140) uniform Density {
  mat4 w1[8 * 16];
  vec4 w2_density[16];  // W2's first column
  uvec4 level[8];       // resolution, hash mask, first entry
  vec4 scale[8];        // of the table's features
};
layout(std140) uniform Features {
  mat4 w2[16 * 4];
  mat4 w3[8 * 16];
  mat4 w5[16];
};
layout(std140) uniform Colour { mat4 w4[16 * 16]; };

uniform sampler2D table;     // an entry per texel, row by row
uniform usampler3D march;    // per occupancy cell, see field_payload.h
uniform sampler3D shares;    // ShareMap, z fastest; a single texel where there is no map
uniform sampler2D splats, nearness;  // of the same view, see splat_fragment.glsl
uniform vec2 size;           // of the picture [px]
uniform sampler3D trained;   // per trained cell 1, near one 0.5, else 0; between cells' middles what lies between
uniform vec3 origin;
uniform mat3 rotation;    // world from camera
uniform vec4 intrinsics;  // 1 / focal lengths, centre [px]
uniform float step_scale, least_transmittance, least_weight;
uniform int rays_per_side;  // of a pixel
out vec4 colour;           // and the share of the splats in the picture

const float kMaxLogDensity = 15.0, kMinWeight = 1e-3;
// Share of a pixel's light from where no training sample was, at which the veil begins and is complete.
const float kVeilBegins = 0.5, kVeilComplete = 0.9;
const float kTransparent = 1e-3;  // opacity of splats below which they have no distance
const float kNowhere = 1e30;  // distance of a surface that a ray does not meet
const int kMaxSamples = 4096, kMaxSteps = 65536;  // no graphics card is to hang on us

// ---- networks

vec4 Entry(uint at) {
  vec4 root = texelFetch(table, ivec2(at & uint(TABLE_WIDTH - 1), at >> TABLE_SHIFT), 0) * (255.0 / 127.0) -
              128.0 / 127.0;
  return root * abs(root);
}

// Trilinear features of a level at u in the unit cube, see kernels/hash_grid_reference.h.
vec4 Encode(int l, vec3 u) {
  uint resolution = level[l].x, mask = level[l].y, first = level[l].z;
  vec3 p = u * float(resolution);
  vec3 cell = min(floor(p), float(resolution - 1u));
  vec3 f = p - cell;
  // What a step along an axis adds to a corner's number: plain sums where dense, exclusive ors where hashed.
  uvec3 factor = mask != 0u ? uvec3(1u, 2654435761u, 805459861u)
                            : uvec3(1u, resolution + 1u, (resolution + 1u) * (resolution + 1u));
  uvec3 low = uvec3(cell) * factor, high = low + factor;
  vec4 sum = vec4(0);
  for (int c = 0; c < 8; ++c) {
    bvec3 upper = bvec3((c & 1) != 0, (c & 2) != 0, (c & 4) != 0);
    uvec3 part = uvec3(upper.x ? high.x : low.x, upper.y ? high.y : low.y, upper.z ? high.z : low.z);
    uint at = mask != 0u ? (part.x ^ part.y ^ part.z) & mask : part.x + part.y + part.z;
    vec3 w = mix(1.0 - f, f, upper);
    sum += w.x * w.y * w.z * Entry(first + at);
  }
  return sum * scale[l];
}

// Density per scene unit, and the first network's hidden layer.
float QueryDensity(vec3 u, out vec4 hidden[16]) {
  for (int j = 0; j < 16; ++j) hidden[j] = vec4(0);
  ivec3 cell = clamp(ivec3(u * float(TRAINED)), 0, TRAINED - 1);
  int n_levels = texelFetch(trained, cell, 0).r > 0.75 ? 8 : KEPT_LEVELS;
  for (int i = 0; i < n_levels; ++i) {
    vec4 features = Encode(i, u);
    for (int j = 0; j < 16; ++j) hidden[j] += w1[i * 16 + j] * features;
  }
  float log_sigma = -1.0;
  for (int j = 0; j < 16; ++j) {
    hidden[j] = max(hidden[j], 0.0);
    log_sigma += dot(hidden[j], w2_density[j]);
  }
  return exp(min(log_sigma, kMaxLogDensity));
}

// nerf/fields/spherical_harmonics.h
void SphericalHarmonics(vec3 d, out vec4 sh[4]) {
  vec3 s = d * d;
  sh[0] = vec4(0.28209479177387814, vec3(-0.48860251190291987, 0.48860251190291987, -0.48860251190291987) * d.yzx);
  sh[1] = vec4(1.0925484305920792 * d.x * d.y, -1.0925484305920792 * d.y * d.z,
               0.31539156525252005 * (3.0 * s.z - 1.0), -1.0925484305920792 * d.x * d.z);
  sh[2] = vec4(0.54627421529603959 * (s.x - s.y), -0.59004358992664352 * d.y * (3.0 * s.x - s.y),
               2.8906114426405538 * d.x * d.y * d.z, -0.45704579946446572 * d.y * (5.0 * s.z - 1.0));
  sh[3] = vec4(0.3731763325901154 * d.z * (5.0 * s.z - 3.0), -0.45704579946446572 * d.x * (5.0 * s.z - 1.0),
               1.445305721320277 * d.z * (s.x - s.y), -0.59004358992664352 * d.x * (s.x - 3.0 * s.y));
}

vec3 QueryColour(vec4 hidden[16], float share, vec3 direction) {
  vec4 inputs[8], sh[4], first[16], second[16];
  SphericalHarmonics(direction, sh);
  for (int j = 0; j < 4; ++j) inputs[j] = vec4(0), inputs[4 + j] = sh[j];
  for (int i = 0; i < 16; ++i) {
    for (int j = 0; j < 4; ++j) inputs[j] += w2[i * 4 + j] * (share * hidden[i]);
    first[i] = second[i] = vec4(0);
  }
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 16; ++j) first[j] += w3[i * 16 + j] * inputs[i];
  for (int i = 0; i < 16; ++i) {
    vec4 lit = max(first[i], 0.0);
    for (int j = 0; j < 16; ++j) second[j] += w4[i * 16 + j] * lit;
  }
  vec3 logit = vec3(0);
  for (int i = 0; i < 16; ++i) logit += (w5[i] * max(second[i], 0.0)).rgb;
  return 1.0 / (1.0 + exp(-logit));
}

// ---- marching, see kernels/march_reference.h

struct Path {
  vec3 start, slope;
  float t, t_last;
};

float Reach(vec3 p) { return max(max(abs(p.x), abs(p.y)), abs(p.z)); }

Path StartPath(vec3 direction) {
  Path path;
  path.t = NEAR;
  path.t_last = FAR;
  vec3 offset = origin - CENTRE;
  for (int i = 0; i < 3 && !UNBOUNDED; ++i) {
    if (abs(direction[i]) < 1e-30) {
      if (abs(offset[i]) > HALF) path.t_last = path.t;
      continue;
    }
    float a = (-HALF - offset[i]) / direction[i], b = (HALF - offset[i]) / direction[i];
    path.t = max(path.t, min(a, b));
    path.t_last = min(path.t_last, max(a, b));
  }
  float to_unit = UNBOUNDED ? 1.0 / HALF : 0.5 / HALF;
  path.start = offset * to_unit + (UNBOUNDED ? 0.0 : 0.5);
  path.slope = direction * to_unit;
  return path;
}

float Delta(float t) { return step_scale * max(STEP_SIZE, CONE_ANGLE * t); }

// Distance along the ray within which it moves by one cell at most.
float CellLength(Path path, float t, float m, float delta) {
  float length = (UNBOUNDED ? 4.0 : 2.0) * HALF / float(GRID);
  if (!UNBOUNDED) return length;
  bool outwards = Reach(path.start + (t + delta) * path.slope) > m;
  return length / (outwards && m > 1.25 ? sqrt((8.0 * m - 12.0) * m + 5.0) / (m * m) : sqrt(1.024));
}

vec3 UnitPlace(vec3 p) {
  float m = Reach(p);
  return clamp(!UNBOUNDED ? p : 0.5 + 0.25 * p * (m <= 1.0 ? 1.0 : (2.0 - 1.0 / m) / m), 0.0, 1.0);
}
vec3 PlaceAtInfinity(vec3 direction) { return clamp(0.5 * direction / Reach(direction) + 0.5, 0.0, 1.0); }

// Advances to the next interval whose middle lies in an occupied cell, and behind it; false at the end.
bool NextSample(inout Path path, out vec3 u, out float delta) {
  for (int i = 0; i < kMaxSteps && path.t < path.t_last; ++i) {
    delta = Delta(path.t);
    float middle = path.t + 0.5 * delta;
    vec3 p = path.start + middle * path.slope;
    float m = Reach(p);
    u = UnitPlace(p);
    uint distance = texelFetch(march, min(ivec3(u * float(GRID)), GRID - 1), 0).r;
    path.t += distance > 1u ? max(delta, float(distance - 1u) * CellLength(path, middle, m, delta)) : delta;
    if (distance == 0u) return true;
  }
  return false;
}

// ---- rays

// Samples share a colour, that of their mean hidden layer, until they weigh least_weight together: what follows
// the hidden layer costs three times as much as what leads to it. stagger: share of the first interval that is
// skipped. Last comes the share of the light from where no training sample was. surface: the distance at which half of
// the light is absorbed.
vec4 RayColour(vec3 direction, float stagger, out float surface) {
  Path path = StartPath(direction);
  path.t += stagger * Delta(path.t);
  vec3 rgb = vec3(0), u;
  vec4 hidden[16], mean[16];
  for (int j = 0; j < 16; ++j) mean[j] = vec4(0);
  float optical_depth = 0.0, transmittance = 1.0, gathered = 0.0, coloured = 0.0, unseen = 0.0, delta;
  bool inside = true;
  surface = kNowhere;
  for (int i = 0; i < kMaxSamples && inside && transmittance >= least_transmittance; ++i) {
    inside = NextSample(path, u, delta);
    float weight = 0.0;
    if (!inside) {  // an opaque sample at infinity may follow
      if (!ENDS_AT_INFINITY && gathered < kMinWeight) break;
      u = PlaceAtInfinity(direction);
    }
    float tau = QueryDensity(u, hidden) * delta;
    if (inside) {
      weight = transmittance * (tau < 1e-3 ? tau - 0.5 * tau * tau : 1.0 - exp(-tau));
      float half_absorbed = log(2.0) - optical_depth;
      if (surface == kNowhere && tau > 0.0 && half_absorbed <= tau)
        surface = path.t - delta + delta * half_absorbed / tau;
      optical_depth += tau;
      transmittance = exp(-optical_depth);
    } else if (ENDS_AT_INFINITY) {
      weight = transmittance;
      transmittance = 0.0;
    }
    gathered += weight;
    if (HAS_UNKNOWN_SPACE) unseen += weight * (1.0 - min(1.0, 2.0 * texture(trained, u).r));
    for (int j = 0; j < 16; ++j) mean[j] += weight * hidden[j];
    bool last = !inside || transmittance < least_transmittance;
    if (gathered >= least_weight || (last && gathered >= kMinWeight)) {
      rgb += gathered * QueryColour(mean, 1.0 / gathered, direction);
      coloured += gathered;
      gathered = 0.0;
      for (int j = 0; j < 16; ++j) mean[j] = vec4(0);
    }
  }
  if (coloured > 0.0) rgb *= (1.0 - transmittance) / coloured;
  return vec4(rgb + transmittance * BACKGROUND, unseen);
}

// SplatShares in nerf/rendering/splat_mixing.cpp: of the splats in the picture, on a ray that meets the field's surface at that distance.
float SplatShare(vec3 direction, float surface) {
  bool met = surface < kNowhere;
  float to_unit = UNBOUNDED ? 1.0 / HALF : 0.5 / HALF;
  vec3 place = met ? UnitPlace((origin - CENTRE + surface * direction) * to_unit + (UNBOUNDED ? 0.0 : 0.5))
                   : PlaceAtInfinity(direction);
  float share = met || UNBOUNDED ? texture(shares, place.zyx).r : SHARE;
  vec2 at = gl_FragCoord.xy / size;
  float opacity = texture(splats, at).a, ratio = surface * texture(nearness, at).r / max(opacity, kTransparent);
  float before = clamp((NEARLY_AS_FAR - ratio) / (NEARLY_AS_FAR - WELL_BEFORE), 0.0, 1.0);
  if (!met || opacity < kTransparent) before = 0.0;
  return share + max(0.0, SHARE_BEHIND - share) * before;
}

void main() {
  float side = 1.0 / float(rays_per_side);
  int n_rays = rays_per_side * rays_per_side;
  vec4 sum = vec4(0);
  float share = 0.0, surface;
  for (int i = 0; i < n_rays; ++i) {
    vec2 cell = (vec2(i % rays_per_side, i / rays_per_side) + 0.5) * side - 0.5;
    vec2 pixel = vec2(gl_FragCoord.x, size.y - gl_FragCoord.y) + cell;
    vec2 image = (pixel - intrinsics.zw) * intrinsics.xy;
    vec3 direction = rotation * normalize(vec3(image.x, -image.y, -1));
    sum += RayColour(direction, float(i) / float(n_rays), surface);
    if (HAS_SPLATS) share += SplatShare(direction, surface);
  }
  vec4 mean = clamp(sum / float(n_rays), 0.0, 1.0);
  float veil = smoothstep(kVeilBegins, kVeilComplete, mean.a);
  colour = vec4(mix(mean.rgb, UNSEEN, veil), (1.0 - veil) * share / float(n_rays));
}
