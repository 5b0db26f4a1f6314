// networks: one pass a layer and up to 8 vectors of outputs; a fragment is an anchor.  Its sums stay
// in registers while it walks over its inputs, so each weight is fetched once an anchor.  (A fragment
// for each four outputs needs 1.5 times as long on software GL; all layers of a network unrolled into
// one shader run 1.4 times as fast there, but take its compiler more than a minute.)
import { BLOCK_VEC4S, DIRECTION, LIGHT } from "../conventions.js";

/** @typedef {import("../entries.js").NetworkEntry} NetworkEntry */
/** @typedef {Pick<import("../entries.js").LayerEntry, "ins" | "outs"> & {weights: Float32Array, bias: Float32Array, parts: Part[]}} Layer  counts of vec4s */
/** @typedef {Pick<NetworkEntry, "looks" | "head" | "clip" | "gain"> & {layers: Layer[], control: Float32Array | null}} Network */
/** @typedef {{first: number, outs: number, weights: WebGLBuffer, bias: WebGLBuffer, ofStops: WebGLBuffer | null}} Part  of a layer */

const HEADS = ["none", "tanh", "sigmoid", "softplus", "exp", "relu"];
export const MOST_OUTPUTS = 8;  // vectors of a pass, where the device has as many targets

/** @param {string} head */
export const headNumber = (head) => Math.max(0, HEADS.indexOf(head));

/** @param {number} outs  vectors @returns {string} the fragment shader */
export function layerShader(outs) {
    const each = (/** @type {(o: number) => string} */ line) => Array.from({ length: outs }, (_, o) => line(o)).join("\n");
    const add = (/** @type {string} */ n, /** @type {string} */ value) => each((o) => [0, 1, 2, 3].map((c) => `s${o} += w[${n} + ${4 * o + c}] * ${value}.${"xyzw"[c]};`).join(" "));
    return `
uniform sampler2DArray inputs;   // vector i of an anchor in layer i
uniform sampler2D anchors, stop_weights, light;
uniform int first_anchor, count, input_row, ins;
uniform bool looks;              // behind these inputs comes the direction from the eye, and light
uniform int lit;                 // channels of the anchors' light by direction: 0, 1 or 3
uniform int stops;               // each anchor has weights of so many stops; 0: Psi is in the bias
uniform vec4 mask[16];           // of the stops that count
uniform int head;                // index of HEADS
uniform float low, high, gain;   // y = gain * head(clamp(z, low, high))
uniform vec3 eye;                // metres in the object
layout(std140) uniform Weights { vec4 w[${BLOCK_VEC4S}]; };
layout(std140) uniform Bias { vec4 bias[${MOST_OUTPUTS}]; };
layout(std140) uniform Stops { vec4 of_stops[${64 * MOST_OUTPUTS}]; };  // C Psi(x_s) of each stop
${each((o) => `layout(location = ${o}) out vec4 out${o};`)}

vec4 activate(vec4 z) {
    if (head == 1) return tanh(clamp(z, -15.0, 15.0));  // +-1 beyond; some drivers' tanh(90) is NaN
    if (head == 2) return 1.0 / (1.0 + exp(-z));
    if (head == 3) return max(z, 0.0) + log(1.0 + exp(-abs(z)));
    if (head == 4) return exp(z);
    if (head == 5) return max(z, 0.0);
    return z;
}

${DIRECTION}
${LIGHT}
float channel_along(int c, int a, vec3 d) {
    int low = 2 * (lit * a + c);
    return light_along(texelFetch(light, at(low), 0), texelFetch(light, at(low + 1), 0), d);
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    int a = first_anchor + here.y * WIDTH + here.x;
    if (a >= count) discard;
    ${each((o) => `vec4 s${o} = bias[${o}];`)}
    for (int i = 0; i < ins; i++) {
        vec4 v = texelFetch(inputs, ivec3(here.x, here.y + input_row, i), 0);
        int n = i * ${4 * outs};
        ${add("n", "v")}
    }
    if (looks) {
        vec4 v = vec4(direction_from(eye, texelFetch(anchors, at(a), 0).xyz), 0.0);
        if (lit > 0) v.w = channel_along(0, a, v.xyz);
        int n = ins * ${4 * outs};
        ${add("n", "v")}
        if (lit > 1) {  // red is beside the direction
            vec4 more = vec4(channel_along(1, a, v.xyz), channel_along(2, a, v.xyz), 0.0, 0.0);
            n += ${4 * outs};
            ${add("n", "more")}
        }
    }
    int vectors = (stops + 3) / 4 + 1;
    float total = 0.0;
    for (int s = 0; s < stops; s++) total += texelFetch(stop_weights, at(a * vectors + s / 4), 0)[s & 3] * mask[s / 4][s & 3];
    for (int s = 0; s < stops; s++) {  // in proportion, where the mask leaves some out
        float share = texelFetch(stop_weights, at(a * vectors + s / 4), 0)[s & 3] * mask[s / 4][s & 3] / (total > 0.0 ? total : 1.0);
        ${each((o) => `s${o} += of_stops[s * ${outs} + ${o}] * share;`)}
    }
    ${each((o) => `out${o} = gain * activate(clamp(s${o}, low, high));`)}
}`;
}

/** How a layer is cut: parts of equal size, that fit a block of weights. @param {Layer} layer @param {number} most */
export function partSize({ ins, outs }, most) {
    const fits = Math.max(1, Math.min(most, Math.floor(BLOCK_VEC4S / (4 * ins))));
    return Math.ceil(outs / Math.ceil(outs / fits));
}

/** Weights of output vectors first to first + outs - 1, in the shader's order: input, output, number. @param {Layer} layer @param {number} first @param {number} outs */
export function weightBlock({ ins, weights }, first, outs) {
    const block = new Float32Array(4 * BLOCK_VEC4S);
    for (let i = 0; i < ins; i++)
        for (let o = 0; o < outs; o++) {
            const from = ((first + o) * ins + i) * 16;
            block.set(weights.subarray(from, from + 16), (i * outs + o) * 16);
        }
    return block;
}

/** The first bias at Psi: b + C Psi, in float64. @param {ArrayLike<number>} bias @param {Float32Array | null} control @param {Float64Array} psi */
export function foldedBias(bias, control, psi) {
    const out = Float64Array.from(bias), d = psi.length;
    if (control) for (let o = 0; o < out.length; o++) for (let t = 0; t < d; t++) out[o] += control[o * d + t] * psi[t];
    return Float32Array.from(out);
}
