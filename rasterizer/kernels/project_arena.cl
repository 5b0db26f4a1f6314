// project_arena: splats of many posed objects -> records and depths, for drawing alone.
// A work-item owns a chunk and takes eight splats at a time as vectors.
#include "common/record.cl"
#include "common/camera.cl"
#include "common/vector.cl"

typedef struct {
  float8 x, y, z, opacity;            // mean in the object, metres
  float8 xx, xy, xz, yy, yz, zz;      // covariance in the object, m^2
  float8 red, green, blue;
  float8 m[12];                       // camera_from_object, rows
} Eight;

// Rows of four or eight floats, one a splat -> one vector a column.
inline void load_eight(Eight* s, const float* mean, const float* cov, const float* color) {
  const float16 p = vload16(0, mean), q = vload16(1, mean);
  s->x = (float8)(p.s048c, q.s048c);
  s->y = (float8)(p.s159d, q.s159d);
  s->z = (float8)(p.s26ae, q.s26ae);
  s->opacity = (float8)(p.s37bf, q.s37bf);
  const float16 a = vload16(0, cov), b = vload16(1, cov), c = vload16(2, cov), d = vload16(3, cov);
  s->xx = (float8)(a.s08, b.s08, c.s08, d.s08);
  s->xy = (float8)(a.s19, b.s19, c.s19, d.s19);
  s->xz = (float8)(a.s2a, b.s2a, c.s2a, d.s2a);
  s->yy = (float8)(a.s3b, b.s3b, c.s3b, d.s3b);
  s->yz = (float8)(a.s4c, b.s4c, c.s4c, d.s4c);
  s->zz = (float8)(a.s5d, b.s5d, c.s5d, d.s5d);
  const float16 g = vload16(0, color), h = vload16(1, color);
  s->red = (float8)(g.s048c, h.s048c);
  s->green = (float8)(g.s159d, h.s159d);
  s->blue = (float8)(g.s26ae, h.s26ae);
}

// Poses of eight splats: nearly always the same object's.
inline void load_poses(Eight* s, const int* object, __global const float* poses) {
  bool same = true;
  for (int lane = 1; lane < LANES; lane++) same &= object[lane] == object[0];
  if (same) {
    for (int k = 0; k < 12; k++) s->m[k] = poses[12 * object[0] + k];
    return;
  }
  for (int k = 0; k < 12; k++) {
    float column[LANES];
    for (int lane = 0; lane < LANES; lane++) column[lane] = poses[12 * object[lane] + k];
    s->m[k] = vload8(0, column);
  }
}

// Four vectors -> eight rows of four.
inline void store_rows(float* rows, int at, float8 a, float8 b, float8 c, float8 d) {
  float p[LANES], q[LANES], r[LANES], t[LANES];
  vstore8(a, 0, p);
  vstore8(b, 0, q);
  vstore8(c, 0, r);
  vstore8(d, 0, t);
  for (int lane = 0; lane < LANES; lane++)
    vstore4((float4)(p[lane], q[lane], r[lane], t[lane]), 0, rows + RECORD * lane + at);
}

inline int kept(int8 lanes) {  // how many lanes are true (-1)
  const int4 a = lanes.lo + lanes.hi;
  const int2 b = a.lo + a.hi;
  return -(b.x + b.y);
}

// rows: 8 records.  depth: 8.  culled: counts of opacity, size, distance, frustum so far.
inline void project_eight(const Eight* s, int8 valid, __constant float* camera, int width,
                          int height, float near, float least_alpha, float most_pixels,
                          float most_distance, float low_pass, float* rows, float* depth,
                          int4* culled) {
  const float8* m = s->m;
  const float8 x = m[0] * s->x + m[1] * s->y + m[2] * s->z + m[3];
  const float8 y = m[4] * s->x + m[5] * s->y + m[6] * s->z + m[7];
  const float8 z = m[8] * s->x + m[9] * s->y + m[10] * s->z + m[11];
  const float8 per_z = 1.0f / z, tan_x = x * per_z, tan_y = y * per_z;
  const float8 jx = camera[CAMERA_FX] * per_z, jy = camera[CAMERA_FY] * per_z;
  const float8 jxz = -jx * fmin(fmax(tan_x, camera[LEAST_X]), camera[MOST_X]);
  const float8 jyz = -jy * fmin(fmax(tan_y, camera[LEAST_Y]), camera[MOST_Y]);
  // Rows of J camera_from_object, then the screen covariance a, b, c.
  const float8 ux = jx * m[0] + jxz * m[8], uy = jx * m[1] + jxz * m[9], uz = jx * m[2] + jxz * m[10];
  const float8 vx = jy * m[4] + jyz * m[8], vy = jy * m[5] + jyz * m[9], vz = jy * m[6] + jyz * m[10];
  const float8 sx = s->xx * ux + s->xy * uy + s->xz * uz;
  const float8 sy = s->xy * ux + s->yy * uy + s->yz * uz;
  const float8 sz = s->xz * ux + s->yz * uy + s->zz * uz;
  const float8 tx = s->xx * vx + s->xy * vy + s->xz * vz;
  const float8 ty = s->xy * vx + s->yy * vy + s->yz * vz;
  const float8 tz = s->xz * vx + s->yz * vy + s->zz * vz;
  const float8 bare_a = ux * sx + uy * sy + uz * sz, b = vx * sx + vy * sy + vz * sz;
  const float8 bare_c = vx * tx + vy * ty + vz * tz;
  const float8 a = bare_a + low_pass, c = bare_c + low_pass;
  const float8 bare = fmax(bare_a * bare_c - b * b, 0.0f);  // float rounding may go below 0
  const float8 determinant = bare + low_pass * (bare_a + bare_c) + low_pass * low_pass;
  const float8 per = 1.0f / determinant;
  const float8 cut = 2.0f * log(s->opacity / least_alpha);
  const float8 half_x = sqrt(cut * a), half_y = sqrt(cut * c);
  const float8 px = jx * x + camera[CAMERA_CX], py = jy * y + camera[CAMERA_CY];
  const float8 mid = 0.5f * (a + c), off = 0.5f * (a - c);
  const float8 major = mid + sqrt(off * off + b * b);  // px^2, one sigma squared
  const float8 distance = x * x + y * y + z * z;
  const float8 finite = s->red + s->green + s->blue;

  // Each gate is a positive test, so that NaN fails it; the first gate that fails counts.
  const int8 bright = valid & (s->opacity > least_alpha) & (s->opacity < FLT_MAX);
  const int8 near_enough = bright & (distance <= most_distance * most_distance);
  int8 seen = near_enough & (z > near) & (z < CULLED_DEPTH);
  seen &= (px + half_x > 0.0f) & (px - half_x < (float)width);
  seen &= (py + half_y > 0.0f) & (py - half_y < (float)height);
  int8 small = seen & (major <= most_pixels * most_pixels) & isfinite(finite);
  small &= (determinant > 0.0f) & (determinant < FLT_MAX) & (half_x < FLT_MAX) & (half_y < FLT_MAX);
  const int n = kept(bright), near_count = kept(near_enough), seen_count = kept(seen);
  *culled += (int4)(kept(valid) - n, seen_count - kept(small), n - near_count,
                    near_count - seen_count);

  const float8 none = -1;
  store_rows(rows, 0, px, py, c * per, -b * per);
  store_rows(rows, 4, a * per, s->opacity, s->red, s->green);
  store_rows(rows, 8, s->blue, select(none, half_x, small), select(none, half_y, small), cut);
  vstore8(select((float8)(CULLED_DEPTH), z, small), 0, depth);
}

__kernel void project_arena(int count, int chunk, int width, int height, float near,
                            float least_alpha, float most_pixels, float most_distance,
                            float low_pass, __constant float* camera,
                            __global const float* mean_opacity, __global const float* covariance,
                            __global const float* color, __global const int* object_index,
                            __global const float* poses, __global float* record,
                            __global float* depth, __global int4* culled) {
  const int c = get_global_id(0);
  const int first = c * chunk, last = min(count, first + chunk);
  int4 counts = 0;
  for (int i = first; i < last; i += LANES) {
    const int n = min(LANES, last - i);
    float mean[4 * LANES], cov[8 * LANES], rgb[4 * LANES], rows[RECORD * LANES], z[LANES];
    int object[LANES], valid[LANES];
    for (int lane = 0; lane < LANES; lane++) {
      const size_t from = i + min(lane, n - 1);
      vstore4(vload4(from, mean_opacity), lane, mean);
      vstore8(vload8(from, covariance), lane, cov);
      vstore4(vload4(from, color), lane, rgb);
      object[lane] = object_index[from];
      valid[lane] = lane < n ? -1 : 0;
    }
    Eight s;
    load_eight(&s, mean, cov, rgb);
    load_poses(&s, object, poses);
    project_eight(&s, vload8(0, valid), camera, width, height, near, least_alpha, most_pixels,
                  most_distance, low_pass, rows, z, &counts);
    for (int lane = 0; lane < n; lane++) {
      vstore8(vload8(0, rows + RECORD * lane), 0, record + (size_t)RECORD * (i + lane));
      vstore4(vload4(0, rows + RECORD * lane + 8), 0, record + (size_t)RECORD * (i + lane) + 8);
      depth[i + lane] = z[lane];
    }
  }
  culled[c] = counts;
}
