// prefix: sums over a group of WORKGROUP invocations, all of which call both (Hillis and Steele).
// Reads:   nothing.
// Defines: uint sum_before(uint own): of the invocations before this one; uint prefix_total(): of
//          all of them, after it.
// Units:   none.

shared uint prefix_sums[WORKGROUP];

// What the invocations before this one have together.
uint sum_before(uint own) {
    uint local = gl_LocalInvocationID.x;
    barrier();  // nobody reads the sums of the call before any more
    prefix_sums[local] = own;
    barrier();
    for (uint reach = 1u; reach < WORKGROUP; reach <<= 1) {
        uint before = local >= reach ? prefix_sums[local - reach] : 0u;
        barrier();
        prefix_sums[local] += before;
        barrier();
    }
    return prefix_sums[local] - own;
}

// What all have together, after sum_before().
uint prefix_total() { return prefix_sums[WORKGROUP - 1]; }
