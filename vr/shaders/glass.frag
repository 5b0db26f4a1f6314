// glass: the picture of another stop within a disc in the room, where nothing nearer hides it.
// Drawn twice: what was there is taken away first, since a picture over the room has an alpha.
// Reads:   aside of panel.vert; picture; box; radius; the splats' depth.
// Writes:  shown: with cut how much is taken away, as alpha; else what comes there instead.
// Units:   metres from the middle; pixels; display sRGB.
#include "scene_depth.glsl"
in vec2 place;
in vec2 aside;
uniform sampler2D picture;  // of the pixels in box
uniform ivec4 box;          // left, bottom, width, height
uniform float radius;       // metres
uniform bool cut;
uniform vec2 size;          // pixels of the target
out vec4 shown;

void main() {
    float outside = length(aside) - radius;
    float here = clamp(0.5 - outside / max(fwidth(outside), 1e-6), 0.0, 1.0);
    here *= seen_before(gl_FragCoord.xy / size, 1.0 / gl_FragCoord.w);
    ivec2 at = clamp(ivec2(gl_FragCoord.xy) - box.xy, ivec2(0), box.zw - 1);
    shown = cut ? vec4(0.0, 0.0, 0.0, here) : here * texelFetch(picture, at, 0);
}
