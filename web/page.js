// page: opens the scene, draws it when something has changed, and joins the picture to its tools.
import { Camera, pointUnder } from "./camera.js";
import { readBeside, readContainer, readInline } from "./renderer/container.js";
import { Grab, depthAlong, handOnRay } from "./grab.js";
import { followParent, keepLink } from "./embedded.js";
import { offerHeadsets } from "./headset/headset.js";
import { followLink, linkOf } from "./link.js";
import { Panel, byId } from "./panel.js";
import { perspective } from "./poses.js";
import { Renderer } from "./renderer/renderer.js";
import { followServer } from "./served.js";

const NEAR_PART = 0.01;  // of the scene's radius
const MOST_RATIO = 2;  // pixels of the picture a pixel of the page
const LINK_MS = 400, READING_MS = 100;

class Page {
    constructor() {
        this.canvas = /** @type {HTMLCanvasElement} */ (byId("picture"));
        const gl = this.canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, powerPreference: "high-performance" });
        if (!gl) throw new Error("this browser offers no WebGL2");
        this.gl = gl;
        this.wanted = true;
        /** @type {number[] | null} */ this.pointed = null;  // pixels of the window, of the picture
        this.unread = false;  // the value at the pointer is of an earlier picture or place
        this.before = this.linked = this.readAt = this.asked = 0;
        /** @type {any} */ this.headset = null;  // while it draws, the page does not
        this.redraw = () => { this.wanted = true; };
    }

    /** @param {ArrayBuffer} bytes */
    open(bytes) {
        const container = readContainer(bytes), earlier = this.renderer;
        const renderer = new Renderer(this.gl, container, this.redraw);
        this.renderer = renderer;
        if (earlier) {  // the same scene, finer: nothing of what its reader did is lost
            earlier.objects.forEach((object, i) => Object.assign(renderer.objects[i], { x: object.x, pose: object.pose }));
            earlier.close();
            this.panel?.close();
        } else {
            document.title = String(container.scene.title ?? document.title).slice(0, 200);
            const takes = (/** @type {PointerEvent} */ e) => this.pressed(e);
            this.camera = new Camera(this.canvas, container.scene.view, this.redraw, takes, (place) => this.centre(place));
            followLink(location.hash, this.camera, renderer);
        }
        this.grab = new Grab(renderer);
        this.panel = new Panel(renderer, this.redraw);
        byId("touch").hidden = !renderer.objects.some((object) => object.movable);
        byId("panel").hidden = byId("top").hidden = false;
        this.redraw();
    }

    /** @param {number} time  milliseconds */
    frame(time) {
        if (this.headset?.session) return;
        this.asked = requestAnimationFrame((now) => this.frame(now));
        const { camera, canvas, grab, panel, renderer } = this, seconds = Math.min(0.1, (time - this.before) / 1000);
        this.before = time;
        if (!(renderer && camera && grab && panel)) return;
        if (camera.step(seconds) || panel.step(seconds) || grab.step(seconds) || renderer.takeMeans()) this.wanted = true;
        const ratio = Math.min(devicePixelRatio, MOST_RATIO), width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
        if (canvas.width !== width || canvas.height !== height) {
            canvas.width = width;
            canvas.height = height;
            this.wanted = true;
        }
        if (!this.wanted) this.read(time);
        if (!this.wanted || this.gl.isContextLost()) return;
        this.wanted = false;
        renderer.draw([{ worldFromEye: camera.pose, tangents: perspective(camera.fovY, [width, height]), near: NEAR_PART * renderer.scene.radius, viewport: [0, 0, width, height] }]);
        this.unread = true;
        this.read(time);
        clearTimeout(this.linked);
        this.linked = setTimeout(() => keepLink(linkOf(camera, renderer)), LINK_MS);
    }

    /** After a headset, which may have kept the page's frames waiting. */
    resume() {
        cancelAnimationFrame(this.asked);
        this.redraw();
        this.frame(performance.now());
    }

    /** A press that takes an object, where things may be moved. @param {PointerEvent} e @returns {boolean} */
    pressed(e) {
        const { camera, canvas, grab } = this;
        if (!camera || !grab || byId("touch").getAttribute("aria-pressed") !== "true" || e.button > 0) return false;
        const rayOf = (/** @type {PointerEvent} */ at) => camera.rayThrough([at.offsetX / canvas.clientWidth, at.offsetY / canvas.clientHeight]);
        const ray = rayOf(e), found = grab.pick(ray);
        if (!found) return false;
        const depth = Math.max(found.depth, depthAlong(ray, found.object.pose.position)), done = new AbortController(), { signal } = done;
        canvas.setPointerCapture(e.pointerId);
        grab.take(e.pointerId, handOnRay(ray, depth), found.object);
        this.panel?.choose(found.object);
        canvas.addEventListener("pointermove", (at) => { if (at.pointerId === e.pointerId) grab.carry(e.pointerId, handOnRay(rayOf(at), depth)); }, { signal });
        for (const name of /** @type {const} */ (["pointerup", "pointercancel"]))
            canvas.addEventListener(name, (at) => { if (at.pointerId === e.pointerId) { grab.release(e.pointerId); done.abort(); } }, { signal });
        return true;
    }

    /** @param {number[]} place  0..1 from upper left */
    centre(place) {
        const { camera, renderer } = this, point = camera && renderer && pointUnder(camera.rayThrough(place), renderer.objects);
        if (!camera || !point) return;
        camera.target = point;
        camera.zoom(Math.hypot(...point.map((value, i) => value - camera.pose.position[i])) / camera.distance);
    }

    /** Where the value of a stop is wanted: under a pointer at rest or moving, at a finger's last tap. @param {PointerEvent} e */
    point(e) {
        this.pointed = e.buttons || e.type === "pointerleave" ? null : [e.clientX, e.clientY, e.offsetX, e.offsetY];
        this.unread = true;
    }

    /** The value there, of the picture as it is now, on a plate at the pointer. @param {number} time  milliseconds */
    read(time) {
        if (!this.unread || time - this.readAt < READING_MS) return;
        this.readAt = time;
        this.unread = false;
        const [left, top, across, down] = this.pointed ?? [0, 0, 0, 0], { clientWidth, clientHeight } = this.canvas;
        const shown = this.pointed && !byId("legend").hidden;
        this.panel?.read((shown ? this.renderer?.valueAt(across / clientWidth, 1 - down / clientHeight) : null) ?? null, [left, top]);
    }

    /** Buttons and keys of the whole page. */
    listen() {
        const toggle = (/** @type {string} */ id, /** @type {string} */ state) => {
            const button = byId(id), on = button.getAttribute(state) !== "true";
            button.setAttribute(state, String(on));
            return on;
        };
        const ask = () => { byId("help").hidden = !toggle("ask", "aria-expanded"); };
        const full = () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()).catch(() => tell("This browser shows no page in full screen here."));
        const share = () => {
            if (!this.camera || !this.renderer) return;
            history.replaceState(null, "", linkOf(this.camera, this.renderer));
            (navigator.clipboard?.writeText(location.href) ?? Promise.reject()).then(() => tell("The link is copied."), () => tell("The link is in the address bar."));
        };
        byId("ask").addEventListener("click", ask);
        byId("full").addEventListener("click", full);
        byId("share").addEventListener("click", share);
        byId("touch").addEventListener("click", () => toggle("touch", "aria-pressed"));
        if (!document.fullscreenEnabled) byId("full").hidden = true;
        for (const name of /** @type {const} */ (["pointermove", "pointerleave", "pointerdown", "click"]))
            this.canvas.addEventListener(name, (e) => this.point(/** @type {PointerEvent} */ (e)));
        document.addEventListener("keydown", (e) => {
            if (e.ctrlKey || e.metaKey || e.altKey || (e.target instanceof HTMLSelectElement)) return;
            const stop = /^[1-9]$/.test(e.key) && this.panel?.stops[Number(e.key) - 1], button = e.target instanceof HTMLButtonElement;
            if (stop) this.panel?.goTo(stop.x);
            else if (e.key === " " && !button) this.panel?.play();
            else if (e.key === "?") ask();
            else if (e.code === "KeyH") byId("panel").hidden = byId("top").hidden = !byId("panel").hidden;
            else if (e.code === "KeyF" && e.shiftKey) full();
            else if (e.code === "KeyT" && !byId("touch").hidden) toggle("touch", "aria-pressed");
            else if (e.code === "KeyL") share();
            else if (e.key === "Escape") byId("help").hidden = true;
            else return;
            e.preventDefault();
        });
        addEventListener("hashchange", () => { if (this.camera && this.renderer) followLink(location.hash, this.camera, this.renderer); this.panel?.show(); });
        this.canvas.addEventListener("webglcontextlost", (e) => { e.preventDefault(); tell("The graphics driver took the picture away; reload the page."); });
        this.canvas.addEventListener("webglcontextrestored", () => location.reload());
    }
}

/** @param {string} text */
function tell(text) { byId("message").textContent = text; }

async function main() {
    const page = new Page(), inline = byId("scene-data");
    page.listen();
    if (inline) page.open(await readInline(inline));
    else {
        page.open(await readBeside("coarse.bin"));
        requestAnimationFrame((time) => page.frame(time));
        page.open(await readBeside("scene.bin"));
    }
    tell("");
    if (inline) requestAnimationFrame((time) => page.frame(time));
    Object.assign(globalThis, { shapeshift: page });  // for tests and for who embeds the page
    await offerHeadsets(page);
    followParent((link) => {
        if (!page.camera || !page.renderer) return;
        followLink(link, page.camera, page.renderer);
        page.panel?.show();
    });
    followServer(() => { if (page.camera && page.renderer) history.replaceState(null, "", linkOf(page.camera, page.renderer)); });
    document.documentElement.dataset.ready = "yes";
}

main().catch((error) => {
    tell(`This scene cannot be shown: ${String(error?.message ?? error).slice(0, 400)}.`);
    document.documentElement.dataset.ready = "no";
});
