// The picture of field and splats in one: nerf/rendering/splat_mixing.h.
precision highp float;

uniform sampler2D field, splats;  // the field's last channel: the splats' share
uniform vec2 size;
out vec4 colour;

void main() {
  vec2 at = gl_FragCoord.xy / size;
  vec4 alone = texture(field, at), before = texture(splats, at);
  vec3 over = before.rgb + (1.0 - before.a) * alone.rgb;
  colour = vec4(clamp(alone.rgb + alone.a * (over - alone.rgb), 0.0, 1.0), 1);
}
