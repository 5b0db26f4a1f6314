// regions: parts of an object with an x of their own, as scene/selectors/selector.py and
// scene/control.py have them.  Each anchor gets weights of the stops; a border shows what a shift
// from outside to inside shows on its way.
import { WIDTH } from "../conventions.js";
import { rowsOf } from "./gl.js";
import { add, conjugate, dot, length, moved, turn } from "../poses.js";
import { hasFalseColors } from "./stops.js";

/** @typedef {Exclude<import("../entries.js").RegionEntry, {kind: "painted"}>} Shape */
/** @typedef {Omit<import("../entries.js").PaintedEntry, "weight"> & {weight: ArrayLike<number>}} Painted */
/** @typedef {Shape | Painted} Region  with the table of a painted one */

/** Metres from the surface, negative inside. @param {Shape} region @param {number[]} place */
function distance(region, place) {
    if (region.kind === "sphere") return length(add(place, region.centre, -1)) - region.radius;
    if (region.kind === "half") return dot(add(place, region.point, -1), region.normal);
    const beyond = turn(conjugate(region.wxyz), add(place, region.centre, -1)).map((value, c) => Math.abs(value) - region.half[c]);
    return length(beyond.map((value) => Math.max(value, 0))) + Math.min(Math.max(...beyond), 0);
}

/** How much of a place is inside, 0 to 1. @param {Region} region @param {number[]} place @param {number} anchor */
function inside(region, place, anchor) {
    if (region.kind === "painted") return region.weight[anchor];
    const away = distance(region, place);
    if (!(region.border > 0)) return away <= 0 ? 1 : 0;
    const out = Math.min(1, Math.max(0, away / region.border));
    return 1 - out * out * (3 - 2 * out);
}

export class Regions {
    /** @param {import("./gl.js").Gpu} gpu @param {import("./renderer.js").SceneObject} object @param {Region[]} regions */
    constructor(gpu, object, regions) {
        const { model } = object, stops = model.stops.length;
        this.gpu = gpu;
        this.regions = regions;
        this.vectors = Math.ceil(stops / 4) + 1;
        this.weights = new Float32Array(stops * model.anchors);  // each anchor's, of the stops
        /** @type {number[]} */ this.most = [];  // of each stop, anywhere
        this.texture = gpu.list("rgba32f", this.vectors * model.anchors);
        this.version = 0;
        this.key = "";
    }

    /** Weights where x, or the place of the object, is another one; whether they are. @param {import("./renderer.js").SceneObject} object */
    update(object) {
        const key = JSON.stringify([object.x, this.regions.some((region) => region.space === "world") && object.pose]);
        if (key === this.key) return false;
        this.key = key;
        this.version++;
        const { model } = object, { blend, positions } = model, stops = model.stops.length, outside = blend.weights(object.x);
        const texels = new Float32Array(4 * WIDTH * rowsOf(this.vectors * model.anchors));
        this.most = outside.map(() => 0);
        for (let a = 0; a < model.anchors; a++) {
            let weights = outside;
            const place = [positions[3 * a], positions[3 * a + 1], positions[3 * a + 2]];
            for (const region of this.regions) {
                const part = inside(region, region.space === "world" ? moved(object.pose, place) : place, a);
                if (part > 0) weights = blend.weights(blend.between(weights, blend.weights(region.x), part));
            }
            this.weights.set(weights, stops * a);
            texels.set(weights, 4 * this.vectors * a);
            let kept = 1;
            for (let s = 0; s < stops; s++) {
                this.most[s] = Math.max(this.most[s], weights[s]);
                if (hasFalseColors(model.stops[s])) kept -= weights[s];
            }
            texels[4 * (this.vectors * (a + 1) - 1)] = Math.max(0, kept);
        }
        this.gpu.updateList(this.texture, rowsOf(this.vectors * model.anchors), texels);
        return true;
    }

    /** 1 for the stops that count, four by four. @param {(s: number) => boolean} counts */
    mask(counts) { return Array.from({ length: 4 * (this.vectors - 1) }, (_, s) => (counts(s) ? 1 : 0)); }
}
