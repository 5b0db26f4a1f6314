// tile_bounds_of_lanes: tile_bounds_of() of tiles.cl for LANES splats at once as vectors.
// Reads:   ellipses of LANES splats, as the record has them.
// Defines: Ellipses, TileBoundsV; tile_bounds_of_lanes(); LOW_BINS, IN_PLACE.
// Units:   pixels and tiles, row 0 on top; keys are the bits of a depth in metres.
#include "common/tiles.cl"
#include "common/vector.cl"
#define LOW_BITS 12  // of a depth key: the digit of the first sorting pass
#define LOW_BINS (1 << LOW_BITS)

// A call would hand these structs over in memory: 6 % of a stereo launch.
#define IN_PLACE __attribute__((always_inline)) inline

// Ellipses on the screen, pixels; `seen` is -1 where there is one.
typedef struct {
  floatv x, y, a, b, c, half_x, half_y, power_threshold;
  intv seen;
} Ellipses;

typedef struct {
  uintv corner, mask;  // the two words of tile bounds
  intv count;          // tiles touched
} TileBoundsV;

// The same two steps as tile_bounds_of(), whose comments say what they are; all lanes walk as many
// rows as the tallest needs, and what a lane has not is masked out instead of branched around.
IN_PLACE TileBoundsV tile_bounds_of_lanes(const Ellipses* e, int tiles_x, int tiles_y) {
  // Culled lanes hold anything, also NaN: they become empty ellipses first.
  const floatv zero = 0;
  const floatv x = select(zero, e->x, e->seen), y = select(zero, e->y, e->seen);
  const floatv ex = select(zero, e->half_x, e->seen), ey = select(zero, e->half_y, e->seen);
  // Pixel centres lie at +0.5: the first and last pixels whose centre is inside the box.
  const intv x0 = CONVERT_INT(ceil(MAXIMUM(x - ex, zero) - 0.5f)) >> 4;
  const intv y0 = CONVERT_INT(ceil(MAXIMUM(y - ey, zero) - 0.5f)) >> 4;
  const intv x1 = CONVERT_INT(floor(MINIMUM(x + ex, (floatv)(TILE * tiles_x)) - 0.5f)) >> 4;
  const intv y1 = CONVERT_INT(floor(MINIMUM(y + ey, (floatv)(TILE * tiles_y)) - 0.5f)) >> 4;
  // >> 4 rounds down also below 0, unlike a division by TILE.
  const intv columns = x1 + 1 - x0, rows = y1 + 1 - y0;
  const intv present = e->seen & (columns > 0) & (rows > 0);
  // Larger than a mask: only its box is kept, and bin walks its rows later.
  const intv box = present & ((columns > 8) | (rows > 4));
  const intv masked = present & ~box;
  // Step 2, the rows of tiles: an interval of columns a row, no test a tile.
  // x = slope y +- sqrt((T - y^2 / Sigma'_yy) / A), farthest to the right at y = y_extreme
  const floatv inv_a = 1.0f / e->a, slope = -e->b * inv_a;
  const floatv y_extreme = -e->b / e->c * ex;
  const floatv inv_yy = e->power_threshold / MAXIMUM(ey * ey, (floatv)(FLT_MIN)),
      threshold = 1.0001f * e->power_threshold;
  // From the mean to the first pixel centre of the box.
  const floatv left = CONVERT_FLOAT(x0 * TILE) + 0.5f - x;
  floatv top = CONVERT_FLOAT(y0 * TILE) + 0.5f - y;
  uintv mask = 0;
  intv count = 0;
  // Of all lanes.
  const int most_rows = max_ints(masked & rows);
  for (int row = 0; row < most_rows; row++) {
    const floatv bottom = top + (TILE - 1);
    const floatv y_right = MINIMUM(MAXIMUM(y_extreme, top), bottom),
        y_left = MINIMUM(MAXIMUM(-y_extreme, top), bottom);
    // 1.0001: float rounding must not lose a pixel.
    const floatv right_2 = MAXIMUM(threshold - y_right * y_right * inv_yy, zero);
    const floatv right_x = slope * y_right + sqrt(right_2 * inv_a) - left;
    const floatv left_2 = MAXIMUM(threshold - y_left * y_left * inv_yy, zero);
    const floatv left_x = slope * y_left - sqrt(left_2 * inv_a) - left;
    const intv after = CONVERT_INT(floor(right_x * (1.0f / TILE))) + 1;
    const intv first = CONVERT_INT(ceil((left_x - (TILE - 1)) * (1.0f / TILE)));
    // A row that this lane does not have leaves its mask as it is: start = end = 0.
    const intv in = masked & (row < rows);
    const intv end = clamp(after, 0, columns) & in, start = min(max(first, 0), end);
    mask |= (((uintv)(1) << AS_UINT(end)) - ((uintv)(1) << AS_UINT(start))) << (uintv)(8 * row);
    count += end - start;
    top += TILE;
  }
  const intv single = masked & (columns == 1) & (rows == 1);  // its box holds a pixel centre
  mask |= AS_UINT(single & 1);
  count |= single & 1;
  // A mask may stay empty: a box may touch pixel centres where its ellipse does not.
  const intv touched = present & (box | (count > 0));
  // Branch free: culled lanes get zeros, wide ones their size in place of the mask.
  TileBoundsV out;
  const uintv corner = AS_UINT(x0) | AS_UINT(y0) << 12;
  out.corner = AS_UINT(touched) & (corner | select((uintv)(MASKED), (uintv)(BOX), AS_UINT(box)));
  const uintv size = AS_UINT(columns) | AS_UINT(rows) << 16;
  out.mask = AS_UINT(touched) & select(mask, size, AS_UINT(box));
  out.count = touched & select(count, columns * rows, box);
  return out;
}
