// pages: where rows that are drawn lie in the arena. With PAGED = 1 a page of PAGE rows lies
// anywhere, and may be drawn for several objects; without it every row is its own.
// Reads:   sources (pages,): the arena's page of each that is drawn, -1: nothing is drawn there.
// Defines: row_of.
// Units:   rows.
#ifndef PAGED
#define PAGED 0
#define PAGE 32
#endif

// The row of the arena that row i of those drawn is; negative: none.
inline long row_of(int i, __global const int* sources) {
#if PAGED
  return (long)PAGE * sources[i / PAGE] + i % PAGE;
#else
  return i;
#endif
}
