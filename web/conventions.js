// conventions: shared with Python, written by tools/web/write_conventions.py from
// the constants there; change it there.
export const WIDTH = 2048;  // runtime_models/web/web_model.py
export const BATCH_ROWS = 64;  // runtime_models/web/web_model.py
export const BLOCK_VEC4S = 1024;  // runtime_models/web/web_model.py
export const MOST_ANCHORS = 4000000;  // runtime_models/web/web_model.py
export const MOST_SPLATS = 4194304;  // runtime_models/web/web_model.py
export const MOST_BYTES = 1073741824;  // runtime_models/web/web_model.py
export const MOST_WEIGHTS = 32768;  // runtime_models/web/web_model.py
export const MIN_ALPHA = 0.00392156862745098;  // a pixel's alpha below this is not drawn
export const MAX_ALPHA = 0.99;  // one splat never hides everything behind it
export const LOW_PASS = 0.3;  // px^2 added to the screen covariance
export const MOST_UNIT = 64.0;  // brighter colours are blended in half floats
export const JACOBIAN_MARGIN = 1.3;  // times the largest tangents of a view
export const LUMINANCE = [0.2126, 0.7152, 0.0722];  // Rec. 709, on display values
export const SNAP = 0.02;  // of the slider: nearer than this to a stop is on the stop
export const SHIFT_S = 0.6;  // from any stop to any other, when somebody asks for it
export const LEG_S = 2.5;  // playing, from one stop to the next
export const REST_S = 0.8;  // playing, at each stop
export const RESORT_DEGREES = 1.0;  // a view that turns farther is sorted anew
export const RESORT_PART = 0.01;  // of the scene's radius: so is one that moves farther
// renderer/shaders/common/direction.glsl
export const DIRECTION = `
vec3 direction_from(vec3 eye, vec3 point) {
    vec3 ray = point - eye;
    float largest = max(abs(ray.x), max(abs(ray.y), abs(ray.z)));
    if (!(largest > 0.0)) return vec3(0.0);
    ray /= largest;  // squares of very short rays would be 0
    return ray / length(ray);
}
`;
// renderer/shaders/common/light.glsl
export const LIGHT = `
float light_along(vec4 low, vec4 high, vec3 d) {
    vec3 products = 2.2360680 * d * d.yzx, squares = d * d;
    float zone = 0.6454972 * (2.0 * squares.z - squares.x - squares.y);
    float rest = 1.1180340 * (squares.x - squares.y);
    return dot(low, vec4(d, products.x)) + dot(high, vec4(products.yz, zone, rest));
}
`;
