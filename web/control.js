// control: how x moves by itself: a shift to a stop, or playing from stop to stop, as
// scene/control.py has them.
import { LEG_S, REST_S, SHIFT_S, SNAP } from "./conventions.js";

/** @typedef {import("./renderer/stops.js").Control} Control */
/** @typedef {import("./renderer/stops.js").StopBlend} StopBlend */

/** Smooth start and stop. @param {number} t */
const ease = (t) => t * t * (3 - 2 * t);

/** x, moved onto a stop that is near. @param {number} x @param {{x: Control}[]} stops */
export function snap(x, stops) {
    const xs = stops.map((stop) => stop.x).filter((at) => typeof at === "number"), near = xs.find((at) => Math.abs(at - x) <= SNAP);
    return near ?? x;
}

/** The control of an object on its way from where it is to where somebody wants it. */
export class Shift {
    /** @param {Control} start @param {Control} end @param {StopBlend} blend */
    constructor(start, end, blend) {
        this.seconds = 0;
        this.control = () => blend.between(start, end, ease(Math.min(1, this.seconds / SHIFT_S)));
    }

    get over() { return this.seconds >= SHIFT_S; }
}

/** Plays through the stops, there and back, resting a moment at each. */
export class Sweep {
    /** @param {StopBlend} blend @param {Control} from */
    constructor(blend, from) {
        const { xs } = blend, x = blend.sliderX(from);
        this.seconds = 0;
        this.way = [...xs, ...xs.slice(1, -1).reverse(), xs[0]];
        const leg = Math.max(0, xs.findIndex((at, i) => i + 1 < xs.length && x >= at && x < xs[i + 1]));
        if (x < xs[xs.length - 1]) {
            const part = (x - xs[leg]) / (xs[leg + 1] - xs[leg]);
            this.seconds = leg * (LEG_S + REST_S) + (part > 0 ? REST_S + LEG_S * (0.5 - Math.sin(Math.asin(1 - 2 * part) / 3)) : 0);
        } else this.seconds = (xs.length - 1) * (LEG_S + REST_S);
        this.blend = blend;
    }

    /** @param {number} seconds @returns {Control} */
    advance(seconds) {
        const { way, blend } = this, step = LEG_S + REST_S;
        if (way.length < 3) return way[0];
        this.seconds = (this.seconds + seconds) % ((way.length - 1) * step);
        const leg = Math.min(way.length - 2, Math.floor(this.seconds / step)), part = (this.seconds - leg * step - REST_S) / LEG_S;
        return blend.between(way[leg], way[leg + 1], ease(Math.min(1, Math.max(0, part))));
    }
}
