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

inline int instances_at(__global const float* record, uint2 place) {
  if (!(place.x & BOX)) return tiles_at(place);
  const Slant slant = slant_of(record, place);
  int sum = 0;
  for (int row = 0; row < (int)(place.y >> 16); row++) {
    const int2 span = span_of_row(&slant, row);
    sum += span.y - span.x;
  }
  return sum;
}

// In depth order: how many instances and slots each splat has, and how many splats are visible.
__kernel void count_instances(int count, __global const uint* keys, __global const int* order,
                              __global const float* record, __global const uint2* places,
                              __global int* instances_of, __global int* slots_of,
                              __global int* visible) {
  const int k = get_global_id(0);
  if (k > count) return;
  const bool here = k < count && keys[k] != ABSENT;
  // entry `count` becomes the total
  instances_of[k] = here ? instances_at(record + (size_t)RECORD * order[k], places[order[k]]) : 0;
  slots_of[k] = here ? tiles_at(places[order[k]]) : 0;
  if (!here && (k == 0 || keys[k - 1] != ABSENT)) visible[0] = k;
}

__kernel void write_instances(int count, int tiles_x, __global const int* order,
                              __global const float* record, __global const uint2* places,
                              __global const int* offsets, __global const int* slots,
                              __global uint* tile_of, __global int* instances,
                              __global int* first_slot) {
  const int k = get_global_id(0);
  if (k >= count) return;
  const int splat = order[k];
  const uint2 place = places[splat];
  int to = offsets[k];
  first_slot[splat] = slots[k];
  const int tile = PLACE_ROW(place) * tiles_x + PLACE_COLUMN(place);
  if (place.x & MASKED) {
    for (uint mask = place.y; mask; mask &= mask - 1) {
      const int bit = popcount(~mask & (mask - 1));  // number of the lowest
      tile_of[to] = tile + (bit >> 3) * tiles_x + (bit & 7);
      instances[to++] = splat;
    }
    return;
  }
  const Slant slant = slant_of(record + (size_t)RECORD * splat, place);
  for (int row = 0; row < (int)(place.y >> 16); row++) {
    const int2 span = span_of_row(&slant, row);
    for (int column = span.x; column < span.y; column++) {
      tile_of[to] = tile + row * tiles_x + column;
      instances[to++] = splat;
    }
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
