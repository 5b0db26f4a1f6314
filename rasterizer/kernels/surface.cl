// surface: splats -> how deep they lie under the pixels around them (common/surface.cl), and back.
// The depth of a ray d with d.z = 1 is d^T M p / d^T M d, M = Sigma^-1 up to a factor; with
//   M = B B^T,  t = B^T p,  b = B t,  beta = p . b
// it is written in pixels from the mean.
// Reads:   means, scales (N, 3), wxyz (N, 4), record (N, 12), a camera; backward also surface and
//          its gradients (N, 8).
// Writes:  surface (N, 8); backward adds to the gradients of means, scales and quaternions.
// Units:   metres; slopes in 1/pixel, squares in 1/pixel^2.
#include "common/record.cl"
#include "common/ewa.cl"
#include "common/surface.cl"

// B with B B' = the inverse covariance times the square of the least scale: the splat's axes, each
// as long as the least scale is of its own.  A flat splat's is its normal alone.
typedef struct {
  floatn3 x, y, z;  // rows of B
  floatn3 length;   // of its columns
  floatn3 t;        // B' p
  floatn3 b;        // B B' p
  floatn beta;      // p' B B' p
} Inverse;

// The least scale over each: 1 of the flattest axis, whatever its size, so nothing overflows.
inline floatn3 inverse_lengths(floatn3 s) {
  const floatn least = fmin(s.x, fmin(s.y, s.z)), one = 1;
  return make3(select(least / s.x, one, s.x == least), select(least / s.y, one, s.y == least),
               select(least / s.z, one, s.z == least));
}

// B = W R diag(lengths): the rows of the rotation, scaled.
inline Inverse inverse_of(const Splat* s) {
  Inverse i;
  i.length = inverse_lengths(s->scale);
  i.x = times3(s->wr_x, i.length);
  i.y = times3(s->wr_y, i.length);
  i.z = times3(s->wr_z, i.length);
  const floatn3 p = s->p;
  // t = B^T p: the columns of B with p.
  i.t = make3(i.x.x * p.x + i.y.x * p.y + i.z.x * p.z, i.x.y * p.x + i.y.y * p.y + i.z.y * p.z,
              i.x.z * p.x + i.y.z * p.y + i.z.z * p.z);
  i.b = make3(dot3(i.x, i.t), dot3(i.y, i.t), dot3(i.z, i.t));
  // Never 0: of a plane through the eye nothing is to be seen, and nothing of it may be NaN.
  i.beta = fmax(dot3(i.t, i.t), 1e-12f * dot3(p, p));
  return i;
}

// near: what lies nearer is not drawn.  Culled splats get zeros.
__kernel void surface(int count, float near, __constant float* camera, __global const float* means,
                      __global const float* scales, __global const float* wxyz,
                      __global const float* record, __global float* surface) {
  const int first = get_global_id(0) * WIDTH, n = min(WIDTH, count - first);
  if (n <= 0) return;
  // No low pass: depth is of the ellipsoid, not of its blurred picture.
  const Splat s = project_splat(LOAD3(means), LOAD3(scales), LOAD(wxyz, 4, 0), LOAD(wxyz, 4, 1),
                        LOAD(wxyz, 4, 2), LOAD(wxyz, 4, 3), camera, 0);
  const Inverse i = inverse_of(&s);
  const intn seen = LOAD(record, RECORD, EXTENT_X) > 0;
  // A pixel u from the mean turns the ray by u / fx: a factor Z / beta makes slopes of b.
  const floatn none = 0, per = s.p.z / i.beta, per_fx = 1 / camera[CAMERA_FX];
  const floatn per_fy = 1 / camera[CAMERA_FY];
  // SURFACE_REACH sigmas along the view, of the third row of M = W R S.
  const floatn reach = SURFACE_REACH * sqrt(dot3(s.m_z, s.m_z));
#define PUT(column, value) STORE(surface, SURFACE_SIZE, column, select(none, value, seen))
  PUT(SURFACE_Z, s.p.z);
  PUT(SURFACE_AU, i.b.x * per * per_fx);
  PUT(SURFACE_AV, i.b.y * per * per_fy);
  PUT(SURFACE_QUU, dot3(i.x, i.x) * per * s.p.z * per_fx * per_fx);
  PUT(SURFACE_QUV, dot3(i.x, i.y) * per * s.p.z * per_fx * per_fy);
  PUT(SURFACE_QVV, dot3(i.y, i.y) * per * s.p.z * per_fy * per_fy);
  PUT(SURFACE_LOW, fmax(s.p.z - reach, (floatn)(near)));
  PUT(SURFACE_HIGH, s.p.z + reach);
}

// Adds to the gradients of means, scales and quaternions those that come by grad_surface (N, 8).
__kernel void surface_backward(int count, float near, __constant float* camera,
                               __global const float* means, __global const float* scales,
                               __global const float* wxyz, __global const float* record,
                               __global const float* surface, __global const float* grad_surface,
                               __global float* grad_means, __global float* grad_scales,
                               __global float* grad_wxyz) {
  const int first = get_global_id(0) * WIDTH, n = min(WIDTH, count - first);
  if (n <= 0) return;
  // Backward, from surface's eight numbers to b, beta and B, and from there to R, S and p.
  Splat s = project_splat(LOAD3(means), LOAD3(scales), LOAD(wxyz, 4, 0), LOAD(wxyz, 4, 1),
                  LOAD(wxyz, 4, 2), LOAD(wxyz, 4, 3), camera, 0);
  const Inverse i = inverse_of(&s);
  const intn seen = LOAD(record, RECORD, EXTENT_X) > 0;
  const floatn none = 0;
#define BY(column) LOAD(grad_surface, SURFACE_SIZE, column)
#define VALUE(column) LOAD(surface, SURFACE_SIZE, column)
  const floatn3 p = s.p;
  const floatn per = p.z / i.beta, per_fx = 1 / camera[CAMERA_FX], per_fy = 1 / camera[CAMERA_FY];
  // Gradients of the slopes AU, AV and of the squares QUU, QUV, QVV.
  const floatn by_au = BY(SURFACE_AU), by_av = BY(SURFACE_AV);
  // 1 / beta is a factor of slopes and squares, so its gradient is their sum.
  const floatn linear = by_au * VALUE(SURFACE_AU) + by_av * VALUE(SURFACE_AV);
  const floatn square = BY(SURFACE_QUU) * VALUE(SURFACE_QUU) +
                        BY(SURFACE_QUV) * VALUE(SURFACE_QUV) +
                        BY(SURFACE_QVV) * VALUE(SURFACE_QVV);
  const floatn by_beta = -(linear + square) / i.beta;
  const floatn by_bx = by_au * per * per_fx, by_by = by_av * per * per_fy;
  const floatn by_xx = BY(SURFACE_QUU) * per * p.z * per_fx * per_fx;
  const floatn by_xy = BY(SURFACE_QUV) * per * p.z * per_fx * per_fy;
  const floatn by_yy = BY(SURFACE_QVV) * per * p.z * per_fy * per_fy;
  // b = B t, beta = t . t, t = B^T p; and the upper left corner of B B^T is the quadratic form.
  const floatn3 across = blend3(by_bx, i.x, by_by, i.y);
  const floatn3 by_t = blend3(2 * by_beta, i.t, 1, across);
  const floatn3 from_b_x = blend3(by_bx, i.t, p.x, by_t), from_b_y = blend3(by_by, i.t, p.y, by_t);
  const floatn3 corner_x = blend3(2 * by_xx, i.x, by_xy, i.y);
  const floatn3 corner_y = blend3(by_xy, i.x, 2 * by_yy, i.y);
  const floatn3 gx = blend3(1, from_b_x, 1, corner_x), gy = blend3(1, from_b_y, 1, corner_y);
  const floatn3 gz = scale3(p.z, by_t);
  // Its ends: Z -+ SURFACE_REACH |m_z|, the near one not beyond `near`.
  const floatn by_low = select(none, BY(SURFACE_LOW), VALUE(SURFACE_LOW) > near);
  const floatn by_high = BY(SURFACE_HIGH), extent = sqrt(dot3(s.m_z, s.m_z));
  const floatn3 g_m_z =
      scale3(SURFACE_REACH * (by_high - by_low) / fmax(extent, FLT_MIN), s.m_z);
  const floatn3 nothing = make3(0, 0, 0);
  floatn3 by_scale, by_length;
  floatn by_q[4], by_turn[4];
  // The bounds go through M's third row, the rest through B, which is a rotation with other scales.
  rotation_scale_backward(&s, camera, nothing, nothing, g_m_z, &by_scale, by_q);
  const floatn3 scale = s.scale;
  // The same function, told that the scales are the lengths of B's columns.
  s.scale = i.length;
  rotation_scale_backward(&s, camera, gx, gy, gz, &by_length, by_turn);
  // The least scale is a factor of all and cancels, so it counts as a constant.
  // p acts through t, and Z through the factors of slopes (once) and squares (twice).
  const floatn pz =
      dot3(i.z, by_t) + BY(SURFACE_Z) + (linear + 2 * square) / p.z + by_low + by_high;
  const floatn px = dot3(i.x, by_t), py = dot3(i.y, by_t);
#define ADD(array, stride, column, value) \
  STORE(array, stride, column, LOAD(array, stride, column) + select(none, value, seen))
  ADD(grad_scales, 3, 0, by_scale.x - by_length.x * i.length.x / scale.x);
  ADD(grad_scales, 3, 1, by_scale.y - by_length.y * i.length.y / scale.y);
  ADD(grad_scales, 3, 2, by_scale.z - by_length.z * i.length.z / scale.z);
  for (int k = 0; k < 4; k++) ADD(grad_wxyz, 4, k, by_q[k] + by_turn[k]);
  ADD(grad_means, 3, 0, camera[0] * px + camera[4] * py + camera[8] * pz);
  ADD(grad_means, 3, 1, camera[1] * px + camera[5] * py + camera[9] * pz);
  ADD(grad_means, 3, 2, camera[2] * px + camera[6] * py + camera[10] * pz);
}
