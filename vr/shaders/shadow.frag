// shadow: hides of the room what an object keeps light off; below what is drawn already.
// Reads:   occlusion, in red.
// Writes:  shown: black, with the part of the light that does not come in alpha.
// Units:   0..1, of light.
in vec2 place;
uniform sampler2D occlusion;
out vec4 shown;

void main() {
    shown = vec4(0.0, 0.0, 0.0, clamp(texture(occlusion, place).r, 0.0, 1.0));
}
