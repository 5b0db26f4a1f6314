// tile_bounds_of_eight: tile_bounds_of() of tiles.cl for eight splats at once as vectors, and their
// entries in the packed lists of a chunk.
// Reads:   ellipses of eight splats, as the record has them.
// Defines: Ellipses, TileBounds8, Chunk; tile_bounds_of_eight(), columns_of_eight_rows();
//          open_chunk(), enter_eight(), close_chunk(); LOW_BINS, IN_PLACE.
// Units:   pixels and tiles, row 0 on top; keys are the bits of a depth in metres.
#include "common/tiles.cl"
#include "common/vector.cl"
#define LOW_BITS 12  // of a depth key: the digit of the first sorting pass
#define LOW_BINS (1 << LOW_BITS)

// A call would hand these structs over in memory: 6 % of a stereo launch.
#define IN_PLACE __attribute__((always_inline)) inline

// Eight ellipses on the screen, pixels; `seen` is -1 where there is one.
typedef struct {
  float8 x, y, a, b, c, half_x, half_y, power_threshold;
  int8 seen;
} Ellipses;

typedef struct {
  uint8 corner, mask;  // the two words of tile bounds
  int8 count;          // tiles touched
} TileBounds8;

// What a chunk gathers: its visible splats, packed at its start, and a histogram of low digits.
typedef struct {
  __global uint2* tile_bounds;
  __global uint2* pairs;  // splat, depth key
  __global int* bins;
  int next;               // where its next visible splat goes
  int8 intersections;     // of each lane, summed at the end; so with the range of keys
  uint8 min_key, max_key;
} Chunk;

// A chunk's slice of the pairs begins where its splats do, so that chunks need no common counter.
inline Chunk open_chunk(int first, __global uint2* tile_bounds, __global uint2* pairs,
                        __global int* bins) {
  const Chunk chunk = {tile_bounds, pairs, bins, first, 0, 0xffffffffu, 0};
  for (int b = 0; b < LOW_BINS; b++) bins[b] = 0;
  return chunk;
}

// The status of a chunk: visible splats, intersections, least and largest key.
inline uint4 close_chunk(const Chunk* chunk, int first) {
  const int4 sum = chunk->intersections.lo + chunk->intersections.hi;
  const uint4 min_key = min(chunk->min_key.lo, chunk->min_key.hi);
  const uint4 max_key = max(chunk->max_key.lo, chunk->max_key.hi);
  return (uint4)(chunk->next - first, sum.x + sum.y + sum.z + sum.w,
                 min(min(min_key.x, min_key.y), min(min_key.z, min_key.w)),
                 max(max(max_key.x, max_key.y), max(max_key.z, max_key.w)));
}

// The same two steps as tile_bounds_of(), whose comments say what they are; all lanes walk as many
// rows as the tallest needs, and what a lane has not is masked out instead of branched around.
IN_PLACE TileBounds8 tile_bounds_of_eight(const Ellipses* e, int tiles_x, int tiles_y) {
  // Culled lanes hold anything, also NaN: they become empty ellipses first.
  const float8 zero = 0;
  const float8 x = select(zero, e->x, e->seen), y = select(zero, e->y, e->seen);
  const float8 ex = select(zero, e->half_x, e->seen), ey = select(zero, e->half_y, e->seen);
  // Pixel centres lie at +0.5: the first and last pixels whose centre is inside the box.
  const int8 x0 = convert_int8(ceil(fmax(x - ex, zero) - 0.5f)) >> 4;
  const int8 y0 = convert_int8(ceil(fmax(y - ey, zero) - 0.5f)) >> 4;
  const int8 x1 = convert_int8(floor(fmin(x + ex, (float8)(TILE * tiles_x)) - 0.5f)) >> 4;
  const int8 y1 = convert_int8(floor(fmin(y + ey, (float8)(TILE * tiles_y)) - 0.5f)) >> 4;
  // >> 4 rounds down also below 0, unlike a division by TILE.
  const int8 columns = x1 + 1 - x0, rows = y1 + 1 - y0;
  const int8 present = e->seen & (columns > 0) & (rows > 0);
  // Larger than a mask: only its box is kept, and bin walks its rows later.
  const int8 box = present & ((columns > 8) | (rows > 4));
  const int8 masked = present & ~box;
  // Step 2, the rows of tiles: an interval of columns a row, no test a tile.
  // x = slope y +- sqrt((T - y^2 / Sigma'_yy) / A), farthest to the right at y = y_extreme
  const float8 inv_a = 1.0f / e->a, slope = -e->b * inv_a;
  const float8 y_extreme = -e->b / e->c * ex;
  const float8 inv_yy = e->power_threshold / fmax(ey * ey, FLT_MIN),
      threshold = 1.0001f * e->power_threshold;
  // From the mean to the first pixel centre of the box.
  const float8 left = convert_float8(x0 * TILE) + 0.5f - x;
  float8 top = convert_float8(y0 * TILE) + 0.5f - y;
  uint8 mask = 0;
  int8 count = 0;
  const int most_rows = max_int8(masked & rows);
  for (int row = 0; row < most_rows; row++) {
    const float8 bottom = top + (TILE - 1);
    const float8 y_right = fmin(fmax(y_extreme, top), bottom),
        y_left = fmin(fmax(-y_extreme, top), bottom);
    // 1.0001: float rounding must not lose a pixel.
    const float8 right_x =
        slope * y_right + sqrt(fmax(threshold - y_right * y_right * inv_yy, 0.0f) * inv_a) - left;
    const float8 left_x =
        slope * y_left - sqrt(fmax(threshold - y_left * y_left * inv_yy, 0.0f) * inv_a) - left;
    const int8 after = convert_int8(floor(right_x * (1.0f / TILE))) + 1;
    const int8 first = convert_int8(ceil((left_x - (TILE - 1)) * (1.0f / TILE)));
    // A row that this lane does not have leaves its mask as it is: start = end = 0.
    const int8 in = masked & (row < rows);
    const int8 end = clamp(after, 0, columns) & in, start = min(max(first, 0), end);
    mask |= (((uint8)(1) << as_uint8(end)) - ((uint8)(1) << as_uint8(start))) << (uint8)(8 * row);
    count += end - start;
    top += TILE;
  }
  const int8 single = masked & (columns == 1) & (rows == 1);  // its box holds a pixel centre
  mask |= as_uint8(single & 1);
  count |= single & 1;
  // A mask may stay empty: a box may touch pixel centres where its ellipse does not.
  const int8 touched = present & (box | (count > 0));
  // Branch free: culled lanes get zeros, wide ones their size in place of the mask.
  TileBounds8 out;
  const uint8 corner = as_uint8(x0) | as_uint8(y0) << 12;
  out.corner = as_uint8(touched) & (corner | select((uint8)(MASKED), (uint8)(BOX), as_uint8(box)));
  const uint8 size = as_uint8(columns) | as_uint8(rows) << 16;
  out.mask = as_uint8(touched) & select(mask, size, as_uint8(box));
  out.count = touched & select(count, columns * rows, box);
  return out;
}

// Enters `n` splats from number i on; depth: their eight depths.
inline void enter_eight(Chunk* chunk, int i, int n, const TileBounds8* p, float8 depth) {
  // Depths are above 0, and such floats sort as their bits do.
  const uint8 c = p->corner, m = p->mask, key = as_uint8(depth);
  const int8 visible = p->count > 0;
  chunk->intersections += p->count;
  // Lanes that are not visible give all ones and zeros: neither least nor largest.
  chunk->min_key = min(chunk->min_key, key | ~as_uint8(visible));
  chunk->max_key = max(chunk->max_key, key & as_uint8(visible));
  if (n == LANES && all(visible)) {
    // The common case, eight visible splats: whole vectors of pairs and bounds are stored.
    vstore16((uint16)(i, key.s0, i + 1, key.s1, i + 2, key.s2, i + 3, key.s3, i + 4, key.s4, i + 5,
                      key.s5, i + 6, key.s6, i + 7, key.s7),
             0, (__global uint*)(chunk->pairs + chunk->next));
    vstore16((uint16)(c.s0, m.s0, c.s1, m.s1, c.s2, m.s2, c.s3, m.s3, c.s4, m.s4, c.s5, m.s5, c.s6,
                      m.s6, c.s7, m.s7), 0, (__global uint*)(chunk->tile_bounds + i));
    chunk->next += LANES;
    // The histogram of the first digit is counted here, so the sort's first pass reads nothing
    // twice.
    uint low[LANES];
    vstore8(key & (LOW_BINS - 1), 0, low);
    for (int lane = 0; lane < LANES; lane++) chunk->bins[low[lane]]++;
    return;
  }
  uint keys[LANES], corner[LANES], mask[LANES];
  vstore8(key, 0, keys);
  vstore8(c, 0, corner);
  vstore8(m, 0, mask);
  for (int lane = 0; lane < n; lane++) {
    chunk->tile_bounds[i + lane] = (uint2)(corner[lane], mask[lane]);
    // Written over by the next one unless visible.
    chunk->pairs[chunk->next] = (uint2)(i + lane, keys[lane]);
    // MASKED and BOX lie above all columns and rows, a culled splat's word is 0.
    const int here = corner[lane] >= MASKED;
    chunk->next += here;
    chunk->bins[keys[lane] & (LOW_BINS - 1)] += here;
  }
}

// columns_of_row() of tiles.cl for eight rows of a BOX from `first` on: the same operations.
IN_PLACE void columns_of_eight_rows(const EllipseRows* s, int first, int* start, int* end) {
  const float8 row = convert_float8((int8)(0, 1, 2, 3, 4, 5, 6, 7) + first);
  const float8 top = s->top + row * (float)TILE, bottom = top + (TILE - 1);
  const float8 y_right = fmin(fmax((float8)(s->y_extreme), top), bottom),
      y_left = fmin(fmax((float8)(-s->y_extreme), top), bottom);
  const float8 half_right = sqrt(
      fmax(fma(-y_right * y_right, (float8)(s->inv_yy), (float8)(s->threshold)), 0.0f) * s->inv_a);
  const float8 half_left = sqrt(
      fmax(fma(-y_left * y_left, (float8)(s->inv_yy), (float8)(s->threshold)), 0.0f) * s->inv_a);
  const float8 slope = s->slope;
  const float8 right = fma(slope, y_right, half_right) - s->left + s->rounding;
  const float8 left = fma(slope, y_left, -half_left) - s->left - s->rounding;
  const float width = (float)(s->columns * TILE);
  // What is not a number leaves nothing out.
  const int8 in_box = right < width;
  const float8 within = select((float8)(0), right, in_box & (right >= 0.0f));
  int8 after = (convert_int8(within) >> 4) + 1;
  after = select(after, (int8)(0), ~(right >= 0.0f));
  after = select((int8)(s->columns), after, in_box);
  const int8 beyond = left > (float)(TILE - 1), meets = left < width;
  const int8 from = convert_int8(ceil(select((float8)(0), left, beyond & meets))) >> 4;
  int8 before = select((int8)(s->columns), from, meets);
  before = select((int8)(0), before, beyond);
  vstore8(min(before, after), 0, start);
  vstore8(after, 0, end);
}
