// stereo_pair: one triangle a splat around its two ellipses, those of the left and of the right
// view, in a grid of pixels where the two lie close to each other; see renderer/gl/stereo_pair.py.
// Reads:   order, records of both views, counts.
// Writes:  gl_Position; sigmas in both ellipses, colours, opacities.
// Units:   pixels of the grid from lower left; sigmas along each ellipse's own axes.
#include "common/sorted.glsl"
uniform vec2 size;    // pixels of the grid
uniform vec2 disparity_offsets;  // x in the grid minus x in the left and right picture, pixels
uniform uint count;   // splats; records of the right view start there
uniform float per_unit;  // 1 over the display value that 1 in the pictures stands for

out vec4 sigmas;  // place in the axes of the left and of the right ellipse
flat out vec3 left_color;
flat out vec3 right_color;
flat out vec2 opacities;

const vec2 NOWHERE = vec2(100.0);  // sigmas, where nothing is left of any splat

// How far a matrix stretches: its largest singular value.
float stretch(mat2 m) {
    vec2 sum = vec2(m[0][0] + m[1][1], m[0][1] - m[1][0]);
    vec2 difference = vec2(m[0][0] - m[1][1], m[0][1] + m[1][0]);
    return 0.5 * (length(sum) + length(difference));
}

void main() {
    uint triangle = uint(gl_VertexID) / 3u, corner = uint(gl_VertexID) % 3u;
    uint i = order[counts[COUNT_SORTED] - 1u - triangle];
    Ellipse left = unpack_record(records[2u * i], records[2u * i + 1u]);
    i += count;
    Ellipse right = unpack_record(records[2u * i], records[2u * i + 1u]);
    left.center.x += disparity_offsets.x;
    right.center.x += disparity_offsets.y;
    // A culled splat's cutoff is 0.
    bool in_left = left.cutoff_sigmas > 0.0, in_right = right.cutoff_sigmas > 0.0;

    // In the axes of one ellipse that one is a disc around 0 whose radius is its cutoff, and the
    // other lies in a disc around what is left of the disparity.  Each edge of the triangle is
    // moved out until both discs are behind it.
    Ellipse e = left;
    if (!in_left) e = right;
    mat2 axes = mat2(e.major, e.minor);
    vec2 disparity = vec2(0.0);
    float radius = 0.0;
    if (in_left && in_right) {
        disparity = inverse(axes) * (right.center - left.center);
        // The right ellipse in axes of the left: a disc as large as these stretch it at most.
        radius = right.cutoff_sigmas * stretch(inverse(axes) * mat2(right.major, right.minor));
    }
    vec2 n = -0.5 * TRIANGLE[corner], m = -0.5 * TRIANGLE[(corner + 1u) % 3u];  // of two edges
    float edge_n = max(e.cutoff_sigmas, dot(n, disparity) + radius),
          edge_m = max(e.cutoff_sigmas, dot(m, disparity) + radius);
    // The corner where the two moved edges meet: n . s = edge_n and m . s = edge_m.
    vec2 s = vec2(edge_n * m.y - edge_m * n.y, n.x * edge_m - m.x * edge_n) /
             (n.x * m.y - n.y * m.x);
    vec2 pixel = e.center + axes * s;

    sigmas = vec4(s, NOWHERE);
    if (!in_left) sigmas = vec4(NOWHERE, s);
    if (in_left && in_right) {
        // The same pixel, in the right ellipse's own axes.
        sigmas.zw = inverse(mat2(right.major, right.minor)) * (pixel - right.center);
    }
    left_color = left.color * per_unit;
    right_color = right.color * per_unit;
    opacities = vec2(left.opacity, right.opacity);
    gl_Position = vec4(2.0 * pixel / size - 1.0, 0.0, 1.0);
}
