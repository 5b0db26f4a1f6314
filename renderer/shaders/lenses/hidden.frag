// hidden: depth, and nothing in the pictures of colours and heat.
// Reads:   nothing.
// Writes:  color, heat.
// Units:   none.
layout(location = 0) out vec4 color;
layout(location = 1) out vec4 heat;

void main() {
    color = heat = vec4(0.0);
}
