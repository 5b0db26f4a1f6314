// bin: splats -> a list of instances (splat, tile) a tile, in depth order.  CPU form.
// A work-item owns a contiguous chunk of splats, counts into a table of its own, and scatters from
// its row of the scanned table: parallel, stable, and the same list for any number of chunks.
#include "common/tiles.cl"
#define LOW_BITS 12
#define LOW_BINS (1 << LOW_BITS)

// Per splat its tiles; per chunk the (depth key, index) pairs of its visible splats, packed at the
// chunk's start, and the histogram of their low digits.  status: visible, instances, key range.
__kernel void find_places(int count, int chunk, int tiles_x, int tiles_y,
                          __global const float* record, __global const float* depth,
                          __global int4* places, __global uint* keys, __global int* splats,
                          __global int* histogram, __global uint4* status) {
  const int c = get_global_id(0);
  const int first = c * chunk, last = min(count, first + chunk);
  __global int* bins = histogram + c * LOW_BINS;
  for (int b = 0; b < LOW_BINS; b++) bins[b] = 0;
  int visible = first;
  uint instances = 0, least = 0xffffffffu, most = 0;
  for (int i = first; i < last; i++) {
    __global const float* s = record + (size_t)RECORD * i;
    int4 place = 0;
    if (s[EXTENT_X] > 0) {
      float copy[RECORD];
      vstore8(vload8(0, s), 0, copy);
      vstore4(vload4(0, s + 8), 0, copy + 8);
      place = tiles_of(copy, tiles_x, tiles_y);
    }
    places[i] = place;
    if (place.w > 0) {
      const uint key = as_uint(depth[i]);  // positive floats sort as their bits
      keys[visible] = key;
      splats[visible++] = i;
      bins[key & (LOW_BINS - 1)]++;
      instances += place.w;
      least = min(least, key);
      most = max(most, key);
    }
  }
  status[c] = (uint4)(visible - first, instances, least, most);
}

// Counts (chunks, bins) -> places to write to, bin by bin and in it chunk by chunk.
__kernel void scan_table(int bins, int chunks, __global int* table, __global int* starts) {
  int sum = 0;
  for (int b = 0; b < bins; b++) {
    starts[b] = sum;
    for (int c = 0; c < chunks; c++) {
      const int n = table[c * bins + b];
      table[c * bins + b] = sum;
      sum += n;
    }
  }
  starts[bins] = sum;
}

__kernel void count_digits(int count, int chunk, int bins, uint origin, int shift,
                           __global const uint* keys, __global int* table) {
  const int c = get_global_id(0);
  __global int* mine = table + c * bins;
  for (int b = 0; b < bins; b++) mine[b] = 0;
  const int last = min(count, (c + 1) * chunk);
  for (int i = c * chunk; i < last; i++) mine[((keys[i] - origin) >> shift) % (uint)bins]++;
}

// One pass of a stable counting sort.  status: how many of each chunk count, or null for all.
__kernel void scatter_digits(int count, int chunk, int bins, uint origin, int shift, int packed,
                             __global const uint4* status, __global const uint* keys,
                             __global const int* splats, __global int* table,
                             __global uint* sorted_keys, __global int* sorted_splats) {
  const int c = get_global_id(0);
  __global int* next = table + c * bins;
  const int first = c * chunk;
  const int last = packed ? first + (int)status[c].x : min(count, first + chunk);
  for (int i = first; i < last; i++) {
    const uint key = keys[i];
    const int to = next[((key - origin) >> shift) % (uint)bins]++;
    sorted_keys[to] = key;
    sorted_splats[to] = splats[i];
  }
}

__kernel void count_tiles(int count, int chunk, int tiles_x, int tiles,
                          __global const int* order, __global const int4* places,
                          __global int* table) {
  const int c = get_global_id(0);
  __global int* mine = table + c * tiles;
  for (int t = 0; t < tiles; t++) mine[t] = 0;
  const int last = min(count, (c + 1) * chunk);
  for (int i = c * chunk; i < last; i++) {
    const int4 place = places[order[i]];
    const int columns = place.y & 0xffff, rows = place.y >> 16;
    const int tile = (place.x >> 16) * tiles_x + (place.x & 0xffff);
    if (place.w == columns * rows) {
      for (int y = 0; y < rows; y++)
        for (int x = 0; x < columns; x++) mine[tile + y * tiles_x + x]++;
    } else {
      int bit = 0;
      for (int y = 0; y < rows; y++)
        for (int x = 0; x < columns; x++, bit++) mine[tile + y * tiles_x + x] += place.z >> bit & 1;
    }
  }
}

__kernel void scatter_tiles(int count, int chunk, int tiles_x, int tiles,
                            __global const int* order, __global const int4* places,
                            __global int* table, __global int* instances) {
  const int c = get_global_id(0);
  __global int* next = table + c * tiles;
  const int last = min(count, (c + 1) * chunk);
  for (int i = c * chunk; i < last; i++) {
    const int splat = order[i];
    const int4 place = places[splat];
    const int columns = place.y & 0xffff, rows = place.y >> 16;
    const int tile = (place.x >> 16) * tiles_x + (place.x & 0xffff);
    if (place.w == columns * rows) {
      for (int y = 0; y < rows; y++)
        for (int x = 0; x < columns; x++) instances[next[tile + y * tiles_x + x]++] = splat;
    } else {
      int bit = 0;
      for (int y = 0; y < rows; y++)
        for (int x = 0; x < columns; x++, bit++)
          if (place.z >> bit & 1) instances[next[tile + y * tiles_x + x]++] = splat;
    }
  }
}

// First slot of every splat: gradients of its instances lie side by side from there.
__kernel void number_slots(int count, __global const int4* places, __global int* first_slot) {
  int sum = 0;
  for (int i = 0; i < count; i++) {
    first_slot[i] = sum;
    sum += places[i].w;
  }
}
