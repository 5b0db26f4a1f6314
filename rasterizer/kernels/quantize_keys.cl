// quantize_keys: exact sort keys -> steps of the frame's own range, 0..65534; the twin of
// renderer/shaders/sort/sort_quantize.comp.  A work-item owns a chunk of pairs and its histogram of
// digits.
// Reads:   pairs (N, 2) of splat and key, packed a chunk; status, of each chunk the number of
//          pairs.
// Writes:  the pairs' keys, the histograms of their low digits, the key range in status.
// Units:   keys are sortable bits of metres before, steps after.
#define LOW_BITS 12
#define LOW_BINS (1 << LOW_BITS)
#define STEPS 65534.0f  // 65535 stays free for what is culled, as on a GPU

// The float whose sortable bits these are (sortable() of project_arena.cl).
inline float value_of(uint key) { return as_float(key >> 31 ? key ^ 0x80000000u : ~key); }

// Clamped: rounding must not lift the largest above the last step.
inline uint step_of(uint key, float least, float scale) {
  return (uint)clamp((value_of(key) - least) * scale, 0.0f, STEPS);
}

__kernel void quantize_keys(int chunk, uint least, uint most, __global uint2* pairs,
                            __global int* table, __global uint4* status) {
  const int c = get_global_id(0);
  __global int* bins = table + c * LOW_BINS;
  for (int b = 0; b < LOW_BINS; b++) bins[b] = 0;
  // 1e-30: where all keys are equal, all steps are 0.
  const float low = value_of(least), scale = STEPS / fmax(value_of(most) - low, 1e-30f);
  const int first = c * chunk, last = first + (int)status[c].x;
  for (int i = first; i < last; i++) {
    const uint step = step_of(pairs[i].y, low, scale);
    pairs[i].y = step;
    // The first pass of the sort reads this histogram, so it has to be that of the new keys.
    bins[step & (LOW_BINS - 1)]++;
  }
  if (last == first) return;
  status[c].z = step_of(status[c].z, low, scale);
  status[c].w = step_of(status[c].w, low, scale);
}
