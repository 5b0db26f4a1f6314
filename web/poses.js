// poses: as in scene/pose.py.  p_a = a_from_b p_b; matrices are row after row, 3 x 4.  The eye
// looks along -z, y is up; quaternions have w first; metres and radians.

/** @typedef {number[]} Vec3 */
/** @typedef {{position: number[], wxyz: number[]}} Pose */

/** @type {Pose} */
export const IDENTITY = { position: [0, 0, 0], wxyz: [1, 0, 0, 0] };

/** @param {number[]} p @param {number[]} q  quaternions @returns {number[]} */
export function product([a, b, c, d], [e, f, g, h]) {
    return [
        a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e,
    ];
}

/** @param {number[]} q @returns {number[]} */
export const conjugate = ([w, x, y, z]) => [w, -x, -y, -z];

/** @param {number[]} q @param {Vec3} v @returns {Vec3} */
export const turn = (q, v) => product(product(q, [0, ...v]), conjugate(q)).slice(1);

/** @param {Vec3} a @param {Vec3} b @param {number} s @returns {Vec3} a + s b */
export const add = (a, b, s = 1) => a.map((value, i) => value + s * b[i]);

/** @param {Vec3} a @param {Vec3} b */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** @param {Vec3} v */
export const length = (v) => Math.hypot(...v);

/** @param {Pose} aFromB @param {Pose} bFromC @returns {Pose} a_from_c */
export const chain = (aFromB, bFromC) => ({
    position: add(aFromB.position, turn(aFromB.wxyz, bFromC.position)), wxyz: product(aFromB.wxyz, bFromC.wxyz),
});

/** @param {Pose} aFromB @returns {Pose} b_from_a */
export function inverse({ position, wxyz }) {
    const back = conjugate(wxyz);
    return { position: turn(back, position).map((value) => -value), wxyz: back };
}

/** @param {Pose} aFromB @param {Vec3} point */
export const moved = (aFromB, point) => add(aFromB.position, turn(aFromB.wxyz, point));

/** @param {Pose} pose @returns {number[]} its matrix, 3 rows of 4 */
export function rows({ position, wxyz: [w, x, y, z] }) {
    return [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), position[0],
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), position[1],
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), position[2],
    ];
}

/** @param {Vec3} axis  unit @param {number} angle @returns {number[]} quaternion */
export function about(axis, angle) {
    const s = Math.sin(angle / 2);
    return [Math.cos(angle / 2), axis[0] * s, axis[1] * s, axis[2] * s];
}

/** The eye that looks at a target, +y up. @param {Vec3} eye @param {Vec3} target @returns {Pose} */
export function lookAt(eye, target) {
    const [dx, dy, dz] = add(target, eye, -1), yaw = Math.atan2(-dx, -dz), pitch = Math.atan2(dy, Math.hypot(dx, dz));
    return { position: eye, wxyz: product(about([0, 1, 0], yaw), about([1, 0, 0], pitch)) };
}

/** Tangents left, right, down, up. @param {number} fovY @param {number[]} size */
export function perspective(fovY, [width, height]) {
    const up = Math.tan(fovY / 2), right = (up * width) / height;
    return [-right, right, -up, up];
}
