// project_arena: splats of many posed objects -> records, tile bounds and sort keys, for drawing
// alone. A work-item owns a chunk and takes LANES splats at a time as vectors.  Memory is the limit
// here: a splat is read once for all views, the tile bounds are found while the ellipses are at
// hand (bin.cl's find_tile_bounds reads them again), and what no view can see is dropped before its
// covariance is read.
//  Sigma' = J W Sigma W^T J^T + low_pass I    (EWA splatting; 3DGS, eq. 5), of the rows u, v of J W
// Needs:   VIEWS = 1 or 2; ORDERS = 0 (an order is kept), 1 (for all views) or VIEWS (one each).
// ANTIALIASED = 1: some object is; without it such scenes alone would pay for the question.
// OWN_COLORS = 1: the second view has colours of its own.
// PAGED = 1: rows that are drawn lie in pages of the arena, see common/pages.cl.
// Reads:   frame (limits, views, poses), mean_opacity (N, 4), covariance (N, 8), color (N, 4),
//          object_index (N,); unseen (clusters,) where there is one: CLUSTER splats each that no
//          view sees (clusters.py), of which nothing is read.
// Writes:  of each view record (N, 12), depth (N,), tile_bounds (N, 2), culled (chunks, 6), status;
//          of each order pairs (N, 2) of splat and key, and histograms of the keys' low digits.
// Units:   metres in the object and in the camera, pixels on the screen, display sRGB.
#ifndef ANTIALIASED
#define ANTIALIASED 0
#endif
#ifndef OWN_COLORS
#define OWN_COLORS 0
#endif
#include "common/camera.cl"
#include "common/limits.cl"
#include "common/pages.cl"
#include "common/eight_rows.cl"
#include "common/tile_bounds_of_lanes.cl"

typedef struct {
  floatv x, y, z, opacity;        // mean in the object, metres
  floatv xx, xy, xz, yy, yz, zz;  // covariance in the object, m^2
  floatv red, green, blue;
  floatv power_threshold;  // 2 ln(opacity / min alpha)
} Splats;

// Blocks of 12 floats an object: camera_from_object of each view, then sort_from_object of each
// order, as rows; then, where some object is antialiased, 1 for those that are.  Those of a
// vector are nearly always of one object, and of the one before.
#define BLOCKS_OF_POSE (VIEWS + ORDERS)
#define POSE (12 * BLOCKS_OF_POSE + ANTIALIASED)

inline void load_poses(floatv* m, intv object, int* current, __global const float* poses) {
  if (ALL_OF(object == object.s0)) {
    if (object.s0 != *current)
      for (int k = 0; k < POSE; k++) m[k] = poses[POSE * object.s0 + k];
    *current = object.s0;
    return;
  }
  // Two objects meet in these splats: every lane gets its own pose.
  *current = -1;
  int index[LANES];
  VSTORE(object, 0, index);
  for (int k = 0; k < POSE; k++) {
    float column[LANES];
    for (int lane = 0; lane < LANES; lane++) column[lane] = poses[POSE * index[lane] + k];
    m[k] = VLOAD(0, column);
  }
}

// One order: its pairs (splat, key), packed at the chunk's start, and a histogram of low digits.
typedef struct {
  __global uint2* pairs;
  __global int* bins;
  int next;  // where the next pair goes
  uintv min_key, max_key;
} Keys;

// Floats of any sign sort as these bits do.
inline uintv sortable(floatv value) {
  const uintv bits = AS_UINT(value);
  // IEEE 754 as integers: negative floats have all bits turned, positive ones the sign alone.
  return bits ^ (AS_UINT(AS_INT(bits) >> 31) | 0x80000000u);
}

// Pairs of the splats that take part in an order, packed; and the first digit's histogram, as
// bin.cl has them.
inline void enter_keys(Keys* keys, int i, uintv key, intv member) {
  keys->min_key = min(keys->min_key, key | ~AS_UINT(member));
  keys->max_key = max(keys->max_key, key & AS_UINT(member));
  uint low[LANES];
  VSTORE(key & (LOW_BINS - 1), 0, low);
  if (ALL_OF(member)) {
    store_all_pairs(AS_UINT(LANE_NUMBERS + i), key, keys->pairs + keys->next);
    for (int lane = 0; lane < LANES; lane++) keys->bins[low[lane]]++;
    keys->next += LANES;
    return;
  }
  uint whole[LANES];
  int here[LANES];
  VSTORE(key, 0, whole);
  VSTORE(member & 1, 0, here);
  for (int lane = 0; lane < LANES; lane++) {
    if (!here[lane]) continue;
    keys->pairs[keys->next++] = (uint2)(i + lane, whole[lane]);
    keys->bins[low[lane]]++;
  }
}

#if PAGED
// Opacities of a part of what there is. Of faint splats the part itself; of opaque ones more, since
// two halves, one behind the other, would let through a quarter in the middle, and less than their
// optical depth says, since then their tails would add up to more than the whole: the least squares
// over a splat's area are at opacity * part^0.69 for two halves that are opaque.
inline floatv weighed(floatv opacity, float part) {
  const floatv least = opacity * part, most = opacity * pow(part, 0.69f);
  return select(opacity, least + (most - least) * opacity, opacity > 0.0f);
}
#endif

inline floatv ramp(floatv room, float per) {  // per 0: there is no limit to fade at
  return per > 0 ? fmin(fmax(room * per, 0.0f), 1.0f) : (floatv)(1);
}

#define STORE_RECORDS(PUT, rows)                                                      \
  PUT_COLUMNS(PUT, rows, RECORD, 0, px, py, c * per, -b * per)                        \
  PUT_COLUMNS(PUT, rows, RECORD, 4, a * per, opacity, s->red, s->green)               \
  PUT_COLUMNS(PUT, rows, RECORD, 8, s->blue, half_x, half_y, power_threshold)

// Screen ellipses of those `alive` in one view: the projection of the paper, then the gates.
// antialiased: above 0 where a splat is.  passed: per lane how many got past each gate.  record:
// that of all splats, these are i to i + n; culled ones get extents of -1.
IN_PLACE Ellipses project_lanes(const Splats* s, const floatv* m, floatv x, floatv y, floatv z,
                                floatv square, floatv antialiased, intv alive,
                                __global const float* view,
                                __global const float* limits, int i, int n,
                                __global float* record, intv* passed) {
  const float low_pass = limits[LOW_PASS];
  // Step 1, J: pixels per metre along x and y, and along z by the tangents, held as 3DGS holds
  // them.
  const floatv inv_z = 1.0f / z, tan_x = x * inv_z, tan_y = y * inv_z;
  const floatv j00 = view[CAMERA_FX] * inv_z, j11 = view[CAMERA_FY] * inv_z;
  // Vectors, since a choice of two is one.
  const floatv least_x = view[MIN_TAN_X], most_x = view[MAX_TAN_X];
  const floatv least_y = view[MIN_TAN_Y], most_y = view[MAX_TAN_Y];
  const floatv j02 = -j00 * MINIMUM(MAXIMUM(tan_x, least_x), most_x);
  const floatv j12 = -j11 * MINIMUM(MAXIMUM(tan_y, least_y), most_y);
  // Step 2, the rows u and v of J W, with W the rotation camera_from_object; J has two zeros.
  const floatv ux = j00 * m[0] + j02 * m[8], uy = j00 * m[1] + j02 * m[9];
  const floatv vx = j11 * m[4] + j12 * m[8], vy = j11 * m[5] + j12 * m[9];
  const floatv uz = j00 * m[2] + j02 * m[10], vz = j11 * m[6] + j12 * m[10];
  // Step 3, Sigma u and Sigma v: Sigma is symmetric, six floats.
  const floatv sx = s->xx * ux + s->xy * uy + s->xz * uz;
  const floatv sy = s->xy * ux + s->yy * uy + s->yz * uz;
  const floatv sz = s->xz * ux + s->yz * uy + s->zz * uz;
  const floatv tx = s->xx * vx + s->xy * vy + s->xz * vz;
  const floatv ty = s->xy * vx + s->yy * vy + s->yz * vz;
  const floatv tz = s->xz * vx + s->yz * vy + s->zz * vz;
  // Step 4, Sigma' = [u.Sigma u, u.Sigma v; ., v.Sigma v] + low pass = [a b; b c].
  const floatv bare_a = ux * sx + uy * sy + uz * sz, b = vx * sx + vy * sy + vz * sz;
  const floatv bare_c = vx * tx + vy * ty + vz * tz;
  const floatv a = bare_a + low_pass, c = bare_c + low_pass;
  // Step 5, its determinant: that without the low pass, which float rounding may take below 0, plus
  // what the low pass adds.
  const floatv bare = MAXIMUM(bare_a * bare_c - b * b, (floatv)(0));
  const floatv determinant = bare + low_pass * (bare_a + bare_c) + low_pass * low_pass;
  const floatv per = 1.0f / determinant;
  floatv power_threshold = s->power_threshold, opacity = s->opacity;
#if ANTIALIASED
  // Mip-Splatting's 2D filter (Yu et al. 2024): what the low pass makes wider becomes fainter by
  // sqrt(det Sigma' / det with the low pass), so that all of it gives the same light.
  const floatv kept = fmin(sqrt(bare / determinant), 1.0f);  // 1 where the quotient is no number
  opacity *= select((floatv)(1), kept, antialiased > 0);
  power_threshold = fmax(2.0f * log(opacity * limits[PER_MIN_ALPHA]), 0.0f);
#endif
  // Step 6: the half axes of the box of alpha >= min alpha, and the 2D mean.
  floatv half_x = sqrt(power_threshold * a), half_y = sqrt(power_threshold * c);
  const floatv px = j00 * x + view[CAMERA_CX], py = j11 * y + view[CAMERA_CY];
  // The larger eigenvalue of Sigma', for the clipping threshold tau_lambda of the paper (section
  // 4.1).
  const floatv mid = 0.5f * (a + c), off = 0.5f * (a - c);
  const floatv major = mid + sqrt(off * off + b * b);  // px^2, one sigma squared

  // The first gate that fails counts.  What is not finite is nowhere, so it fails at "size", whose
  // tests are positive.
  const intv finite = (half_x < FLT_MAX) & (half_y < FLT_MAX) & isfinite(px + py);
  // On the screen: the box meets the image.  Splats whose mean is outside stay if they reach in.
  const intv inside = (px + half_x > 0.0f) & (px - half_x < view[IMAGE_WIDTH]) &
                      (py + half_y > 0.0f) & (py - half_y < view[IMAGE_HEIGHT]);
  const intv seen = alive & (inside | ~finite);
  // Not larger than tau_lambda; finite in everything that a pixel will be computed from.
  intv small = seen & finite & (major <= limits[MAX_PIXELS_2]);
  small &= (determinant > 0.0f) & (determinant < FLT_MAX) & (fabs(s->red) <= MAX_COLOR) &
           (fabs(s->green) <= MAX_COLOR) & (fabs(s->blue) <= MAX_COLOR);
  // sqrt(threshold lambda) is how far the splat reaches along its longer axis.
  const intv large = small & (power_threshold * major >= limits[MIN_PIXELS_2]);
  intv drawn = large;
#if ANTIALIASED
  drawn &= opacity >= limits[MIN_ALPHA];
#endif
  // Bands before the limits in which opacity falls to 0: splats fade out instead of popping.
  if (limits[FADES] > 0) {
    opacity *= ramp(limits[MAX_PIXELS] - sqrt(major), limits[PER_PIXELS]) *
               ramp(limits[MAX_DISTANCE] - sqrt(square), limits[PER_DISTANCE]) *
               ramp(sqrt(power_threshold * major) - limits[MIN_PIXELS], limits[PER_FOOTPRINT]);
    drawn &= opacity >= limits[MIN_ALPHA];
    // A fainter splat reaches alpha = min alpha nearer to its mean.
    power_threshold = fmax(2.0f * log(opacity * limits[PER_MIN_ALPHA]), 0.0f);
    half_x = sqrt(power_threshold * a);
    half_y = sqrt(power_threshold * c);
  }
  passed[GATE_FRUSTUM] += seen;
  passed[GATE_SIZE] += small;
  passed[GATE_FOOTPRINT] += large;
  passed[GATE_FADED] += drawn;

  const floatv none = -1;
  // An extent of -1 says "culled" to everyone who reads the record.
  half_x = select(none, half_x, drawn);
  half_y = select(none, half_y, drawn);
  STREAM_ROWS(STORE_RECORDS, record, RECORD)
  const Ellipses out = {px, py, c * per, -b * per, a * per, half_x, half_y, power_threshold, drawn};
  return out;
}

// Splats without a record: their extent, their depth and their empty tile bounds say so.
inline void leave_out(int i, int n, __global float* record, __global float* depth,
                      __global uint2* tile_bounds) {
  for (int lane = 0; lane < n; lane++) {
    record[(size_t)RECORD * (i + lane) + EXTENT_X] = -1;
    depth[i + lane] = CULLED_DEPTH;
    tile_bounds[i + lane] = (uint2)(0);
  }
}

// frame: the limits, VIEW_SIZE floats a view, POSE floats an object.  by_distance: keys are metres
// to the sort frame's origin, else along its z.  keep_outside: also splats that no view sees get a
// key.  status: pairs of the view's order, intersections, least and largest key.
__kernel void project_arena(
    int count, int chunk, int by_distance, int keep_outside, __global const int* unseen,
    __global const int* sources, __global const float* weights, __global const float* frame,
    __global const float* mean_opacity, __global const float* covariance,
    __global const float* color, __global const float* second_color,
    __global const int* object_index,
    __global float* record_0, __global float* depth_0, __global int* culled_0,
    __global uint2* tile_bounds_0, __global uint4* status_0, __global uint2* pairs_0,
    __global int* table_0,
    __global float* record_1, __global float* depth_1, __global int* culled_1,
    __global uint2* tile_bounds_1, __global uint4* status_1, __global uint2* pairs_1,
    __global int* table_1) {
  const int c = get_global_id(0);
  const int first = c * chunk, last = min(count, first + chunk);
  __global const float *limits = frame, *views = frame + LIMITS;
  __global const float* poses = views + VIEWS * VIEW_SIZE;
  __global float* const record[2] = {record_0, record_1};
  __global float* const depth[2] = {depth_0, depth_1};
  __global int* const culled[2] = {culled_0, culled_1};
  __global uint2* const tile_bounds[2] = {tile_bounds_0, tile_bounds_1};
  __global uint4* const status[2] = {status_0, status_1};
  __global uint2* const pairs[2] = {pairs_0, pairs_1};
  __global int* const table[2] = {table_0, table_1};

  // One more than ORDERS, since C has no arrays of none.
  Keys keys[ORDERS + 1];
  for (int o = 0; o < ORDERS; o++) {
    const Keys none = {pairs[o], table[o] + c * LOW_BINS, first, 0xffffffffu, 0};
    keys[o] = none;
    for (int b = 0; b < LOW_BINS; b++) keys[o].bins[b] = 0;
  }
  intv passed[VIEWS][GATES], intersections[VIEWS], entered = 0;
  for (int v = 0; v < VIEWS; v++) {
    intersections[v] = 0;
    for (int g = 0; g < GATES; g++) passed[v][g] = 0;
  }
  int current = -1;  // the object whose pose m holds
  floatv m[POSE];
  Splats s;
  for (int i = first; i < last; i += LANES) {
    // Chunks begin where clusters do.
    const int left = unseen && i % CLUSTER == 0 ? unseen[i / CLUSTER] : 0;
    if (left) {
      // They are counted as the gates would count them.
      const int end = min(i + CLUSTER, last), bright = (left >> 1) - 1;
      entered.s0 -= bright;
      for (int v = 0; v < VIEWS; v++) {
        passed[v][GATE_DISTANCE].s0 -= bright;
        if (!(left & 1)) leave_out(i, end - i, record[v], depth[v], tile_bounds[v]);
      }
      i = end - LANES;
      continue;
    }
    const int n = min(LANES, last - i);
    const intv valid = LANE_NUMBERS < n;
    const long moved = row_of(i, sources) - i;  // from a row that is drawn to where it lies
    if (i + moved < 0) {
      for (int v = 0; v < VIEWS; v++) leave_out(i, n, record[v], depth[v], tile_bounds[v]);
      continue;
    }
    // As if it began there.
    __global const float* means = mean_opacity + 4 * moved;
    LOAD_ROWS(LOAD_MEANS, s, means, 4)
#if PAGED
    const float weight = weights[i / PAGE];
    if (weight != 1.0f) s.opacity = weighed(s.opacity, weight);
#endif
    // Gate 1, opacity: absent splats of other modalities end here, LANES at a time.
    const intv bright = valid & (s.opacity >= limits[MIN_ALPHA]) & (s.opacity < FLT_MAX);
    entered += bright;
    if (!ANY_OF(bright)) {
      for (int v = 0; v < VIEWS; v++) leave_out(i, n, record[v], depth[v], tile_bounds[v]);
      continue;
    }
    intv object;
    LOAD_INDICES(object, object_index)
    load_poses(m, object, &current, poses);
    // Gate 2, distance (the paper's second threshold, for distant splats), and the near plane; both
    // need the mean alone.
    floatv x[VIEWS], y[VIEWS], z[VIEWS], square[VIEWS];
    intv alive[VIEWS], seen[VIEWS + 1], anywhere = 0;
    for (int v = 0; v < VIEWS; v++) {
      const floatv* to = m + 12 * v;
      x[v] = to[0] * s.x + to[1] * s.y + to[2] * s.z + to[3];
      y[v] = to[4] * s.x + to[5] * s.y + to[6] * s.z + to[7];
      z[v] = to[8] * s.x + to[9] * s.y + to[10] * s.z + to[11];
      square[v] = x[v] * x[v] + y[v] * y[v] + z[v] * z[v];
      const intv near_enough = bright & (square[v] <= limits[MAX_DISTANCE_2]);
      passed[v][GATE_DISTANCE] += near_enough;
      alive[v] = near_enough & (z[v] > views[VIEW_SIZE * v + NEAR]);
      anywhere |= alive[v];
      seen[v] = 0;
    }
    // Covariances and colours, the larger part of a splat, only where some view may see one of
    // them.
    if (ANY_OF(anywhere)) {
      __global const float* covariances = covariance + 8 * moved;
      LOAD_ROWS(LOAD_COVARIANCES, s, covariances, 8)
      LOAD_ROWS(LOAD_COLORS, s, color, 4)
      s.power_threshold = fmax(2.0f * log(s.opacity * limits[PER_MIN_ALPHA]), 0.0f);
    }
    intv drawn_anywhere = 0;
    for (int v = 0; v < VIEWS; v++) {
      if (!ANY_OF(alive[v])) {
        leave_out(i, n, record[v], depth[v], tile_bounds[v]);
        continue;
      }
#if OWN_COLORS
      if (v == 1) {
        LOAD_ROWS(LOAD_COLORS, s, second_color, 4)
      }
#endif
      __global const float* view = views + VIEW_SIZE * v;
      const floatv antialiased = ANTIALIASED ? m[POSE - 1] : (floatv)(0);
      // Gates 3 to 6 and the record.
      const Ellipses e = project_lanes(&s, m + 12 * v, x[v], y[v], z[v], square[v], antialiased,
                                       alive[v], view, limits, i, n, record[v], passed[v]);
      // The ellipses are in registers: their tile bounds are cheapest here.
      const TileBoundsV p = tile_bounds_of_lanes(&e, (int)view[TILES_X], (int)view[TILES_Y]);
      intersections[v] += p.count;
      seen[v] = p.count > 0;
      drawn_anywhere |= seen[v];
      const floatv far = select((floatv)(CULLED_DEPTH), z[v], e.seen);
      store_floats(far, i, n, depth[v]);
      store_pairs(p.corner, p.mask, i, n, tile_bounds[v]);
    }
    // Sort keys: of each view its own, or of one frame between two eyes for both.
    for (int o = 0; o < ORDERS; o++) {
      const floatv* to = m + 12 * (VIEWS + o);
      // An order that is kept while the views turn holds every splat that is there.
      const intv member = keep_outside ? bright : ORDERS == 1 ? drawn_anywhere : seen[o];
      if (!ANY_OF(member)) continue;
      const floatv kz = to[8] * s.x + to[9] * s.y + to[10] * s.z + to[11];
      // Depth along the view, as 3DGS sorts: it changes while a head turns, and splats pop
      // (StopThePop, Radl et al. 2024).  The distance to the eye does not.
      floatv key = kz;
      if (by_distance) {
        const floatv kx = to[0] * s.x + to[1] * s.y + to[2] * s.z + to[3];
        const floatv ky = to[4] * s.x + to[5] * s.y + to[6] * s.z + to[7];
        key = sqrt(kx * kx + ky * ky + kz * kz);
      }
      enter_keys(keys + o, i, sortable(key), member & isfinite(key));
    }
  }
  // Counts a gate: how many came to it less how many passed.
  for (int v = 0; v < VIEWS; v++) {
    int before = last - first;
    for (int g = 0; g < GATES; g++) {
      const int after = -sum_ints(g == GATE_OPACITY ? entered : passed[v][g]);
      culled[v][GATES * c + g] = max(before, 0) - max(after, 0);
      before = after;
    }
    uint4 summary = (uint4)(0, sum_ints(intersections[v]), 0, 0);
    if (ORDERS) {
      const Keys* mine = keys + (ORDERS == 1 ? 0 : v);
      summary.x = mine->next - first;
      summary.z = min_uints(mine->min_key);
      summary.w = max_uints(mine->max_key);
    }
    status[v][c] = summary;
  }
}
