// tiles: which tiles of 16x16 pixels a splat touches: its tile bounds, a uint2.
//  x: first column | first row << 12 | kind (0 culled, MASKED, BOX)
//  y: MASKED: the tile mask, bit 8 row + column for each touched tile of a grid of 8 x 4
//     BOX: columns | rows << 16 of a box larger than that grid; columns_of_row says which of them
// The tiles of the bounding box of alpha >= min alpha, less those that the ellipse misses: SnugBox
// and AccuTile (Speedy-Splat, Hanson et al. 2025), where 3DGS takes a square of three sigmas.
// Reads:   a record (record.cl).
// Defines: tile_bounds_of(), ellipse_rows_of(), columns_of_row(), tiles_at(), rank_of_tile().
// Units:   pixels and tiles, row 0 on top.
#include "common/record.cl"
// 3DGS's tile.  A power of two, and 256 pixels are one work-group of a GPU.
#define TILE 16
// A mask of 32 bits holds the tiles of nearly all splats, and bits are counted and walked fast.
#define MASKED (1u << 24)
#define BOX (2u << 24)
#define BOUNDS_COLUMN(bounds) ((int)((bounds).x & 0xfff))
#define BOUNDS_ROW(bounds) ((int)((bounds).x >> 12 & 0xfff))

// Bounds of one splat; tile_bounds_of_lanes.cl does the same for vectors.
inline uint2 tile_bounds_of(const float* s, int tiles_x, int tiles_y) {
  const float x = s[MEAN_X], y = s[MEAN_Y], ex = s[EXTENT_X], ey = s[EXTENT_Y];
  if (!(ex > 0)) return (uint2)(0);
  // Step 1, the box: the ellipse d^T Sigma'^-1 d = T reaches sqrt(T Sigma'_xx) to either side,
  // which is the extent in the record.
  // Pixel centres lie at +0.5: the first and last pixels whose centre is inside the box.
  const int left_px = (int)ceil(fmax(x - ex, 0.0f) - 0.5f);
  const int top_px = (int)ceil(fmax(y - ey, 0.0f) - 0.5f);
  const int right_px = (int)floor(fmin(x + ex, (float)(TILE * tiles_x)) - 0.5f);
  const int bottom_px = (int)floor(fmin(y + ey, (float)(TILE * tiles_y)) - 0.5f);
  const int x0 = left_px / TILE, columns = (right_px >> 4) + 1 - x0;
  const int y0 = top_px / TILE, rows = (bottom_px >> 4) + 1 - y0;
  if (!(columns > 0 && rows > 0)) return (uint2)(0);
  const uint corner = (uint)x0 | (uint)y0 << 12;
  if (columns == 1 && rows == 1) return (uint2)(corner | MASKED, 1);
  if (columns > 8 || rows > 4)
    return (uint2)(corner | BOX, (uint)columns | (uint)rows << 16);
  // Step 2, the rows: a row of tiles is a strip top <= y <= bottom.  At one y the ellipse spans
  // x = slope y +- sqrt((T - y^2 / Sigma'_yy) / A),   slope = -B / A
  // and it lies farthest to the right at y = y_extreme = -B / C extent_x, to the left at its
  // negative.  Within a strip the farthest is therefore at the y in it that is next to these: two
  // roots a strip find its interval of columns, and no tile is tested for itself.
  const float inv_a = 1.0f / s[CONIC_A], slope = -s[CONIC_B] * inv_a;
  const float y_extreme = -s[CONIC_B] / s[CONIC_C] * ex;
  // 1 / Sigma'_yy = T / extent_y^2.  1.0001: float rounding must not lose a pixel.
  const float inv_yy = s[POWER_THRESHOLD] / fmax(ey * ey, FLT_MIN),
      threshold = 1.0001f * s[POWER_THRESHOLD];
  const float left = x0 * TILE + 0.5f - x;
  uint mask = 0;
  for (int row = 0; row < rows; row++) {
    const float top = (y0 + row) * TILE + 0.5f - y, bottom = top + (TILE - 1);
    // Of the strip's pixel centres the first and the last row, and the y next to the extremes.
    const float y_right = clamp(y_extreme, top, bottom), y_left = clamp(-y_extreme, top, bottom);
    const float right_x =
        slope * y_right + sqrt(fmax(threshold - y_right * y_right * inv_yy, 0.0f) * inv_a) - left;
    const float left_x =
        slope * y_left - sqrt(fmax(threshold - y_left * y_left * inv_yy, 0.0f) * inv_a) - left;
    // Columns whose last pixel centre lies right of left_x and whose first left of right_x.
    const int after = (int)floor(right_x * (1.0f / TILE)) + 1;
    const int first = (int)ceil((left_x - (TILE - 1)) * (1.0f / TILE));
    const int end = clamp(after, 0, columns), start = min(max(first, 0), end);
    // Ones from start to before end, as a difference of two powers of two.
    mask |= ((1u << end) - (1u << start)) << (8 * row);
  }
  // The box may touch pixel centres where its ellipse does not.
  return mask ? (uint2)(corner | MASKED, mask) : (uint2)(0);
}

// What the rows of a BOX are found by: step 2 for one row at a time, with room for what float
// rounding does to a pixel's own test, which is much for long thin splats.  Lists are counted and
// written by two kernels, which have to agree: whatever a compiler might fuse in one and not in the
// other is an fma already.
typedef struct {
  float slope, inv_a, y_extreme, inv_yy, threshold, left, top, rounding;
  int columns;
} EllipseRows;

inline EllipseRows ellipse_rows_of(__global const float* s, uint2 bounds) {
  const float x = s[MEAN_X], y = s[MEAN_Y], ex = s[EXTENT_X], ey = s[EXTENT_Y];
  const float a = s[CONIC_A], c = s[CONIC_C];
  EllipseRows ellipse;
  ellipse.inv_a = 1.0f / a;
  ellipse.slope = -s[CONIC_B] * ellipse.inv_a;
  ellipse.y_extreme = -s[CONIC_B] / c * ex;
  ellipse.inv_yy = s[POWER_THRESHOLD] / fmax(ey * ey, FLT_MIN);
  // Relative room for the power, which cancels between a ex^2, c ey^2 and the mixed term ...
  ellipse.threshold = fma(1.0001f, s[POWER_THRESHOLD], 5e-7f * fma(a * ex, ex, c * ey * ey));
  // ... and absolute room for x, in pixels.
  ellipse.rounding = 1e-6f * fma(fabs(ellipse.slope), ey + fabs(y), ex + fabs(x));
  // The box's first pixel centre, from the mean.
  ellipse.left = (float)(BOUNDS_COLUMN(bounds) * TILE) + 0.5f - x;
  ellipse.top = (float)(BOUNDS_ROW(bounds) * TILE) + 0.5f - y;
  ellipse.columns = bounds.y & 0xffff;
  return ellipse;
}

// The columns of the box, from x to before y, that the ellipse touches in one of its rows of tiles.
inline int2 columns_of_row(const EllipseRows* s, int row) {
  const float top = s->top + (float)(row * TILE), bottom = top + (TILE - 1);
  const float y_right = clamp(s->y_extreme, top, bottom),
      y_left = clamp(-s->y_extreme, top, bottom);
  const float half_right =
      sqrt(fmax(fma(-y_right * y_right, s->inv_yy, s->threshold), 0.0f) * s->inv_a);
  const float half_left =
      sqrt(fmax(fma(-y_left * y_left, s->inv_yy, s->threshold), 0.0f) * s->inv_a);
  const float right = fma(s->slope, y_right, half_right) - s->left + s->rounding;
  const float left = fma(s->slope, y_left, -half_left) - s->left - s->rounding;
  const float width = (float)(s->columns * TILE);
  // What is not a number leaves nothing out.
  const int end = !(right < width) ? s->columns : right >= 0 ? (int)right / TILE + 1 : 0;
  // Its last tile ends at TILE - 1 pixel centres: more to the left and the first column is touched.
  const int start = !(left > TILE - 1) ? 0 : left < width ? (int)ceil(left) / TILE : s->columns;
  return (int2)(min(start, end), end);
}

// Slots of a splat for its gradients: of a BOX also those of tiles that its ellipse does not touch,
// since to count the touched ones would be to walk the rows again.
inline int tiles_at(uint2 bounds) {
  if (bounds.x & MASKED) return popcount(bounds.y);
  return (bounds.y & 0xffff) * (bounds.y >> 16);
}

// The number of one tile among the splat's tiles, row by row: which of its slots it writes.  Of a
// mask it is the number of bits below the tile's own.
inline int rank_of_tile(uint2 bounds, int tile_x, int tile_y) {
  const int column = tile_x - BOUNDS_COLUMN(bounds), row = tile_y - BOUNDS_ROW(bounds);
  if (bounds.x & MASKED) return popcount(bounds.y & ((1u << (8 * row + column)) - 1u));
  return row * (int)(bounds.y & 0xffff) + column;
}
