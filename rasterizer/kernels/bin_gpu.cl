// bin, GPU form: one work-item a splat; the sorts lie in sort_gpu.cl.
// Depths are sorted, instances written in that order, then sorted by tile: stable, so each tile's
// list is near to far.
#include "common/tiles.cl"
#define ABSENT 0xffffffffu

__kernel void find_places(int count, int tiles_x, int tiles_y, __global const float* record,
                          __global const float* depth, __global uint2* places,
                          __global uint* keys, __global int* splats) {
  const int i = get_global_id(0);
  if (i >= count) return;
  float copy[RECORD];
  for (int k = 0; k < RECORD; k++) copy[k] = record[(size_t)RECORD * i + k];
  const uint2 place = place_of(copy, tiles_x, tiles_y);
  places[i] = place;
  keys[i] = place.x >= MASKED ? as_uint(depth[i]) : ABSENT;  // positive floats sort as their bits
  splats[i] = i;
}

// In depth order: how many instances each splat has, and how many splats are visible.
__kernel void count_instances(int count, __global const uint* keys, __global const int* order,
                              __global const uint2* places, __global int* instances_of,
                              __global int* visible) {
  const int k = get_global_id(0);
  if (k > count) return;
  const bool here = k < count && keys[k] != ABSENT;
  instances_of[k] = here ? tiles_at(places[order[k]]) : 0;  // entry `count` becomes the total
  if (!here && (k == 0 || keys[k - 1] != ABSENT)) visible[0] = k;
}

__kernel void write_instances(int count, int tiles_x, __global const int* order,
                              __global const uint2* places, __global const int* offsets,
                              __global uint* tile_of, __global int* instances,
                              __global int* first_slot) {
  const int k = get_global_id(0);
  if (k >= count) return;
  const int splat = order[k];
  const uint2 place = places[splat];
  int to = offsets[k];
  first_slot[splat] = to;
  const int tile = PLACE_ROW(place) * tiles_x + PLACE_COLUMN(place);
  const bool masked = place.x & MASKED;
  const int rows = masked ? 4 : place.y >> 16, columns = masked ? 8 : place.y & 0xffff;
  for (int row = 0; row < rows; row++)
    for (int column = 0; column < columns; column++) {
      if (masked && !(place.y >> (8 * row + column) & 1)) continue;
      tile_of[to] = tile + row * tiles_x + column;
      instances[to++] = splat;
    }
}

// starts[t]: the first instance of tile t; of an empty tile, where it would be.
__kernel void find_starts(int total, int tiles, __global const uint* tile_of,
                          __global int* starts) {
  const int i = get_global_id(0);
  if (i > total) return;
  const int before = i > 0 ? (int)tile_of[i - 1] : -1;
  const int here = i < total ? (int)tile_of[i] : tiles;
  for (int t = before + 1; t <= here; t++) starts[t] = i;
}
