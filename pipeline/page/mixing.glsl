// The picture of field and splats in one: nerf/rendering/splat_mixing.h, but the splats have the same share everywhere,
// behind floaters of the field as well. The field's veil lies over both.
precision highp float;

uniform sampler2D field, splats;
uniform vec2 size;
out vec4 colour;

void main() {
  vec2 at = gl_FragCoord.xy / size;
  vec4 veiled = texture(field, at);
  vec3 alone = veiled.rgb;
  vec4 before = texture(splats, at);
  vec3 over = before.rgb + (1.0 - before.a) * alone;
  colour = vec4(mix(UNSEEN, clamp(alone + SHARE * (over - alone), 0.0, 1.0), veiled.a), 1);
}
