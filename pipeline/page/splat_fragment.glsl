// kernels/splat_blending_reference.h; colours, and 1 / distance, times opacity, blended over what is farther.
precision highp float;

in vec2 offset;
flat in vec3 conic;
flat in vec4 seen;
flat in float inverse_distance;
layout(location = 0) out vec4 colour;
layout(location = 1) out vec4 nearness;

void main() {
  float power = -0.5 * (conic.x * offset.x * offset.x + conic.z * offset.y * offset.y) - conic.y * offset.x * offset.y;
  float alpha = min(MAX_ALPHA, seen.a * exp(power));
  if (alpha < MIN_ALPHA) discard;
  colour = alpha * vec4(seen.rgb, 1);
  nearness = alpha * vec4(inverse_distance, 0, 0, 1);
}
