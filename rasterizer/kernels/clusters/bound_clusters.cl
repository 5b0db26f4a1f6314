// bound_clusters: boxes around the splats that can be drawn, CLUSTER rows of an arena together.
// Reads:   mean_opacity (N, 4), covariance (N, 8), object_index (N,); see common/pages.cl.
// Writes:  bounds (clusters, 12): least mean, greatest mean, greatest variance along any direction,
//          greatest opacity, number of splats whose opacity is enough, object (-1: of two, or with
//          numbers that say nothing), 0, 0.
// Units:   metres in the object, m^2.
#include "common/limits.cl"
#include "common/pages.cl"
#define MOST 1e15f  // what is larger says nothing: products of it may be infinite

__kernel void bound_clusters(int count, float min_alpha, __global const float* mean_opacity,
                             __global const float* covariance, __global const int* object_index,
                             __global const int* sources, __global float* bounds) {
  const int c = get_global_id(0);
  const int first = c * CLUSTER, last = min(count, first + CLUSTER);
  if (first >= last) return;
  // x, y and z of the means, and the opacity, side by side.
  float4 low = MAXFLOAT, high = -MAXFLOAT;
  float variance = 0, object = object_index[first];
  int bright = 0;
  for (int i = first; i < last; i++) {
    const long at = row_of(i, sources);
    if (at < 0) continue;
    const float4 s = vload4(at, mean_opacity);
    // Absent splats end at the first gate, wherever they are.
    if (!(s.w >= min_alpha && s.w < FLT_MAX)) continue;
    bright++;
    low = fmin(low, s);
    high = fmax(high, s);
    // A matrix reaches no farther than the largest sum of absolute values in one of its rows.
    const float8 m = vload8(at, covariance);
    const float4 off = fabs((float4)(m.s1, m.s2, m.s4, 0));
    const float sums = fmax(fabs(m.s0) + off.x + off.y,
                            fmax(off.x + fabs(m.s3) + off.z, off.y + off.z + fabs(m.s5)));
    variance = fmax(variance, sums);
    // Positive, so that NaN fails: sums keep it, which fmin and fmax would pass over.
    const float4 size = fabs(s);
    const float all = fabs(m.s0) + fabs(m.s3) + fabs(m.s5) + off.x + off.y + off.z;
    if (!(size.x < MOST && size.y < MOST && size.z < MOST && all < MOST)) object = -1;
    if (object_index[i] != (int)object) object = -1;
  }
  vstore4((float4)(low.xyz, high.x), 0, bounds + 12 * c);
  vstore4((float4)(high.yz, variance, high.w), 0, bounds + 12 * c + 4);
  vstore4((float4)(bright, object, 0, 0), 0, bounds + 12 * c + 8);
}
