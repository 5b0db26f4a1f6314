// container: reads what runtime_models/web/web_model.py wrote: 8 bytes "SHIFTWEB", length of
// the JSON (uint32), the JSON, then arrays at multiples of 4.  The file is a stranger's: nothing in
// it runs, and every count and length is checked here, before anything is allocated for it.
import { MOST_ANCHORS, MOST_SPLATS, MOST_BYTES, MOST_WEIGHTS } from "../conventions.js";

// What Python writes; whether it is what a file has, checkScene asks.
/** @typedef {import("../entries.js").SceneEntry} SceneEntry */
/** @typedef {import("../entries.js").ModelEntry} ModelEntry */
/** @typedef {import("../entries.js").NetworkEntry} NetworkEntry */
/** @typedef {import("../entries.js").RegionEntry} RegionEntry */
/** @typedef {import("../entries.js").Section} Section  type, byte offset, count of numbers */
/** @typedef {import("../entries.js").TableEntry} Table  codes between the ends of each column */
/** @typedef {{scene: SceneEntry, array: (section: Section) => Float32Array | Uint16Array | Uint8Array,
 *   table: (table: Table, rows: number) => Float32Array}} Container */

const MAGIC = "SHIFTWEB";
/** @typedef {import("../entries.js").SectionKind} Kind */
/** @type {Record<Exclude<Kind, `p${number}`>, Float32ArrayConstructor | Uint16ArrayConstructor | Uint8ArrayConstructor>} */
const TYPES = { f32: Float32Array, f16: Uint16Array, u16: Uint16Array, u8: Uint8Array };
/** @type {Record<Extract<Kind, `p${number}`>, number>} */
const PLANES = { p8: 1, p16: 2, p24: 3 };  // bytes a code, all lowest bytes first: such deflate better

class BadScene extends Error {}

/** @param {string} sentence @returns {never} */
export function refuse(sentence) {
    throw new BadScene(sentence);
}

/** @param {any} value @param {number} least @param {number} most @param {string} what */
export function whole(value, least, most, what) {
    if (!(Number.isInteger(value) && value >= least && value <= most))
        refuse(`${what} is ${String(value).slice(0, 20)}, and ${least} to ${most} is wanted`);
    return /** @type {number} */ (value);
}

/** @param {any} value @param {number} count @param {string} what @returns {number[]} */
export function numbers(value, count, what) {
    if (!(Array.isArray(value) && value.length === count && value.every(Number.isFinite)))
        refuse(`${what} is not made of ${count} finite numbers`);
    return value;
}

/** @param {ArrayBuffer} buffer @returns {Container} */
export function readContainer(buffer) {
    const bytes = new Uint8Array(buffer);
    if (bytes.length < 12 || String.fromCharCode(...bytes.subarray(0, 8)) !== MAGIC) refuse("this is no scene for a web page");
    const length = new DataView(buffer).getUint32(8, true), start = (12 + length + 3) & ~3;
    if (!(12 + length <= bytes.length)) refuse("the scene is cut off");
    let scene;
    try {
        scene = JSON.parse(new TextDecoder("utf-8", { fatal: true }).decode(bytes.subarray(12, 12 + length)));
    } catch {
        refuse("the scene's table of contents is damaged");
    }
    if (!scene || typeof scene !== "object") refuse("the scene's table of contents is damaged");

    const array = (/** @type {any} */ section) => {
        const [type, offset, count] = Array.isArray(section) ? section : [];
        const size = /** @type {any} */ (PLANES)[type] ?? /** @type {any} */ (TYPES)[type]?.BYTES_PER_ELEMENT;
        const inside = Number.isInteger(offset) && Number.isInteger(count) && offset >= 0 && count >= 0 && offset % 4 === 0;
        if (!(size && inside && start + offset + count * size <= bytes.length)) refuse("the scene is cut off");
        if (type in PLANES) return bytes.subarray(start + offset, start + offset + count * size);
        return new (/** @type {any} */ (TYPES)[type])(buffer, start + offset, count);
    };
    const table = (/** @type {Table} */ coded, /** @type {number} */ rows) => {
        const width = whole(coded?.width, 1, 1024, "the width of a table"), ends = array(coded.ends), type = coded.codes?.[0];
        if (type === "f32") {
            const values = array(coded.codes);
            if (values.length !== rows * width) refuse("the scene's tables do not fit its counts");
            return /** @type {Float32Array} */ (values);
        }
        if (!(type in PLANES) || coded.codes[2] !== rows * width || coded.ends[0] !== "f32" || ends.length !== 2 * width)
            refuse("the scene's tables do not fit its counts");
        return decodeColumns(array(coded.codes), ends, rows, width, /** @type {any} */ (PLANES)[type], /** @type {number} */ (coded.most));
    };
    return { scene, array, table };
}

/**
 * Codes between the ends of their column, lows first, then highs, as feature_codes.py has them.
 * @param {Uint8Array} codes @param {Float32Array} ends @param {number} rows @param {number} width
 * @param {number} planes @param {number} most
 */
function decodeColumns(codes, ends, rows, width, planes, most) {
    whole(most, 1, 256 ** planes - 1, "the largest code of a table");
    const out = new Float32Array(rows * width), count = rows * width;
    for (let c = 0; c < width; c++) {
        const low = ends[c], step = (ends[width + c] - low) / most;
        for (let i = c; i < count; i += width) {
            let code = codes[i];
            if (planes > 1) code += 256 * codes[count + i];
            if (planes > 2) code += 65536 * codes[2 * count + i];
            out[i] = low + code * step;
        }
    }
    return out;
}

/**
 * What the shaders loop over must be what is there: a wrong count could hold a driver for minutes.
 * @param {Container} container
 */
export function checkScene({ scene, array }) {
    if (scene.format !== "shapeshift web 1") refuse("the scene is of another version; export it again");
    numbers(scene.background, 3, "the background");
    numbers(scene.view?.eye, 3, "the first view");
    numbers(scene.view?.target, 3, "the first view");
    numbers([scene.view?.fovY, scene.radius], 2, "the first view");
    if (!(scene.view.fovY > 0 && scene.view.fovY < 3.1 && scene.radius > 0)) refuse("the first view is none");
    const lists = [scene.models, scene.objects];
    if (!lists.every((list) => Array.isArray(list) && list.length >= 1 && list.length <= 256)) refuse("the scene has no object, or too many");
    let splats = 0;
    for (const model of scene.models) checkModel(model, array);
    for (const object of scene.objects) {
        const model = scene.models[whole(object?.model, 0, scene.models.length - 1, "the model of an object")];
        splats += model.anchors * model.perAnchor;
        if (typeof object.name !== "string") refuse("an object has no name");
        numbers(object.position, 3, "the place of an object");
        numbers(object.wxyz, 4, "the turn of an object");
        numbers([...numbers(object.centre, 3, "the middle of an object"), object.radius], 4, "the size of an object");
        checkControl(object.x, model.stops.length);
        checkRegions(object.regions ?? [], model.stops.length);
    }
    if (!(splats <= MOST_SPLATS)) refuse(`the scene has ${splats} splats, and a page shows at most ${MOST_SPLATS}`);
    for (const palette of Object.values(scene.palettes ?? {}))
        if (palette?.width !== 3 || palette.codes?.[2] !== 768) refuse("a palette has not 256 colours");
}

/** @param {RegionEntry[]} regions @param {number} stops */
function checkRegions(regions, stops) {
    whole(Array.isArray(regions) ? regions.length : -1, 0, 64, "the count of regions");
    const fields = /** @type {{[K in RegionEntry["kind"]]: [keyof Extract<RegionEntry, {kind: K}>, number][]}} */ ({
        sphere: [["centre", 3]], box: [["centre", 3], ["half", 3], ["wxyz", 4]], half: [["point", 3], ["normal", 3]], painted: [],
    });
    for (const region of regions) {
        if (!Object.hasOwn(fields, region?.kind)) refuse("a region is of a kind that this page does not know");
        for (const [name, count] of fields[region.kind]) numbers(/** @type {any} */ (region)[name], count, "a region");
        if (region.kind === "sphere") numbers([region.radius], 1, "a region");
        if (region.kind === "painted" ? region.weight?.width !== 1 : !Number.isFinite(region.border)) refuse("a region is not whole");
        checkControl(region.x, stops);
    }
}

/** @param {import("../entries.js").ControlEntry} x @param {number} stops */
function checkControl(x, stops) {
    const sound = (/** @type {any} */ value) => value >= 0 && value <= 1;
    if (!(sound(x) && typeof x === "number") && !(Array.isArray(x) && x.length === stops && x.every(sound))) refuse("the x of an object is not from 0 to 1");
}

/** @param {ModelEntry} model @param {Container["array"]} array */
function checkModel(model, array) {
    const anchors = whole(model?.anchors, 1, MOST_ANCHORS, "the count of anchors"), k = whole(model.perAnchor, 1, 64, "the count of splats an anchor");
    whole(anchors * k, 1, MOST_SPLATS, "the count of splats");
    const stops = Array.isArray(model.stops) ? model.stops : [];
    whole(stops.length, 1, 64, "the count of stops");
    for (const stop of stops) {
        if (typeof stop?.name !== "string" || !(stop.x >= 0 && stop.x <= 1)) refuse("a stop has no name or no place");
        if (stop.valueRange) numbers(stop.valueRange, 2, "the value range of a stop");
    }
    for (const pace of model.pace ?? []) {
        whole(pace.start, 0, stops.length - 1, "a stop of a pace");
        whole(pace.end, 0, stops.length - 1, "a stop of a pace");
        const { blend } = pace;
        numbers(blend, whole(blend?.length, 2, 4096, "the length of a pace"), "a pace");
        if (!blend.every((/** @type {number} */ v, /** @type {number} */ i) => v >= (i ? blend[i - 1] : 0) && v <= 1)) refuse("a pace does not rise from 0 to 1");
    }
    if (model.kind === "layers") {
        const coefficients = whole(model.coefficients, 1, 16, "the count of harmonics");
        const rest = coefficients > 1 ? model.shRest?.width === 3 * coefficients - 3 : !model.shRest;
        if (![1, 4, 9, 16].includes(coefficients) || model.sh?.width !== 3 || !rest) refuse("the scene's harmonics are of no known degree");
        if (model.perAnchor !== 1 || array(model.layer).length !== anchors) refuse("the scene's tables do not fit its counts");
        for (const layer of Array.from(array(model.layer))) if (!(layer < stops.length)) refuse("a splat is of a layer that is not there");
        return;
    }
    if (model.kind !== "anchors") refuse("the scene has a model of a kind that this page does not know");
    const features = whole(model.featureVecs, 1, 64, "the width of the features"), { d, spacing, sigma } = model.encoding ?? {};
    whole(d, 1, 256, "the width of the control encoding");
    if (!(Number.isFinite(spacing) && sigma > 0)) refuse("the control encoding is none");
    if (model.features?.width !== 4 * features) refuse("the scene's tables do not fit its counts");
    if (model.light && !([8, 24].includes(model.light.width) && model.networks?.color?.looks)) refuse("the scene's tables do not fit its counts");
    /** @type {Record<string, number>} */
    const vectors = { offset: Math.ceil((3 * k) / 4), scale: Math.ceil((3 * k) / 4), rotation: k, opacity: Math.ceil(k / 4), color: Math.ceil((3 * k) / 4) };
    for (const [name, outs] of Object.entries(vectors)) checkNetwork(model.networks?.[name], features, name === "color" ? lookVectors(model) : 1, outs, d, array);
}

/** How many vectors the colours' network takes of the eye: the direction and light of one channel, or of three. @param {{light?: {width: number}}} model */
export const lookVectors = (model) => (model.light?.width === 24 ? 2 : 1);

/** @param {NetworkEntry} net @param {number} features @param {number} looks  vectors @param {number} outs @param {number} d @param {Container["array"]} array */
function checkNetwork(net, features, looks, outs, d, array) {
    const wrong = "the scene's networks do not fit together";
    if (!Array.isArray(net?.layers) || !(net.layers.length >= 1 && net.layers.length <= 4)) refuse(wrong);
    numbers([...numbers(net.clip, 2, "the clip of a network"), net.gain], 3, "the gain of a network");
    let before = features + (net.looks ? looks : 0), weights = 0;
    for (const layer of net.layers) {
        if (layer.ins !== before) refuse(wrong);
        before = whole(layer.outs, 1, 64, "the width of a network");
        weights += 16 * layer.ins * layer.outs;
        if (array(layer.bias).length !== 4 * layer.outs || array(layer.weights).length !== 16 * layer.outs * layer.ins) refuse(wrong);
    }
    if (before !== outs || !(weights <= MOST_WEIGHTS)) refuse(wrong);
    if (net.control && array(net.control).length !== 4 * net.layers[0].outs * d) refuse(wrong);
}

/**
 * Inflates until `most` bytes and no further: a few bytes may stand for very many.
 * @param {ReadableStream<any>} stream  a deflate stream @param {number} most @returns {Promise<ArrayBuffer>}
 */
export async function inflate(stream, most = MOST_BYTES) {
    const reader = stream.pipeThrough(new DecompressionStream("deflate")).getReader();
    /** @type {Uint8Array[]} */
    const parts = [];
    let length = 0;
    for (;;) {
        const { done, value } = await reader.read().catch(() => refuse("the scene is damaged"));
        if (done) break;
        length += value.length;
        if (!(length <= most)) {
            await reader.cancel().catch(() => {});
            refuse(`the scene is larger than ${Math.round(most / 1e6)} MB`);
        }
        parts.push(value);
    }
    const out = new Uint8Array(length);
    let at = 0;
    for (const part of parts) {
        out.set(part, at);
        at += part.length;
    }
    return out.buffer;
}

/**
 * The bytes inside the page, base64 of a deflate stream whose length inflated the page says.
 * @param {HTMLElement} inline
 */
export function readInline(inline) {
    const length = whole(Number(inline.dataset.bytes), 12, MOST_BYTES, "the size of the scene");
    let text;
    try {
        text = atob(inline.textContent ?? "");
    } catch {
        refuse("the scene is damaged");
    }
    const packed = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
    inline.remove();  // a megabyte of text that nobody needs again
    return inflate(new Blob([packed]).stream(), length);
}

/** A file beside the page. @param {string} name */
export async function readBeside(name) {
    const answer = await fetch(name).catch(() => refuse("the scene beside this page cannot be read; a folder needs a server"));
    if (!answer.ok || !answer.body) refuse(`the server answers ${answer.status} for ${name}`);
    return inflate(answer.body);
}
