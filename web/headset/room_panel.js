// room_panel: the page's panel as a thing in the room, one quad with a picture of it: slider, stops,
// legend, what sharpness costs, recentre and leave.  A headset shows nothing of the page itself.
import { add, inverse, length, lookAt, moved, turn } from "../poses.js";

/** @typedef {import("../panel.js").Panel} Panel */
/** @typedef {import("../poses.js").Pose} Pose */
/** @typedef {{left: number, top: number, width: number, height: number, text: string, on: boolean, act: () => void}} Button */

const WIDTH_PX = 800, HEIGHT_PX = 480, PIXEL_M = 0.0007;  // 0.56 x 0.34 m, 0.9 m away: a letter is a degree high
const AHEAD_M = 0.9, DOWN_M = 0.36, ASIDE = 0.3;  // radians to the left
const SLIDER = { left: 50, right: 750, y: 105, reach: 34 };
const FAR_M = 2.5;  // a panel that was left behind comes along

export class RoomPanel {
    /** @param {{recentre: () => void, leave: () => void, sharpen: () => void}} acts */
    constructor(acts) {
        this.acts = acts;
        this.canvas = document.createElement("canvas");
        this.canvas.width = WIDTH_PX;
        this.canvas.height = HEIGHT_PX;
        this.context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
        this.shown = true;
        /** @type {Pose | null} */ this.pose = null;  // world; +z towards who looks
        /** @type {Button[]} */ this.buttons = [];
        this.drawnFor = "";
        /** @type {WebGLTexture | null} */ this.texture = null;
        /** @type {any} */ this.gpu = null;
    }

    /** Before a head, below what it looks at. @param {Pose} head  world */
    place(head) {
        const [x, , z] = turn(head.wxyz, [0, 0, -1]), yaw = Math.atan2(x, -z) - ASIDE;
        const position = add(head.position, [AHEAD_M * Math.sin(yaw), -DOWN_M, -AHEAD_M * Math.cos(yaw)]);
        this.pose = { position, wxyz: lookAt(position, add(position, add(position, head.position, -1))).wxyz };
    }

    /** @param {Pose} head  world */
    follow(head) {
        if (!this.pose || length(add(this.pose.position, head.position, -1)) > FAR_M) this.place(head);
    }

    /** Where a ray meets it, in its pixels, and how far away. @param {import("../grab.js").Ray} ray */
    hit(ray) {
        if (!this.pose || !this.shown) return null;
        const back = inverse(this.pose), from = moved(back, ray.position), along = turn(back.wxyz, ray.along), depth = -from[2] / along[2];
        const x = WIDTH_PX / 2 + (from[0] + depth * along[0]) / PIXEL_M, y = HEIGHT_PX / 2 - (from[1] + depth * along[1]) / PIXEL_M;
        return from[2] > 0 && depth > 0 && x >= 0 && x <= WIDTH_PX && y >= 0 && y <= HEIGHT_PX ? { x, y, depth } : null;
    }

    /** A press; whether it took the knob. @param {{x: number, y: number}} at @param {Panel} panel */
    press(at, panel) {
        if (Math.abs(at.y - SLIDER.y) < SLIDER.reach) {
            this.drag(at, panel);
            return true;
        }
        this.buttons.find(({ left, top, width, height }) => at.x >= left && at.x <= left + width && at.y >= top && at.y <= top + height)?.act();
        return false;
    }

    /** @param {{x: number}} at @param {Panel} panel */
    drag(at, panel) {
        panel.free = false;
        panel.drag(Math.min(1, Math.max(0, (at.x - SLIDER.left) / (SLIDER.right - SLIDER.left))));
    }

    /** The four corners, as the overlay takes them. @returns {number[][]} */
    corners() {
        const { pose } = this, [x, y] = [(WIDTH_PX / 2) * PIXEL_M, (HEIGHT_PX / 2) * PIXEL_M];
        return pose ? [[-x, -y, 0], [x, -y, 0], [-x, y, 0], [x, y, 0]].map((corner) => moved(pose, corner)) : [];
    }

    /**
     * Its picture as it is now, drawn anew only where it has changed.
     * @param {import("../renderer/gl.js").Gpu} gpu @param {Panel} panel @param {string} sharpness @param {boolean} automatic @param {string[]} prices
     */
    picture(gpu, panel, sharpness, automatic, prices) {
        const { gl } = gpu, { shown, renderer, chosen, stops } = panel, { blend } = shown.model, x = blend.sliderX(shown.x);
        const measured = renderer.measured(shown), legend = measured && { ...measured.stop, clear: Math.min(1, 0.3 + 2 * measured.weight) };
        const state = JSON.stringify([x, chosen?.name, stops, legend, sharpness, automatic, prices, panel.sweep !== null]);
        if (state === this.drawnFor && this.gpu === gpu && this.texture) return this.texture;
        this.drawnFor = state;
        this.draw(panel, x, legend, sharpness, automatic, prices);
        if (this.gpu !== gpu || !this.texture) {
            this.gpu = gpu;
            this.texture = gpu.texture("rgba8", WIDTH_PX, HEIGHT_PX);
            gl.bindTexture(gl.TEXTURE_2D, this.texture);
            for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.LINEAR);
        }
        gl.bindTexture(gl.TEXTURE_2D, this.texture);
        gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, gl.RGBA, gl.UNSIGNED_BYTE, this.canvas);
        gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
        return this.texture;
    }

    /** @param {Panel} panel @param {number} x @param {any} legend @param {string} sharpness @param {boolean} automatic @param {string[]} prices */
    draw(panel, x, legend, sharpness, automatic, prices) {
        const { context: to } = this, { stops } = panel, { blend } = panel.shown.model;
        const near = stops.find((stop) => Math.abs(blend.sliderX(stop.x) - x) < 0.005), place = (/** @type {number} */ at) => SLIDER.left + at * (SLIDER.right - SLIDER.left);
        to.clearRect(0, 0, WIDTH_PX, HEIGHT_PX);
        to.fillStyle = "#16181bd9";
        to.beginPath();
        to.roundRect(0, 0, WIDTH_PX, HEIGHT_PX, 24);
        to.fill();
        to.textBaseline = "middle";
        this.buttons = [];
        this.text(near ? near.name : x.toFixed(2), 780, 38, 34, "right", 360);
        if (panel.renderer.objects.length > 1) this.button(20, 12, 380, 52, panel.chosen ? panel.chosen.name : "All things", panel.chosen !== null, () => this.nextObject(panel));
        to.fillStyle = "#6b7078";
        to.fillRect(SLIDER.left, SLIDER.y - 4, SLIDER.right - SLIDER.left, 8);
        for (const stop of stops) to.fillRect(place(blend.sliderX(stop.x)) - 2, SLIDER.y - 16, 4, 32);
        to.fillStyle = "#f80";
        to.beginPath();
        to.arc(place(x), SLIDER.y, 20, 0, 7);
        to.fill();
        const wide = 760 / Math.max(1, stops.length);
        stops.forEach((stop, i) => this.button(20 + i * wide, 144, wide - 8, 56, stop.name, stop === near, () => panel.goTo(stop.x)));
        if (legend) this.legend(panel, legend);
        [...prices.slice(0, 5), sharpness].forEach((line, i) => this.text(line, i % 2 ? 410 : 24, 290 + 34 * (i >> 1), 24, "left", 370));
        const acts = [["Play", panel.sweep !== null, () => panel.play()], [automatic ? "Sharp: auto" : "Sharp: full", false, this.acts.sharpen], ["Recentre", false, this.acts.recentre], ["Leave", false, this.acts.leave]];
        acts.forEach(([text, on, act], i) => this.button(20 + 190 * i, 408, 182, 58, /** @type {string} */ (text), on === true, /** @type {() => void} */ (act)));
    }

    /** What a colour stands for. @param {Panel} panel @param {any} legend */
    legend(panel, legend) {
        const { context: to } = this, rgb = panel.renderer.palettes[legend.palette], [low, high] = legend.valueRange ?? [0, 1];
        to.globalAlpha = legend.clear;
        for (let i = 0; i < 256; i++) {
            const part = (/** @type {number} */ c) => Math.round(255 * (rgb ? rgb[3 * i + c] : i / 255));
            to.fillStyle = `rgb(${part(0)},${part(1)},${part(2)})`;
            to.fillRect(170 + i * 1.8, 218, 2, 30);
        }
        this.text(`${low} ${legend.unit}`, 160, 233, 26, "right", 140);
        this.text(`${high} ${legend.unit}`, 640, 233, 26, "left", 140);
        to.globalAlpha = 1;
    }

    /** @param {number} left @param {number} top @param {number} width @param {number} height @param {string} text @param {boolean} on @param {() => void} act */
    button(left, top, width, height, text, on, act) {
        const { context: to } = this;
        this.buttons.push({ left, top, width, height, text, on, act });
        to.fillStyle = on ? "#f80" : "#2c3036";
        to.beginPath();
        to.roundRect(left, top, width, height, 12);
        to.fill();
        this.text(text, left + width / 2, top + height / 2, 28, "center", width - 12, on ? "#111" : "#eee");
    }

    /** @param {string} text @param {number} x @param {number} y @param {number} size @param {CanvasTextAlign} align @param {number} most  pixels @param {string} color */
    text(text, x, y, size, align, most, color = "#eee") {
        const { context: to } = this;
        to.font = `${size}px system-ui, sans-serif`;
        to.textAlign = align;
        to.fillStyle = color;
        to.fillText(text, x, y, most);
    }

    /** Whose slider it is: all, then one after the other. @param {Panel} panel */
    nextObject(panel) {
        const { objects } = panel.renderer, at = panel.chosen ? objects.indexOf(panel.chosen) : -1;
        panel.choose(at + 1 < objects.length ? objects[at + 1] : null);
    }
}
