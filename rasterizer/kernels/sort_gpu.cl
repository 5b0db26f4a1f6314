// sort: a stable radix sort and prefix sums for many work-groups: the GPU form of what bin.cl does
// a chunk at a time.  OpenCL 1.2, atomics in local memory alone, no subgroups.  A group of GROUP
// items owns SPAN contiguous keys and walks through them GROUP at a time; in each such block a bit
// set a digit says which items hold it, and the bits below one's own are one's rank: stable.
// Reads:   keys and values (count,), or data to be summed.
// Writes:  sorted keys and values; exclusive sums.
// Units:   none.
#define GROUP 256
#define PER_ITEM 8
#define SPAN (GROUP * PER_ITEM)
#define DIGIT_BITS 8
#define DIGITS 256        // as many as items: each has one to count and to clear
#define WORDS (GROUP / 32)

// Exclusive sum over the group of one number an item.  Returns the sum before; *total: of all.
inline int group_scan(int value, __local int* shared, int* total) {
  const int l = get_local_id(0);
  shared[l] = value;
  barrier(CLK_LOCAL_MEM_FENCE);
  // Hillis and Steele: log2(GROUP) rounds, each adds what stands `reach` items before.
  for (int reach = 1; reach < GROUP; reach *= 2) {
    const int before = l >= reach ? shared[l - reach] : 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    shared[l] += before;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  const int sum = shared[l];
  *total = shared[GROUP - 1];
  barrier(CLK_LOCAL_MEM_FENCE);
  return sum - value;
}

// data (count,) -> exclusive sums within each group's SPAN; sums[group]: its total.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scan_spans(
    int count, __global int* data, __global int* sums) {
  __local int shared[GROUP];
  const int first = get_group_id(0) * SPAN + get_local_id(0) * PER_ITEM;
  int mine[PER_ITEM], sum = 0, total;
  for (int k = 0; k < PER_ITEM; k++) {
    mine[k] = first + k < count ? data[first + k] : 0;
    sum += mine[k];
  }
  // An item scans its own run in registers, from where the group's scan says it begins.
  int before = group_scan(sum, shared, &total);
  for (int k = 0; k < PER_ITEM; k++) {
    if (first + k < count) data[first + k] = before;
    before += mine[k];
  }
  if (get_local_id(0) == 0) sums[get_group_id(0)] = total;
}

// The totals before each span, scanned by the same kernels, complete the sums.
__kernel void add_sums(int count, __global int* data, __global const int* sums) {
  const int i = get_global_id(0);
  if (i < count) data[i] += sums[i / SPAN];
}

// table [digit][group]: how many keys of each digit a group has.  base: what keys are counted from.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void count_digits(
    int count, int groups, uint base, int shift, __global const uint* keys, __global int* table) {
  __local int occurrences[DIGITS];
  const int l = get_local_id(0), group = get_group_id(0);
  occurrences[l] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  // The digits of a group's keys add up to the same in any order.
  for (int i = group * SPAN + l; i < min(count, (group + 1) * SPAN); i += GROUP)
    atomic_inc(&occurrences[(keys[i] - base) >> shift & (DIGITS - 1)]);
  barrier(CLK_LOCAL_MEM_FENCE);
  table[l * groups + group] = occurrences[l];
}

// A group a digit: how many of its keys the groups before have, in place; totals[digit]: of all.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scan_digits(
    int groups, __global int* table, __global int* totals) {
  __local int shared[GROUP];
  const int l = get_local_id(0), digit = get_group_id(0);
  int carry = 0, total;
  for (int first = 0; first < groups; first += GROUP) {
    const int at = digit * groups + first + l;
    const int here = first + l < groups ? table[at] : 0;
    const int before = group_scan(here, shared, &total);
    if (first + l < groups) table[at] = carry + before;
    carry += total;
  }
  if (l == 0) totals[digit] = carry;
}

// table and totals are scan_digits': where each group's keys of each digit go.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scatter_digits(
    int count, int groups, uint base, int shift, __global const uint* keys,
    __global const int* values, __global const int* table, __global const int* totals,
    __global uint* sorted_keys, __global int* sorted_values) {
  __local int shared[GROUP], next[DIGITS];  // next: where the group's next key of a digit goes
  __local uint holders[WORDS * DIGITS];     // [word][digit]
  const int l = get_local_id(0), group = get_group_id(0), word = l / 32;
  const uint bit = 1u << (l % 32);
  int all;
  // A digit's keys begin where those of all digits before it end.
  next[l] = group_scan(totals[l], shared, &all) + table[l * groups + group];
  for (int block = 0; block < PER_ITEM; block++) {
    // A digit's bit set is cleared by the item of its number.
    for (int w = 0; w < WORDS; w++) holders[w * DIGITS + l] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    const int i = group * SPAN + block * GROUP + l;
    const bool here = i < count;
    const uint key = here ? keys[i] : 0;
    const int d = (key - base) >> shift & (DIGITS - 1);
    const int to = next[d];
    // Bits may be set in any order: the set is the same.
    if (here) atomic_or(&holders[word * DIGITS + d], bit);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (here) {
      int rank = 0, total = 0;
      for (int w = 0; w < WORDS; w++) {
        const uint bits = holders[w * DIGITS + d];
        total += popcount(bits);
        rank += popcount(w < word ? bits : w == word ? bits & (bit - 1) : 0);
      }
      sorted_keys[to + rank] = key;
      sorted_values[to + rank] = values[i];
      // The last holder moves the group's next place on, after everybody has read it.
      if (rank == total - 1) next[d] = to + total;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}
