// floor: a grid on a level of the world and a glow at the horizon, where splats leave an eye's
// picture uncovered.  What it writes is added to that picture, or taken off a bright one.
// Reads:   coverage, the alpha of the splats' picture; the eye, the level and the grid's spacing.
// Writes:  shown, the light to be added, alpha 0.
// Units:   metres of the world; tangents of the eye; display sRGB.
in vec2 place;              // 0..1 from lower left
uniform sampler2D coverage; // alpha: how much splats hide of what is behind them
uniform bool top_first;     // its first row is the upper one
uniform vec3 eye;           // world metres; x and z less a multiple of all lines
uniform mat3 world_from_eye;
uniform vec4 tangents;      // of the eye: left, right, down, up
uniform float level_m;      // of the floor in the world
uniform float scale;        // metres of the world a metre of the room
uniform float spacing_m;    // of the world, between lines; others lie a tenth and ten times as far
uniform float finer;        // 0..1, how much of those is seen
uniform float clearness;    // 0..1, of the lines
out vec4 shown;

const float LINE = 0.20, MAJOR = 1.6;     // display value of a fine line; times that of coarse ones
const float FAR_M = 14.0;                 // of the room: so far a line is down to a third
const float GLOW = 0.045, GLOW_RISE = 0.05, GROUND = 0.012;  // at the horizon, and below it
const float WIDTH_PX = 0.75;              // half of a line's

// 0..1 where a line of the grid lies, none where lines are closer than three pixels.
float lines(vec2 at, vec2 pixel_m, float apart) {
    vec2 pixel = pixel_m / apart;                               // of a cell
    vec2 away = abs(fract(at / apart - 0.5) - 0.5) / pixel;     // pixels to the next line
    vec2 line = clamp(WIDTH_PX + 0.5 - away, 0.0, 1.0);         // its edge is a pixel wide
    line *= clamp((0.35 - pixel) / 0.2, 0.0, 1.0);
    return max(line.x, line.y);
}

// Steps of 1/255 in a glow would be seen as bands.
float dither() {
    return fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))) - 0.5;
}

void main() {
    vec2 tangent = mix(tangents.xz, tangents.yw, place);
    vec3 ray = normalize(world_from_eye * vec3(tangent, -1.0));
    float down = (level_m - eye.y) / (abs(ray.y) > 1e-5 ? ray.y : 1e-5);  // world metres along it
    vec3 point = eye + ray * clamp(down, 0.0, 1e4 * scale);
    vec2 pixel_m = max(fwidth(point.xz), vec2(1e-7));
    float open = 1.0 - texture(coverage, top_first ? vec2(place.x, 1.0 - place.y) : place).a;
    if (!(open > 1.0 / 512.0)) discard;
    float line = 0.0;
    if (down > 0.0) {
        line = finer * lines(point.xz, pixel_m, 0.1 * spacing_m);
        line = max(line, mix(1.0, MAJOR, finer) * lines(point.xz, pixel_m, spacing_m));
        line = max(line, MAJOR * lines(point.xz, pixel_m, 10.0 * spacing_m));
        line *= exp(-down / (scale * FAR_M));
    }
    float glow = GLOW * exp(-abs(ray.y) / GLOW_RISE) + (ray.y < 0.0 ? GROUND : 0.0);
    float value = open * max(LINE * clearness * line + glow + dither() / 255.0, 0.0);
    shown = vec4(vec3(value), 0.0);
}
