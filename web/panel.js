// panel: slider, stops with their pictures, play, legend and the choice of an object.
import { Shift, Sweep, snap } from "./control.js";

/** @typedef {import("./renderer/renderer.js").Renderer} Renderer */
/** @typedef {import("./renderer/renderer.js").SceneObject} SceneObject */
/** @typedef {import("./renderer/stops.js").Control} Control */

const NEAR = 0.005;  // of the slider: at a stop
const PLATE_AWAY = 14;  // pixels of the window from the pointer to the plate with its value

/** @param {string} id @returns {any} */
export const byId = (id) => document.getElementById(id);

/** @param {string} kind @param {Record<string, any>} properties @param {Element} parent @returns {any} */
export function element(kind, properties, parent) {
    const made = Object.assign(document.createElement(kind), properties);
    parent.append(made);
    return made;
}

export class Panel {
    /** @param {Renderer} renderer @param {() => void} onChange  x has moved */
    constructor(renderer, onChange) {
        this.renderer = renderer;
        this.onChange = onChange;
        /** @type {SceneObject | null} */ this.chosen = null;  // an object with an x of its own; null: all
        /** @type {Shift | null} */ this.shift = null;
        /** @type {Sweep | null} */ this.sweep = null;
        this.calm = matchMedia("(prefers-reduced-motion: reduce)");
        this.done = new AbortController();  // of all that it listens to
        const { signal } = this.done;
        this.slider = byId("x");
        this.slider.addEventListener("input", () => this.drag(Number(this.slider.value)), { signal });
        this.slider.addEventListener("pointerdown", (/** @type {PointerEvent} */ e) => { this.free = e.altKey; }, { signal });
        byId("play").addEventListener("click", () => this.play(), { signal });
        this.addObjects();
        this.addPalettes();
        this.addStops();
        this.show();
    }

    /** Whose x the slider shows. */
    get shown() {
        const { objects } = this.renderer;
        return this.chosen ?? objects.reduce((a, b) => (b.model.stops.length > a.model.stops.length ? b : a));
    }

    /** @returns {import("./entries.js").StateEntry[]} */
    get stops() { return this.shown.states; }

    /** @param {Control} x @param {SceneObject | null} object */
    setX(x, object = this.chosen) {
        const { objects } = this.renderer;
        if (!Array.isArray(x)) this.renderer.setX(x, object);
        else for (const o of object ? [object] : objects) {  // weights are of one model's stops
            if (o.model === this.shown.model) this.renderer.setX(x, o);
            else this.renderer.setX(this.shown.model.blend.sliderX(x), o);
        }
        this.show();
        this.onChange();
    }

    /** A hand on the slider. @param {number} x */
    drag(x) {
        this.stop();
        this.setX(this.free ? x : snap(x, this.stops));
    }

    /** Goes to a control smoothly, at once for who wants no motion. @param {Control} x */
    goTo(x) {
        this.stop();
        if (this.calm.matches) this.setX(x);
        else this.shift = new Shift(this.shown.x, x, this.shown.model.blend);
    }

    stop() {
        this.shift = this.sweep = null;
        byId("play").setAttribute("aria-pressed", "false");
        byId("play").textContent = "▶";
    }

    play() {
        const playing = this.sweep !== null;
        this.stop();
        if (playing || this.shown.model.stops.length < 2) return;
        this.sweep = new Sweep(this.shown.model.blend, this.shown.x);
        byId("play").setAttribute("aria-pressed", "true");
        byId("play").textContent = "⏸";
    }

    /** What moves by itself; whether something does. @param {number} seconds */
    step(seconds) {
        if (this.sweep) this.setX(this.sweep.advance(seconds));
        else if (this.shift) {
            this.shift.seconds += seconds;
            this.setX(this.shift.control());
            if (this.shift?.over) this.shift = null;
        } else return false;
        return true;
    }

    addObjects() {
        const { objects } = this.renderer, choice = byId("object");
        choice.closest(".row").hidden = objects.length < 2;
        objects.forEach((object, i) => element("option", { value: i, textContent: object.name }, choice));
        choice.addEventListener("change", () => this.choose(choice.value === "" ? null : objects[choice.value]), { signal: this.done.signal });
    }

    /** @param {SceneObject | null} object */
    choose(object) {
        this.stop();
        this.chosen = object;
        byId("object").value = object ? this.renderer.objects.indexOf(object) : "";
        this.addStops();
        this.show();
        this.onChange();
    }

    addStops() {
        const row = byId("stops");
        row.replaceChildren();
        this.stops.forEach((stop, i) => {
            const button = element("button", { type: "button", title: i < 9 ? String(i + 1) : "" }, row);
            if (stop.picture) element("img", { src: stop.picture, alt: "", width: 96, height: 54 }, button);
            element("span", { textContent: stop.name }, button);
            button.addEventListener("click", () => this.goTo(stop.x));
        });
    }

    addPalettes() {
        const choice = byId("palette");
        Object.keys(this.renderer.palettes).forEach((name) => element("option", { value: name, textContent: name }, choice));
        choice.addEventListener("change", () => {
            const found = this.renderer.measured(this.shown);
            if (found) for (const model of this.renderer.models) for (const stop of model.stops) if (stop.palette === found.stop.palette) stop.palette = choice.value;
            this.show();
            this.onChange();
        }, { signal: this.done.signal });
    }

    /** Before the panel of another renderer takes its place. */
    close() {
        this.done.abort();
        byId("palette").replaceChildren();
        byId("object").replaceChildren(byId("object").options[0]);  // "all"
    }

    /** The panel as x is. */
    show() {
        const { blend } = this.shown.model, x = blend.sliderX(this.shown.x), near = this.stops.find((stop) => Math.abs(blend.sliderX(stop.x) - x) < NEAR);
        this.slider.value = x;
        this.slider.setAttribute("aria-valuetext", near ? near.name : x.toFixed(2));
        for (const [i, button] of [...byId("stops").children].entries()) button.setAttribute("aria-pressed", String(this.stops[i] === near));
        this.showLegend();
    }

    /** What a colour stands for; as clear as the weight of its stop. */
    showLegend() {
        const found = this.renderer.measured(this.shown), box = byId("legend");
        box.hidden = !found;
        if (!found) return;
        const rgb = this.renderer.palettes[found.stop.palette], context = box.querySelector("canvas").getContext("2d"), pixels = context.createImageData(256, 1);
        for (let i = 0; i < 256; i++) for (let c = 0; c < 4; c++) pixels.data[4 * i + c] = c < 3 ? 255 * (rgb ? rgb[3 * i + c] : i / 255) + 0.5 : 255;
        context.putImageData(pixels, 0, 0);
        const [low, high] = found.stop.valueRange ?? [0, 1], ends = box.querySelectorAll("span");
        ends[0].textContent = `${low} ${found.stop.unit}`;
        ends[1].textContent = `${high} ${found.stop.unit}`;
        byId("palette").value = found.stop.palette;
        box.style.opacity = Math.min(1, 0.3 + 2 * found.weight);
    }

    /**
     * The value of a place of the picture, on a plate above it that stays within the window; null: there is none.
     * @param {number | null} intensity  0..1
     * @param {[number, number]} place  pixels of the window
     */
    read(intensity, [left, top]) {
        const found = this.renderer.measured(this.shown), [low, high] = found?.stop.valueRange ?? [0, 1], plate = byId("reading");
        plate.textContent = found && intensity !== null ? `${(low + (high - low) * intensity).toFixed(Math.min(9, found.stop.digits ?? 1))} ${found.stop.unit}` : "";
        plate.style.left = `${Math.max(0, Math.min(left + PLATE_AWAY, innerWidth - plate.offsetWidth))}px`;
        plate.style.top = `${Math.max(0, top - PLATE_AWAY - plate.offsetHeight)}px`;
    }
}
