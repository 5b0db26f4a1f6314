// heat_over_shape: adds to a thermal picture what is fine in the luminance of a photo.  Two passes:
// a Gaussian blur is one along the rows, then one along the columns.
// Needs:   SECOND = 0: blurs along x; 1: blurs along y and adds;
//          MOST: weights that there is room for.
// Reads:   photo; weights; with SECOND also blurred, of the first pass, and heat.
// Writes:  shown: luminance, blurred along x; with SECOND the picture, opaque.
// Units:   display sRGB; pixels.
uniform sampler2D photo;
uniform float weights[MOST];  // of the pixel itself, and of those 1, 2, ... away
uniform int reach;
#if SECOND
uniform sampler2D blurred, heat;
uniform float detail;
#endif
out vec4 shown;
#include "common/luminance.glsl"

#if SECOND
float broad(ivec2 at, int last) {
    float sum = weights[0] * texelFetch(blurred, at, 0).r;
    for (int i = 1; i <= reach; i++) {
        sum += weights[i] * (texelFetch(blurred, ivec2(at.x, max(at.y - i, 0)), 0).r
                             + texelFetch(blurred, ivec2(at.x, min(at.y + i, last)), 0).r);
    }
    return sum;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    float luminance = dot(texelFetch(photo, at, 0).rgb, LUMINANCE);
    float fine = luminance - broad(at, textureSize(blurred, 0).y - 1);
    // Grey is added: the palette's hues stay.
    shown = vec4(clamp(texelFetch(heat, at, 0).rgb + detail * fine, 0.0, 1.0), 1.0);
}
#else
float luminance_at(int x, int y) {
    return dot(texelFetch(photo, ivec2(x, y), 0).rgb, LUMINANCE);
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    int last = textureSize(photo, 0).x - 1;
    float sum = weights[0] * luminance_at(at.x, at.y);
    for (int i = 1; i <= reach; i++) {
        sum += weights[i] * (luminance_at(max(at.x - i, 0), at.y)
                             + luminance_at(min(at.x + i, last), at.y));
    }
    shown = vec4(sum, 0.0, 0.0, 1.0);
}
#endif
