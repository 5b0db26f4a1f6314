// evidence, CPU form: how much each splat shows of each label of a picture, in tiles, blocks and
// batches as raster_cpu.cl draws: the very alpha T that it blends (OWD, section 3.3).
//   E[splat, label] = sum of alpha T over the pixels of that label
// One work-item a tile.  Sums are whole numbers of 1 / steps pixels, since integers add up to the
// same in any order of tiles; a tile's share is rounded once.
// Reads:   tile_start (tiles + 1), intersections, record (N, 12), labels (H, W): SILENT and what is
//          not below `columns` says nothing; first: of the labels of each tile, counted from its
//          least, this pass sums LABELS from there on; EACH: splats a row of the table, in a row.
// Writes:  table (rows, columns), added to.
// Units:   pixels, row 0 on top; table in 1 / steps pixels.
#include "common/vector.cl"
#include "common/raster.cl"
#include "common/raster_blocks.cl"
#define SILENT 255
#define LABELS 16    // of a tile that a pass sums
#define NO LABELS    // the column of pixels that have none of them: summed, never written
#define SEVERAL -1   // labels, in a block or in the tile

// alpha T of a splat in a block, and what it leaves of T: as in rasterize of raster_cpu.cl, which
// says why.
#define WEIGH(k)                                                               \
  POWER_IN(k)                                                                  \
  float8 alpha = fmin(s[OPACITY] * exp2p(power), MAX_ALPHA);                   \
  const float8 weight = select((float8)(0), alpha, power >= least) * T[k];     \
  T[k] -= weight;

__kernel void evidence(int width, int height, int tiles_x, __global const int* tile_start,
                       __global const int* intersections, __global const float* record,
                       __global const uchar* labels, int first, int columns, float steps,
                       __global uint* table) {
  const int tile = get_global_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
  const int w = min(TILE, width - x0), h = min(TILE, height - y0);
  // Which labels the tile has, and of this pass's ones (at most 16, mostly one to three) the place
  // in `sums` of each: what has to be cleared and written for every splat stays short.
  uchar place[256];
  for (int l = 0; l < 256; l++) place[l] = 0;
  for (int y = 0; y < h; y++)
    for (int x = 0; x < w; x++) place[labels[(size_t)(y0 + y) * width + x0 + x]] = 1;
  int label_of[LABELS], present = 0;
  for (int l = 0, number = 0; l < 256; l++) {
    const bool there = place[l] && l < columns && l != SILENT;
    const bool mine = there && number >= first && number < first + LABELS;
    place[l] = mine ? present : NO;
    if (mine) label_of[present++] = l;
    number += there;
  }
  if (!present) return;
  // Transmittance of all 256 pixels, and the place of each pixel's label.
  float8 T[BLOCKS], block_x[BLOCKS], block_y[BLOCKS];
  int8 of[BLOCKS];
  int same[BLOCKS];  // the place that all pixels of a block have, or SEVERAL
  int whole = NO;    // the same of the tile
  for (int k = 0; k < BLOCKS; k++) {
    BLOCK_CENTRES(k)
    T[k] = inside(k, x0, y0, width, height);
    int lanes[LANES];
    for (int lane = 0; lane < LANES; lane++) {
      // Pixels outside the image have no T; they count as their neighbours on the border.
      const int x = min(k / DOWN * BLOCK_W + lane % BLOCK_W, w - 1);
      const int y = min(k % DOWN * BLOCK_H + lane / BLOCK_W, h - 1);
      const int at = place[labels[(size_t)(y0 + y) * width + x0 + x]];
      lanes[lane] = at;
      same[k] = lane == 0 || same[k] == at ? at : SEVERAL;
    }
    of[k] = vload8(0, lanes);
    whole = k == 0 || whole == same[k] ? same[k] : SEVERAL;
  }
  OPEN_TILE
  while (p < end && open) {
    const int n = fetch(p, end, x0, y0, intersections, record, &batch);
    // Rows lie anywhere in the table: ahead of use, so that their misses overlap.
    for (int j = 0; j < n; j++)
      PREFETCH(table + (size_t)columns * (intersections[p + j] / EACH));
    for (int j = 0; j < n; j++) {
      const float* s = batch.splats + RECORD * j;
      const float mx = s[MEAN_X] - x0, my = s[MEAN_Y] - y0;
      EXPONENTS(s[CONIC_A], s[CONIC_B], s[CONIC_C])
      uint left = open & batch.blocks[j];
      if (!left) continue;
      // Tiles meet in rows of the table: atomics, of integers, which any order leaves equal.
      __global uint* row = table + (size_t)columns * (intersections[p + j] / EACH);
      if (whole != SEVERAL) {  // one label: nothing is told apart
        float8 all = 0;
        for (; left; left &= left - 1) {
          const int k = lowest(left);
          WEIGH(k)
          all += weight;
        }
        const uint amount = (uint)rint(sum8(all) * steps);
        if (amount) atomic_add(row + label_of[0], amount);
        continue;
      }
      float8 sums[LABELS + 1];
      for (int m = 0; m < present; m++) sums[m] = 0;
      for (; left; left &= left - 1) {
        const int k = lowest(left);
        WEIGH(k)
        if (same[k] != SEVERAL)
          sums[same[k]] += weight;
        else  // as many masks as the tile has labels: few, and quicker than lane by lane
          for (int m = 0; m < present; m++)
            sums[m] += select((float8)(0), weight, of[k] == m);
      }
      for (int m = 0; m < present; m++) {
        const uint amount = (uint)rint(sum8(sums[m]) * steps);
        if (amount) atomic_add(row + label_of[m], amount);
      }
    }
    p += n;
    open = still_open(open, T);
  }
}
