// stops: where between its stops a model is shown, as runtime_models/stop_weights.py has it.  Psi
// enters the first layer of every network linearly, so x between two stops stands for a blend of
// their encodings, Psi = sum of w_s Psi(x_s), at the pace that makes even steps look even.

/** @typedef {import("../entries.js").StopEntry} Stop */
/** @typedef {import("../entries.js").ControlEntry} Control  x on the slider, 0 to 1, or the weights of all stops */
/** @typedef {import("../entries.js").EncodingEntry} Encoding */

/** Whether a palette makes the colours of a stop: it shows values, heat or others. @param {Stop} stop */
export const hasFalseColors = (stop) => (stop.kind === "thermal" || stop.kind === "values") && Boolean(stop.palette);

/** @param {number} x @param {number[]} xs  rising @param {number[]} ys @returns {number} as numpy.interp */
export function interpolate(x, xs, ys) {
    const last = xs.length - 1;
    if (!(x > xs[0])) return ys[0];
    if (x >= xs[last]) return ys[last];
    let i = 0;
    while (xs[i + 1] < x) i++;
    return ys[i] + ((ys[i + 1] - ys[i]) * (x - xs[i])) / (xs[i + 1] - xs[i]);
}

const EVEN = [0, 1];
const steps = (/** @type {number[]} */ curve) => curve.map((_, i) => i / (curve.length - 1));
const along = (/** @type {number[]} */ curve, /** @type {number} */ part) => interpolate(part, steps(curve), curve);
const partOf = (/** @type {number[]} */ curve, /** @type {number} */ share) => interpolate(share, curve, steps(curve));

export class StopBlend {
    /** @param {Stop[]} stops @param {import("../entries.js").PaceEntry[]} pace @param {boolean} direct */
    constructor(stops, pace = [], direct = false) {
        this.stops = stops;
        this.direct = direct;
        /** @type {Map<string, number[]>} */
        this.curves = new Map();
        for (const { start, end, blend } of pace) {
            this.curves.set(`${start} ${end}`, blend);
            this.curves.set(`${end} ${start}`, [...blend].reverse().map((share) => 1 - share));
        }
        this.order = stops.map((_, s) => s).sort((a, b) => stops[a].x - stops[b].x);
        this.xs = this.order.map((s) => stops[s].x);
    }

    /** Weight of stop b at even steps of the way from stop a. @param {number} a @param {number} b */
    curve(a, b) { return this.curves.get(`${a} ${b}`) ?? EVEN; }

    /** @param {Control} control @returns {number[]} of all stops */
    weights(control) {
        if (Array.isArray(control)) return control;
        const { order, xs } = this, out = this.stops.map(() => 0), above = xs.findIndex((x) => x >= control);
        if (above === 0) out[order[0]] = 1;
        else if (above < 0) out[order[xs.length - 1]] = 1;
        else {
            const [a, b] = [order[above - 1], order[above]], part = (control - xs[above - 1]) / (xs[above] - xs[above - 1]);
            out[b] = along(this.direct ? EVEN : this.curve(a, b), part);
            out[a] += 1 - out[b];
        }
        return out;
    }

    /** `part` 0..1 of the way from one control to another, directly. @param {Control} start @param {Control} end @param {number} part @returns {Control} */
    between(start, end, part) {
        if (part <= 0 || part >= 1) return part <= 0 ? start : end;
        if (typeof start === "number" && typeof end === "number" && this.walks(start, end)) return start + (end - start) * part;
        const from = this.weights(start), to = this.weights(end), met = from.map((_, s) => s).filter((s) => from[s] > 0 || to[s] > 0);
        if (met.length === 2) {  // equal steps of the line between the two stops that are met
            const [b, a] = to[met[0]] > 0 && from[met[1]] > 0 ? met : [met[1], met[0]], curve = this.curve(a, b), first = partOf(curve, from[b]);
            const share = along(curve, first + (partOf(curve, to[b]) - first) * part);
            return from.map((_, s) => (s === b ? share : s === a ? 1 - share : 0));
        }
        let share = 0;
        for (const a of met) for (const b of met) share += from[a] * to[b] * along(this.curve(a, b), part);
        const mixed = from.map((weight, s) => weight + (to[s] - weight) * Math.min(1, Math.max(0, share)));
        const total = mixed.reduce((sum, weight) => sum + weight);
        return mixed.map((weight) => weight / total);
    }

    /** Whether all numbers between two mean a blend of the same two stops. @param {number} start @param {number} end */
    walks(start, end) {
        if (this.direct || this.stops.length < 2) return true;
        const edges = [-Infinity, ...this.xs, Infinity], low = Math.min(start, end), high = Math.max(start, end);
        return edges.some((edge, i) => i > 0 && edges[i - 1] <= low && high <= edge);
    }

    /** x of the slider's knob. @param {Control} control @returns {number} */
    sliderX(control) {
        if (!Array.isArray(control)) return control;
        const present = control.map((weight, s) => s).filter((s) => control[s] > 0), { stops } = this;
        if (present.length === 2) {
            const [a, b] = present;
            return stops[a].x + (stops[b].x - stops[a].x) * partOf(this.curve(a, b), control[b]);
        }
        return control.reduce((sum, weight, s) => sum + weight * stops[s].x, 0);
    }

    /** Psi of a control, d numbers. @param {Encoding} encoding @param {Control} control */
    psi(encoding, control) {
        const { xs } = this;
        if (typeof control === "number" && (this.direct || xs.length < 2 || !(control >= xs[0] && control <= xs[xs.length - 1])))
            return encode(encoding, control);
        const out = new Float64Array(encoding.d);
        this.weights(control).forEach((weight, s) => {
            if (weight) encode(encoding, this.stops[s].x).forEach((value, t) => { out[t] += weight * value; });
        });
        return out;
    }
}

/** Equations 6 and 7 of the paper. @param {Encoding} encoding @param {number} x */
export function encode({ d, spacing, sigma }, x) {
    return Float64Array.from({ length: d }, (_, t) => Math.exp(-((t * spacing - x) ** 2) / (2 * sigma * sigma)));
}
