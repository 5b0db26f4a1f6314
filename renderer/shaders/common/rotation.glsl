// Reads:   nothing.
// Defines: mat3 rotation(vec4 wxyz)   columns are the local axes; any length, zero = identity.

mat3 rotation(vec4 wxyz) {
    float length2 = dot(wxyz, wxyz);
    vec4 q = length2 > 0.0 ? wxyz * inversesqrt(length2) : vec4(1.0, 0.0, 0.0, 0.0);
    float w = q.x, x = q.y, y = q.z, z = q.w;
    return mat3(
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
        2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
        2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}
