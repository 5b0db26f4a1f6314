// surface_arena: splats of posed objects -> their depth (common/surface.cl) and, in place of their
// colours, their normals.  For pictures, not for frames: one splat a work-item.
// Reads:   poses, rows of camera_from_object, 12 floats an object; mean_opacity (N, 4), covariance
//          (N, 8) as pack.cl leaves it; object_index (N,).
// Writes:  surface (N, 8); the colours in record (N, 12) become normals.
// Units:   metres; slopes in 1/pixel; normals have eye axes: x right, y up, z towards the eye.
#include "common/record.cl"
#include "common/camera.cl"
#include "common/pages.cl"
#include "common/surface.cl"

// The normal is that of the surface of midpoints at the mean, b = M p turned towards the eye; of a
// flat splat its own.
__kernel void surface_arena(int count, float near, __constant float* camera,
                            __global const float* poses, __global const float* mean_opacity,
                            __global const float* covariance, __global const int* object_index,
                            __global const int* sources,
                            __global float* record, __global float* surface) {
  const int i = get_global_id(0);
  if (i >= count) return;
  __global float* r = record + (size_t)RECORD * i;
  __global float* f = surface + (size_t)SURFACE_SIZE * i;
  // A culled splat has no surface.
  for (int k = 0; k < SURFACE_SIZE; k++) f[k] = 0;
  if (!(r[EXTENT_X] > 0)) return;
  __global const float* m = poses + 12 * object_index[i];
  const float4 mean = vload4(row_of(i, sources), mean_opacity);
  const float8 c = vload8(row_of(i, sources), covariance);
  const float3 w[3] = {vload3(0, m), vload3(0, m + 4), vload3(0, m + 8)};
  float p[3], sigma[3][3];
  const float3 rows[3] = {(float3)(c.s0, c.s1, c.s2), (float3)(c.s1, c.s3, c.s4),
                          (float3)(c.s2, c.s4, c.s5)};
  // W Sigma W^T, in two halves: W Sigma, then its rows with those of W.
  float3 w_sigma[3];
  for (int a = 0; a < 3; a++) {
    p[a] = dot(w[a], mean.xyz) + m[4 * a + 3];
    w_sigma[a] = w[a].x * rows[0] + w[a].y * rows[1] + w[a].z * rows[2];
  }
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++) sigma[a][b] = dot(w_sigma[a], w[b]);
  // Along the view the splat reaches sqrt(sigma_zz) for one sigma.
  const float reach = SURFACE_REACH * sqrt(fmax(sigma[2][2], 0.0f));
  // Cofactors instead of the inverse: their largest is exact of a flat splat, too.
  // By the trace first: cofactors are squares, which may leave the floats.
  const float size = 1 / (sigma[0][0] + sigma[1][1] + sigma[2][2]);
  const float xx = sigma[0][0] * size, xy = sigma[0][1] * size, xz = sigma[0][2] * size;
  const float yy = sigma[1][1] * size, yz = sigma[1][2] * size, zz = sigma[2][2] * size;
  float mxx = yy * zz - yz * yz, mxy = xz * yz - xy * zz, mxz = xy * yz - xz * yy;
  float myy = xx * zz - xz * xz, myz = xy * xz - xx * yz, mzz = xx * yy - xy * xy;
  const float per_trace = 1 / fmax(mxx + myy + mzz, FLT_MIN);
  const float bx = (mxx * p[0] + mxy * p[1] + mxz * p[2]) * per_trace;
  const float by = (mxy * p[0] + myy * p[1] + myz * p[2]) * per_trace;
  const float bz = (mxz * p[0] + myz * p[1] + mzz * p[2]) * per_trace;
  const float distance2 = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
  // Never 0: a plane through the eye shows nothing, and nothing of it may be NaN.
  const float beta = fmax(p[0] * bx + p[1] * by + p[2] * bz, 1e-12f * distance2);
  const float per_fx = 1 / camera[CAMERA_FX], per_fy = 1 / camera[CAMERA_FY], per = p[2] / beta;
  f[SURFACE_Z] = p[2];
  f[SURFACE_AU] = bx * per * per_fx;
  f[SURFACE_AV] = by * per * per_fy;
  f[SURFACE_QUU] = mxx * per_trace * per * p[2] * per_fx * per_fx;
  f[SURFACE_QUV] = mxy * per_trace * per * p[2] * per_fx * per_fy;
  f[SURFACE_QVV] = myy * per_trace * per * p[2] * per_fy * per_fy;
  f[SURFACE_LOW] = fmax(p[2] - reach, near);
  f[SURFACE_HIGH] = p[2] + reach;
  // A direction towards the eye, with y turned up.
  const float length = sqrt(bx * bx + by * by + bz * bz), to_eye = length > 0 ? 1 / length : 0;
  r[RED] = -bx * to_eye;
  r[GREEN] = by * to_eye;
  r[BLUE] = bz * to_eye;
}
