// project_arena: splats of many posed objects -> records, depths and tiles, for drawing alone.
// A work-item owns a chunk and takes eight splats at a time as vectors.  Memory is the limit here:
// the tiles are found while the ellipses are at hand (bin.cl's find_places reads them again).
#include "common/camera.cl"
#include "common/places_of_eight.cl"

typedef struct {
  float8 x, y, z, opacity;            // mean in the object, metres
  float8 xx, xy, xz, yy, yz, zz;      // covariance in the object, m^2
  float8 red, green, blue;
  float8 m[12];                       // camera_from_object, rows
} Eight;

// Rows of four or eight floats, one a splat -> one vector a column.
#define LOAD_EIGHT(into, mean, covariance, color)                                        \
  {                                                                                      \
    const float16 p = vload16(0, mean), q = vload16(1, mean);                            \
    into.x = (float8)(p.s048c, q.s048c);                                                 \
    into.y = (float8)(p.s159d, q.s159d);                                                 \
    into.z = (float8)(p.s26ae, q.s26ae);                                                 \
    into.opacity = (float8)(p.s37bf, q.s37bf);                                           \
    const float16 a = vload16(0, covariance), b = vload16(1, covariance);                \
    const float16 c = vload16(2, covariance), d = vload16(3, covariance);                \
    into.xx = (float8)(a.s08, b.s08, c.s08, d.s08);                                      \
    into.xy = (float8)(a.s19, b.s19, c.s19, d.s19);                                      \
    into.xz = (float8)(a.s2a, b.s2a, c.s2a, d.s2a);                                      \
    into.yy = (float8)(a.s3b, b.s3b, c.s3b, d.s3b);                                      \
    into.yz = (float8)(a.s4c, b.s4c, c.s4c, d.s4c);                                      \
    into.zz = (float8)(a.s5d, b.s5d, c.s5d, d.s5d);                                      \
    const float16 g = vload16(0, color), h = vload16(1, color);                          \
    into.red = (float8)(g.s048c, h.s048c);                                               \
    into.green = (float8)(g.s159d, h.s159d);                                             \
    into.blue = (float8)(g.s26ae, h.s26ae);                                              \
  }

// Poses of eight splats: nearly always one object's, and the one of the eight before.
inline void load_poses(Eight* s, int8 object, int* current, __global const float* poses) {
  if (all(object == object.s0)) {
    if (object.s0 != *current)
      for (int k = 0; k < 12; k++) s->m[k] = poses[12 * object.s0 + k];
    *current = object.s0;
    return;
  }
  *current = -1;
  int index[LANES];
  vstore8(object, 0, index);
  for (int k = 0; k < 12; k++) {
    float column[LANES];
    for (int lane = 0; lane < LANES; lane++) column[lane] = poses[12 * index[lane] + k];
    s->m[k] = vload8(0, column);
  }
}

// Four vectors -> eight rows of four, into column `at` of the records.
inline void store_rows(float* rows, int at, float8 a, float8 b, float8 c, float8 d) {
  const float8 ab_lo = (float8)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3);
  const float8 ab_hi = (float8)(a.s4, b.s4, a.s5, b.s5, a.s6, b.s6, a.s7, b.s7);
  const float8 cd_lo = (float8)(c.s0, d.s0, c.s1, d.s1, c.s2, d.s2, c.s3, d.s3);
  const float8 cd_hi = (float8)(c.s4, d.s4, c.s5, d.s5, c.s6, d.s6, c.s7, d.s7);
  vstore4((float4)(ab_lo.s01, cd_lo.s01), 0, rows + at);
  vstore4((float4)(ab_lo.s23, cd_lo.s23), 0, rows + at + RECORD);
  vstore4((float4)(ab_lo.s45, cd_lo.s45), 0, rows + at + RECORD * 2);
  vstore4((float4)(ab_lo.s67, cd_lo.s67), 0, rows + at + RECORD * 3);
  vstore4((float4)(ab_hi.s01, cd_hi.s01), 0, rows + at + RECORD * 4);
  vstore4((float4)(ab_hi.s23, cd_hi.s23), 0, rows + at + RECORD * 5);
  vstore4((float4)(ab_hi.s45, cd_hi.s45), 0, rows + at + RECORD * 6);
  vstore4((float4)(ab_hi.s67, cd_hi.s67), 0, rows + at + RECORD * 7);
}

inline int kept(int8 lanes) {  // how many lanes are true (-1)
  const int4 a = lanes.lo + lanes.hi;
  const int2 b = a.lo + a.hi;
  return -(b.x + b.y);
}

// rows: 8 records.  depth: 8.  culled: counts of opacity, size, distance, frustum so far.
inline Ellipses project_eight(const Eight* s, int8 valid, __constant float* camera, int width,
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
  const Ellipses out = {px, py, c * per, -b * per, a * per, half_x, half_y, cut, small};
  return out;
}

__kernel void project_arena(int count, int chunk, int width, int height, float near,
                            float least_alpha, float most_pixels, float most_distance,
                            float low_pass, __constant float* camera,
                            __global const float* mean_opacity, __global const float* covariance,
                            __global const float* color, __global const int* object_index,
                            __global const float* poses, __global float* record,
                            __global float* depth, __global int4* culled, int tiles_x, int tiles_y,
                            __global uint2* places, __global uint2* pairs,
                            __global int* histogram, __global uint4* status) {
  const int c = get_global_id(0);
  const int first = c * chunk, last = min(count, first + chunk);
  int4 counts = 0;
  int current = -1;  // the object whose pose s.m holds
  Eight s;
  Chunk mine = open_chunk(first, places, pairs, histogram + c * LOW_BINS);
  for (int i = first; i < last; i += LANES) {
    const int n = min(LANES, last - i);
    float rows[RECORD * LANES], z[LANES];
    int8 object, valid = -1;
    if (n == LANES) {
      LOAD_EIGHT(s, mean_opacity + (size_t)4 * i, covariance + (size_t)8 * i, color + (size_t)4 * i)
      object = vload8(0, object_index + i);
    } else {  // the last few: the last one again for those that are missing
      float mean[4 * LANES], cov[8 * LANES], rgb[4 * LANES];
      int index[LANES];
      for (int lane = 0; lane < LANES; lane++) {
        const size_t from = i + min(lane, n - 1);
        vstore4(vload4(from, mean_opacity), lane, mean);
        vstore8(vload8(from, covariance), lane, cov);
        vstore4(vload4(from, color), lane, rgb);
        index[lane] = object_index[from];
      }
      LOAD_EIGHT(s, mean, cov, rgb)
      object = vload8(0, index);
      valid = (int8)(0, 1, 2, 3, 4, 5, 6, 7) < n;
    }
    load_poses(&s, object, &current, poses);
    const Ellipses e =
        project_eight(&s, valid, camera, width, height, near, least_alpha, most_pixels,
                      most_distance, low_pass, rows, z, &counts);
    for (int lane = 0; lane < n; lane++) {
      vstore8(vload8(0, rows + RECORD * lane), 0, record + (size_t)RECORD * (i + lane));
      vstore4(vload4(0, rows + RECORD * lane + 8), 0, record + (size_t)RECORD * (i + lane) + 8);
      depth[i + lane] = z[lane];
    }
    const Places p = places_of_eight(&e, tiles_x, tiles_y);
    enter_eight(&mine, i, n, &p, vload8(0, z));
  }
  culled[c] = counts;
  status[c] = close_chunk(&mine, first);
}
