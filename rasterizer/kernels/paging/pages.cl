// pages: runs of rows to their places in the arena and back, whatever an array's width.
// Reads:   pages (n,): which page of the array each run of `words` 32-bit words belongs to; given.
// Writes:  the array, or `out` (n, words).
// Units:   none: bits are copied.

// A work-item a word.
__kernel void scatter_pages(int count, int words, __global const int* pages,
                            __global const uint* given, __global uint* array) {
  const int i = get_global_id(0);
  if (i < count) array[(size_t)words * pages[i / words] + i % words] = given[i];
}

__kernel void gather_pages(int count, int words, __global const int* pages,
                           __global const uint* array, __global uint* out) {
  const int i = get_global_id(0);
  if (i < count) out[i] = array[(size_t)words * pages[i / words] + i % words];
}
