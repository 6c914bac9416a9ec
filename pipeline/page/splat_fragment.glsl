// kernels/splat_blending_reference.h; colours times opacity, blended over what is farther.
precision highp float;

in vec2 offset;
flat in vec3 conic;
flat in vec4 seen;
out vec4 colour;

void main() {
  float power = -0.5 * (conic.x * offset.x * offset.x + conic.z * offset.y * offset.y) - conic.y * offset.x * offset.y;
  float alpha = min(MAX_ALPHA, seen.a * exp(power));
  if (alpha < MIN_ALPHA) discard;
  colour = alpha * vec4(seen.rgb, 1);
}
