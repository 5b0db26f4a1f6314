// project: splats (means, scales, quaternions) -> records and depths, and the way back; for
// training. EWA splatting as in 3DGS: Sigma' = J W Sigma W^T J^T + low_pass I (common/ewa.cl has
// the steps).
// Reads:   means, scales (N, 3), wxyz (N, 4), opacity (N,), color (N, 3), a camera; the backward
//          pass also the records and the gradients of them.
// Writes:  record (N, 12), depth (N,); backward the gradients of the five arrays.
// Units:   metres in the world, pixels on the screen, opacity 0..1, display sRGB.
#include "common/record.cl"
#include "common/ewa.cl"

// The steps of the paper: R, M = W R S, J, Sigma' = (J M)(J M)^T + low pass.
#define PROJECT_SPLATS(s)              \
  const floatn4 q = LOAD4(wxyz, 4, 0); \
  const Splat s =                      \
      project_splat(LOAD3(means), LOAD3(scales), q.x, q.y, q.z, q.w, camera, low_pass);

__kernel void project(int count, int width, int height, float near, float min_alpha,
                      float low_pass, __constant float* camera, __global const float* means,
                      __global const float* scales, __global const float* wxyz,
                      __global const float* opacity, __global const float* color,
                      __global float* record, __global float* depth) {
  const int first = get_global_id(0) * WIDTH, n = min(WIDTH, count - first);
  if (n <= 0) return;
  PROJECT_SPLATS(s)
  const floatn alpha = LOAD(opacity, 1, 0);
  const floatn3 rgb = LOAD3(color);
  // alpha(d) = o exp(-power / 2) >= min_alpha  <=>  power <= 2 ln(o / min_alpha), the threshold;
  // the ellipse of that power reaches sqrt(threshold Sigma'_xx) to either side.
  const floatn per = 1 / s.determinant, power_threshold = 2 * log(alpha / min_alpha);
  const floatn half_x = sqrt(power_threshold * s.a), half_y = sqrt(power_threshold * s.c);
  // The 2D mean; j00 p.x = fx x / z.
  const floatn x = s.j00 * s.p.x + camera[CAMERA_CX], y = s.j11 * s.p.y + camera[CAMERA_CY];

  // Positive tests, so that NaN fails: bright enough, in front, finite, on the screen.
  intn seen = (alpha > min_alpha) & (s.p.z > near) & (s.p.z < CULLED_DEPTH);
  seen &= (s.determinant > 0) & (s.determinant < FLT_MAX);
  seen &= fabs(rgb.x + rgb.y + rgb.z) < FLT_MAX;
  seen &= (half_x < FLT_MAX) & (half_y < FLT_MAX);
  seen &= (x + half_x > 0) & (x - half_x < (float)width);
  seen &= (y + half_y > 0) & (y - half_y < (float)height);
  // A culled splat's record is all zeros with extents of -1: raster never meets it, and its
  // gradients are zero.
  const floatn none = 0, culled = -1, far = CULLED_DEPTH;
  // Its twelve columns in three parts, in the order of record.cl: mean and conic, of which
  // the inverse of [a b; b c] is [c -b; -b a] / determinant,
  STORE4(record, RECORD, MEAN_X, select(none, x, seen), select(none, y, seen),
         select(none, s.c * per, seen), select(none, -s.b * per, seen));
  // the conic's end, opacity and colour,
  STORE4(record, RECORD, CONIC_C, select(none, s.a * per, seen), select(none, alpha, seen),
         select(none, rgb.x, seen), select(none, rgb.y, seen));
  // and how far the splat reaches.
  STORE4(record, RECORD, BLUE, select(none, rgb.z, seen), select(culled, half_x, seen),
         select(culled, half_y, seen), select(none, power_threshold, seen));
  STORE(depth, 1, 0, select(far, s.p.z, seen));
}

__kernel void project_backward(int count, float low_pass, __constant float* camera,
                               __global const float* means, __global const float* scales,
                               __global const float* wxyz, __global const float* record,
                               __global const float* grad_record, __global float* grad_means,
                               __global float* grad_scales, __global float* grad_wxyz,
                               __global float* grad_opacity, __global float* grad_color) {
  const int first = get_global_id(0) * WIDTH, n = min(WIDTH, count - first);
  if (n <= 0) return;
  // Computed again: cheaper than to store it between the passes.
  PROJECT_SPLATS(s)
  const intn seen = LOAD(record, RECORD, EXTENT_X) > 0;
  const floatn none = 0;
  // What of a record and of its gradient is needed, in the order of record.cl.
  const floatn4 from_mean = LOAD4(record, RECORD, MEAN_X);
  const floatn4 by_mean = LOAD4(grad_record, RECORD, MEAN_X);
  const floatn4 by_conic_c = LOAD4(grad_record, RECORD, CONIC_C);
#define KEEP(value) select(none, value, seen)  // a culled splat's may be NaN
  // Opacity and colour go through projection unchanged.
  STORE(grad_opacity, 1, 0, KEEP(by_conic_c.y));
  STORE3(grad_color, make3(KEEP(by_conic_c.z), KEEP(by_conic_c.w),
                           KEEP(LOAD(grad_record, RECORD, BLUE))));

  // conic Q = Sigma'^-1, so dSigma' = -Q dQ Q (the off-diagonal entry counts twice).
  const floatn A = from_mean.z, B = from_mean.w, C = LOAD(record, RECORD, CONIC_C);
  const floatn gA = by_mean.z, gB = by_mean.w, gC = by_conic_c.x;
  const floatn xx = A * gA + 0.5f * B * gB, xy = 0.5f * A * gB + B * gC;
  const floatn yx = B * gA + 0.5f * C * gB, yy = 0.5f * B * gB + C * gC;
  // b stands twice in Sigma', so its gradient is that of both.
  const floatn grad_a = -(xx * A + xy * B), grad_b = -2 * (xx * B + xy * C);
  const floatn grad_c = -(yx * B + yy * C);
  // Sigma' = (J M)(J M)^T: a = u.u, b = u.v, c = v.v of its rows u and v, so dL/du = 2 a' u + b' v.
  const floatn3 gx = blend3(2 * grad_a, s.jm_x, grad_b, s.jm_y);
  const floatn3 gy = blend3(grad_b, s.jm_x, 2 * grad_c, s.jm_y);

  // Rows of J M with J = [j00 0 j02; 0 j11 j12]: dL/dJ, then dL/dM = J^T dL/d(J M) below.
  const floatn grad_j00 = dot3(gx, s.m_x), grad_j02 = dot3(gx, s.m_z);
  const floatn grad_j11 = dot3(gy, s.m_y), grad_j12 = dot3(gy, s.m_z);
  floatn3 grad_scale;
  floatn grad_q[4];
  rotation_scale_backward(&s, camera, scale3(s.j00, gx), scale3(s.j11, gy),
                blend3(s.j02, gx, s.j12, gy), &grad_scale, grad_q);
  STORE3(grad_scales, make3(KEEP(grad_scale.x), KEEP(grad_scale.y), KEEP(grad_scale.z)));
  // Of the quaternion as it was given, of any length.
  STORE4(grad_wxyz, 4, 0, KEEP(grad_q[0]), KEEP(grad_q[1]), KEEP(grad_q[2]), KEEP(grad_q[3]));

  // The mean acts through x = fx X/Z + cx, through j00 = fx/Z and through j02 = -fx/Z tan_x, where
  // tan_x = X/Z unless it is held; the low pass is a constant.
  const floatn tx = s.p.x * s.inv_z, ty = s.p.y * s.inv_z;
  const intn free_x = (tx > camera[MIN_TAN_X]) & (tx < camera[MAX_TAN_X]);
  const intn free_y = (ty > camera[MIN_TAN_Y]) & (ty < camera[MAX_TAN_Y]);
  const floatn along_x = select(none, -grad_j02 * s.j00 * s.inv_z, free_x);
  const floatn along_y = select(none, -grad_j12 * s.j11 * s.inv_z, free_y);
  const floatn mean_x = by_mean.x * s.j00, mean_y = by_mean.y * s.j11;
  const floatn px = mean_x + along_x, py = mean_y + along_y;
  // All of J's entries fall as 1/Z.
  const floatn jacobian =
      grad_j00 * s.j00 + grad_j11 * s.j11 + grad_j02 * s.j02 + grad_j12 * s.j12;
  const floatn pz = -(px * tx + py * ty) - jacobian * s.inv_z;
  // From the camera to the world: W^T.
  STORE3(grad_means, make3(KEEP(camera[0] * px + camera[4] * py + camera[8] * pz),
                           KEEP(camera[1] * px + camera[5] * py + camera[9] * pz),
                           KEEP(camera[2] * px + camera[6] * py + camera[10] * pz)));
}
