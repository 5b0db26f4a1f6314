// finite: tests that no compiler optimises away: it turns !(a >= b) into a < b and x < 0 ? 0 : x
// into max, and NaN slips by.  So by the bits.
// Reads:   nothing.
// Defines: bool finite(float), bool finite(vec2), bool finite(vec3): neither NaN nor infinite.
// Units:   any.

bool finite(float x) {
    return (floatBitsToUint(x) & 0x7fffffffu) < 0x7f800000u;
}

bool finite(vec2 v) {
    return finite(v.x) && finite(v.y);
}

bool finite(vec3 v) {
    return finite(v.xy) && finite(v.z);
}
