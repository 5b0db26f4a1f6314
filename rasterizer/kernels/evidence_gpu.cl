// evidence, GPU form: one work-group a tile of 16x16 pixels, an item a pixel, as raster_gpu.cl
// draws; what is summed, and for which labels, is as in evidence_cpu.cl.
// Reads:   as evidence_cpu.cl.
// Writes:  table (rows, columns), added to.
// Units:   pixels, row 0 on top; table in 1 / steps pixels; local sums in 1 / FINE pixels.
#include "common/raster_pixels.cl"
#define BATCH 64  // splats in local memory: 7 kB with their sums
#define SILENT 255
#define LABELS 16  // of a tile that a pass sums
#define NONE -1
// Items add in any order, so local sums are integers, too; 256 pixels of 2^20 stay below 2^29.
#define FINE 1048576.0f

__kernel __attribute__((reqd_work_group_size(PIXELS, 1, 1))) void evidence(
    int width, int height, int tiles_x, __global const int* tile_start,
    __global const int* intersections, __global const float* record,
    __global const uchar* labels, int first, int columns, float steps,
    __global uint* table) {
  __local float batch[BATCH * RECORD];
  __local int row_of[BATCH];
  __local uint sums[BATCH * LABELS];
  // Which labels the tile has, one an item: there are as many labels as pixels in a tile.
  __local uchar there[PIXELS];
  __local int label_of[LABELS], present, open;
  PIXEL_OF_ITEM
  const int label = inside ? labels[(size_t)py * width + px] : SILENT;
  const bool says = label < columns && label != SILENT;
  there[l] = 0;
  if (l == 0) present = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (says) there[label] = 1;  // every writer writes the same
  barrier(CLK_LOCAL_MEM_FENCE);
  // The label's number in the tile, from its least on; this pass has those from `first` on.
  int place = NONE;
  if (says) {
    int number = 0;
    for (int k = 0; k < label; k++) number += there[k];
    if (number >= first && number < first + LABELS) {
      place = number - first;
      label_of[place] = label;
      atomic_max(&present, place + 1);
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (!present) return;  // all items alike: nothing here is of this pass
  float T = inside ? 1 : 0;
  int p = tile_start[tile];
  const int end = tile_start[tile + 1];
  while (p < end) {
    END_WHERE_ALL_ARE_DONE
    const int n = min(BATCH, end - p);
    for (int k = l; k < n * RECORD; k += PIXELS)
      batch[k] = record[(size_t)RECORD * intersections[p + k / RECORD] + k % RECORD];
    if (l < n) row_of[l] = intersections[p + l] / EACH;
    for (int k = l; k < n * present; k += PIXELS) sums[k] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    // Near to far: the weight alpha T of each splat, as rasterize of raster_gpu.cl blends it.
    for (int j = 0; j < n && T >= STOP; j++) {
      __local const float* s = batch + j * RECORD;
      WEIGHT_OF(s, weight)
      T -= weight;
      if (place != NONE) atomic_add(sums + j * present + place, (uint)rint(weight * FINE));
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    // A tile's share is rounded once, and added once for each splat and label.
    for (int k = l; k < n * present; k += PIXELS) {
      const uint amount = (uint)rint(sums[k] * (steps / FINE));
      if (amount)
        atomic_add(table + (size_t)columns * row_of[k / present] + label_of[k % present], amount);
    }
    p += n;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}
