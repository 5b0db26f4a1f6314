// Which tiles of 16x16 pixels a splat touches: its bounds, a uint2.
//   x: first column | first row << 12 | kind (0 culled, MASKED, BOX)
//   y: MASKED: bit 8 row + column for each touched tile of a grid of 8 x 4
//      BOX: columns | rows << 16 of a box larger than that grid; span_of_row says which of them
#include "common/record.cl"
#define TILE 16
#define MASKED (1u << 24)
#define BOX (2u << 24)
#define BOUNDS_COLUMN(bounds) ((int)((bounds).x & 0xfff))
#define BOUNDS_ROW(bounds) ((int)((bounds).x >> 12 & 0xfff))

inline uint2 tile_bounds_of(const float* s, int tiles_x, int tiles_y) {
  const float x = s[MEAN_X], y = s[MEAN_Y], ex = s[EXTENT_X], ey = s[EXTENT_Y];
  if (!(ex > 0)) return (uint2)(0);
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
  // The interval of each row of tiles, as in tile_bounds_of_eight.cl.
  const float per_a = 1.0f / s[CONIC_A], tilt = -s[CONIC_B] * per_a;
  const float lean = -s[CONIC_B] / s[CONIC_C] * ex;
  const float per_yy = s[POWER_THRESHOLD] / fmax(ey * ey, FLT_MIN), most = 1.0001f * s[POWER_THRESHOLD];
  const float left = x0 * TILE + 0.5f - x;
  uint mask = 0;
  for (int row = 0; row < rows; row++) {
    const float top = (y0 + row) * TILE + 0.5f - y, bottom = top + (TILE - 1);
    const float up = clamp(lean, top, bottom), down = clamp(-lean, top, bottom);
    const float right_x = tilt * up + sqrt(fmax(most - up * up * per_yy, 0.0f) * per_a) - left;
    const float left_x = tilt * down - sqrt(fmax(most - down * down * per_yy, 0.0f) * per_a) - left;
    const int after = (int)floor(right_x * (1.0f / TILE)) + 1;
    const int first = (int)ceil((left_x - (TILE - 1)) * (1.0f / TILE));
    const int end = clamp(after, 0, columns), start = min(max(first, 0), end);
    mask |= ((1u << end) - (1u << start)) << (8 * row);
  }
  return mask ? (uint2)(corner | MASKED, mask) : (uint2)(0);
}

// What the rows of a BOX are found by: as above, with room for what float rounding does to a pixel's
// own test, which is much for long thin splats.  Lists are counted and written by two kernels, which
// have to agree: whatever a compiler might fuse in one and not in the other is an fma already.
typedef struct {
  float tilt, per_a, lean, per_yy, most, left, top, spare;
  int columns;
} Slant;

inline Slant slant_of(__global const float* s, uint2 bounds) {
  const float x = s[MEAN_X], y = s[MEAN_Y], ex = s[EXTENT_X], ey = s[EXTENT_Y];
  const float a = s[CONIC_A], c = s[CONIC_C];
  Slant slant;
  slant.per_a = 1.0f / a;
  slant.tilt = -s[CONIC_B] * slant.per_a;
  slant.lean = -s[CONIC_B] / c * ex;
  slant.per_yy = s[POWER_THRESHOLD] / fmax(ey * ey, FLT_MIN);
  slant.most = fma(1.0001f, s[POWER_THRESHOLD], 5e-7f * fma(a * ex, ex, c * ey * ey));
  slant.spare = 1e-6f * fma(fabs(slant.tilt), ey + fabs(y), ex + fabs(x));
  slant.left = (float)(BOUNDS_COLUMN(bounds) * TILE) + 0.5f - x;
  slant.top = (float)(BOUNDS_ROW(bounds) * TILE) + 0.5f - y;
  slant.columns = bounds.y & 0xffff;
  return slant;
}

// The columns of the box, from x to before y, that the ellipse touches in one of its rows of tiles.
inline int2 span_of_row(const Slant* s, int row) {
  const float top = s->top + (float)(row * TILE), bottom = top + (TILE - 1);
  const float up = clamp(s->lean, top, bottom), down = clamp(-s->lean, top, bottom);
  const float half_up = sqrt(fmax(fma(-up * up, s->per_yy, s->most), 0.0f) * s->per_a);
  const float half_down = sqrt(fmax(fma(-down * down, s->per_yy, s->most), 0.0f) * s->per_a);
  const float right = fma(s->tilt, up, half_up) - s->left + s->spare;
  const float left = fma(s->tilt, down, -half_down) - s->left - s->spare;
  const float width = (float)(s->columns * TILE);
  // What is not a number leaves nothing out.
  const int end = !(right < width) ? s->columns : right >= 0 ? (int)right / TILE + 1 : 0;
  const int start = !(left > TILE - 1) ? 0 : left < width ? (int)ceil(left) / TILE : s->columns;
  return (int2)(min(start, end), end);
}

// Slots of a splat: of a BOX also those of tiles that its ellipse does not touch.
inline int tiles_at(uint2 bounds) {
  if (bounds.x & MASKED) return popcount(bounds.y);
  return (bounds.y & 0xffff) * (bounds.y >> 16);
}

// The how-manieth of the splat's tiles this one is, row by row.
inline int rank_of_tile(uint2 bounds, int tile_x, int tile_y) {
  const int column = tile_x - BOUNDS_COLUMN(bounds), row = tile_y - BOUNDS_ROW(bounds);
  if (bounds.x & MASKED) return popcount(bounds.y & ((1u << (8 * row + column)) - 1u));
  return row * (int)(bounds.y & 0xffff) + column;
}
