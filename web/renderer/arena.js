// arena: what all objects' splats are as decoded, and what each view makes of them; as
// renderer/gl/buffers.py.  The splats of an object begin with a row of the lists.
import { MIN_ALPHA, MOST_UNIT, WIDTH } from "../conventions.js";

/** @typedef {{ellipses: WebGLTexture, rests: WebGLTexture, framebuffer: WebGLFramebuffer}} Records */
/** @typedef {{image: WebGLTexture, heat: WebGLTexture | null, framebuffer: WebGLFramebuffer, size: number[], kind: string}} Image */

export class Arena {
    /** @param {import("./gl.js").Gpu} gpu @param {number} rows @param {Record<string, Float32Array>} palettes  (256, 3) each @param {boolean} hasHeat @param {number} brightest  display value of any colour; Infinity: nobody knows */
    constructor(gpu, rows, palettes, hasHeat, brightest) {
        this.gpu = gpu;
        this.count = rows * WIDTH;
        const list = (/** @type {string} */ kind) => gpu.list(kind, this.count);
        this.meanOpacity = list("rgba32f");
        this.covariance0 = list("rgba32f");
        this.covariance1 = list("rgba32f");
        this.colors = list("rgba16f");
        this.heat = hasHeat ? list("rgba16f") : null;
        this.order = gpu.list("r32ui", this.count);  // far to near
        this.sorted = 0;  // how many the order has
        this.shapes = gpu.framebuffer(this.meanOpacity, this.covariance0, this.covariance1);
        this.means = gpu.framebuffer(this.meanOpacity);
        this.colored = gpu.framebuffer(this.colors, ...(this.heat ? [this.heat] : []));
        this.noLayers = gpu.texture("rgba8", 1, 1, null, 1);
        /** @type {Record<string, WebGLTexture>} */
        this.palettes = { "": gpu.texture("rgba32f", 256, 1) };
        for (const [name, rgb] of Object.entries(palettes)) {
            const rgba = new Float32Array(1024);
            for (let i = 0; i < 256; i++) rgba.set(rgb.subarray(3 * i, 3 * i + 3), 4 * i);
            this.palettes[name] = gpu.texture("rgba32f", 256, 1, rgba);
        }
        /** @type {Records[]} */ this.records = [];
        /** @type {Image[]} */ this.images = [];
        this.target = "rgba16f";
        this.minAlpha = MIN_ALPHA;
        this.unit = 1;  // the display value that 1 in a picture stands for
        this.blendInto(gpu.norm16 ? "rgba16" : "rgba16f", brightest);
    }

    /**
     * What splats blend into: 16 bits from 0 to the brightest colour, where such is known and the
     * device can, since many faint layers get too dark in half floats; "rgba8" is coarser still.
     * @param {string} target @param {number} brightest
     */
    blendInto(target, brightest) {
        this.target = target === "rgba16" && !(brightest <= MOST_UNIT) ? "rgba16f" : target;
        this.unit = this.target === "rgba16" ? Math.max(1, brightest) : 1;
    }

    /** @param {string} name */
    paletteOf(name) { return this.palettes[name] ?? this.palettes[""]; }

    /** Screen ellipses of a view. @param {number} view */
    recordsOf(view) {
        const { gpu } = this;
        return (this.records[view] ??= (() => {
            const ellipses = gpu.list("rgba32f", this.count), rests = gpu.list("rgba32f", this.count);
            return { ellipses, rests, framebuffer: gpu.framebuffer(ellipses, rests) };
        })());
    }

    /** The picture of a view, premultiplied; with heat a second one. @param {number} view @param {number[]} size @param {boolean} heat */
    imageOf(view, size, heat) {
        const { gpu } = this, have = this.images[view], [width, height] = size;
        if (have && have.kind === this.target && !!have.heat === heat && have.size[0] === width && have.size[1] === height) return have;
        if (have) {
            gpu.drop(have.image, have.framebuffer);
            if (have.heat) gpu.drop(have.heat, have.framebuffer);
        }
        const image = gpu.texture(this.target, width, height), second = heat ? gpu.texture(this.target, width, height) : null;
        return (this.images[view] = { image, heat: second, framebuffer: gpu.framebuffer(image, ...(second ? [second] : [])), size, kind: this.target });
    }
}
