// overlay: what lies over the splats in a headset, whatever is nearer: the panel, rays, a jump's arc.
import { add, inverse, length, moved } from "../poses.js";

/** @typedef {import("../renderer/project.js").View} View */

const CORNERS = `
uniform vec4 corners[4];  // clip space: lower left, lower right, upper left, upper right
out vec2 place;           // 0..1 from upper left

void main() {
    place = vec2(gl_VertexID & 1, 1 - (gl_VertexID >> 1));
    gl_Position = corners[gl_VertexID];
}`;

const FLAT = `
uniform sampler2D picture;
uniform bool use_picture;
uniform vec4 color;       // premultiplied
in vec2 place;
layout(location = 0) out vec4 premultiplied;

void main() {
    premultiplied = use_picture ? texture(picture, place) : color;
}`;

export class Overlay {
    /** @param {import("../renderer/gl.js").Gpu} gpu */
    constructor(gpu) {
        this.gpu = gpu;
        this.program = gpu.program(CORNERS, FLAT);
        this.nothing = gpu.texture("rgba8", 1, 1);
        /** @type {View | null} */ this.view = null;
    }

    /** Quads go over this view from now on. @param {View} view @param {WebGLFramebuffer | null} target */
    begin(view, target) {
        const { gl } = this.gpu, [x, y, width, height] = view.viewport;
        this.view = view;
        this.worldToEye = inverse(view.worldFromEye);
        gl.bindFramebuffer(gl.FRAMEBUFFER, target);
        gl.viewport(x, y, width, height);
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    }

    end() { this.gpu.gl.disable(this.gpu.gl.BLEND); }

    /** @param {number[][]} corners  world; lower left, lower right, upper left, upper right @param {number[]} color  premultiplied @param {WebGLTexture | null} picture */
    quad(corners, color, picture = null) {
        const { gl } = this.gpu;
        this.program.use({
            corners: { vec4s: corners.flatMap((corner) => this.clip(corner)) }, color,
            use_picture: { int: picture ? 1 : 0 }, picture: { texture: picture ?? this.nothing },
        });
        gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }

    /** A straight line as wide everywhere. @param {number[]} from @param {number[]} to  world @param {number} width  metres @param {number[]} color */
    line(from, to, width, color) {
        const eye = this.view?.worldFromEye.position ?? from, [ax, ay, az] = add(to, from, -1), [bx, by, bz] = add(eye, from, -1);
        const across = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], size = length(across);
        if (!(size > 0)) return;
        const side = across.map((value) => (value * width) / (2 * size));
        this.quad([add(from, side, -1), add(from, side), add(to, side, -1), add(to, side)], color);
    }

    /** A square that looks at the eye. @param {number[]} middle  world @param {number} size  metres @param {number[]} color */
    dot(middle, size, color) {
        const pose = { position: middle, wxyz: this.view?.worldFromEye.wxyz ?? [1, 0, 0, 0] }, half = size / 2;
        this.quad([[-half, -half, 0], [half, -half, 0], [-half, half, 0], [half, half, 0]].map((corner) => moved(pose, corner)), color);
    }

    /** Clip space of a point; nearer than the near plane is clipped. @param {number[]} point  world @returns {number[]} */
    clip(point) {
        const { view, worldToEye } = this;
        if (!view || !worldToEye) return [0, 0, 0, 0];
        const [x, y, z] = moved(worldToEye, point), [left, right, down, up] = view.tangents;
        return [(2 * (x + left * z)) / (right - left) + z, (2 * (y + down * z)) / (up - down) + z, -z - 2 * view.near, -z];
    }
}
