// renderer: the passes of a frame in their order; the file to read first.  decode, project, sort,
// splat, resolve, as renderer/renderer.py has them.  Nothing of the page is in here.
import { LUMINANCE, RESORT_DEGREES, RESORT_PART, WIDTH } from "../conventions.js";
import { Arena } from "./arena.js";
import { checkScene } from "./container.js";
import { Decoder } from "./decode.js";
import { shadeOf, wayOf } from "./false_colors.js";
import { Gpu, rowsOf } from "./gl.js";
import { loadModel } from "./models.js";
import { add, chain, dot, inverse, length, rows } from "../poses.js";
import { Regions } from "./regions.js";
import { hasFalseColors } from "./stops.js";
import { Projector } from "./project.js";
import { Resolver } from "./resolve.js";
import { Sorter } from "./sort.js";
import { Splatter } from "./splat.js";

/** @typedef {import("../poses.js").Pose} Pose */
/** @typedef {import("./project.js").View} View */
/** @typedef {import("./stops.js").Control} Control */

/** What is in the world: a model with a pose and a control, and what of it is decoded. */
export class SceneObject {
    /** @param {import("../entries.js").ObjectEntry} described @param {import("./models.js").Model} model @param {number} row  of the arena */
    constructor(described, model, row) {
        this.name = String(described.name);
        this.model = model;
        /** @type {Control} */ this.x = described.x;
        /** @type {Pose} */ this.pose = { position: described.position, wxyz: described.wxyz };
        this.centre = described.centre;  // of its bounding sphere, metres in the object
        this.radius = described.radius;
        this.movable = described.movable === true;
        this.visible = described.visible !== false;
        this.states = described.states ?? model.stops;
        this.count = model.anchors * model.perAnchor;
        this.row = row;
        this.rows = rowsOf(this.count);
        this.first = row * WIDTH;
        this.shaped = false;
        /** @type {string} */ this.coloredFor = "";  // the shade that is decoded
        /** @type {number[] | null} */ this.coloredFrom = null;
        /** @type {Regions | null} */ this.own = null;  // of an object with regions: each anchor's weights of the stops
    }

    /** Rows of eye_from_object; a hidden object is nowhere. @param {Pose} worldFromEye */
    seenFrom(worldFromEye) {
        return this.visible ? rows(chain(inverse(worldFromEye), this.pose)) : new Array(12).fill(NaN);
    }
}

export class Renderer {
    /** @param {WebGL2RenderingContext} gl @param {import("./container.js").Container} container @param {() => void} onChange  there is something new to draw */
    constructor(gl, container, onChange = () => {}) {
        const { scene, array, table } = container;
        checkScene(container);
        this.gl = gl;
        this.gpu = new Gpu(gl);
        this.scene = scene;
        /** @type {number[]} */ this.background = scene.background;
        this.onChange = onChange;
        /** @type {Record<string, Float32Array>} */
        this.palettes = Object.fromEntries(Object.entries(scene.palettes ?? {}).map(([name, coded]) => [name, table(coded, 256)]));
        this.models = scene.models.map((described) => loadModel(this.gpu, described, container));
        let row = 0;
        /** @type {SceneObject[]} */
        this.objects = scene.objects.map((described) => {
            const object = new SceneObject(described, this.models[described.model], row);
            row += object.rows;
            if (described.regions?.length) {
                const regions = described.regions.map((region) => (region.kind === "painted" ? { ...region, weight: table(region.weight, object.model.anchors) } : region));
                object.own = new Regions(this.gpu, object, regions);
            }
            return object;
        });
        const hasHeat = this.models.some((model) => model.stops.some(hasFalseColors));
        this.arena = new Arena(this.gpu, row, this.palettes, hasHeat, scene.brightest ?? Infinity);
        this.decoder = new Decoder(this.gpu, this.arena);
        this.projector = new Projector(this.gpu, this.arena);
        this.splatter = new Splatter(this.gpu, this.arena);
        this.resolver = new Resolver(this.gpu, this.arena);
        for (const model of this.models) this.decoder.prepare(model);
        this.sorter = new Sorter((order, count) => { this.takeOrder(order, count); this.onChange(); });
        /** @type {{object: SceneObject, buffer: WebGLBuffer, fence: WebGLSync}[]} */ this.reads = [];
        /** @type {Pose | null} */ this.sortedFor = null;
        this.resortDegrees = RESORT_DEGREES;
        this.recolorDegrees = 0;
        this.direct = false;  // blended in the target itself, where no palette needs a picture of its own
        /** @type {{way: import("./false_colors.js").Way, palette: string}} */ this.colors = { way: "no heat", palette: "" };
    }

    /** @param {Control} x @param {SceneObject | null} object  null: all */
    setX(x, object = null) {
        for (const o of object ? [object] : this.objects) {
            if (o.x === x) continue;
            o.x = x;
            if (o.model.shapeFollows) o.shaped = false;
        }
        this.onChange();
    }

    /** @param {SceneObject} object @param {Pose} pose */
    place(object, pose) {
        object.pose = pose;
        this.sortedFor = null;
        this.onChange();
    }

    /** Every pass that the views need. @param {View[]} views @param {WebGLFramebuffer | null} target @param {number} passesThrough */
    draw(views, target = null, passesThrough = 0) {
        const middle = views.reduce((sum, view) => add(sum, view.worldFromEye.position, 1 / views.length), [0, 0, 0]);
        const sizes = views.map(({ viewport, scale }) => viewport.slice(2).map((pixels) => Math.max(1, Math.round(pixels * (scale ?? 1)))));
        this.gl.bindVertexArray(this.gpu.vertexArray);
        this.decode(middle);
        this.takeMeans();
        this.sort({ ...views[0].worldFromEye, position: middle }, views[0].near);
        const heat = this.colors.way === "beside";
        views.forEach((view, i) => this.projector.project(i, this.objects, view, sizes[i]));
        const direct = views.map(({ scale }) => this.direct && !(scale && scale < 1) && ["no heat", "splats"].includes(this.colors.way));
        const ground = passesThrough ? [0, 0, 0, 0] : [...this.background, 1];
        views.forEach(({ viewport }, i) => this.splatter.draw(i, sizes[i], heat, direct[i] ? { target, viewport, ground } : null));
        views.forEach((view, i) => direct[i] || this.resolver.draw(i, target, view.viewport, this.background, this.colors, passesThrough));
    }

    /** Only what has another x, or is looked at from elsewhere. @param {number[]} eye  world metres */
    decode(eye) {
        for (const object of this.objects) if (object.own?.update(object)) object.shaped = false;
        const shades = this.objects.map((o) => shadeOf(o.model, o.x, o.own?.most));
        this.colors = wayOf(shades.filter((_, i) => this.objects[i].visible));
        this.objects.forEach((object, i) => {
            if (!object.shaped) {
                this.decoder.decodeShape(object);
                this.readMeans(object);
                object.shaped = true;
            }
            const inObject = chain(inverse(object.pose), { position: eye, wxyz: [1, 0, 0, 0] }).position;
            const key = JSON.stringify([this.colors.way, shades[i], object.own?.version]), from = object.coloredFrom;
            if (key === object.coloredFor && from && (!object.model.colorsLook || !this.looksOther(object, from, inObject))) return;
            this.decoder.decodeColors(object, shades[i], this.colors.way, inObject);
            object.coloredFor = key;
            object.coloredFrom = inObject;
        });
    }

    /** Whether colours that were made for one eye are too old for another one, both in the object. @param {SceneObject} object @param {number[]} from @param {number[]} to */
    looksOther(object, from, to) {
        if (!this.recolorDegrees) return length(add(to, from, -1)) > 0;
        const a = add(from, object.centre, -1), b = add(to, object.centre, -1);
        return !(dot(a, b) >= length(a) * length(b) * Math.cos((this.recolorDegrees * Math.PI) / 180));
    }

    /** What may be left out from now on. @param {import("../headset/sharpness.js").Levers} levers */
    leaveOut({ minAlpha, direct, resortDegrees, recolorDegrees }) {
        Object.assign(this, { direct, resortDegrees, recolorDegrees });
        this.arena.minAlpha = minAlpha;
    }

    /** Means and opacities on their way back to the sorter, without waiting for the GPU. @param {SceneObject} object */
    readMeans(object) {
        const { gl } = this, buffer = /** @type {WebGLBuffer} */ (gl.createBuffer());
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.arena.means);
        gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
        gl.bufferData(gl.PIXEL_PACK_BUFFER, 16 * WIDTH * object.rows, gl.STREAM_READ);
        gl.readPixels(0, object.row, WIDTH, object.rows, gl.RGBA, gl.FLOAT, 0);
        gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
        this.reads = this.reads.filter((read) => read.object !== object || this.forget(read));
        const fence = /** @type {WebGLSync} */ (gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0));
        this.reads.push({ object, buffer, fence });
        gl.flush();
    }

    /** @param {{buffer: WebGLBuffer, fence: WebGLSync}} read @returns {false} */
    forget({ buffer, fence }) {
        this.gl.deleteBuffer(buffer);
        this.gl.deleteSync(fence);
        return false;
    }

    /** Hands means that have come to the sorter; whether some have. */
    takeMeans() {
        const { gl } = this, waiting = this.reads.length;
        this.reads = this.reads.filter((read) => {
            const { object, buffer, fence } = read;
            if (gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) return true;
            const means = new Float32Array(4 * object.count);
            gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
            gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, means);
            gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
            this.sorter.setMeans(object.first, means);
            this.sortedFor = null;
            return this.forget(read);
        });
        return this.reads.length < waiting;
    }

    /** Asks for a new order where the view has turned or something has moved since the last one. @param {Pose} worldFromEye @param {number} near */
    sort(worldFromEye, near) {
        if (this.sortedFor) {
            const [w] = chain(inverse(this.sortedFor), worldFromEye).wxyz, turned = (360 / Math.PI) * Math.acos(Math.min(1, Math.abs(w)));
            const way = length(add(worldFromEye.position, this.sortedFor.position, -1));
            if (turned <= this.resortDegrees && way <= RESORT_PART * this.scene.radius) return;
        }
        const frames = this.objects.map((object) => /** @type {[number, number[]]} */ ([object.first, object.seenFrom(worldFromEye).slice(8)]));
        this.sorter.sort(frames, near);
        this.sortedFor = worldFromEye;
    }

    /** @param {Uint32Array} order  whole rows of the list @param {number} count */
    takeOrder(order, count) {
        const { gl, arena } = this;
        gl.bindTexture(gl.TEXTURE_2D, arena.order);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDTH, rowsOf(count), gl.RED_INTEGER, gl.UNSIGNED_INT, order);
        arena.sorted = count;
    }

    /** Whether the last frame showed everything as it is: no read-back and no sort under way. */
    get settled() {
        return !this.reads.length && this.sorter.settled && this.sortedFor !== null && this.objects.every((object) => object.shaped);
    }

    /** How much of a palette an object shows, and of which stop: for a legend. @param {SceneObject} object */
    measured(object) {
        const weights = object.model.blend.weights(object.x);
        let best = null;
        for (const [s, stop] of object.model.stops.entries())
            if (hasFalseColors(stop) && weights[s] > (best?.weight ?? 0)) best = { weight: weights[s], stop };
        return best;
    }

    /** The value 0..1 that a value stop shows at a place of the last picture; null: none there. @param {number} x @param {number} y  0..1 from lower left */
    valueAt(x, y) {
        const { gl, colors, arena } = this, image = arena.images[0], beside = colors.way === "beside";
        if (!image || !["picture", "beside"].includes(colors.way)) return null;
        const pixel = new Float32Array(4), [width, height] = image.size;
        gl.bindFramebuffer(gl.FRAMEBUFFER, image.framebuffer);
        gl.readBuffer(beside ? gl.COLOR_ATTACHMENT1 : gl.COLOR_ATTACHMENT0);
        const normalised = arena.target === "rgba16", raw = normalised ? new Uint16Array(4) : pixel;
        gl.readPixels(Math.floor(x * width), Math.floor(y * height), 1, 1, gl.RGBA, normalised ? gl.UNSIGNED_SHORT : gl.FLOAT, raw);
        if (normalised) pixel.set(Array.from(raw, (step) => step / 65535));
        gl.readBuffer(gl.COLOR_ATTACHMENT0);
        const [r, g, b, a] = pixel, value = arena.unit * (beside ? r / g : (LUMINANCE[0] * r + LUMINANCE[1] * g + LUMINANCE[2] * b) / a);
        return (beside ? g : a) > 0.1 ? Math.min(1, Math.max(0, value)) : null;
    }

    close() {
        this.reads.forEach((read) => this.forget(read));
        this.sorter.close();
        this.gpu.close();
    }
}
