// stereo_pair_crop: the part of an image that starts at column `first`, pixel by pixel.
// Reads:   image, first.
// Writes:  color.
// Units:   pixels.
uniform sampler2D image;
uniform int first;
out vec4 color;

void main() {
    color = texelFetch(image, ivec2(gl_FragCoord.xy) + ivec2(first, 0), 0);
}
