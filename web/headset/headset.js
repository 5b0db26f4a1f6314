// headset: a scene in VR or AR (WebXR).  Both eyes are drawn over one order; the person stands on
// the scene's floor, at true scale, where the page looked from.
import { Hands, turnedAbout, yawOf } from "./hands.js";
import { Overlay } from "./overlay.js";
import { byId, element } from "../panel.js";
import { about, add, chain, moved, turn } from "../poses.js";
import { RoomPanel } from "./room_panel.js";
import { EXACT, Sharpness, leversOf, priced } from "./sharpness.js";

/** @typedef {import("../poses.js").Pose} Pose */

const WAYS_IN = { "immersive-vr": "Enter VR", "immersive-ar": "Enter AR" };
const NEAR_M = 0.05, EYE_HEIGHT_M = 1.6;  // of who has no floor
const USUAL_RATE = 72;

/** A button for each way in that this browser has. @param {any} page */
export async function offerHeadsets(page) {
    const xr = /** @type {any} */ (navigator).xr, row = byId("headsets");
    if (!xr) return;
    row.replaceChildren();
    for (const [kind, text] of Object.entries(WAYS_IN)) {
        if (!(await xr.isSessionSupported(kind).catch(() => false))) continue;
        element("button", { type: "button", textContent: text }, row).addEventListener("click", () => {
            if (page.headset?.session) return;
            page.headset = new Headset(page, kind);
            page.headset.start().catch((/** @type {Error} */ error) => {
                byId("message").textContent = `The headset cannot be entered: ${String(error?.message ?? error).slice(0, 300)}`;
                page.headset?.leave();
            });
        });
    }
    xr.ondevicechange = () => offerHeadsets(page);
}

export class Headset {
    /** @param {{renderer: import("../renderer/renderer.js").Renderer} & Record<string, any>} page @param {string} kind  "immersive-vr" or "immersive-ar" */
    constructor(page, kind) {
        this.page = page;
        this.kind = kind;
        this.gl = page.gl;
        /** @type {any} */ this.session = null;
        this.levers = leversOf(page.renderer.scene.profile);
        this.hands = new Hands(this);
        this.roomPanel = new RoomPanel({ recentre: () => this.recentre(), leave: () => this.leave(), sharpen: () => { this.sharpness.automatic = !this.sharpness.automatic; } });
        this.sharpness = new Sharpness(1000 / USUAL_RATE);
        /** @type {Pose} */ this.first = page.camera.pose;  // where recentring leads
        /** @type {Pose} */ this.worldFromFloor = { position: [0, 0, 0], wxyz: [1, 0, 0, 0] };
        /** @type {Pose | null} */ this.head = null;  // room
        this.frames = this.before = this.eyeHeight = this.widest = 0;
        /** @type {any[]} */ this.views = [];
    }

    get grab() { return this.page.grab; }

    /** World height of what is stood on. */
    get floorLevel() { return this.page.renderer.scene.floorY ?? this.worldFromFloor.position[1] - this.eyeHeight; }

    async start() {
        const xr = /** @type {any} */ (navigator).xr, { XRWebGLLayer } = /** @type {any} */ (globalThis);
        const session = await xr.requestSession(this.kind, { optionalFeatures: ["local-floor", "hand-tracking"] });
        this.session = session;
        session.addEventListener("end", () => this.ended());
        await this.gl.makeXRCompatible();
        this.layer = new XRWebGLLayer(session, this.gl, { antialias: false, depth: false, stencil: false, alpha: true });
        if ("fixedFoveation" in this.layer) this.layer.fixedFoveation = this.levers.foveation;
        session.updateRenderState({ baseLayer: this.layer, depthNear: NEAR_M });
        const { rate } = this.levers;
        if (rate && session.supportedFrameRates?.includes(rate)) await session.updateTargetFrameRate?.(rate);
        this.sharpness.period = 1000 / (session.frameRate || rate || USUAL_RATE);
        this.space = await session.requestReferenceSpace("local-floor").catch(() => {
            this.eyeHeight = EYE_HEIGHT_M;
            return session.requestReferenceSpace("local");
        });
        this.space.addEventListener?.("reset", () => { this.head = null; });
        this.through = session.environmentBlendMode && session.environmentBlendMode !== "opaque" ? 1 : 0;
        session.addEventListener("selectstart", (/** @type {any} */ e) => this.hands.selectStart(e));
        session.addEventListener("selectend", (/** @type {any} */ e) => this.hands.letGo(e.inputSource));
        session.addEventListener("squeezestart", () => this.nextStop());
        session.requestAnimationFrame((/** @type {number} */ t, /** @type {any} */ f) => this.frame(t, f));
    }

    /** @param {any} frame @param {any} space @returns {Pose | null} */
    inWorld(frame, space) {
        const pose = frame.getPose(space, this.space);
        return pose ? chain(this.worldFromFloor, rigid(pose.transform)) : null;
    }

    /** @param {number} time  ms @param {any} frame */
    frame(time, frame) {
        const { session, page, sharpness } = this;
        if (!session) return;
        session.requestAnimationFrame((/** @type {number} */ t, /** @type {any} */ f) => this.frame(t, f));
        const ms = this.before ? time - this.before : 0, seconds = Math.min(0.1, ms / 1000);
        this.before = time;
        sharpness.step(ms);
        const seen = frame.getViewerPose(this.space);
        if (!seen || this.gl.isContextLost()) return;
        const fresh = !this.head;
        this.head = rigid(seen.transform);
        if (fresh) this.recentre();
        this.hands.step(frame, seconds);
        if (!this.session) return;  // a long press has ended it
        page.panel.step(seconds);
        page.grab.step(seconds);
        this.roomPanel.follow(chain(this.worldFromFloor, this.head));
        this.draw(seen.views);
    }

    /** @param {any[]} eyes  XRView */
    draw(eyes) {
        const { page, layer, levers, sharpness } = this, { renderer } = page, target = layer.framebuffer;
        const views = eyes.map((eye) => {
            // Where the browser takes smaller pictures, splats go there directly; some ignore the wish.
            eye.requestViewportScale?.(sharpness.scale);
            const { x, y, width, height } = layer.getViewport(eye);
            this.widest = Math.max(this.widest, width);
            return {
                worldFromEye: chain(this.worldFromFloor, rigid(eye.transform)), tangents: tangentsOf(eye.projectionMatrix), near: NEAR_M,
                viewport: [x, y, width, height], scale: Math.min(1, (sharpness.scale * this.widest) / Math.max(1, width)),
            };
        }).filter(({ viewport }) => viewport[2] > 0 && viewport[3] > 0);
        if (!views.length) return;
        renderer.leaveOut(levers);
        renderer.draw(views, target, this.through);
        if (this.overlayOf !== renderer) {
            /** @type {import("../renderer/renderer.js").Renderer | undefined} */
            this.overlayOf = renderer;
            this.overlay = new Overlay(renderer.gpu);
        }
        const picture = this.roomPanel.shown ? this.roomPanel.picture(renderer.gpu, page.panel, sharpness.words, sharpness.automatic, priced(levers)) : null;
        for (const view of views) {
            this.overlay?.begin(view, target);
            if (picture) this.overlay?.quad(this.roomPanel.corners(), [0, 0, 0, 0], picture);
            if (this.overlay) this.hands.draw(this.overlay);
        }
        this.overlay?.end();
        this.views = views;
        this.frames++;
    }

    /** Back to where the page looked from. */
    recentre() {
        const { head, first } = this;
        if (!head) return;
        const wxyz = about([0, 1, 0], yawOf(first.wxyz) - yawOf(head.wxyz)), [x, y, z] = turn(wxyz, head.position);
        const { floorY } = this.page.renderer.scene, level = typeof floorY === "number" ? floorY + this.eyeHeight : first.position[1] - y;
        this.worldFromFloor = { position: [first.position[0] - x, level, first.position[2] - z], wxyz };
        this.settle();
    }

    /** @param {number} angle  radians to the left, about the head */
    turnBy(angle) {
        if (!this.head) return;
        this.worldFromFloor = turnedAbout(this.worldFromFloor, about([0, 1, 0], angle), moved(this.worldFromFloor, this.head.position));
        this.settle();
    }

    /** @param {number[]} point  world, on the floor; the head comes to be above it */
    jumpTo(point) {
        if (!this.head) return;
        const [x, , z] = add(point, moved(this.worldFromFloor, this.head.position), -1);
        this.worldFromFloor = { ...this.worldFromFloor, position: add(this.worldFromFloor.position, [x, 0, z]) };
        this.settle();
    }

    /** After a leap: the panel comes along, and what is held was not thrown. */
    settle() {
        if (this.head) this.roomPanel.place(chain(this.worldFromFloor, this.head));
        this.hands.moved();
    }

    switchPanel() {
        this.roomPanel.shown = !this.roomPanel.shown;
        this.settle();
    }

    nextStop() {
        const { panel } = this.page, { blend } = panel.shown.model, now = blend.sliderX(panel.shown.x);
        const stops = [...panel.stops].sort((a, b) => blend.sliderX(a.x) - blend.sliderX(b.x));
        if (stops.length) panel.goTo((stops.find((stop) => blend.sliderX(stop.x) > now + 1e-6) ?? stops[0]).x);
    }

    leave() { this.session?.end().catch(() => this.ended()); }

    /** The page goes on where it was. */
    ended() {
        if (!this.session) return;
        for (const source of [...this.hands.hands.keys()]) this.hands.forget(source);
        this.session = null;
        this.page.renderer.leaveOut(EXACT);
        this.page.resume();
    }
}

/** @param {any} transform  XRRigidTransform @returns {Pose} */
const rigid = ({ position: p, orientation: q }) => ({ position: [p.x, p.y, p.z], wxyz: [q.w, q.x, q.y, q.z] });

/** Tangents left, right, down, up of a projection matrix, column after column. @param {Float32Array} m */
const tangentsOf = (m) => [(m[8] - 1) / m[0], (m[8] + 1) / m[0], (m[9] - 1) / m[5], (m[9] + 1) / m[5]];
