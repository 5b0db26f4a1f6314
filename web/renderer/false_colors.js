// false_colors: where palettes belong, as renderer/colors/false_colors.py has it.  At a pure stop
// of values the palette is laid over the whole picture.  Between such a stop and another one both stops'
// colours are decoded; what is of values, heat or others, is drawn in addition and coloured at the last
// step.  Where several palettes show at once each splat's heat is coloured before it is drawn.

import { hasFalseColors } from "./stops.js";

/** @typedef {import("./stops.js").Control} Control */
/** @typedef {{stop: number, control: Control, palette: string, weight: number, ofLayer: boolean}} Heat */
/** @typedef {{rest: Control | null, heats: Heat[], pure: boolean}} Shade */
/** @typedef {"no heat" | "picture" | "beside" | "splats"} Way */

/**
 * The colours that an object shows: `rest` where the final ones are decoded, `heats` what stops
 * of values have in them.  own: each anchor has weights of its own, and these stops are met somewhere.
 * @param {import("./models.js").Model} model @param {Control} control @param {number[] | null} own @returns {Shade}
 */
export function shadeOf(model, control, own = null) {
    const { blend } = model, { stops } = blend, follows = model.colorsFollow, weights = own ?? blend.weights(control);
    const at = follows ? control : 0;
    const measured = stops.map((_, s) => s)
        .filter((s) => hasFalseColors(stops[s]) && weights[s] > 0);
    if (!measured.length) return { rest: at, heats: [], pure: false };
    const others = weights.map((weight, s) => (measured.includes(s) ? 0 : weight));
    const left = others.reduce((a, b) => a + b, 0), pure = !left && measured.length === 1;
    const layered = model.kind === "layers" && model.mode === "exclusive" && !pure;
    const heats = measured.map((s) => ({
        stop: s, palette: stops[s].palette, ofLayer: layered,
        control: pure && !own ? at : follows ? stops[s].x : 0,
        weight: pure ? 1 : weights[s],
    }));
    if (pure) return { rest: null, heats, pure: true };
    if (layered) return { rest: 0, heats, pure: false };
    return { rest: left ? (follows ? others.map((weight) => weight / left) : 0) : null, heats, pure: false };
}

/** How all shades of a scene together come about. @param {Shade[]} shades @returns {{way: Way, palette: string}} */
export function wayOf(shades) {
    const names = [...new Set(shades.flatMap((shade) => shade.heats.map((heat) => heat.palette)))];
    if (!names.length) return { way: "no heat", palette: "" };
    if (names.length > 1) return { way: "splats", palette: "" };
    return { way: shades.every((shade) => shade.pure) ? "picture" : "beside", palette: names[0] };
}
