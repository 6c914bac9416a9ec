// A splat as a square that holds its ellipse: kernels/splat_projection_reference.h. Texels: splat_payload.h.
precision highp float;
precision highp int;
precision highp usampler2D;

uniform usampler2D splats;
uniform vec3 origin;
uniform mat3 rotation;          // columns: the camera's axes, x right, y up, z back
uniform vec4 projection;        // focal lengths, centre [px]
uniform vec2 size;              // [px]
uniform float low_pass;         // added to variances [px^2]
uniform vec4 slopes;            // lowest x, y, highest x, y of what projection is linearised at
layout(location = 0) in uint splat;  // farthest first
out vec2 offset;                // from the splat's centre [px], y down
flat out vec3 conic;
flat out vec4 seen;             // colour, opacity
flat out float inverse_distance;

vec4 Bytes(uint word) { return vec4(word & 255u, word >> 8 & 255u, word >> 16 & 255u, word >> 24); }

mat3 Turn(vec4 q) {  // w x y z
  q = normalize(q);
  float w = q.x, x = q.y, y = q.z, z = q.w;
  return mat3(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
              2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
              2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}

vec3 Colour(uvec4 words, vec3 direction) {
  vec4 mean = Bytes(words.y), first = Bytes(words.z), second = Bytes(words.w);
  vec3 k0 = mean.yzw, k1 = first.xyz, k2 = vec3(first.w, second.xy), k3 = vec3(second.zw, Bytes(words.x).w);
  return max(vec3(0), 0.5 + HARMONIC0 * COLOUR0 * (k0 - 128.0) +
      HARMONIC1 * COLOUR1 * (-direction.y * (k1 - 128.0) + direction.z * (k2 - 128.0) - direction.x * (k3 - 128.0)));
}

void main() {
  gl_Position = vec4(0, 0, 2, 1);  // outside of the picture
  ivec2 at = ivec2(int(splat) % (SPLAT_WIDTH / 2) * 2, int(splat) / (SPLAT_WIDTH / 2));
  uvec4 place = texelFetch(splats, at, 0), look = texelFetch(splats, at + ivec2(1, 0), 0);
  vec3 way = uintBitsToFloat(place.xyz) - origin, p = vec3(way * rotation) * vec3(1, -1, -1);
  if (!(p.z > NEAREST)) return;
  float opacity = Bytes(look.y).x / 255.0;
  if (opacity <= MIN_ALPHA) return;
  vec2 slope = clamp(p.xy / p.z, slopes.xy, slopes.zw);
  vec3 right = rotation[0], down = -rotation[1], forward = -rotation[2];
  mat3 turn = Turn(Bytes(place.w) - 128.0);
  vec3 deviations = exp(LOWEST_SCALE + SCALE_STEP * Bytes(look.x).xyz);
  vec3 across = projection.x / p.z * ((right - slope.x * forward) * turn) * deviations,
       along = projection.y / p.z * ((down - slope.y * forward) * turn) * deviations;
  vec3 covariance = vec3(dot(across, across) + low_pass, dot(across, along), dot(along, along) + low_pass);
  float determinant = covariance.x * covariance.z - covariance.y * covariance.y;
  conic = vec3(covariance.z, -covariance.y, covariance.x) / determinant;
  seen = vec4(Colour(look, normalize(way)), opacity);
  inverse_distance = 1.0 / max(NEAREST, length(way));
  vec2 corner = vec2(gl_VertexID % 2, gl_VertexID / 2) * 2.0 - 1.0;
  offset = corner * sqrt(2.0 * log(opacity / MIN_ALPHA) * covariance.xz);
  vec2 pixel = projection.xy * p.xy / p.z + projection.zw + offset;
  gl_Position = vec4((2.0 * pixel / size - 1.0) * vec2(1, -1), 0, 1);
}
