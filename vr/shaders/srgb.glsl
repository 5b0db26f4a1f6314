// srgb: display values as light.
// Reads:   nothing.
// Defines: vec3 linear_from_srgb(vec3): IEC 61966-2-1.
// Units:   display sRGB; light from 0 to 1.
vec3 linear_from_srgb(vec3 c) {
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
}
