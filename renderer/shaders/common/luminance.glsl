// luminance: what a palette is looked up with.
// Reads:   nothing.
// Defines: const vec3 LUMINANCE, weights of red, green and blue, as renderer/colors/palette.py has
//          them.
// Units:   display sRGB.
const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);  // Rec. 709, on display values
