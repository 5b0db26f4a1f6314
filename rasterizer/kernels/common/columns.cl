// columns: what both ways of cutting a tile into blocks of pixels share: raster_blocks.cl's for
// training, draw_batch.cl's for the screen.
// Reads:   BATCH.
// Defines: Columns; FOUR_BY_FOUR_X and FOUR_BY_FOUR_Y.
// Units:   pixels, row 0 on top.

// What of a batch the masks of blocks are made of, a column each.
typedef struct {
  float x[BATCH], y[BATCH], a[BATCH], b[BATCH], c[BATCH], half_x[BATCH], half_y[BATCH],
      power_threshold[BATCH];
} Columns;

// Pixel centres of a block, from its corner: lane k is column k % 4, row k / 4.
#define FOUR_BY_FOUR_X (float16)(0.5f, 1.5f, 2.5f, 3.5f, 0.5f, 1.5f, 2.5f, 3.5f, \
                                 0.5f, 1.5f, 2.5f, 3.5f, 0.5f, 1.5f, 2.5f, 3.5f)
#define FOUR_BY_FOUR_Y (float16)(0.5f, 0.5f, 0.5f, 0.5f, 1.5f, 1.5f, 1.5f, 1.5f, \
                                 2.5f, 2.5f, 2.5f, 2.5f, 3.5f, 3.5f, 3.5f, 3.5f)
