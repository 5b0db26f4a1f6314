// rotation: R of the covariance (paper eq. 1) from a quaternion.
// Reads:   nothing.
// Defines: mat3 rotation(vec4 wxyz): columns are the local axes; any length, zero = identity.
// Units:   none.

mat3 rotation(vec4 wxyz) {
    // Squares of very small or large numbers leave the floats.  By two factors, not divided by the
    // largest: a GPU multiplies by 1 / 3e38, which it takes for 0.
    float largest = max(max(abs(wxyz.x), abs(wxyz.y)), max(abs(wxyz.z), abs(wxyz.w)));
    float scale = largest > 1e15 ? 1e-20 : largest < 1e-15 ? 1e20 : 1.0;
    vec4 q = wxyz == vec4(0.0) ? vec4(1.0, 0.0, 0.0, 0.0) : wxyz * scale;  // NaN stays
    q /= length(q);
    float w = q.x, x = q.y, y = q.z, z = q.w;
    return mat3(
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
        2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
        2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}
