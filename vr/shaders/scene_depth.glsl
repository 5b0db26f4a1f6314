// scene_depth: how far the splats are in a pixel of an eye, and whether what is drawn over them is
// nearer.
// Reads:   scene_depth, the drawing's own (settings.depth_scale).
// Defines: float scene_depth_m(vec2 place); float seen_before(vec2 place, float depth_m).
// Units:   metres of the room along the view; place in 0..1 from lower left.
uniform sampler2D scene_depth;  // red: metres of the world times coverage; alpha: coverage
uniform bool has_depth;
uniform float play_per_world;   // metres of the room a metre of the world
uniform vec2 slack;             // metres, and part of the depth, that a thing may lie behind

const float SOLID = 0.5;        // less coverage hides nothing, as in renderer/surface.py
const float SOFT_M = 0.01;      // the edge: expected depth trembles by about so much

// Far behind all, where splats leave the pixel open.
float scene_depth_m(vec2 place) {
    vec4 blended = texture(scene_depth, place);
    return blended.a >= SOLID ? play_per_world * blended.r / blended.a : 1e9;
}

// 0..1: how much is seen of a thing at that depth.
float seen_before(vec2 place, float depth_m) {
    if (!has_depth) return 1.0;
    float least = scene_depth_m(place) * (1.0 + slack.y) + slack.x;
    return 1.0 - smoothstep(least, least + SOFT_M, depth_m);
}
