// box: the pixels that a splat may reach, for passes without tiles.
// Reads:   RECORD (common/record.cl); of the kernel `width` and `height`.
// Defines: BOX_OF.
// Units:   pixels, row 0 on top.
#include "common/record.cl"

// Pixels whose centres lie in the box of record r, x0 to x1 - 1 and y0 to y1 - 1; returns from the
// kernel where it is culled.  Clamped as floats, because a box may be as wide as any.
#define BOX_OF(r)                                                                              \
  if (!(r[EXTENT_X] > 0.0f && r[EXTENT_Y] > 0.0f)) return;                                     \
  const int x0 = (int)clamp(ceil(r[MEAN_X] - r[EXTENT_X] - 0.5f), 0.0f, (float)width);         \
  const int x1 = (int)clamp(floor(r[MEAN_X] + r[EXTENT_X] - 0.5f) + 1.0f, 0.0f, (float)width); \
  const int y0 = (int)clamp(ceil(r[MEAN_Y] - r[EXTENT_Y] - 0.5f), 0.0f, (float)height);        \
  const int y1 = (int)clamp(floor(r[MEAN_Y] + r[EXTENT_Y] - 0.5f) + 1.0f, 0.0f, (float)height);
