// sharpness: what pictures in a headset leave out to be in time, and what each of it costs.  The
// limit there is pixels, not splats: an eye 1 m from the demo blends 58 million fragments.  Prices
// are the least PSNR of docs/bench/chart/workshop/rows.csv, of "direct" that of docs/web.md.
import { MIN_ALPHA, RESORT_DEGREES } from "../conventions.js";

/** @typedef {{minAlpha: number, direct: boolean, resortDegrees: number, recolorDegrees: number, foveation: number, rate: number}} Levers */

/** @type {Levers} what a page draws with */
export const EXACT = { minAlpha: MIN_ALPHA, direct: false, resortDegrees: RESORT_DEGREES, recolorDegrees: 0, foveation: 0, rate: 0 };
/** @type {Record<import("../entries.js").SceneEntry["profile"], Levers>} */
const PROFILES = {
    any: { ...EXACT, recolorDegrees: 2 },
    quest: { minAlpha: 2 / 255, direct: true, resortDegrees: 5, recolorDegrees: 2, foveation: 1, rate: 72 },
};
/** @type {[number, number][]} image scale, dB */
const SCALE_PRICES = [[0.75, 34], [0.5, 28]];
const SCALE_STEP = 0.05, LEAST_SCALE = 0.5, WINDOW = 20, LATE = 1.15;  // frames that are looked at together; times the display's period
const FIRST_PATIENCE = 6, MOST_PATIENCE = 192;  // windows in time before more pixels are tried
const PAUSE_MS = 2000;  // a headset that was put away is not late

/** What a scene asks for; of a stranger's word for it only the known ones count. @param {keyof typeof PROFILES} name @returns {Levers} */
export const leversOf = (name) => (typeof name === "string" && Object.hasOwn(PROFILES, name) ? PROFILES[name] : PROFILES.any);

/** Each lever in words with its price. @param {Levers} levers @returns {string[]} */
export function priced(levers) {
    return [
        levers.minAlpha > MIN_ALPHA ? `alpha from ${Math.round(255 * levers.minAlpha)}/255: 46 dB` : "",
        levers.direct ? "8 bits, blended directly: 48 dB" : "",
        `sorted after ${levers.resortDegrees}°: ${levers.resortDegrees > 1 ? 51 : 61} dB`,
        levers.recolorDegrees ? `colours after ${levers.recolorDegrees}°: 69 dB` : "",
        levers.foveation ? "coarser towards the edge: not measured" : "",
    ].filter(Boolean);
}

/** The image scale that keeps the display's rate, from the time between frames. */
export class Sharpness {
    /** @param {number} period  of the display, ms @param {boolean} automatic */
    constructor(period, automatic = true) {
        this.period = period;
        this.automatic = automatic;
        this.scale = 1;
        this.sum = this.frames = this.calm = 0;
        this.patience = FIRST_PATIENCE;
        this.raised = false;  // by the last change
    }

    /** A frame that came `ms` after the one before. @param {number} ms */
    step(ms) {
        if (!this.automatic) this.scale = 1;
        if (!this.automatic || !(ms > 0 && ms < PAUSE_MS)) return;
        this.sum += ms;
        if (++this.frames < WINDOW) return;
        const mean = this.sum / this.frames;
        this.sum = this.frames = 0;
        if (mean > LATE * this.period) {
            if (this.raised) this.patience = Math.min(2 * this.patience, MOST_PATIENCE);
            this.raised = false;
            this.calm = 0;
            // Fragments, and with them time, go with the square of the scale.
            this.change(Math.max(0.8, Math.sqrt(this.period / mean)) * this.scale - SCALE_STEP / 2);
        } else if (++this.calm >= this.patience && this.scale < 1) {
            this.calm = 0;
            this.raised = true;
            this.change(this.scale + SCALE_STEP);
        }
    }

    /** @param {number} wanted */
    change(wanted) {
        this.scale = Math.min(1, Math.max(LEAST_SCALE, Math.round(wanted / SCALE_STEP) * SCALE_STEP));
    }

    /** What is said of it, with the price of the next lower scale that was measured. */
    get words() {
        const price = SCALE_PRICES.find(([scale]) => this.scale >= scale - 1e-6), percent = `sharpness ${Math.round(100 * this.scale)} %`;
        if (this.scale > 0.999 || !price) return percent;
        return `${percent}: ${price[1]} dB${this.scale > price[0] + 1e-6 ? " or better" : ""}`;
    }
}
