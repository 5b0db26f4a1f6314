// splat: draws the sorted ellipses back to front, as renderer/shaders/splat.vert and splat.frag.
// Splats are pulled by gl_VertexID: an instance a splat, the usual way of the web, costs software GL
// 2.4 to 7 times as much.  A quad of two triangles covers 23 % fewer pixels than one triangle, and
// by indices its four corners are made once and not six times.
import { MAX_ALPHA } from "../conventions.js";

const vertexShader = (/** @type {boolean} */ heat) => `
uniform highp usampler2D order;          // far to near
uniform sampler2D ellipses, rests, colors;
${heat ? "uniform sampler2D heats;\nflat out vec2 value_weight;" : ""}
uniform vec2 size;                       // pixels
uniform float per_unit;                  // 1 over the display value that 1 in the picture stands for
out vec2 sigmas;                         // place in the ellipse's own axes
flat out vec4 color_opacity;
uniform int first;                       // splat of this draw's first vertex

void main() {
    int i = first + (gl_VertexID >> 2), corner = gl_VertexID & 3;
    ivec2 here = at(int(texelFetch(order, at(i), 0).r));
    vec4 e = texelFetch(ellipses, here, 0), r = texelFetch(rests, here, 0), rgba = texelFetch(colors, here, 0);
    float along = length(e.zw);
    vec2 minor = along > 0.0 ? vec2(-e.w, e.z) * (r.x / along) : vec2(0.0);
    sigmas = r.y * vec2(2 * (corner & 1) - 1, (corner & 2) - 1);
    vec2 pixel = e.xy + sigmas.x * e.zw + sigmas.y * minor;
    color_opacity = vec4(rgba.rgb * per_unit, r.z);
    ${heat ? "value_weight = texelFetch(heats, here, 0).xy * vec2(per_unit, 1.0);" : ""}
    gl_Position = vec4(rgba.a < 0.0 ? vec2(-4.0) : 2.0 * pixel / size - 1.0, 0.0, 1.0);
}`;

const fragmentShader = (/** @type {boolean} */ heat) => `
in vec2 sigmas;
flat in vec4 color_opacity;
uniform float min_alpha;
layout(location = 0) out vec4 premultiplied;
${heat ? "flat in vec2 value_weight;\nlayout(location = 1) out vec4 heat;" : ""}

void main() {
    float alpha = min(${MAX_ALPHA}, color_opacity.a * exp(-0.5 * dot(sigmas, sigmas)));
    if (!(alpha >= min_alpha)) discard;
    premultiplied = vec4(color_opacity.rgb * alpha, alpha);
    // Value and weight are blended as the colours are.
    ${heat ? "heat = vec4(value_weight * alpha, 0.0, alpha);" : ""}
}`;

const QUADS = 16384;  // of one draw: the corners that 16-bit indices reach

export class Splatter {
    /** @param {import("./gl.js").Gpu} gpu @param {import("./arena.js").Arena} arena */
    constructor(gpu, arena) {
        this.gpu = gpu;
        this.arena = arena;
        const indices = new Uint16Array(6 * QUADS);
        for (let i = 0; i < QUADS; i++) indices.set([0, 1, 2, 2, 1, 3].map((corner) => 4 * i + corner), 6 * i);
        this.quads = gpu.indexBuffer(indices);
        this.plain = gpu.program(vertexShader(false), fragmentShader(false));
        /** @type {import("./gl.js").Program | null} */
        this.heated = null;
    }

    /**
     * @param {number} view @param {number[]} size  pixels @param {boolean} heat
     * @param {{target: WebGLFramebuffer | null, viewport: number[], ground: number[]} | null} direct  into there and over this; null: into the view's picture
     */
    draw(view, size, heat, direct = null) {
        const { arena, gpu } = this, { gl } = gpu, records = arena.recordsOf(view), framebuffer = direct ? direct.target : arena.imageOf(view, size, heat).framebuffer;
        const [x, y, width, height] = direct?.viewport ?? [0, 0, ...size], [r, g, b, a] = direct?.ground ?? [0, 0, 0, 0];
        if (heat) this.heated ??= gpu.program(vertexShader(true), fragmentShader(true));
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        gl.viewport(x, y, width, height);
        gl.clearColor(r, g, b, a);
        gl.enable(gl.SCISSOR_TEST);  // the other eye's half stays
        gl.scissor(x, y, width, height);
        gl.clear(gl.COLOR_BUFFER_BIT);
        gl.disable(gl.SCISSOR_TEST);
        if (!arena.sorted) return;
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
        const program = heat && this.heated ? this.heated : this.plain;
        program.use({
            order: { texture: arena.order }, ellipses: { texture: records.ellipses }, rests: { texture: records.rests }, colors: { texture: arena.colors },
            ...(heat && arena.heat ? { heats: { texture: arena.heat } } : {}), size, min_alpha: arena.minAlpha, per_unit: direct ? 1 : 1 / arena.unit,
        });
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.quads);
        for (let first = 0; first < arena.sorted; first += QUADS) {
            program.set({ first: { int: first } });
            gl.drawElements(gl.TRIANGLES, 6 * Math.min(QUADS, arena.sorted - first), gl.UNSIGNED_SHORT, 0);
        }
        gl.disable(gl.BLEND);
    }
}
