// link: the camera and every x in the address, so that a link shows what its sender saw.
import { numbers } from "./renderer/container.js";

/** @typedef {import("./camera.js").Camera} Camera */
/** @typedef {import("./renderer/renderer.js").Renderer} Renderer */

const short = (/** @type {number} */ value) => String(+value.toPrecision(6));

/** @param {Camera} camera @param {Renderer} renderer */
export function linkOf(camera, renderer) {
    const { objects } = renderer, control = (/** @type {any} */ x) => (Array.isArray(x) ? x.map(short).join("_") : short(x));
    const same = objects.every((object) => control(object.x) === control(objects[0].x));
    const xs = (same ? objects.slice(0, 1) : objects).map((object) => control(object.x)).join(",");
    return `#x=${xs}&eye=${camera.pose.position.map(short).join(",")}&turn=${camera.pose.wxyz.map(short).join(",")}&at=${camera.target.map(short).join(",")}`;
}

/** Takes over what a link says and is sound; a stranger wrote it. @param {string} hash @param {Camera} camera @param {Renderer} renderer */
export function followLink(hash, camera, renderer) {
    const said = new URLSearchParams(hash.replace(/^#/, "")), { objects } = renderer;
    try {
        const xs = (said.get("x") ?? "").split(",");
        if (said.has("x") && (xs.length === 1 || xs.length === objects.length))
            objects.forEach((object, i) => {
                const parts = xs[xs.length === 1 ? 0 : i].split("_").map(Number), sum = parts.reduce((a, b) => a + b, 0);
                if (!parts.every((part) => part >= 0 && part <= 1)) return;
                if (parts.length === 1) renderer.setX(parts[0], object);
                else if (parts.length === object.model.stops.length && Math.abs(sum - 1) < 1e-3) renderer.setX(parts.map((part) => part / sum), object);
            });
        if (said.has("eye")) {
            const list = (/** @type {string} */ name, /** @type {number} */ count) => numbers((said.get(name) ?? "").split(",").map(Number), count, name);
            const position = list("eye", 3), wxyz = list("turn", 4), size = Math.hypot(...wxyz);
            if (size > 0.5 && size < 2) camera.put({ position, wxyz: wxyz.map((value) => value / size) }, list("at", 3));
        }
    } catch {
        // what a link says wrongly is left as it was
    }
}
