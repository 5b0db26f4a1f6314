// project: splats of one posed object -> screen ellipses, as renderer/shaders/project.comp.  The only
// culling gate.  Sigma' = J W Sigma W^T J^T + low_pass I (EWA splatting; 3DGS, eq. 5).  Eye space has
// y up and looks along -z; pixels count from lower left.
import { JACOBIAN_MARGIN, LOW_PASS } from "../conventions.js";

/** @typedef {{worldFromEye: import("../poses.js").Pose, tangents: number[], near: number, viewport: number[], scale?: number}} View */

const PROJECT = `
uniform sampler2D mean_opacity, covariance0, covariance1;
uniform vec4 frame[3];      // rows eye_from_object
uniform vec4 tangents;      // left, right, down, up; left and down negative
uniform vec2 clamps;        // largest tangents that the Jacobian sees, either side of the axis
uniform vec2 size;          // pixels
uniform float near, min_alpha, low_pass;
uniform bool antialiased;   // what the low pass makes wider becomes fainter
layout(location = 0) out vec4 ellipse;   // centre, major axis (one sigma), pixels
layout(location = 1) out vec4 rest;      // minor sigma (pixels), cutoff (sigmas), opacity

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 m = texelFetch(mean_opacity, here, 0), s0 = texelFetch(covariance0, here, 0), s1 = texelFetch(covariance1, here, 0);
    mat3 sigma = mat3(s0.x, s0.y, s0.z, s0.y, s0.w, s1.x, s0.z, s1.x, s1.y);
    vec4 mean = vec4(m.xyz, 1.0);
    vec3 p = vec3(dot(frame[0], mean), dot(frame[1], mean), dot(frame[2], mean));
    float z = -p.z, per_z = 1.0 / z;
    // J: far beside the view the slope of the projection is held, or a splat there would cover all.
    vec2 focal = size / (tangents.yw - tangents.xz), tangent = p.xy * per_z;
    vec2 held = clamp(tangent, -clamps, clamps);
    // u and v, the rows of J W: how the pixel moves with the object's metres.
    vec3 u = focal.x * per_z * (frame[0].xyz + held.x * frame[2].xyz);
    vec3 v = focal.y * per_z * (frame[1].xyz + held.y * frame[2].xyz);
    // Sigma' = [u.Sigma u, u.Sigma v; ., v.Sigma v] + low pass = [a b; b c], px^2.
    vec3 sigma_u = sigma * u, sigma_v = sigma * v;
    float bare_a = dot(u, sigma_u), b = dot(v, sigma_u), bare_c = dot(v, sigma_v);
    float a = bare_a + low_pass, c = bare_c + low_pass;
    float bare = max(bare_a * bare_c - b * b, 0.0);  // rounding may take it below 0
    float determinant = bare + low_pass * (bare_a + bare_c) + low_pass * low_pass;
    float opacity = m.w;
    if (antialiased) {
        float kept = sqrt(bare / determinant);  // Mip-Splatting's 2D filter: the same light in all
        opacity *= kept < 1.0 ? kept : 1.0;
    }
    // alpha = o exp(-r / 2) = min_alpha at r = 2 ln(o / min_alpha).
    float cutoff = sqrt(max(2.0 * log(opacity / min_alpha), 0.0));
    // The squared half axes; the smaller one from the determinant, since mid - root cancels.
    float mid = 0.5 * (a + c), off = 0.5 * (a - c), root = sqrt(off * off + b * b);
    float major = mid + root, minor = determinant / major;
    vec2 along = off >= 0.0 ? vec2(off + root, b) : vec2(b, root - off);
    vec2 direction = root > 1e-12 * mid ? along * (inversesqrt(root) * inversesqrt(2.0 * (root + abs(off)))) : vec2(1.0, 0.0);
    vec2 center = (tangent - tangents.xz) * focal, extent = cutoff * sqrt(vec2(a, c));
    bool drawn = opacity >= min_alpha && z > near && major < 1e12 && minor > 0.0
        && all(lessThan(center - extent, size)) && all(greaterThan(center + extent, vec2(0.0)));
    ellipse = drawn ? vec4(center, direction * sqrt(major)) : vec4(-1e6, -1e6, 0.0, 0.0);
    rest = drawn ? vec4(sqrt(minor), cutoff, opacity, 0.0) : vec4(0.0);
}`;

export class Projector {
    /** @param {import("./gl.js").Gpu} gpu @param {import("./arena.js").Arena} arena */
    constructor(gpu, arena) {
        this.gpu = gpu;
        this.arena = arena;
        this.program = gpu.program(null, PROJECT);
    }

    /** @param {number} view  number of its records @param {import("./renderer.js").SceneObject[]} objects @param {View} from @param {number[]} size */
    project(view, objects, from, size) {
        const { arena, gpu } = this, records = arena.recordsOf(view), [left, right, down, up] = from.tangents;
        for (const object of objects) {
            this.program.use({
                mean_opacity: { texture: arena.meanOpacity }, covariance0: { texture: arena.covariance0 }, covariance1: { texture: arena.covariance1 },
                frame: { vec4s: object.seenFrom(from.worldFromEye) }, tangents: from.tangents, size, near: from.near,
                clamps: [JACOBIAN_MARGIN * Math.max(-left, right), JACOBIAN_MARGIN * Math.max(-down, up)],
                min_alpha: arena.minAlpha, low_pass: LOW_PASS, antialiased: { int: /** @type {import("./models.js").LayerModel} */ (object.model).antialiased ? 1 : 0 },
            });
            gpu.fill(records.framebuffer, object.rows, object.row);
        }
    }
}
