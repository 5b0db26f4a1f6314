// Which tiles of 16x16 pixels a splat touches: its place, a uint2.
//   x: first column | first row << 12 | kind (0 culled, MASKED, BOX)
//   y: MASKED: bit 8 row + column for each touched tile of a grid of 8 x 4
//      BOX: columns | rows << 16, all of a box larger than that grid
#include "common/record.cl"
#define TILE 16
#define MASKED (1u << 24)
#define BOX (2u << 24)
#define PLACE_COLUMN(place) ((int)((place).x & 0xfff))
#define PLACE_ROW(place) ((int)((place).x >> 12 & 0xfff))

// Least r = A dx^2 + 2 B dx dy + C dy^2 over a box [x0, x1] x [y0, y1] of offsets from the mean.
inline float least_r(float A, float B, float C, float x0, float x1, float y0, float y1) {
  const float dx = clamp(0.0f, x0, x1), dy = clamp(0.0f, y0, y1);  // nearest edges
  const float y = clamp(-B / C * dx, y0, y1), x = clamp(-B / A * dy, x0, x1);
  const float on_x = A * dx * dx + 2 * B * dx * y + C * y * y;
  const float on_y = A * x * x + 2 * B * x * dy + C * dy * dy;
  // Inside in x (dx = 0): the face across y is the near one, and the other way round.
  return dx == 0 ? (dy == 0 ? 0 : on_y) : (dy == 0 ? on_x : fmin(on_x, on_y));
}

inline uint2 place_of(const float* s, int tiles_x, int tiles_y) {
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
  const float cut = s[CUT] * 1.0001f;  // float rounding must not lose a pixel
  uint mask = 0;
  for (int row = 0; row < rows; row++)
    for (int column = 0; column < columns; column++) {
      const float left = (x0 + column) * TILE + 0.5f - x, top = (y0 + row) * TILE + 0.5f - y;
      const float r = least_r(s[CONIC_A], s[CONIC_B], s[CONIC_C], left, left + TILE - 1, top,
                              top + TILE - 1);
      if (r <= cut) mask |= 1u << (8 * row + column);
    }
  return mask ? (uint2)(corner | MASKED, mask) : (uint2)(0);
}

inline int tiles_at(uint2 place) {
  if (place.x & MASKED) return popcount(place.y);
  return (place.y & 0xffff) * (place.y >> 16);
}

// The how-manieth of the splat's tiles this one is, row by row.
inline int rank_of_tile(uint2 place, int tile_x, int tile_y) {
  const int column = tile_x - PLACE_COLUMN(place), row = tile_y - PLACE_ROW(place);
  if (place.x & MASKED) return popcount(place.y & ((1u << (8 * row + column)) - 1u));
  return row * (int)(place.y & 0xffff) + column;
}
