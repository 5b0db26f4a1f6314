// sort: a stable radix sort and prefix sums for many work-groups: the GPU form of what bin.cl does
// a chunk at a time.  OpenCL 1.2, no atomics, no subgroups. A group of GROUP items owns SPAN
// contiguous keys, an item PER_ITEM of them, so that counts laid out digit by digit and item by
// item give each key its stable place.
// Reads:   keys and values (count,), or data to be summed.
// Writes:  sorted keys and values; exclusive sums.
// Units:   none.
#define GROUP 256
#define PER_ITEM 8
#define SPAN (GROUP * PER_ITEM)
// Four bits a pass: the local table of 16 digits x 256 items is 16 KiB of the 32 that OpenCL
// promises.
#define DIGIT_BITS 4
#define DIGITS 16

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

// Local counts [digit][item] of a group's keys; then exclusive sums of them in that order.
inline void count_and_scan(int count, int shift, __global const uint* keys, __local int* counts,
                           __local int* shared) {
  const int l = get_local_id(0), first = get_group_id(0) * SPAN + l * PER_ITEM;
  // A column of the table is written by its item alone: no atomics, and the order within an item
  // stays.
  for (int d = 0; d < DIGITS; d++) counts[d * GROUP + l] = 0;
  for (int k = 0; k < PER_ITEM; k++)
    if (first + k < count) counts[(keys[first + k] >> shift & (DIGITS - 1)) * GROUP + l]++;
  barrier(CLK_LOCAL_MEM_FENCE);
  int sum = 0, total;  // an item scans DIGITS neighbours of the flat table
  for (int k = 0; k < DIGITS; k++) sum += counts[l * DIGITS + k];
  int before = group_scan(sum, shared, &total);
  for (int k = 0; k < DIGITS; k++) {
    const int n = counts[l * DIGITS + k];
    counts[l * DIGITS + k] = before;
    before += n;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}

// table [digit][group]: how many keys of each digit a group has.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void count_digits(
    int count, int groups, int shift, __global const uint* keys, __global int* table) {
  __local int counts[DIGITS * GROUP], shared[GROUP];
  count_and_scan(count, shift, keys, counts, shared);
  const int d = get_local_id(0), group = get_group_id(0);
  if (d < DIGITS) {
    const int all = min(SPAN, count - group * SPAN);
    // In the scanned table neighbouring digits' first entries differ by the digit's count.
    const int end = d + 1 < DIGITS ? counts[(d + 1) * GROUP] : all;
    table[d * groups + group] = end - counts[d * GROUP];
  }
}

// table is scanned: where each group's keys of each digit go.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scatter_digits(
    int count, int groups, int shift, __global const uint* keys, __global const int* values,
    __global const int* table, __global uint* sorted_keys, __global int* sorted_values) {
  __local int counts[DIGITS * GROUP], shared[GROUP], starts[DIGITS];
  const int l = get_local_id(0), group = get_group_id(0), first = group * SPAN + l * PER_ITEM;
  count_and_scan(count, shift, keys, counts, shared);
  if (l < DIGITS) starts[l] = counts[l * GROUP];
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int k = 0; k < PER_ITEM; k++) {
    if (first + k >= count) break;
    const uint key = keys[first + k];
    const int d = key >> shift & (DIGITS - 1);
    // Place = where the group's digit begins + the key's rank in the group among equal digits.
    const int to = table[d * groups + group] + counts[d * GROUP + l]++ - starts[d];
    sorted_keys[to] = key;
    sorted_values[to] = values[first + k];
  }
}
