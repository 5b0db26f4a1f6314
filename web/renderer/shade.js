// shade: colours of splats and the heat that value stops have in them, as heat.comp, shade_sh.comp
// and weigh.comp of renderer/shaders.  One fragment a splat; of several parts the later are added.
import { LUMINANCE, WIDTH } from "../conventions.js";
import { rowsOf } from "./gl.js";
import { SPLAT_OF_FRAGMENT } from "./pack.js";

/** @typedef {import("./false_colors.js").Shade} Shade */
/** @typedef {import("./stops.js").Control} Control */
/** @typedef {import("./models.js").LayerModel} LayerModel */
/** @typedef {import("./renderer.js").SceneObject} SceneObject */

export const PALETTE_COLOR = `
vec3 palette_color(float value) {
    float place = clamp(value, 0.0, 1.0) * 255.0;
    int below = int(place);
    vec3 upper = texelFetch(palette, ivec2(min(below + 1, 255), 0), 0).rgb;
    return mix(texelFetch(palette, ivec2(below, 0), 0).rgb, upper, place - float(below));
}`;

const shadeShader = (/** @type {boolean} */ harmonics) => `
uniform sampler2DArray staged;       // colours of the networks
uniform sampler2D sh, anchors;       // of plain splats: harmonics, 3 numbers a coefficient; means
uniform sampler2D palette, stop_weights;
uniform int per_anchor, count, first_anchor, first_row;
uniform int coefficients;            // 1, 4, 9 or 16
uniform vec3 eye;                    // metres in the object
uniform int channel, vectors;        // of an anchor's own weights; channel -1: \`weight\` for all
uniform float weight;
uniform int role;                    // 0: final colours; 1: heat; 2: heat in the palette's colours
layout(location = 0) out vec4 color; // display sRGB; a below 0: no number
layout(location = 1) out vec4 heat;  // value times weight, weight
${PALETTE_COLOR}
float output_number(ivec2 here, int n) { return texelFetch(staged, ivec3(here, n >> 2), 0)[n & 3]; }
float number(int a, int n) {
    int i = a * coefficients * 3 + n;
    return texelFetch(sh, at(i >> 2), 0)[i & 3];
}
vec3 coefficient(int a, int k) { return vec3(number(a, 3 * k), number(a, 3 * k + 1), number(a, 3 * k + 2)); }

// The basis and its signs of 3DGS.
vec3 shaded(int a) {
    vec3 rgb = 0.5 + 0.28209479177387814 * coefficient(a, 0);
    vec3 ray = texelFetch(anchors, at(a), 0).xyz - eye;
    float square = dot(ray, ray);
    vec3 d = square > 0.0 ? ray * inversesqrt(square) : vec3(0.0);
    float x = d.x, y = d.y, z = d.z, xx = x * x, yy = y * y, zz = z * z;
    if (coefficients > 1) rgb += 0.4886025119029199 * (z * coefficient(a, 2) - y * coefficient(a, 1) - x * coefficient(a, 3));
    if (coefficients > 4) {
        rgb += 1.0925484305920792 * (x * y * coefficient(a, 4) - y * z * coefficient(a, 5) - x * z * coefficient(a, 7));
        rgb += 0.31539156525252005 * (2.0 * zz - xx - yy) * coefficient(a, 6);
        rgb += 0.5462742152960396 * (xx - yy) * coefficient(a, 8);
    }
    if (coefficients > 9) {
        rgb -= 0.5900435899266435 * y * (3.0 * xx - yy) * coefficient(a, 9);
        rgb += 2.890611442640554 * x * y * z * coefficient(a, 10);
        rgb -= 0.4570457994664658 * y * (4.0 * zz - xx - yy) * coefficient(a, 11);
        rgb += 0.3731763325901154 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * coefficient(a, 12);
        rgb -= 0.4570457994664658 * x * (4.0 * zz - xx - yy) * coefficient(a, 13);
        rgb += 1.445305721320277 * z * (xx - yy) * coefficient(a, 14);
        rgb -= 0.5900435899266435 * x * (xx - 3.0 * yy) * coefficient(a, 15);
    }
    return max(rgb, 0.0);
}

void main() {${SPLAT_OF_FRAGMENT}
    color = heat = vec4(0.0);
    if (a >= count) return;
    ${harmonics ? "" : "ivec2 here = at(a - first_anchor);"}
    vec3 rgb = ${harmonics ? "shaded(a)" : "vec3(output_number(here, 3 * j), output_number(here, 3 * j + 1), output_number(here, 3 * j + 2))"};
    float share = weight;
    if (channel >= 0) share = texelFetch(stop_weights, at(a * vectors + channel / 4), 0)[channel & 3];
    float brightest = max(max(abs(rgb.r), abs(rgb.g)), abs(rgb.b));
    if (!(brightest <= 65504.0)) {  // beyond half floats, or no number
        color.a = -1e4;
        return;
    }
    color.a = 1.0;
    if (!(share > 0.0)) return;
    float value = dot(rgb, vec3(${LUMINANCE.join(", ")}));
    if (role == 0) color.rgb = share * rgb;
    else if (role == 1) heat = vec4(share * value, share, 0.0, 0.0);
    else color.rgb = share * palette_color(value);
}`;

export class Shader {
    /** @param {import("./gl.js").Gpu} gpu @param {import("./arena.js").Arena} arena */
    constructor(gpu, arena) {
        this.gpu = gpu;
        this.arena = arena;
        this.ofNetworks = gpu.program(null, shadeShader(false));
        this.ofHarmonics = gpu.program(null, shadeShader(true));
    }

    /**
     * @param {SceneObject} object @param {Shade} shade @param {import("./false_colors.js").Way} way @param {number[]} eye
     * @param {WebGLTexture | null} staged @param {number} first  anchor @param {number} rows
     * @param {(control: Control, heat: boolean) => void} decode  fills the staging texture
     */
    shade(object, shade, way, eye, staged, first, rows, decode) {
        const { gpu, arena } = this, { gl } = gpu, { own } = object, model = /** @type {LayerModel} */ (object.model), program = staged ? this.ofNetworks : this.ofHarmonics;
        const heats = way === "picture" ? [] : shade.heats, kept = heats.reduce((left, heat) => left - heat.weight, 1);
        const parts = heats.map((heat) => ({ control: heat.control, role: way === "splats" ? 2 : 1, share: heat.weight, channel: own || heat.ofLayer ? heat.stop : -1, palette: heat.palette }));
        const rest = way === "picture" && shade.pure ? shade.heats[0].control : shade.rest;
        if (rest !== null) parts.unshift({ control: rest, role: 0, share: kept, channel: -1, palette: "" });
        const stops = model.stops.length, vectors = Math.ceil(stops / 4) + 1;
        parts.forEach((part, n) => {
            const each = shade.pure ? null : heats.some((heat) => heat.ofLayer) ? model.layerList : own ? own.texture : null;
            const heated = each && heats.length > 0;  // what is left for the final colours is the channel after the stops'
            decode(part.control, part.role > 0);
            program.use({
                ...(staged ? { staged: { layers: staged } } : { sh: { texture: model.shList }, anchors: { texture: model.anchorList }, coefficients: { int: model.coefficients }, eye }),
                palette: { texture: arena.paletteOf(part.palette) }, stop_weights: { texture: each ?? arena.paletteOf("") },
                per_anchor: { int: model.perAnchor }, count: { int: model.anchors }, first_anchor: { int: first }, first_row: { int: object.row },
                channel: { int: !heated ? -1 : part.role ? part.channel : 4 * (vectors - 1) }, vectors: { int: vectors },
                weight: part.share, role: { int: part.role },
            });
            if (n) { gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE); }
            gpu.fill(arena.colored, rows, object.row + (first * model.perAnchor) / WIDTH);
            gl.disable(gl.BLEND);
        });
    }

    /** Opacity of plain splats = their own times how much of their layer there is. @param {SceneObject} object @param {import("./gl.js").Program} pack */
    weighLayers(object, pack) {
        const model = /** @type {LayerModel} */ (object.model), rows = rowsOf(model.anchors), { gpu } = this, texels = new Float32Array(4 * WIDTH * rows);
        const there = (/** @type {number[]} */ weights) => weights.map((weight, layer) => (model.mode !== "cumulative" ? weight : weights.reduce((sum, w, s) => sum + (s >= layer ? w : 0), 0)));
        const all = there(model.blend.weights(object.x)), own = object.own?.weights, stops = model.stops.length;
        for (let i = 0; i < model.anchors; i++) {
            const shares = own ? there(Array.from(own.subarray(i * stops, (i + 1) * stops))) : all;
            texels[4 * i] = model.opacity[i] * Math.min(1, shares[model.layer[i]]);
        }
        gpu.updateList(model.opacityList, rows, texels);
        pack.use({
            staged: { layers: this.arena.noLayers }, anchors: { texture: model.anchorList }, frames: { texture: model.frameList ?? model.anchorList }, opacities: { texture: model.opacityList },
            per_anchor: { int: 1 }, count: { int: model.anchors }, first_anchor: { int: 0 }, first_row: { int: object.row }, source: { int: 2 }, swell: model.swell ?? 1,
        });
        gpu.fill(this.arena.shapes, object.rows, object.row);
    }
}
