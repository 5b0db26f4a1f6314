// hands: controllers and bare hands of a headset: sticks, buttons, what is held, what is pointed at.
import { add, product, turn } from "../poses.js";

/** @typedef {import("../poses.js").Pose} Pose */
/** @typedef {import("../grab.js").Ray} Ray */
/**
 * @typedef {object} Hand  what is remembered of an input source
 * @property {Ray | null} ray  world; null: not tracked
 * @property {number} depth  metres along the ray to what it meets
 * @property {boolean} sliding  it has the panel's knob
 * @property {boolean} turned  its stick has not come back yet
 * @property {number[][] | null} arc  of a jump that is aimed, world
 * @property {Map<number, number>} down  button -> seconds since it was pressed
 */

const DEADZONE = 0.15, PUSHED = 0.7, BACK = 0.4;  // of a stick's way
const X_PER_SECOND = 0.5, TURN = Math.PI / 6, LONG_S = 1;
const SELECT_BUTTONS = { panel: 4, home: 5 };  // A or X, B or Y: "xr-standard"
const JUMP_SPEED = 6, JUMP_STEP_S = 0.04, JUMP_STEPS = 40;  // m/s of what a jump throws
const RAY_M = 2.5;  // where nothing is met
const RAY_COLOR = [0.5, 0.5, 0.5, 0.5], KNOB_COLOR = [1, 0.55, 0.1, 1], ARC_COLOR = [0.1, 0.6, 0.7, 0.7];

export class Hands {
    /** @param {any} headset */
    constructor(headset) {
        this.headset = headset;
        /** @type {Map<any, Hand>} */ this.hands = new Map();
    }

    /** @param {any} source @returns {Hand} */
    handOf(source) {
        const known = this.hands.get(source) ?? { ray: null, depth: RAY_M, sliding: false, turned: false, arc: null, down: new Map() };
        this.hands.set(source, known);
        return known;
    }

    /** Every source of the session, once a frame. @param {any} frame @param {number} seconds */
    step(frame, seconds) {
        const { headset } = this, { grab, roomPanel, page } = headset, sources = [...headset.session.inputSources];
        for (const source of sources) {
            const hand = this.handOf(source), pose = headset.inWorld(frame, source.targetRaySpace);
            hand.ray = pose && { position: pose.position, along: turn(pose.wxyz, [0, 0, -1]) };
            if (!pose || !hand.ray) {
                this.letGo(source);
                continue;
            }
            const at = roomPanel.hit(hand.ray), found = at ? null : grab.pick(hand.ray);
            hand.depth = at?.depth ?? found?.depth ?? RAY_M;
            if (hand.sliding && at) roomPanel.drag(at, page.panel);
            grab.carry(source, pose);
            this.stick(source, hand, sources, at !== null, seconds);
            this.buttons(source, hand, seconds);
        }
        for (const source of this.hands.keys()) if (!sources.includes(source)) this.forget(source);
    }

    /**
     * Sideways: x, of the hand that holds something, points at the panel, is the left or the only
     * one; else a turn.  Ahead: a jump, aimed until the stick comes back.
     * @param {any} source @param {Hand} hand @param {any[]} sources @param {boolean} onPanel @param {number} seconds
     */
    stick(source, hand, sources, onPanel, seconds) {
        const { headset } = this, { grab, page } = headset, axes = source.gamepad?.axes ?? [], across = axes[2] ?? axes[0] ?? 0, ahead = -(axes[3] ?? axes[1] ?? 0);
        const others = sources.some((other) => other !== source && other.gamepad), slides = grab.held.has(source) || onPanel || source.handedness === "left" || !others;
        if (slides && Math.abs(across) > DEADZONE && !hand.arc) {
            const { panel } = page, { blend } = panel.shown.model;
            panel.stop();
            panel.setX(Math.min(1, Math.max(0, blend.sliderX(panel.shown.x) + across * X_PER_SECOND * seconds)));
        } else if (!slides && Math.abs(across) > PUSHED && !hand.turned && !hand.arc) {
            hand.turned = true;
            headset.turnBy(across > 0 ? -TURN : TURN);
        }
        if (Math.abs(across) < BACK) hand.turned = false;
        if (ahead > PUSHED && Math.abs(across) < PUSHED && hand.ray) hand.arc = this.arcOf(hand.ray);
        else if (hand.arc && ahead > BACK && hand.ray) hand.arc = this.arcOf(hand.ray);
        else if (hand.arc) {
            const landing = hand.arc[hand.arc.length - 1];
            hand.arc = null;
            if (landing[1] <= headset.floorLevel + 1e-6) headset.jumpTo(landing);
        }
    }

    /** A jump's way through the air; its last point lies on the floor where it comes down. @param {Ray} ray */
    arcOf(ray) {
        const floor = this.headset.floorLevel, points = [ray.position];
        let [at, speed] = [ray.position, ray.along.map((value) => value * JUMP_SPEED)];
        for (let i = 0; i < JUMP_STEPS && at[1] > floor; i++) {
            speed = add(speed, [0, -9.81 * JUMP_STEP_S, 0]);
            const next = add(at, speed, JUMP_STEP_S), part = next[1] < floor ? (at[1] - floor) / (at[1] - next[1]) : 1;
            at = add(at, add(next, at, -1), part);
            points.push(at);
        }
        return points;
    }

    /** @param {any} source @param {Hand} hand @param {number} seconds */
    buttons(source, hand, seconds) {
        const { headset } = this, { panel, home } = SELECT_BUTTONS;
        for (const button of [panel, home]) {
            const pressed = source.gamepad?.buttons[button]?.pressed === true, since = hand.down.get(button);
            if (pressed) {
                hand.down.set(button, (since ?? 0) + seconds);
                if (button === home && since !== undefined && since < LONG_S && since + seconds >= LONG_S) headset.leave();
            } else if (since !== undefined) {
                hand.down.delete(button);
                if (button === panel) headset.switchPanel();
                else if (since < LONG_S) headset.recentre();
            }
        }
    }

    /** A trigger pulled or fingers pinched. @param {any} event */
    selectStart({ frame, inputSource: source }) {
        const { headset } = this, { grab, roomPanel, page } = headset, pose = headset.inWorld(frame, source.targetRaySpace);
        if (!pose) return;
        const ray = { position: pose.position, along: turn(pose.wxyz, [0, 0, -1]) }, at = roomPanel.hit(ray);
        if (at) {
            this.handOf(source).sliding = roomPanel.press(at, page.panel);
            return;
        }
        const found = grab.pick(ray);
        if (!found) return;
        grab.take(source, pose, found.object);
        page.panel.choose(found.object);
    }

    /** @param {any} source */
    letGo(source) {
        this.headset.grab.release(source);
        this.handOf(source).sliding = false;
    }

    /** @param {any} source */
    forget(source) {
        this.letGo(source);
        this.hands.delete(source);
    }

    /** What is held came along with a turn or jump: it was not thrown. */
    moved() { for (const held of this.headset.grab.held.values()) held.track.length = 0; }

    /** Rays, what they meet, arcs. @param {import("./overlay.js").Overlay} overlay */
    draw(overlay) {
        for (const [source, { ray, depth, arc }] of this.hands) {
            if (!ray) continue;
            if (arc) {
                for (let i = 1; i < arc.length; i++) overlay.line(arc[i - 1], arc[i], 0.012, ARC_COLOR);
                overlay.dot(arc[arc.length - 1], 0.12, ARC_COLOR);
            } else if (!this.headset.grab.held.has(source)) {
                const end = add(ray.position, ray.along, depth);
                overlay.line(ray.position, end, 0.004, RAY_COLOR);
                overlay.dot(end, 0.012, KNOB_COLOR);
            }
            overlay.dot(ray.position, 0.02, RAY_COLOR);
        }
    }
}

/** Radians about +y by which an eye looks to the left of -z. @param {number[]} wxyz */
export function yawOf(wxyz) {
    const [x, , z] = turn(wxyz, [0, 0, -1]);
    return Math.atan2(-x, -z);
}

/** A pose turned about a point that stays. @param {Pose} pose @param {number[]} wxyz @param {number[]} point @returns {Pose} */
export function turnedAbout(pose, wxyz, point) {
    return { position: add(point, turn(wxyz, add(pose.position, point, -1))), wxyz: product(wxyz, pose.wxyz) };
}
