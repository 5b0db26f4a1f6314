// capsule: soft light from above and from the head for what is solid; lines shine by themselves.
// Reads:   normal, towards_eye and color of capsule.vert; lit; the splats' depth.
// Writes:  shown, premultiplied.
// Units:   display sRGB.
#include "scene_depth.glsl"
in vec3 normal;
in vec3 towards_eye;
in vec4 color;
uniform bool lit;
uniform vec2 size;  // pixels
out vec4 shown;  // display sRGB, premultiplied

void main() {
    vec3 rgb = color.rgb;
    if (lit) {
        vec3 n = normalize(normal);
        float facing = max(dot(n, normalize(towards_eye)), 0.0);
        // A hemisphere light: all from above, nothing from below; the rest follows the head, so
        // that a hand is never black.
        float sky = 0.5 + 0.5 * n.y;
        rgb *= 0.30 + 0.42 * sky + 0.28 * facing;
        rgb *= mix(0.72, 1.0, smoothstep(0.0, 0.45, facing));  // a darker outline parts the fingers
    }
    // 1 / w of the clip space is the depth along the view.
    float opacity = color.a * seen_before(gl_FragCoord.xy / size, 1.0 / gl_FragCoord.w);
    if (!(opacity > 1.0 / 512.0)) discard;  // it would leave its depth
    shown = vec4(rgb * opacity, opacity);
}
