// project: splats (means, scales, quaternions) -> records and depths, and the way back.
// One work-item a splat.  EWA splatting as 3DGS does it: Sigma' = J W Sigma W^T J^T + low_pass.
#include "common/record.cl"
#include "common/camera.cl"

// Everything of a splat that both directions need.
typedef struct {
  float3 p;          // mean in the camera, metres
  float4 q;          // unit quaternion: x y z w
  float inverse_length;
  float turn[9];     // camera_from_splat rotation, rows
  float root[9];     // turn with columns times the scales: covariance = root root^T
  float3 row_x, row_y;  // rows of J root: the screen covariance is their Gram matrix + low_pass
  float jx, jxz, jy, jyz;  // Jacobian: d(px)/dx, d(px)/dz, d(py)/dy, d(py)/dz
  float tan_x, tan_y;  // clamped x/z, y/z
  float a, b, c, determinant;
} Splat;

inline void rotation(float4 q, float* r) {
  r[0] = 1 - 2 * (q.y * q.y + q.z * q.z);
  r[1] = 2 * (q.x * q.y - q.w * q.z);
  r[2] = 2 * (q.x * q.z + q.w * q.y);
  r[3] = 2 * (q.x * q.y + q.w * q.z);
  r[4] = 1 - 2 * (q.x * q.x + q.z * q.z);
  r[5] = 2 * (q.y * q.z - q.w * q.x);
  r[6] = 2 * (q.x * q.z - q.w * q.y);
  r[7] = 2 * (q.y * q.z + q.w * q.x);
  r[8] = 1 - 2 * (q.x * q.x + q.y * q.y);
}

inline Splat place(int i, __global const float* means, __global const float* scales,
                   __global const float* wxyz, __constant float* camera, float low_pass) {
  Splat s;
  const float3 mean = vload3(i, means), scale = vload3(i, scales);
  s.p.x = camera[0] * mean.x + camera[1] * mean.y + camera[2] * mean.z + camera[3];
  s.p.y = camera[4] * mean.x + camera[5] * mean.y + camera[6] * mean.z + camera[7];
  s.p.z = camera[8] * mean.x + camera[9] * mean.y + camera[10] * mean.z + camera[11];
  const float4 given = vload4(i, wxyz).yzwx;
  // By the largest entry first: neither tiny nor huge quaternions lose their length.
  const float4 size = fabs(given);
  const float largest = fmax(fmax(size.x, size.y), fmax(size.z, size.w));
  const float4 scaled = given / largest;
  const float inverse = 1 / sqrt(dot(scaled, scaled));  // not finite where there is no direction
  s.q = scaled * inverse;
  s.inverse_length = inverse / largest;
  float r[9];
  rotation(s.q, r);
  for (int row = 0; row < 3; row++)
    for (int column = 0; column < 3; column++)
      s.turn[3 * row + column] = camera[4 * row] * r[column] + camera[4 * row + 1] * r[3 + column] +
                                 camera[4 * row + 2] * r[6 + column];
  for (int row = 0; row < 3; row++) {
    s.root[3 * row] = s.turn[3 * row] * scale.x;
    s.root[3 * row + 1] = s.turn[3 * row + 1] * scale.y;
    s.root[3 * row + 2] = s.turn[3 * row + 2] * scale.z;
  }
  const float per_z = 1 / s.p.z;
  s.tan_x = clamp(s.p.x * per_z, camera[LEAST_X], camera[MOST_X]);
  s.tan_y = clamp(s.p.y * per_z, camera[LEAST_Y], camera[MOST_Y]);
  s.jx = camera[CAMERA_FX] * per_z;
  s.jy = camera[CAMERA_FY] * per_z;
  s.jxz = -s.jx * s.tan_x;
  s.jyz = -s.jy * s.tan_y;
  const float3 x = vload3(0, s.root), y = vload3(1, s.root), z = vload3(2, s.root);
  s.row_x = s.jx * x + s.jxz * z;
  s.row_y = s.jy * y + s.jyz * z;
  const float a = dot(s.row_x, s.row_x), c = dot(s.row_y, s.row_y);
  s.a = a + low_pass;
  s.b = dot(s.row_x, s.row_y);
  s.c = c + low_pass;
  // a c - b^2 cancels for long thin splats; |row_x x row_y|^2 is the same without the loss.
  const float3 area = cross(s.row_x, s.row_y);
  s.determinant = dot(area, area) + low_pass * (a + c) + low_pass * low_pass;
  return s;
}

__kernel void project(int count, int width, int height, float near, float least_alpha,
                      float low_pass, __constant float* camera, __global const float* means,
                      __global const float* scales, __global const float* wxyz,
                      __global const float* opacity, __global const float* color,
                      __global float* record, __global float* depth) {
  const int i = get_global_id(0);
  if (i >= count) return;
  __global float* out = record + RECORD * i;
  for (int k = 0; k < RECORD; k++) out[k] = 0;
  out[EXTENT_X] = out[EXTENT_Y] = -1;
  depth[i] = CULLED_DEPTH;
  const float alpha = opacity[i];
  if (!(alpha > least_alpha)) return;  // absent, too faint, or not a number

  const Splat s = place(i, means, scales, wxyz, camera, low_pass);
  const float3 rgb = vload3(i, color);
  if (!(s.p.z > near && s.p.z < CULLED_DEPTH)) return;
  if (!(s.determinant > 0 && s.determinant < FLT_MAX && isfinite(rgb.x + rgb.y + rgb.z))) return;
  const float per = 1 / s.determinant, cut = 2 * log(alpha / least_alpha);
  const float half_x = sqrt(cut * s.a), half_y = sqrt(cut * s.c);
  const float x = s.jx * s.p.x + camera[CAMERA_CX], y = s.jy * s.p.y + camera[CAMERA_CY];
  const bool inside = x + half_x > 0 && x - half_x < width && y + half_y > 0 && y - half_y < height;
  if (!(inside && half_x < FLT_MAX && half_y < FLT_MAX)) return;

  vstore8((float8)(x, y, s.c * per, -s.b * per, s.a * per, alpha, rgb.x, rgb.y), 0, out);
  vstore4((float4)(rgb.z, half_x, half_y, cut), 0, out + 8);
  depth[i] = s.p.z;
}

// Gradients of the quaternion from those of the rotation's entries (rows, already in the world).
inline float4 rotation_backward(float4 q, const float* g) {
  const float w = 2 * (-q.z * g[1] + q.y * g[2] + q.z * g[3] - q.x * g[5] - q.y * g[6] + q.x * g[7]);
  const float x = 2 * (q.y * (g[1] + g[3]) + q.z * (g[2] + g[6]) - 2 * q.x * (g[4] + g[8]) +
                       q.w * (g[7] - g[5]));
  const float y = 2 * (q.x * (g[1] + g[3]) + q.z * (g[5] + g[7]) - 2 * q.y * (g[0] + g[8]) +
                       q.w * (g[2] - g[6]));
  const float z = 2 * (q.x * (g[2] + g[6]) + q.y * (g[5] + g[7]) - 2 * q.z * (g[0] + g[4]) +
                       q.w * (g[3] - g[1]));
  return (float4)(x, y, z, w);
}

__kernel void project_backward(int count, float low_pass, __constant float* camera,
                               __global const float* means, __global const float* scales,
                               __global const float* wxyz, __global const float* record,
                               __global const float* grad_record, __global float* grad_means,
                               __global float* grad_scales, __global float* grad_wxyz,
                               __global float* grad_opacity, __global float* grad_color) {
  const int i = get_global_id(0);
  if (i >= count) return;
  __global const float* kept = record + RECORD * i;
  __global const float* g = grad_record + RECORD * i;
  if (!(kept[EXTENT_X] > 0)) {
    vstore3((float3)(0), i, grad_means);
    vstore3((float3)(0), i, grad_scales);
    vstore4((float4)(0), i, grad_wxyz);
    vstore3((float3)(0), i, grad_color);
    grad_opacity[i] = 0;
    return;
  }
  const Splat s = place(i, means, scales, wxyz, camera, low_pass);
  grad_opacity[i] = g[OPACITY];
  vstore3((float3)(g[RED], g[GREEN], g[BLUE]), i, grad_color);

  // conic Q = Sigma'^-1, so dSigma' = -Q dQ Q (the off-diagonal entry counts twice).
  const float A = kept[CONIC_A], B = kept[CONIC_B], C = kept[CONIC_C];
  const float xx = A * g[CONIC_A] + 0.5f * B * g[CONIC_B], xy = 0.5f * A * g[CONIC_B] + B * g[CONIC_C];
  const float yx = B * g[CONIC_A] + 0.5f * C * g[CONIC_B], yy = 0.5f * B * g[CONIC_B] + C * g[CONIC_C];
  const float grad_a = -(xx * A + xy * B), grad_b = -2 * (xx * B + xy * C);
  const float grad_c = -(yx * B + yy * C);
  const float3 grad_x = 2 * grad_a * s.row_x + grad_b * s.row_y;
  const float3 grad_y = grad_b * s.row_x + 2 * grad_c * s.row_y;

  // rows of J root, with J = [jx 0 jxz; 0 jy jyz].
  const float3 root_x = vload3(0, s.root), root_y = vload3(1, s.root), root_z = vload3(2, s.root);
  const float grad_jx = dot(grad_x, root_x), grad_jxz = dot(grad_x, root_z);
  const float grad_jy = dot(grad_y, root_y), grad_jyz = dot(grad_y, root_z);
  float grad_root[9];
  vstore3(s.jx * grad_x, 0, grad_root);
  vstore3(s.jy * grad_y, 1, grad_root);
  vstore3(s.jxz * grad_x + s.jyz * grad_y, 2, grad_root);

  // x = fx X/Z + cx; jx = fx/Z; jxz = -fx/Z tan_x, tan_x = X/Z unless clamped.
  const float per_z = 1 / s.p.z, tx = s.p.x * per_z, ty = s.p.y * per_z;
  const bool free_x = tx > camera[LEAST_X] && tx < camera[MOST_X];
  const bool free_y = ty > camera[LEAST_Y] && ty < camera[MOST_Y];
  const float along_x = free_x ? -grad_jxz * s.jx * per_z : 0;
  const float along_y = free_y ? -grad_jyz * s.jy * per_z : 0;
  const float3 grad_p = (float3)(
      g[MEAN_X] * s.jx + along_x, g[MEAN_Y] * s.jy + along_y,
      -(g[MEAN_X] * s.jx * tx + g[MEAN_Y] * s.jy * ty) - (grad_jx * s.jx + grad_jy * s.jy) * per_z -
          (grad_jxz * s.jxz + grad_jyz * s.jyz) * per_z - along_x * tx - along_y * ty);
  vstore3((float3)(camera[0] * grad_p.x + camera[4] * grad_p.y + camera[8] * grad_p.z,
                   camera[1] * grad_p.x + camera[5] * grad_p.y + camera[9] * grad_p.z,
                   camera[2] * grad_p.x + camera[6] * grad_p.y + camera[10] * grad_p.z),
          i, grad_means);

  // root = turn scale; turn = camera rotation.
  float grad_scale[3], grad_rotation[9];
  const float scale[3] = {scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]};
  for (int k = 0; k < 3; k++) {
    grad_scale[k] = grad_root[k] * s.turn[k] + grad_root[3 + k] * s.turn[3 + k] +
                    grad_root[6 + k] * s.turn[6 + k];
    for (int row = 0; row < 3; row++)
      grad_rotation[3 * row + k] = (camera[row] * grad_root[k] + camera[4 + row] * grad_root[3 + k] +
                                    camera[8 + row] * grad_root[6 + k]) * scale[k];
  }
  vstore3(vload3(0, grad_scale), i, grad_scales);
  // through q = given / |given|: only what is across q remains.
  const float4 grad_q = rotation_backward(s.q, grad_rotation);
  const float4 across = (grad_q - dot(grad_q, s.q) * s.q) * s.inverse_length;
  vstore4(across.wxyz, i, grad_wxyz);
}
