// Which tiles a splat touches.  A splat's place is an int4:
//   x: first column | first row << 16    y: columns | rows << 16 (0: culled)
//   z: bit mask of the touched tiles, row by row, where the box has at most 32; else all ones
//   w: how many tiles it touches
#include "common/record.cl"
#define TILE 16
#define MASKED 32

// Least r = A dx^2 + 2 B dx dy + C dy^2 over a box [x0, x1] x [y0, y1] of offsets from the mean.
inline float least_r(float A, float B, float C, float x0, float x1, float y0, float y1) {
  const float dx = clamp(0.0f, x0, x1), dy = clamp(0.0f, y0, y1);  // nearest edges
  const float y = clamp(-B / C * dx, y0, y1), x = clamp(-B / A * dy, x0, x1);
  const float on_x = A * dx * dx + 2 * B * dx * y + C * y * y;
  const float on_y = A * x * x + 2 * B * x * dy + C * dy * dy;
  // Inside in x (dx = 0): the face across y is the near one, and the other way round.
  return dx == 0 ? (dy == 0 ? 0 : on_y) : (dy == 0 ? on_x : fmin(on_x, on_y));
}

inline int4 tiles_of(const float* s, int tiles_x, int tiles_y) {
  const float x = s[MEAN_X], y = s[MEAN_Y], ex = s[EXTENT_X], ey = s[EXTENT_Y];
  // Pixel centres lie at +0.5: the first and last pixels whose centre is inside the box.
  const int left_px = (int)ceil(fmax(x - ex, 0.0f) - 0.5f);
  const int top_px = (int)ceil(fmax(y - ey, 0.0f) - 0.5f);
  const int right_px = (int)floor(fmin(x + ex, (float)(TILE * tiles_x)) - 0.5f);
  const int bottom_px = (int)floor(fmin(y + ey, (float)(TILE * tiles_y)) - 0.5f);
  const int x0 = left_px / TILE, x1 = (right_px >> 4) + 1;
  const int y0 = top_px / TILE, y1 = (bottom_px >> 4) + 1;
  const int columns = x1 - x0, rows = y1 - y0;
  if (!(ex > 0 && columns > 0 && rows > 0)) return (int4)(0);
  int count = columns * rows;
  uint mask = 0xffffffffu;
  // One row or column of tiles has no corners to cut off.
  if (columns > 1 && rows > 1 && count <= MASKED) {
    const float A = s[CONIC_A], B = s[CONIC_B], C = s[CONIC_C];
    const float cut = s[CUT] * 1.0001f;  // float rounding must not lose a pixel
    mask = 0;
    for (int row = 0; row < rows; row++)
      for (int column = 0; column < columns; column++) {
        const float left = (x0 + column) * TILE + 0.5f - x, top = (y0 + row) * TILE + 0.5f - y;
        const float r = least_r(A, B, C, left, left + TILE - 1, top, top + TILE - 1);
        if (r <= cut) mask |= 1u << (row * columns + column);
      }
    count = popcount(mask);
    if (count == 0) return (int4)(0);
  }
  return (int4)(x0 | y0 << 16, columns | rows << 16, as_int(mask), count);
}

// The splat's how-manieth tile this is: bits of the mask below the tile's own.
inline int rank_of_tile(int4 place, int tile_x, int tile_y) {
  const int columns = place.y & 0xffff, rows = place.y >> 16;
  const int bit = (tile_y - (place.x >> 16)) * columns + tile_x - (place.x & 0xffff);
  return columns * rows > MASKED ? bit : popcount(as_uint(place.z) & ((1u << bit) - 1u));
}
