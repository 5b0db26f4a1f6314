// shade_sh: spherical harmonics -> colour towards the eye, for eight splats as vectors. colour =
// max(0, 0.5 + sum of basis(direction) * coefficient), the basis and its signs of 3DGS.
// Needs:   COEFFICIENTS = 1, 4, 9 or 16.
// PAGED = 1: of pages (n,) that are drawn, from pages of the arena (n,), which begin at `start`.
// Reads:   mean_opacity (N, 4); sh (blocks, 3 COEFFICIENTS, 8): what eight splats need is one run
//          of memory (with a stream a coefficient it took 2.6 times as long); seen, a byte a block.
// Writes:  color (N, 4).
// Units:   metres in the object; display sRGB, from 0 on.
#include "common/pages.cl"
#include "common/eight_rows.cl"

typedef struct {
  float8 x, y, z, opacity;
} Means;

// Not fmax alone, since fmax(NaN, 0) is 0 and project must see a colour that is not a number; told
// by its bits, since a compiler may turn a comparison into fmax.
inline float8 at_least_0(float8 color) {
  const int8 finite = (as_int8(color) & 0x7fffffff) < 0x7f800000;
  return select(color, fmax(color, 0.0f), finite);
}

// One coefficient of three channels, times its basis function.
#define ADD(k, basis)                          \
  {                                            \
    const float8 weight = basis;               \
    red += weight * vload8(3 * (k), s);        \
    green += weight * vload8(3 * (k) + 1, s);  \
    blue += weight * vload8(3 * (k) + 2, s);   \
  }

#define STORE_COLORS(rows) STORE_COLUMNS(rows, 4, 0, red, green, blue, 0)

// A work-item takes `run` blocks.  seen: a byte a block, 0 where no colour is wanted; may be null.
__kernel void shade_sh(int count, int start, int run, float eye_x, float eye_y, float eye_z,
                       __global const float* mean_opacity, __global const float* sh,
                       __global const uchar* seen, __global const int* stored,
                       __global const int* drawn, __global float* color) {
  const int first = get_global_id(0) * run, blocks = (count + LANES - 1) / LANES;
  for (int block = first; block < min(first + run, blocks); block++) {
    if (seen && !seen[block]) continue;
#if PAGED
    const int page = block / (PAGE / LANES), part = block % (PAGE / LANES), n = LANES;
    const int from = PAGE / LANES * stored[page] + part, i = start + LANES * from;
    __global float* into = color + 4 * ((long)start + PAGE * (long)drawn[page] + LANES * part - i);
#else
    const int n = min(LANES, count - LANES * block), i = start + LANES * block, from = block;
    __global float* into = color;
#endif
    __global const float* s = sh + (size_t)(3 * COEFFICIENTS * LANES) * from;
    // 3DGS stores colours less a half.
    float8 red = 0.5f, green = 0.5f, blue = 0.5f;
    // Degree 0: Y00 = 1 / (2 sqrt(pi)), the same from everywhere.
    ADD(0, 0.28209479177387814f)
#if COEFFICIENTS > 1
    Means mean;
    LOAD_ROWS(LOAD_MEANS, mean, mean_opacity, 4)
    float8 x = mean.x - eye_x, y = mean.y - eye_y, z = mean.z - eye_z;
    const float8 per = 1.0f / fmax(sqrt(x * x + y * y + z * z), 1e-12f);  // finite at the eye
    x *= per;
    y *= per;
    z *= per;
    // Degree 1: sqrt(3 / (4 pi)) times -y, z, -x, in this order and with these signs.
    ADD(1, -0.4886025119029199f * y)
    ADD(2, 0.4886025119029199f * z)
    ADD(3, -0.4886025119029199f * x)
#endif
#if COEFFICIENTS > 4
    // Degree 2: five functions; the constants are those of the real harmonics.
    const float8 xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
    ADD(4, 1.0925484305920792f * xy)
    ADD(5, -1.0925484305920792f * yz)
    ADD(6, 0.31539156525252005f * (2 * zz - xx - yy))
    ADD(7, -1.0925484305920792f * xz)
    ADD(8, 0.5462742152960396f * (xx - yy))
#endif
#if COEFFICIENTS > 9
    // Degree 3: seven more.
    ADD(9, -0.5900435899266435f * y * (3 * xx - yy))
    ADD(10, 2.890611442640554f * xy * z)
    ADD(11, -0.4570457994644658f * y * (4 * zz - xx - yy))
    ADD(12, 0.3731763325901154f * z * (2 * zz - 3 * xx - 3 * yy))
    ADD(13, -0.4570457994644658f * x * (4 * zz - xx - yy))
    ADD(14, 1.445305721320277f * z * (xx - yy))
    ADD(15, -0.5900435899266435f * x * (xx - 3 * yy))
#endif
    red = at_least_0(red);
    green = at_least_0(green);
    blue = at_least_0(blue);
    STORE_ROWS(STORE_COLORS, into, 4)
  }
}
