// What moves on a page, without a browser: camera, slider, sharpness, sticks, things that fall.
//     node motion.mjs < the stops and paces of a model > what it did
import { readFileSync } from "node:fs";
import { Camera } from "../../../web/camera.js";
import { Shift, Sweep, snap } from "../../../web/control.js";
import { Grab } from "../../../web/grab.js";
import { Hands } from "../../../web/headset/hands.js";
import { Sharpness } from "../../../web/headset/sharpness.js";
import { StopBlend } from "../../../web/renderer/stops.js";

const { stops, pace, starts, step_s, steps } = JSON.parse(readFileSync(0, "utf8"));
const blend = new StopBlend(stops, pace), told = {};

told.sweeps = starts.map((x) => {
    const sweep = new Sweep(blend, x);
    return Array.from({ length: steps }, () => blend.weights(sweep.advance(step_s)));
});
told.shift = Array.from({ length: 8 }, (_, k) => {
    const shift = new Shift(stops[0].x, stops[2].x, blend);
    shift.seconds = k / 10;
    return [blend.weights(shift.control()), shift.over];
});
told.snapped = [0.379, 0.381, 0.4, 0.419, 0.421, 0.7].map((x) => snap(x, stops));

function dragged(by, buttons = 1) {  // the pose before, and after a drag by so many pixels
    const on = {}, canvas = {
        clientWidth: 480, clientHeight: 400, setPointerCapture() {}, addEventListener(name, act) { on[name] = act; },
    };
    const camera = new Camera(canvas, { eye: [0.5, 1, 3], target: [0, 0.2, 0], fovY: 0.8 }, () => {}), before = camera.pose;
    on.pointerdown({ pointerId: 1, clientX: 200, clientY: 200, timeStamp: 1e4, offsetX: 0, offsetY: 0 });
    on.pointermove({ pointerId: 1, clientX: 200 + by[0], clientY: 200 + by[1], buttons });
    return { before, after: camera.pose };
}
told.orbits = [[40, 0], [0, 30], [-25, -10]].map((by) => dragged(by));
told.pan = dragged([40, -20], 2);
told.steep = dragged([0, 5000]);  // far over the pole

const sharpness = (ms, frames) => {
    const made = new Sharpness(1000 / 72);
    for (let k = 0; k < frames; k++) made.step(ms * made.period);
    return made.scale;
};
told.scales = [1, 1.14, 1.16, 2].map((periods) => sharpness(periods, 40));

told.turns = [0.9, -0.9, 0.5].map((across) => {
    const turns = [], source = { handedness: "right", gamepad: { axes: [0, 0, across, 0] } };
    const hands = new Hands({ grab: { held: new Map() }, page: {}, turnBy: (by) => turns.push(by) });
    for (let k = 0; k < 3; k++) hands.stick(source, hands.handOf(source), [source, { gamepad: {} }], false, 0.01);
    return turns;
});

function thing() {
    const object = { pose: { position: [0, 5, 0], wxyz: [1, 0, 0, 0] }, centre: [0, 0, 0], movable: true, visible: true };
    const scene = { gravity: 9.81, floorY: 0, objects: [{ solid: true, half: [0.1, 0.2, 0.1], restitution: 0 }] };
    return { object, grab: new Grab({ scene, objects: [object], place: (what, pose) => { what.pose = pose; } }) };
}
const { object, grab } = thing();
grab.moving.set(object, { velocity: [1, 0, 0], spin: [0, 0, 0] });
for (let k = 0; k < 60; k++) grab.step(1 / 120);
told.fell = object.pose.position;
for (let k = 0; k < 600; k++) grab.step(1 / 120);
told.lies = [object.pose.position[1], grab.moving.size];

told.thrown = [3, 100].map((speed) => {
    const { object: held, grab: by } = thing(), hand = {}, at = (k) => ({ position: [(speed * k) / 90, 5, 0], wxyz: [1, 0, 0, 0] });
    by.take(hand, at(0), held);
    for (let k = 1; k < 9; k++) {
        by.step(1 / 90);
        by.carry(hand, at(k));
    }
    by.release(hand);
    return by.moving.get(held).velocity;
});
process.stdout.write(JSON.stringify(told));
