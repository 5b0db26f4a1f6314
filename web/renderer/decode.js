// decode: the networks of one object -> means, opacities, covariances (pack) and colours (shade) in
// the arena.  The shape runs on a change of x alone, colours on a change of the eye too.  Anchors go
// through in batches, so that what lies between the passes stays small.
import { BATCH_ROWS, WIDTH } from "../conventions.js";
import { lookVectors } from "./container.js";
import { rowsOf } from "./gl.js";
import { MOST_OUTPUTS, foldedBias, headNumber, layerShader, partSize, weightBlock } from "./networks.js";
import { PACK } from "./pack.js";
import { Shader } from "./shade.js";

/** @typedef {import("./gl.js").Gpu} Gpu */
/** @typedef {import("./gl.js").Program} Program */
/** @typedef {import("./stops.js").Control} Control */
/** @typedef {import("./models.js").AnchorModel} AnchorModel */
/** @typedef {import("./networks.js").Network} Network */
/** @typedef {import("./networks.js").Part} Part */
/** @typedef {import("./renderer.js").SceneObject} SceneObject */
/** @typedef {import("./false_colors.js").Shade} Shade */
/** @typedef {{first: number, rows: number}} Batch  first anchor, rows of anchors */
/** @typedef {{texture: WebGLTexture, rows: number, layers: number, framebuffers: Map<string, WebGLFramebuffer>}} Stage */

/** Where the outputs of the networks are staged, and how many vectors in all. @param {number} k */
function staging(k) {
    const triples = Math.ceil((3 * k) / 4);
    return { first: { offset: 0, scale: triples, rotation: 2 * triples, opacity: 2 * triples + k }, vectors: 2 * triples + k + Math.ceil(k / 4) };
}
const LARGEST = 3.4e38;

export class Decoder {
    /** @param {Gpu} gpu @param {import("./arena.js").Arena} arena */
    constructor(gpu, arena) {
        this.gpu = gpu;
        this.arena = arena;
        this.pack = gpu.program(null, PACK);
        this.shader = new Shader(gpu, arena);
        /** @type {Map<number, Program>} by their output vectors */
        this.programs = new Map();
        this.most = Math.min(MOST_OUTPUTS, gpu.gl.getParameter(gpu.gl.MAX_DRAW_BUFFERS));
        /** @type {Record<string, Stage>} outputs of networks, and hidden units by turns */
        this.stages = {};
        this.emptyStops = gpu.uniformBuffer(new Float32Array(64 * 4 * MOST_OUTPUTS));
        this.runs = 0;  // of networks, for who counts them
    }

    /** What the networks of a model need on the GPU; compiles their shaders early. @param {import("./models.js").Model} model */
    prepare(model) {
        const { gpu } = this;
        for (const net of Object.values("networks" in model ? model.networks : {}))
            for (const layer of net.layers) {
                const size = partSize(layer, this.most);
                layer.parts = [];
                for (let first = 0; first < layer.outs; first += size) {
                    const outs = Math.min(size, layer.outs - first), bias = new Float32Array(4 * MOST_OUTPUTS);
                    bias.set(layer.bias.subarray(4 * first, 4 * (first + outs)));
                    layer.parts.push({ first, outs, weights: gpu.uniformBuffer(weightBlock(layer, first, outs)), bias: gpu.uniformBuffer(bias), ofStops: null });
                    if (!this.programs.has(outs)) this.programs.set(outs, gpu.program(null, layerShader(outs)));
                }
            }
    }

    /** Room for `layers` vectors of each anchor of a batch. @param {string} name @param {number} rows @param {number} layers @returns {Stage} */
    stage(name, rows, layers) {
        const { gpu } = this, have = this.stages[name];
        if (have && have.rows >= rows && have.layers >= layers) return have;
        if (have) have.framebuffers.forEach((framebuffer) => gpu.drop(have.texture, framebuffer));
        rows = Math.max(rows, have?.rows ?? 0);
        layers = Math.max(layers, have?.layers ?? 0);
        return (this.stages[name] = { texture: gpu.texture("rgba32f", WIDTH, rows, null, layers), rows, layers, framebuffers: new Map() });
    }

    /**
     * One network for the anchors of a batch, into layers of the stage "out" from `layer` on.
     * @param {SceneObject} object @param {string} name @param {Control | null} control  null: the object's own weights, times `mask`
     * @param {Batch} batch @param {number} layer @param {number[]} eye @param {number[]} mask
     */
    run(object, name, control, batch, layer, eye = [0, 0, 0], mask = []) {
        const model = /** @type {AnchorModel} */ (object.model), net = model.networks[name], { gpu } = this, stops = control === null && net.control ? model.stops.length : 0;
        if (control !== null && net.control) this.fold(net, model.blend.psi(model.encoding, control));
        else if (net.control) this.fold(net, new Float64Array(model.encoding.d));
        let inputs = model.featureLayers, inputRow = batch.first / WIDTH;
        net.layers.forEach((of, l) => {
            const last = l + 1 === net.layers.length, target = last ? this.stages.out : this.stage(`hidden${l % 2}`, batch.rows, of.outs), looks = net.looks && !l;
            for (const part of of.parts) {
                const program = /** @type {Program} */ (this.programs.get(part.outs)), first = part.first + (last ? layer : 0), key = `${first} ${part.outs}`;
                let framebuffer = target.framebuffers.get(key);
                if (!framebuffer) target.framebuffers.set(key, (framebuffer = gpu.framebufferOfLayers(target.texture, first, part.outs)));
                program.use({
                    inputs: { layers: inputs }, anchors: { texture: model.anchorList }, stop_weights: { texture: object.own?.texture ?? model.anchorList }, light: { texture: model.lightList ?? model.anchorList }, lit: { int: looks && model.light ? model.light.width / 8 : 0 },
                    first_anchor: { int: batch.first }, count: { int: model.anchors }, input_row: { int: inputRow }, ins: { int: of.ins - (looks ? (name === "color" ? lookVectors(model) : 1) : 0) },
                    looks: { int: looks ? 1 : 0 }, stops: { int: l ? 0 : stops }, head: { int: headNumber(last ? net.head : "relu") },
                    low: last ? net.clip[0] : -LARGEST, high: last ? net.clip[1] : LARGEST, gain: last ? net.gain : 1, eye,
                    ...(stops && !l ? { mask: { vec4s: mask } } : {}),
                });
                program.useBlocks({ Weights: part.weights, Bias: part.bias, Stops: stops && !l ? this.stopsOf(net, model, part) : this.emptyStops });
                gpu.fill(framebuffer, batch.rows);
            }
            [inputs, inputRow] = [target.texture, 0];
        });
        this.runs++;
    }

    /** Psi into the first biases. @param {Network} net @param {Float64Array} psi */
    fold(net, psi) {
        const [layer] = net.layers, bias = foldedBias(layer.bias, net.control, psi);
        for (const { first, outs, bias: buffer } of layer.parts) this.gpu.updateUniforms(buffer, bias.subarray(4 * first, 4 * (first + outs)));
    }

    /** What each stop adds to a part of the first layer: C Psi(x_s). @param {Network} net @param {AnchorModel} model @param {Part} part */
    stopsOf(net, model, part) {
        if (part.ofStops) return part.ofStops;
        const values = new Float32Array(64 * 4 * MOST_OUTPUTS), none = new Float32Array(net.layers[0].bias.length);
        model.stops.forEach((stop, s) =>
            values.set(foldedBias(none, net.control, model.blend.psi(model.encoding, stop.x)).subarray(4 * part.first, 4 * (part.first + part.outs)), 4 * s * part.outs));
        return (part.ofStops = this.gpu.uniformBuffer(values));
    }

    /** Means, opacities and covariances at the object's control. @param {SceneObject} object */
    decodeShape(object) {
        const { model } = object, k = model.perAnchor, { arena, gpu } = this;
        if (model.kind === "layers") return this.shader.weighLayers(object, this.pack);
        for (const batch of batchesOf(model)) {
            const { texture } = this.stage("out", batch.rows, staging(k).vectors);
            for (const [name, layer] of Object.entries(staging(k).first))
                this.run(object, name, object.own ? null : object.x, batch, layer, undefined, object.own?.mask(() => true));
            this.pack.use({
                staged: { layers: texture }, anchors: { texture: model.anchorList }, frames: { texture: model.frameList ?? model.anchorList }, opacities: { texture: model.anchorList },
                per_anchor: { int: k }, count: { int: model.anchors }, first_anchor: { int: batch.first },
                first_row: { int: object.row }, source: { int: model.frameList ? 1 : 0 }, swell: model.swell ?? 1,
            });
            gpu.fill(arena.shapes, splatRows(batch, object), object.row + (batch.first * k) / WIDTH);
        }
    }

    /** Colours, and heat, towards an eye in the object's frame. @param {SceneObject} object @param {Shade} shade @param {import("./false_colors.js").Way} way @param {number[]} eye */
    decodeColors(object, shade, way, eye) {
        const { model } = object, k = model.perAnchor;
        if (model.kind === "layers") return this.shader.shade(object, shade, way, eye, null, 0, object.rows, () => {});
        const measured = new Set(shade.heats.map((heat) => heat.stop)), mixed = object.own && !shade.pure;
        for (const batch of batchesOf(model)) {
            const { texture } = this.stage("out", batch.rows, staging(k).vectors);
            this.shader.shade(object, shade, way, eye, texture, batch.first, splatRows(batch, object), (control, heat) =>
                this.run(object, "color", mixed && !heat ? null : control, batch, 0, eye, object.own?.mask((/** @type {number} */ s) => !measured.has(s))));
        }
    }
}

/** @param {AnchorModel} model @returns {Batch[]} */
function batchesOf(model) {
    const rows = rowsOf(model.anchors), out = [];
    for (let row = 0; row < rows; row += BATCH_ROWS) out.push({ first: row * WIDTH, rows: Math.min(BATCH_ROWS, rows - row) });
    return out;
}

/** Rows of the arena that a batch fills. @param {Batch} batch @param {SceneObject} object */
const splatRows = (batch, object) => Math.min(batch.rows * object.model.perAnchor, object.rows - (batch.first * object.model.perAnchor) / WIDTH);
