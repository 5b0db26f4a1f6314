// bin, GPU form: splats -> the lists of intersections; one work-item a splat, sorts in sort_gpu.cl.
// Depths are sorted, intersections written in that order, then sorted by tile: stable, so each
// tile's list is near to far, and the same as that of bin.cl.
// Reads:   record (N, 12) and depth (N,) of project; or of project_arena record, tile_bounds,
//          status and pairs, whose order several views may share.
// Writes:  tile_bounds (N, 2), keys and order, tile_of and intersections, starts (tiles + 1),
//          first_slot.
// Units:   pixels and tiles; depths in metres, sorted as the bits of floats above 0.
#include "common/tiles.cl"
#define ABSENT 0xffffffffu  // sorts behind every depth, so that culled splats come last

__kernel void find_tile_bounds(int count, int tiles_x, int tiles_y, __global const float* record,
                          __global const float* depth, __global uint2* tile_bounds,
                          __global uint* keys, __global int* splats) {
  const int i = get_global_id(0);
  if (i >= count) return;
  // A private copy: tile_bounds_of() is shared with kernels that read records from elsewhere.
  float copy[RECORD];
  for (int k = 0; k < RECORD; k++) copy[k] = record[(size_t)RECORD * i + k];
  const uint2 bounds = tile_bounds_of(copy, tiles_x, tiles_y);
  tile_bounds[i] = bounds;
  keys[i] = bounds.x >= MASKED ? as_uint(depth[i]) : ABSENT;  // positive floats sort as their bits
  splats[i] = i;
}

// Pairs of splat and key that every chunk has packed at its start -> keys and splats of all places,
// `absent` in the empty ones.  status: x: how many pairs a chunk has.
__kernel void unpack_pairs(int count, int chunk, uint absent, __global const uint4* status,
                           __global const uint2* pairs, __global uint* keys,
                           __global int* splats) {
  const int i = get_global_id(0);
  if (i >= count) return;
  const bool here = i % chunk < (int)status[i / chunk].x;
  keys[i] = here ? pairs[i].y : absent;
  splats[i] = here ? (int)pairs[i].x : 0;
}

// The number of list entries of a splat; of a box the rows are walked to count, and again to write.
inline int intersections_at(__global const float* record, uint2 bounds) {
  if (!(bounds.x & BOX)) return tiles_at(bounds);
  // A box: fused multiply-adds in columns_of_row() make both walks agree to the last tile.
  const EllipseRows ellipse = ellipse_rows_of(record, bounds);
  int sum = 0;
  for (int row = 0; row < (int)(bounds.y >> 16); row++) {
    const int2 span = columns_of_row(&ellipse, row);
    sum += span.y - span.x;
  }
  return sum;
}

// In depth order: how many intersections and slots each splat has, and how many splats are visible.
__kernel void count_intersections(int count, __global const uint* keys, __global const int* order,
                              __global const float* record, __global const uint2* tile_bounds,
                              __global int* intersections_of, __global int* slots_of,
                              __global int* visible) {
  const int k = get_global_id(0);
  if (k > count) return;
  const bool here = k < count && keys[k] != ABSENT;
  // entry `count` becomes the total
  intersections_of[k] =
      here ? intersections_at(record + (size_t)RECORD * order[k], tile_bounds[order[k]]) : 0;
  slots_of[k] = here ? tiles_at(tile_bounds[order[k]]) : 0;
  // Where the first culled splat stands in the order, there end the visible ones.
  if (!here && (k == 0 || keys[k - 1] != ABSENT)) visible[0] = k;
}

// The same of an order from elsewhere: of splats that this view does not show, none.
__kernel void count_ordered(int count, __global const int* order, __global const float* record,
                            __global const uint2* tile_bounds, __global int* intersections_of) {
  const int k = get_global_id(0);
  if (k > count) return;
  const bool here = k < count && tile_bounds[order[k]].x >= MASKED;
  // entry `count` becomes the total
  intersections_of[k] =
      here ? intersections_at(record + (size_t)RECORD * order[k], tile_bounds[order[k]]) : 0;
}

// Number `tiles` stands for all tiles that are hidden: their entries are sorted behind every list.
inline uint list_of(int tile, int tiles, __global const uchar* hidden) {
  return hidden && hidden[tile] ? tiles : tile;
}

// Prefix sums of the counts said where each splat's entries go (offsets) and its slots (slots).
__kernel void write_intersections(int count, int tiles_x, int tiles, __global const uchar* hidden,
                                  __global const int* order, __global const float* record,
                                  __global const uint2* tile_bounds, __global const int* offsets,
                                  __global const int* slots, __global uint* tile_of,
                                  __global int* intersections, __global int* first_slot) {
  const int k = get_global_id(0);
  if (k >= count) return;
  const int splat = order[k];
  const uint2 bounds = tile_bounds[splat];
  // Number k in depth order: its entries follow those of all nearer splats.
  int to = offsets[k];
  if (first_slot) first_slot[splat] = slots[k];
  if (!(bounds.x >= MASKED)) return;
  const int tile = BOUNDS_ROW(bounds) * tiles_x + BOUNDS_COLUMN(bounds);
  if (bounds.x & MASKED) {
    // The tile mask: mask & (mask - 1) clears the lowest bit, the ones below it are its number.
    for (uint mask = bounds.y; mask; mask &= mask - 1) {
      const int bit = popcount(~mask & (mask - 1));  // number of the lowest
      tile_of[to] = list_of(tile + (bit >> 3) * tiles_x + (bit & 7), tiles, hidden);
      intersections[to++] = splat;
    }
    return;
  }
  // The box: row by row of tiles, the interval of columns in each.
  const EllipseRows ellipse = ellipse_rows_of(record + (size_t)RECORD * splat, bounds);
  for (int row = 0; row < (int)(bounds.y >> 16); row++) {
    const int2 span = columns_of_row(&ellipse, row);
    for (int column = span.x; column < span.y; column++) {
      tile_of[to] = list_of(tile + row * tiles_x + column, tiles, hidden);
      intersections[to++] = splat;
    }
  }
}

// starts[t]: the first intersection of tile t; of an empty tile, where it would be.
__kernel void find_starts(int total, int tiles, __global const uint* tile_of,
                          __global int* starts) {
  const int i = get_global_id(0);
  if (i > total) return;
  const int before = i > 0 ? (int)tile_of[i - 1] : -1;
  const int here = i < total ? (int)tile_of[i] : tiles;
  // Tiles without intersections between two that have some begin where the latter does.
  for (int t = before + 1; t <= here; t++) starts[t] = i;
}
