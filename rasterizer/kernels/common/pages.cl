// pages: where rows that are drawn lie in the arena. With PAGED = 1 a page of PAGE rows lies
// anywhere, and may be drawn for several objects; without it every row is its own.
// Reads:   sources (pages,): the arena's page of each that is drawn, -1: nothing is drawn there.
// Defines: row_of, weighed.
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

// Opacities with a part of their optical depth: those of two parts that add up to 1, one behind the
// other, hide what the whole hides.  What is absent stays so.
inline float8 weighed(float8 opacity, float weight) {
  const float8 left = 1.0f - pow(fmax(1.0f - opacity, 0.0f), weight);
  return select(opacity, left, opacity > 0.0f);
}
