// triangle: the smallest triangle around the unit circle, one a splat.
// Reads:   nothing.
// Defines: const vec2 TRIANGLE[3], its corners.
// Units:   sigmas of the cutoff, along the ellipse's own axes.

// Its tip lies along the ellipse's shorter axis: fewer screen tiles are touched.
const vec2 TRIANGLE[3] = vec2[3](vec2(0.0, 2.0), vec2(-1.7320508, -1.0), vec2(1.7320508, -1.0));
