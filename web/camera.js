// camera: orbit and fly with mouse, touch and keys, as docs/viewer.md has them.
import { about, add, dot, length, lookAt, product, turn } from "./poses.js";

/** @typedef {import("./poses.js").Pose} Pose */

const TURNS = /** @type {Record<string, number[]>} */ ({ ArrowLeft: [0.08, 0], ArrowRight: [-0.08, 0], ArrowUp: [0, -0.08], ArrowDown: [0, 0.08] });
const TAP_MS = 300, TAP_PX = 24;  // two taps so near to each other are a double one
const RAY_REACH = 0.05;  // tangent of the angle up to which a point can be meant by a ray

export class Camera {
    /**
     * @param {HTMLCanvasElement} canvas @param {import("./entries.js").ViewEntry} view @param {() => void} onChange
     * @param {(e: PointerEvent) => boolean} takes  whether another tool takes a press
     * @param {(place: number[]) => void} onDouble  place on the canvas, 0..1 from upper left
     */
    constructor(canvas, view, onChange, takes = () => false, onDouble = () => {}) {
        this.canvas = canvas;
        this.view = view;
        this.fovY = view.fovY;
        this.flying = false;
        /** @type {Set<string>} */ this.keys = new Set();
        /** @type {Map<number, number[]>} */ this.pointers = new Map();
        this.onChange = onChange;
        /** @type {number[]} */ this.lastTap = [0, 0, 0];
        /** @type {Pose} */ this.pose = lookAt(view.eye, view.target);
        this.target = view.target;
        this.distance = 1;
        this.frame();
        canvas.addEventListener("pointerdown", (e) => {
            if (takes(e)) return;
            canvas.setPointerCapture(e.pointerId);
            this.pointers.set(e.pointerId, [e.clientX, e.clientY]);
            const [time, x, y] = this.lastTap, twice = e.timeStamp - time < TAP_MS && Math.hypot(e.clientX - x, e.clientY - y) < TAP_PX;
            if (twice && this.pointers.size === 1) onDouble([e.offsetX / canvas.clientWidth, e.offsetY / canvas.clientHeight]);
            this.lastTap = twice ? [0, 0, 0] : [e.timeStamp, e.clientX, e.clientY];
        });
        for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) canvas.addEventListener(name, (e) => this.pointers.delete(e.pointerId));
        canvas.addEventListener("pointermove", (e) => this.drag(e, canvas.clientHeight));
        canvas.addEventListener("wheel", (e) => { e.preventDefault(); this.zoom(Math.exp(e.deltaY * 0.001)); }, { passive: false });
        canvas.addEventListener("contextmenu", (e) => e.preventDefault());
        canvas.addEventListener("keydown", (e) => this.key(e));
        canvas.addEventListener("keyup", (e) => this.keys.delete(e.code));
        canvas.addEventListener("blur", () => this.keys.clear());
    }

    /** The first look; the exporter framed it for 16:9, so a narrow page stands back. */
    frame() {
        const { eye, target } = this.view, back = Math.max(1, 16 / 9 / (this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight)));
        this.put(lookAt(add(target, add(eye, target, -1), back), target), target);
    }

    /** @param {Pose} pose @param {number[]} target */
    put(pose, target) {
        this.pose = pose;
        this.target = target;
        this.distance = Math.max(1e-9, length(add(pose.position, target, -1)));
        this.onChange();
    }

    /** @param {PointerEvent} e @param {number} height */
    drag(e, height) {
        const before = this.pointers.get(e.pointerId);
        if (!before) return;
        const [dx, dy] = [e.clientX - before[0], e.clientY - before[1]].map((pixels) => pixels / height);
        const other = [...this.pointers].find(([id]) => id !== e.pointerId)?.[1];
        if (other) {
            const apart = (/** @type {number[]} */ p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
            this.zoom(apart(before) / Math.max(apart([e.clientX, e.clientY]), 1));
            this.pan(dx / 2, dy / 2);
        } else if (e.buttons & 6) this.pan(dx, dy);
        else this.orbit(-4 * dx, -4 * dy);
        this.pointers.set(e.pointerId, [e.clientX, e.clientY]);
    }

    /** @param {number} yaw @param {number} pitch */
    orbit(yaw, pitch) {
        const flat = product(about([0, 1, 0], yaw), this.pose.wxyz), tilted = product(flat, about([1, 0, 0], pitch));
        const wxyz = turn(tilted, [0, 1, 0])[1] > 0.02 ? tilted : flat;  // never over the poles
        this.pose = { position: this.flying ? this.pose.position : add(this.target, turn(wxyz, [0, 0, this.distance])), wxyz };
        if (this.flying) this.target = add(this.pose.position, turn(wxyz, [0, 0, -this.distance]));
        this.onChange();
    }

    /** @param {number} dx @param {number} dy  parts of the picture's height */
    pan(dx, dy) {
        const reach = 2 * this.distance * Math.tan(this.fovY / 2);
        this.move(turn(this.pose.wxyz, [-dx * reach, dy * reach, 0]));
    }

    /** @param {number[]} by */
    move(by) {
        this.target = add(this.target, by);
        this.pose = { ...this.pose, position: add(this.pose.position, by) };
        this.onChange();
    }

    /** @param {number} factor */
    zoom(factor) {
        this.distance = Math.min(1e6, Math.max(1e-6, this.distance * factor));
        this.pose = { ...this.pose, position: add(this.target, turn(this.pose.wxyz, [0, 0, this.distance])) };
        this.onChange();
    }

    /** @param {KeyboardEvent} e */
    key(e) {
        if (e.ctrlKey || e.metaKey || e.altKey) return;
        if (TURNS[e.code]) this.orbit(TURNS[e.code][0], TURNS[e.code][1]);
        else if (e.code === "KeyV") this.flying = !this.flying;
        else if ((e.code === "KeyF" && !e.shiftKey) || e.code === "Home") this.frame();
        else if (e.key === "+" || e.key === "=" || e.key === "-") this.zoom(e.key === "-" ? 1.1 : 0.9);
        else if (/^Key[WASDQE]$/.test(e.code)) this.keys.add(e.code);
        else return;
        e.preventDefault();
        this.onChange();
    }

    /** Moves by the keys that are down; whether one is. @param {number} seconds */
    step(seconds) {
        if (!this.flying || !this.keys.size) return false;
        const side = (/** @type {string} */ a, /** @type {string} */ b) => +this.keys.has(a) - +this.keys.has(b), reach = this.distance * seconds;
        this.move(turn(this.pose.wxyz, [side("KeyD", "KeyA"), side("KeyE", "KeyQ"), side("KeyS", "KeyW")].map((value) => value * reach)));
        return true;
    }

    /** The ray through a place of the canvas, 0..1 from upper left. @param {number[]} place */
    rayThrough([x, y]) {
        const up = Math.tan(this.fovY / 2), right = (up * this.canvas.clientWidth) / Math.max(1, this.canvas.clientHeight);
        const along = turn(this.pose.wxyz, [(2 * x - 1) * right, (1 - 2 * y) * up, -1]);
        return { position: this.pose.position, along: along.map((value) => value / length(along)) };
    }
}

/**
 * The point that a ray means: the nearest of those close to it. @param {{position: number[], along: number[]}} ray
 * @param {import("./renderer/renderer.js").SceneObject[]} objects @returns {number[] | null} world
 */
export function pointUnder({ position, along }, objects) {
    let best = null, bestScore = Infinity;
    for (const object of objects) {
        const { positions } = object.model;
        for (let i = 0; i < positions.length; i += 3) {
            const place = add(object.pose.position, turn(object.pose.wxyz, [positions[i], positions[i + 1], positions[i + 2]])), to = add(place, position, -1), depth = dot(to, along);
            if (!(depth > 0)) continue;
            const off = length(add(to, along, -depth)) / depth, score = depth * (1 + 20 * off);  // 0.05 off counts as twice as far
            if (off < RAY_REACH && score < bestScore) [best, bestScore] = [place, score];
        }
    }
    return best;
}
