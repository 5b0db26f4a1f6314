// raster_pixels: how a work-group walks over its tile, an item a pixel: raster_gpu.cl draws so, and
// evidence_gpu.cl sums what it would draw, by the same operations.
// Reads:   STOP (common/raster.cl), RECORD (common/record.cl); of the kernel `tiles_x`, `width` and
//          `height`, T of the pixel, `open` of the group.
// Defines: PIXELS; PIXEL_OF_ITEM, END_WHERE_ALL_ARE_DONE, WEIGHT_OF.
// Units:   pixels, row 0 on top; transmittance 0..1.
#include "common/raster.cl"
#define PIXELS (TILE * TILE)

// The group's tile, the item's number, its pixel and that pixel's centre.
#define PIXEL_OF_ITEM                                                                     \
  const int tile = get_group_id(0), l = get_local_id(0);                                  \
  const int px = tile % tiles_x * TILE + l % TILE, py = tile / tiles_x * TILE + l / TILE; \
  const float x = px + 0.5f, y = py + 0.5f;                                               \
  const bool inside = px < width && py < height;

// The group goes on as long as one of its pixels does (3DGS counts them in the same way).
// A barrier before and after: nobody reads `open` while it is being reset or set.
#define END_WHERE_ALL_ARE_DONE                                 \
  if (l == 0) open = 0;                                        \
  barrier(CLK_LOCAL_MEM_FENCE);                                \
  if (T >= STOP) open = 1; /* every writer writes the same */  \
  barrier(CLK_LOCAL_MEM_FENCE);                                \
  if (!open) break;

// Of splat s in the pixel: d from the mean, power = d^T Q d with the conic Q, and the weight
// alpha T, with alpha = min(0.99, o exp(-power / 2)).  On to the next splat where alpha is below
// min alpha, found without its exponential; NaN is skipped, too.
#define WEIGHT_OF(s, weight)                                                               \
  const float dx = x - s[MEAN_X], dy = y - s[MEAN_Y];                                      \
  const float q = s[CONIC_A] * dx * dx + 2 * s[CONIC_B] * dx * dy + s[CONIC_C] * dy * dy;  \
  if (!(q <= s[POWER_THRESHOLD])) continue;                                                \
  const float weight = fmin(MAX_ALPHA, s[OPACITY] * exp(-0.5f * q)) * T;
