// models: what a scene's models are on the GPU, once, however many objects have one.
import { WIDTH } from "../conventions.js";
import { rowsOf } from "./gl.js";
import { hasFalseColors, StopBlend } from "./stops.js";

/** @typedef {import("./gl.js").Gpu} Gpu */
/** @typedef {import("./container.js").Container} Container */
/** @typedef {import("./container.js").Table} Table */
/** @typedef {Omit<import("../entries.js").AnchorsEntry, "positions"> & Lists} Anchors */
/** @typedef {Omit<import("../entries.js").LayersEntry, "positions"> & Lists} Layers */
/** @typedef {{blend: StopBlend, positions: Float32Array, anchorList: WebGLTexture, frameList: WebGLTexture | null}} Lists  of any kind of model */
/** @typedef {ReturnType<typeof loadNetworks>} AnchorModel */
/** @typedef {ReturnType<typeof loadLayers>} LayerModel */
/** @typedef {AnchorModel | LayerModel} Model */

/** A model with its lists; `described` is checked already. @param {Gpu} gpu @param {import("./container.js").ModelEntry} described @param {Container} container @returns {Model} */
export function loadModel(gpu, described, { array, table }) {
    const count = described.anchors, positions = table(described.positions, count);
    const lists = {
        blend: new StopBlend(described.stops, described.pace ?? [], described.direct === true), positions,
        anchorList: gpu.list("rgba32f", count, vec4s(positions, 3)),
        frameList: described.scales ? gpu.list("rgba32f", 2 * count, pairs(table(described.scales, count), table(/** @type {Table} */ (described.wxyz), count))) : null,
    };
    return described.kind === "layers" ? loadLayers(gpu, { ...described, ...lists }, array, table) : loadNetworks(gpu, { ...described, ...lists }, array, table);
}

/** @param {Gpu} gpu @param {Anchors} model @param {Container["array"]} array @param {Container["table"]} table */
function loadNetworks(gpu, model, array, table) {
    const floats = (/** @type {import("./container.js").Section} */ section) => /** @type {Float32Array} */ (array(section));
    /** @type {Record<string, import("./networks.js").Network>} */
    const networks = Object.fromEntries(Object.entries(model.networks).map(([name, net]) => [name, {
        ...net, control: net.control ? floats(net.control) : null,
        layers: net.layers.map((layer) => ({ ...layer, bias: floats(layer.bias), weights: floats(layer.weights), parts: [] })),
    }]));
    const shapes = ["offset", "scale", "rotation", "opacity"];
    return {
        ...model, networks, featureLayers: layers(gpu, table(model.features, model.anchors), model.anchors, model.featureVecs),
        lightList: model.light ? gpu.list("rgba32f", (model.light.width / 4) * model.anchors, table(model.light, model.anchors)) : null,
        colorsFollow: !!networks.color.control, colorsLook: networks.color.looks, shapeFollows: shapes.some((name) => networks[name].control),
    };
}

/** Vector i of each anchor in layer i. @param {Gpu} gpu @param {Float32Array} features @param {number} count @param {number} vectors */
function layers(gpu, features, count, vectors) {
    const rows = rowsOf(count), planes = new Float32Array(4 * WIDTH * rows * vectors);
    for (let v = 0; v < vectors; v++)
        for (let a = 0, to = 4 * WIDTH * rows * v, from = 4 * v; a < count; a++, to += 4, from += 4 * vectors)
            for (let c = 0; c < 4; c++) planes[to + c] = features[from + c];
    return gpu.texture("rgba32f", WIDTH, rows, planes, vectors);
}

/** Plain splats: lists of what networks would have made. @param {Gpu} gpu @param {Layers} model @param {Container["array"]} array @param {Container["table"]} table */
function loadLayers(gpu, model, array, table) {
    const count = model.anchors, layer = array(model.layer), stops = model.stops.length, vectors = Math.ceil(stops / 4) + 1;
    const harmonics = joined(table(model.sh, count), model.shRest ? table(model.shRest, count) : new Float32Array(0), count), exclusive = new Float32Array(4 * vectors * count);
    for (let i = 0; i < count; i++) {
        exclusive[4 * vectors * i + layer[i]] = 1;
        exclusive[4 * vectors * i + 4 * (vectors - 1)] = hasFalseColors(model.stops[layer[i]]) ? 0 : 1;
    }
    return {
        ...model, layer, opacity: table(model.opacity, count), shList: gpu.list("rgba32f", harmonics.length / 4, harmonics),
        opacityList: gpu.list("rgba32f", count), layerList: gpu.list("rgba32f", vectors * count, exclusive),
        colorsFollow: false, colorsLook: model.coefficients > 1, shapeFollows: true,
    };
}

/** Harmonics of each splat side by side, filled up to whole texels. @param {Float32Array} first @param {Float32Array} rest @param {number} count */
function joined(first, rest, count) {
    const width = 3 + rest.length / count, out = new Float32Array(4 * Math.ceil((width * count) / 4));
    for (let i = 0; i < count; i++) {
        out.set(first.subarray(3 * i, 3 * i + 3), width * i);
        out.set(rest.subarray((width - 3) * i, (width - 3) * (i + 1)), width * i + 3);
    }
    return out;
}

/** @param {Float32Array} values @param {number} width  numbers a row, at most 4 */
function vec4s(values, width) {
    const count = values.length / width, out = new Float32Array(4 * count);
    for (let i = 0; i < count; i++) for (let c = 0; c < width; c++) out[4 * i + c] = values[width * i + c];
    return out;
}

/** Scales, stored by their logarithm, and quaternion of each, side by side. @param {Float32Array} scales @param {Float32Array} wxyz */
function pairs(scales, wxyz) {
    const count = wxyz.length / 4, out = new Float32Array(8 * count);
    for (let i = 0; i < count; i++) {
        for (let c = 0; c < 3; c++) out[8 * i + c] = Math.exp(scales[3 * i + c]);
        out.set(wxyz.subarray(4 * i, 4 * i + 4), 8 * i + 4);
    }
    return out;
}
