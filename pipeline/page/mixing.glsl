// The picture of field and splats in one: nerf/rendering/splat_mixing.h.
precision highp float;

uniform sampler2D field, splats;
uniform vec2 size;
out vec4 colour;

void main() {
  vec2 at = gl_FragCoord.xy / size;
  vec3 alone = texture(field, at).rgb;
  vec4 before = texture(splats, at);
  vec3 over = before.rgb + (1.0 - before.a) * alone;
  colour = vec4(clamp(alone + SHARE * (over - alone), 0.0, 1.0), 1);
}
