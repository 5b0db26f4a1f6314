// project: splats (means, scales, quaternions) -> records and depths, and the way back.
// One work-item for WIDTH splats.  EWA splatting as in 3DGS: Sigma' = J W Sigma W^T J^T + low_pass.
#include "common/record.cl"
#include "common/place.cl"

__kernel void project(int count, int width, int height, float near, float least_alpha,
                      float low_pass, __constant float* camera, __global const float* means,
                      __global const float* scales, __global const float* wxyz,
                      __global const float* opacity, __global const float* color,
                      __global float* record, __global float* depth) {
  const int first = get_global_id(0) * WIDTH, n = min(WIDTH, count - first);
  if (n <= 0) return;
  const Splat s = place(LOAD3(means), LOAD3(scales), LOAD(wxyz, 4, 0), LOAD(wxyz, 4, 1),
                        LOAD(wxyz, 4, 2), LOAD(wxyz, 4, 3), camera, low_pass);
  const floatn alpha = LOAD(opacity, 1, 0);
  const floatn3 rgb = LOAD3(color);
  const floatn per = 1 / s.determinant, cut = 2 * log(alpha / least_alpha);
  const floatn half_x = sqrt(cut * s.a), half_y = sqrt(cut * s.c);
  const floatn x = s.jx * s.p.x + camera[CAMERA_CX], y = s.jy * s.p.y + camera[CAMERA_CY];

  // Positive tests, so that NaN fails: bright enough, in front, finite, on the screen.
  intn seen = (alpha > least_alpha) & (s.p.z > near) & (s.p.z < CULLED_DEPTH);
  seen &= (s.determinant > 0) & (s.determinant < FLT_MAX);
  seen &= fabs(rgb.x + rgb.y + rgb.z) < FLT_MAX;
  seen &= (half_x < FLT_MAX) & (half_y < FLT_MAX);
  seen &= (x + half_x > 0) & (x - half_x < (float)width);
  seen &= (y + half_y > 0) & (y - half_y < (float)height);
  const floatn none = 0, culled = -1, far = CULLED_DEPTH;
  STORE(record, RECORD, MEAN_X, select(none, x, seen));
  STORE(record, RECORD, MEAN_Y, select(none, y, seen));
  STORE(record, RECORD, CONIC_A, select(none, s.c * per, seen));
  STORE(record, RECORD, CONIC_B, select(none, -s.b * per, seen));
  STORE(record, RECORD, CONIC_C, select(none, s.a * per, seen));
  STORE(record, RECORD, OPACITY, select(none, alpha, seen));
  STORE(record, RECORD, RED, select(none, rgb.x, seen));
  STORE(record, RECORD, GREEN, select(none, rgb.y, seen));
  STORE(record, RECORD, BLUE, select(none, rgb.z, seen));
  STORE(record, RECORD, EXTENT_X, select(culled, half_x, seen));
  STORE(record, RECORD, EXTENT_Y, select(culled, half_y, seen));
  STORE(record, RECORD, CUT, select(none, cut, seen));
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
  const Splat s = place(LOAD3(means), LOAD3(scales), LOAD(wxyz, 4, 0), LOAD(wxyz, 4, 1),
                        LOAD(wxyz, 4, 2), LOAD(wxyz, 4, 3), camera, low_pass);
  const intn seen = LOAD(record, RECORD, EXTENT_X) > 0;
  const floatn none = 0;
#define GRAD(column) LOAD(grad_record, RECORD, column)
#define KEEP(value) select(none, value, seen)  // a culled splat's may be NaN
  STORE(grad_opacity, 1, 0, KEEP(GRAD(OPACITY)));
  STORE3(grad_color, make3(KEEP(GRAD(RED)), KEEP(GRAD(GREEN)), KEEP(GRAD(BLUE))));

  // conic Q = Sigma'^-1, so dSigma' = -Q dQ Q (the off-diagonal entry counts twice).
  const floatn A = LOAD(record, RECORD, CONIC_A), B = LOAD(record, RECORD, CONIC_B);
  const floatn C = LOAD(record, RECORD, CONIC_C);
  const floatn gA = GRAD(CONIC_A), gB = GRAD(CONIC_B), gC = GRAD(CONIC_C);
  const floatn xx = A * gA + 0.5f * B * gB, xy = 0.5f * A * gB + B * gC;
  const floatn yx = B * gA + 0.5f * C * gB, yy = 0.5f * B * gB + C * gC;
  const floatn grad_a = -(xx * A + xy * B), grad_b = -2 * (xx * B + xy * C);
  const floatn grad_c = -(yx * B + yy * C);
  const floatn3 gx = blend3(2 * grad_a, s.row_x, grad_b, s.row_y);
  const floatn3 gy = blend3(grad_b, s.row_x, 2 * grad_c, s.row_y);

  // rows of J root, with J = [jx 0 jxz; 0 jy jyz].
  const floatn grad_jx = dot3(gx, s.root_x), grad_jxz = dot3(gx, s.root_z);
  const floatn grad_jy = dot3(gy, s.root_y), grad_jyz = dot3(gy, s.root_z);
  floatn3 grad_scale;
  floatn grad_q[4];
  turn_backward(&s, camera, scale3(s.jx, gx), scale3(s.jy, gy),
                blend3(s.jxz, gx, s.jyz, gy), &grad_scale, grad_q);
  STORE3(grad_scales, make3(KEEP(grad_scale.x), KEEP(grad_scale.y), KEEP(grad_scale.z)));
  for (int k = 0; k < 4; k++) STORE(grad_wxyz, 4, k, KEEP(grad_q[k]));

  // x = fx X/Z + cx; jx = fx/Z; jxz = -fx/Z tan_x, tan_x = X/Z unless clamped.
  const floatn tx = s.p.x * s.per_z, ty = s.p.y * s.per_z;
  const intn free_x = (tx > camera[LEAST_X]) & (tx < camera[MOST_X]);
  const intn free_y = (ty > camera[LEAST_Y]) & (ty < camera[MOST_Y]);
  const floatn along_x = select(none, -grad_jxz * s.jx * s.per_z, free_x);
  const floatn along_y = select(none, -grad_jyz * s.jy * s.per_z, free_y);
  const floatn mean_x = GRAD(MEAN_X) * s.jx, mean_y = GRAD(MEAN_Y) * s.jy;
  const floatn px = mean_x + along_x, py = mean_y + along_y;
  const floatn jacobian =
      grad_jx * s.jx + grad_jy * s.jy + grad_jxz * s.jxz + grad_jyz * s.jyz;
  const floatn pz = -(px * tx + py * ty) - jacobian * s.per_z;
  STORE3(grad_means, make3(KEEP(camera[0] * px + camera[4] * py + camera[8] * pz),
                           KEEP(camera[1] * px + camera[5] * py + camera[9] * pz),
                           KEEP(camera[2] * px + camera[6] * py + camera[10] * pz)));
}
