// resolve: a premultiplied picture over a background, as renderer/shaders/resolve.frag.  A palette
// makes its colours of the picture's luminance, or adds those of its heat.  A palette colours what
// is there and not the background: values are divided by alpha first.
import { LUMINANCE } from "../conventions.js";
import { PALETTE_COLOR } from "./shade.js";

const RESOLVE = `
uniform sampler2D image, heat, palette;
uniform bool use_palette, use_heat;
uniform vec3 background;       // display sRGB
uniform vec2 corner, scale;    // pixels of the viewport -> the picture's 0..1
uniform float unit;            // the display value that 1 in the picture stands for
uniform float passes_through;  // 1: alpha goes out too (AR)
out vec4 shown;
${PALETTE_COLOR}
void main() {
    vec2 place = (gl_FragCoord.xy - corner) * scale;
    vec4 rgba = texture(image, place) * vec4(vec3(unit), 1.0);
    if (use_heat) {
        vec2 value_weight = texture(heat, place).rg;
        rgba.rgb += palette_color(unit * value_weight.x / max(value_weight.y, 1e-6)) * value_weight.y;
    } else if (use_palette) {
        rgba.rgb = palette_color(dot(rgba.rgb, vec3(${LUMINANCE.join(", ")})) / max(rgba.a, 1e-6)) * rgba.a;
    }
    shown = mix(vec4(rgba.rgb + (1.0 - rgba.a) * background, 1.0), rgba, passes_through);
}`;

export class Resolver {
    /** @param {import("./gl.js").Gpu} gpu @param {import("./arena.js").Arena} arena */
    constructor(gpu, arena) {
        this.gpu = gpu;
        this.arena = arena;
        this.program = gpu.program(null, RESOLVE);
    }

    /**
     * @param {number} view @param {WebGLFramebuffer | null} target @param {number[]} viewport  x y width height
     * @param {number[]} background @param {{way: string, palette: string}} colors @param {number} passesThrough
     */
    draw(view, target, viewport, background, { way, palette }, passesThrough = 0) {
        const { gl } = this.gpu, [x, y, width, height] = viewport, { image, heat } = this.arena.images[view];
        const smaller = this.arena.images[view].size[0] < width;
        for (const texture of [image, heat]) {
            if (texture) gl.bindTexture(gl.TEXTURE_2D, texture);
            if (texture) gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, smaller ? gl.LINEAR : gl.NEAREST);
        }
        gl.bindFramebuffer(gl.FRAMEBUFFER, target);
        gl.viewport(x, y, width, height);
        this.program.use({
            image: { texture: image }, heat: { texture: heat ?? image }, palette: { texture: this.arena.paletteOf(palette) },
            use_palette: { int: way === "picture" ? 1 : 0 }, use_heat: { int: way === "beside" && heat ? 1 : 0 },
            background, unit: this.arena.unit, corner: [x, y], scale: [1 / width, 1 / height], passes_through: passesThrough,
        });
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
}
