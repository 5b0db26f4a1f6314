// grab: carrying and throwing objects by their bounding boxes.  No engine: boxes fall, rest and push
// each other apart along the axis of least overlap; what turns stops when it lands.
import { about, add, chain, dot, inverse, length, moved, product, turn } from "./poses.js";

/** @typedef {import("./renderer/renderer.js").SceneObject} SceneObject */
/** @typedef {import("./poses.js").Pose} Pose */
/** @typedef {{position: number[], along: number[]}} Ray  along: unit */

const STEP_S = 1 / 120, TRACK_S = 0.1, SLEEP = 0.02, FRICTION = 0.95, MOST_SPEED = 12;  // seconds; of the speed that a step keeps; m/s

export class Grab {
    /** @param {import("./renderer/renderer.js").Renderer} renderer */
    constructor(renderer) {
        this.renderer = renderer;
        const { scene, objects } = renderer;
        this.gravity = scene.gravity ?? 9.81;
        this.floor = scene.floorY ?? -Infinity;
        /** @type {Map<any, {object: SceneObject, handFromObject: Pose, track: {seconds: number, pose: Pose}[]}>} */ this.held = new Map();
        /** @type {Map<SceneObject, {velocity: number[], spin: number[]}>} */ this.moving = new Map();
        this.solid = objects.filter((object, i) => scene.objects[i].solid);
        this.seconds = this.rest = 0;
        /** @type {Map<SceneObject, number[]>} half sides, metres in the object */
        this.halves = new Map(objects.map((object, i) => [object, scene.objects[i].half]));
    }

    /** The first movable object whose bounding box a ray meets. @param {Ray} ray @returns {{object: SceneObject, depth: number} | null} */
    pick(ray) {
        let best = null;
        for (const object of this.renderer.objects) {
            if (!object.movable || !object.visible) continue;
            const back = inverse(object.pose), from = add(moved(back, ray.position), object.centre, -1), along = turn(back.wxyz, ray.along);
            const half = this.halfOf(object).map((side) => Math.max(side, 0.005));
            let near = 0, far = Infinity;
            for (let c = 0; c < 3; c++) {
                const a = (-half[c] - from[c]) / along[c], b = (half[c] - from[c]) / along[c];
                near = Math.max(near, Math.min(a, b));
                far = Math.min(far, Math.max(a, b));
            }
            if (near <= far && (!best || near < best.depth)) best = { object, depth: near };
        }
        return best;
    }

    /** @param {any} hand  whoever holds it @param {Pose} pose  of the hand, world @param {SceneObject} object */
    take(hand, pose, object) {
        for (const [other, { object: its }] of this.held) if (its === object) this.held.delete(other);
        this.moving.delete(object);
        this.held.set(hand, { object, handFromObject: chain(inverse(pose), object.pose), track: [] });
    }

    /** @param {any} hand @param {Pose} pose */
    carry(hand, pose) {
        const held = this.held.get(hand);
        if (!held) return;
        const now = chain(pose, held.handFromObject);
        held.track.push({ seconds: this.seconds, pose: now });
        while (held.track.length > 2 && this.seconds - held.track[0].seconds > TRACK_S) held.track.shift();
        this.renderer.place(held.object, now);
    }

    /** Lets go: it flies on as the hand moved. @param {any} hand */
    release(hand) {
        const held = this.held.get(hand);
        if (!held) return;
        this.held.delete(hand);
        const { track, object } = held, first = track[0], last = track[track.length - 1];
        let velocity = [0, 0, 0], spin = [0, 0, 0];
        if (track.length > 1 && last.seconds > first.seconds && this.seconds - last.seconds < TRACK_S) {
            const time = last.seconds - first.seconds, [w, ...axis] = product(last.pose.wxyz, [first.pose.wxyz[0], ...first.pose.wxyz.slice(1).map((v) => -v)]);
            velocity = add(last.pose.position, first.pose.position, -1).map((value) => value / time);
            const speed = length(velocity), sine = length(axis);
            if (speed > MOST_SPEED) velocity = velocity.map((value) => (value * MOST_SPEED) / speed);
            if (sine > 1e-6) spin = axis.map((value) => (value / sine) * ((2 * Math.atan2(sine, Math.abs(w)) * Math.sign(w || 1)) / time));
        }
        this.moving.set(object, { velocity, spin });
    }

    /** @param {number} seconds @returns {boolean} whether something moves */
    step(seconds) {
        this.seconds += seconds;
        this.rest = Math.min(this.rest + seconds, 0.1);
        if (!this.moving.size) this.rest = 0;
        while (this.rest >= STEP_S && this.moving.size) {
            this.rest -= STEP_S;
            for (const [object, motion] of this.moving) this.fly(object, motion);
        }
        return this.moving.size > 0 || this.held.size > 0;
    }

    /** @param {SceneObject} object @param {{velocity: number[], spin: number[]}} motion */
    fly(object, motion) {
        motion.velocity = add(motion.velocity, [0, -this.gravity * STEP_S, 0]);
        const angle = length(motion.spin), middle = moved(object.pose, object.centre);
        const wxyz = angle > 1e-6 ? product(about(motion.spin.map((value) => value / angle), angle * STEP_S), object.pose.wxyz) : object.pose.wxyz;
        const to = add(middle, motion.velocity, STEP_S);
        object.pose = { position: add(to, turn(wxyz, object.centre), -1), wxyz };
        const landed = this.collide(object, motion);
        this.renderer.place(object, object.pose);
        if (landed && length(motion.velocity) < SLEEP + this.gravity * STEP_S) this.moving.delete(object);
        if (!(object.pose.position[1] > -1e3)) this.moving.delete(object);  // there is no floor
    }

    /** Pushes an object out of the floor and of other boxes; whether it stands on something. @param {SceneObject} object @param {{velocity: number[], spin: number[]}} motion */
    collide(object, motion) {
        let landed = false;
        const mine = this.boxOf(object), below = this.floor - (mine.middle[1] - mine.half[1]);
        if (below > 0) landed = this.push(object, motion, 1, below);
        for (const other of this.solid) {
            if (other === object || [...this.held.values()].some((held) => held.object === other)) continue;
            const box = this.boxOf(object), its = this.boxOf(other), to = add(box.middle, its.middle, -1), overlap = box.half.map((half, c) => half + its.half[c] - Math.abs(to[c]));
            if (!overlap.every((value) => value > 0)) continue;
            const c = overlap.indexOf(Math.min(...overlap));
            if (overlap[c] > 1.5 * box.half[c]) continue;  // well inside: a room that surrounds it
            landed = this.push(object, motion, c, Math.sign(to[c] || 1) * overlap[c]) || landed;
        }
        return landed;
    }

    /** @param {SceneObject} object @param {{velocity: number[], spin: number[]}} motion @param {number} axis @param {number} by  metres @returns {boolean} */
    push(object, motion, axis, by) {
        const out = [0, 0, 0], bounce = this.renderer.scene.objects[this.renderer.objects.indexOf(object)].restitution ?? 0.1;
        out[axis] = by;
        object.pose = { ...object.pose, position: add(object.pose.position, out) };
        const speed = motion.velocity[axis];
        if (speed * by < 0) {
            motion.velocity = motion.velocity.map((value, c) => (c === axis ? (Math.abs(speed) > 0.3 ? -bounce * speed : 0) : value * FRICTION));
            motion.spin = motion.spin.map((value) => 0.5 * value);
        }
        if (axis === 1 && Math.abs(motion.velocity[1]) < 0.3) motion.spin = [0, 0, 0];
        return axis === 1 && by > 0;
    }

    /** The box along the world's axes around an object as it lies. @param {SceneObject} object */
    boxOf(object) {
        const half = this.halfOf(object), middle = moved(object.pose, object.centre);
        const sides = [0, 1, 2].map((c) => turn(object.pose.wxyz, [0, 1, 2].map((i) => (i === c ? half[c] : 0))));
        return { middle, half: [0, 1, 2].map((c) => sides.reduce((sum, side) => sum + Math.abs(side[c]), 0)) };
    }

    /** @param {SceneObject} object */
    halfOf(object) { return this.halves.get(object) ?? [object.radius, object.radius, object.radius]; }
}

/** The hand of a pointer: as far along its ray as it took the object. @param {Ray} ray @param {number} depth @returns {Pose} */
export const handOnRay = (ray, depth) => ({ position: add(ray.position, ray.along, depth), wxyz: [1, 0, 0, 0] });

/** How deep a point lies along a ray. @param {Ray} ray @param {number[]} point */
export const depthAlong = (ray, point) => dot(add(point, ray.position, -1), ray.along);
