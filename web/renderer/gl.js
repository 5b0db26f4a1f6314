// gl: the few WebGL2 calls that every pass needs.  A "list" stands for renderer/'s storage buffers,
// which WebGL2 has not: a texture of WIDTH texels a row, element i at (i % WIDTH, i / WIDTH).
import { WIDTH } from "../conventions.js";

const HEADER = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
precision highp usampler2D;
const int WIDTH = ${WIDTH};
ivec2 at(int i) { return ivec2(i % WIDTH, i / WIDTH); }
bool finite(float x) { return abs(x) <= 3.4e38; }  // NaN is not
`;

const WHOLE = `void main() {
    gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0);
}`;

/** @type {Record<string, [string, string, string]>} kind -> internal format, format, type */
const KINDS = {
    rgba32f: ["RGBA32F", "RGBA", "FLOAT"],
    rgba16f: ["RGBA16F", "RGBA", "HALF_FLOAT"],
    rgba16: ["RGBA16_EXT", "RGBA", "UNSIGNED_SHORT"],  // of EXT_texture_norm16
    rgba8: ["RGBA8", "RGBA", "UNSIGNED_BYTE"],
    r32ui: ["R32UI", "RED_INTEGER", "UNSIGNED_INT"],
};

/**
 * @typedef {{texture: WebGLTexture} | {layers: WebGLTexture} | {int: number}
 *   | {vec4s: number[]} | number | number[]} Uniform
 */

/** @param {number} count */
export const rowsOf = (count) => Math.max(1, Math.ceil(count / WIDTH));

export class Program {
    /**
     * @param {WebGL2RenderingContext} gl
     * @param {string | null} vertex  null: one triangle over the viewport
     * @param {string} fragment
     */
    constructor(gl, vertex, fragment) {
        this.gl = gl;
        this.handle = /** @type {WebGLProgram} */ (gl.createProgram());
        this.shaders = [[gl.VERTEX_SHADER, vertex ?? WHOLE], [gl.FRAGMENT_SHADER, fragment]].map(([kind, text]) => {
            const shader = /** @type {WebGLShader} */ (gl.createShader(Number(kind)));
            gl.shaderSource(shader, HEADER + text);
            gl.compileShader(shader);
            gl.attachShader(this.handle, shader);
            gl.deleteShader(shader);  // goes with the program
            return shader;
        });
        gl.linkProgram(this.handle);
        /** @type {Record<string, WebGLUniformLocation | null>} */
        this.locations = {};
        this.checked = false;
    }

    /** Only at the first use: drivers compile several programs at once until somebody looks. */
    check() {
        const { gl, handle } = this;
        this.checked = true;
        if (gl.isContextLost() || gl.getProgramParameter(handle, gl.LINK_STATUS)) return;
        const logs = this.shaders.map((shader) => gl.getShaderInfoLog(shader));
        throw new Error(`this browser's graphics driver refuses a shader (${logs.join(" ")} ${gl.getProgramInfoLog(handle)})`);
    }

    /** @param {Record<string, Uniform>} values  textures get units in order */
    use(values) {
        const { gl } = this;
        if (!this.checked) this.check();
        gl.useProgram(this.handle);
        this.set(values);
    }

    /** More uniforms of the program in use; textures count from unit 0. @param {Record<string, Uniform>} values */
    set(values) {
        const { gl } = this;
        let unit = 0;
        for (const [name, value] of Object.entries(values)) {
            const at = (this.locations[name] ??= gl.getUniformLocation(this.handle, name));
            if (typeof value === "number") gl.uniform1f(at, value);
            else if (Array.isArray(value)) {
                if (value.length === 2) gl.uniform2fv(at, value);
                else if (value.length === 3) gl.uniform3fv(at, value);
                else gl.uniform4fv(at, value);
            } else if ("int" in value) gl.uniform1i(at, value.int);
            else if ("vec4s" in value) gl.uniform4fv(at, value.vec4s);
            else {
                gl.activeTexture(gl.TEXTURE0 + unit);
                if ("texture" in value) gl.bindTexture(gl.TEXTURE_2D, value.texture);
                else gl.bindTexture(gl.TEXTURE_2D_ARRAY, value.layers);
                gl.uniform1i(at, unit++);
            }
        }
    }

    /** @param {Record<string, WebGLBuffer>} buffers  uniform blocks by their names */
    useBlocks(buffers) {
        const { gl, handle } = this;
        Object.entries(buffers).forEach(([name, buffer], slot) => {
            const block = gl.getUniformBlockIndex(handle, name);
            if (block === gl.INVALID_INDEX) return;
            gl.uniformBlockBinding(handle, block, slot);
            gl.bindBufferBase(gl.UNIFORM_BUFFER, slot, buffer);
        });
    }
}

/** Everything that one scene has on the GPU; close() gives it back. */
export class Gpu {
    /** @param {WebGL2RenderingContext} gl */
    constructor(gl) {
        if (!gl.getExtension("EXT_color_buffer_float"))
            throw new Error("this browser cannot draw into float textures, which a scene needs");
        this.gl = gl;
        /** @type {Set<WebGLTexture>} */ this.textures = new Set();
        /** @type {Set<WebGLFramebuffer>} */ this.framebuffers = new Set();
        /** @type {Set<WebGLBuffer>} */ this.buffers = new Set();
        /** @type {Program[]} */ this.programs = [];
        this.norm16 = gl.getExtension("EXT_texture_norm16");
        this.vertexArray = gl.createVertexArray();  // no attributes at all
        gl.bindVertexArray(this.vertexArray);
        gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    }

    /** @param {string | null} vertex @param {string} fragment */
    program(vertex, fragment) {
        const made = new Program(this.gl, vertex, fragment);
        this.programs.push(made);
        return made;
    }

    /** @param {string} kind @param {number} width @param {number} height @param {ArrayBufferView | null} data @param {number} layers */
    texture(kind, width, height, data = null, layers = 0) {
        const { gl } = this, [internal, format, type] = KINDS[kind], target = layers ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D;
        const constant = (/** @type {string} */ name) => /** @type {number} */ (/** @type {any} */ (gl)[name] ?? /** @type {any} */ (this.norm16)[name]);
        const handle = /** @type {WebGLTexture} */ (gl.createTexture());
        gl.bindTexture(target, handle);
        if (layers) gl.texStorage3D(target, 1, constant(internal), width, height, layers);
        else gl.texStorage2D(target, 1, constant(internal), width, height);
        for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, side, gl.NEAREST);
        for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(target, side, gl.CLAMP_TO_EDGE);
        if (data && layers) gl.texSubImage3D(target, 0, 0, 0, 0, width, height, layers, constant(format), constant(type), data);
        else if (data) gl.texSubImage2D(target, 0, 0, 0, width, height, constant(format), constant(type), data);
        this.textures.add(handle);
        return handle;
    }

    /**
     * A list of `count` texels; data: 4 numbers (of r32ui 1) each, of the array type of its kind.
     * @param {string} kind @param {number} count @param {Float32Array | Uint16Array | null} data
     */
    list(kind, count, data = null) {
        const size = 4 * WIDTH * rowsOf(count), { gl } = this;
        if (!(rowsOf(count) <= gl.getParameter(gl.MAX_TEXTURE_SIZE))) throw new Error("the scene has more splats than this device's textures hold");
        if (data && data.length < size) {
            const whole = data instanceof Float32Array ? new Float32Array(size) : new Uint16Array(size);
            whole.set(data);
            data = whole;
        }
        return this.texture(kind, WIDTH, rowsOf(count), data);
    }

    /** @param {WebGLTexture[]} textures */
    framebuffer(...textures) {
        return this.attached(textures.map((texture) => ({ texture, layer: -1 })));
    }

    /** @param {WebGLTexture} layers @param {number} first @param {number} count */
    framebufferOfLayers(layers, first, count) {
        return this.attached(Array.from({ length: count }, (_, i) => ({ texture: layers, layer: first + i })));
    }

    /** @param {{texture: WebGLTexture, layer: number}[]} attachments */
    attached(attachments) {
        const { gl } = this, handle = /** @type {WebGLFramebuffer} */ (gl.createFramebuffer());
        gl.bindFramebuffer(gl.FRAMEBUFFER, handle);
        attachments.forEach(({ texture, layer }, i) => {
            const place = gl.COLOR_ATTACHMENT0 + i;
            if (layer < 0) gl.framebufferTexture2D(gl.FRAMEBUFFER, place, gl.TEXTURE_2D, texture, 0);
            else gl.framebufferTextureLayer(gl.FRAMEBUFFER, place, texture, 0, layer);
        });
        gl.drawBuffers(attachments.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
        if (!gl.isContextLost() && gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE)
            throw new Error("this browser cannot draw into float textures of this size");
        this.framebuffers.add(handle);
        return handle;
    }

    /** @param {Float32Array} data  whole vec4s */
    uniformBuffer(data) {
        const { gl } = this, handle = /** @type {WebGLBuffer} */ (gl.createBuffer());
        gl.bindBuffer(gl.UNIFORM_BUFFER, handle);
        gl.bufferData(gl.UNIFORM_BUFFER, data, gl.DYNAMIC_DRAW);
        this.buffers.add(handle);
        return handle;
    }

    /** @param {Uint16Array} data */
    indexBuffer(data) {
        const { gl } = this, handle = /** @type {WebGLBuffer} */ (gl.createBuffer());
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, handle);
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, data, gl.STATIC_DRAW);
        this.buffers.add(handle);
        return handle;
    }

    /** @param {WebGLBuffer} buffer @param {Float32Array} data */
    updateUniforms(buffer, data) {
        this.gl.bindBuffer(this.gl.UNIFORM_BUFFER, buffer);
        this.gl.bufferSubData(this.gl.UNIFORM_BUFFER, 0, data);
    }

    /** @param {WebGLTexture} texture @param {number} rows @param {Float32Array} data  whole rows of a list of rgba32f */
    updateList(texture, rows, data) {
        const { gl } = this;
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDTH, rows, gl.RGBA, gl.FLOAT, data);
    }

    /** One triangle over rows first to first + rows - 1 of the framebuffer's lists. @param {WebGLFramebuffer} framebuffer @param {number} rows @param {number} first */
    fill(framebuffer, rows, first = 0) {
        const { gl } = this;
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        gl.viewport(0, first, WIDTH, rows);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    /** @param {WebGLTexture} texture @param {WebGLFramebuffer} framebuffer */
    drop(texture, framebuffer) {
        this.gl.deleteTexture(texture);
        this.gl.deleteFramebuffer(framebuffer);
        this.textures.delete(texture);
        this.framebuffers.delete(framebuffer);
    }

    close() {
        const { gl } = this;
        this.textures.forEach((texture) => gl.deleteTexture(texture));
        this.framebuffers.forEach((framebuffer) => gl.deleteFramebuffer(framebuffer));
        this.buffers.forEach((buffer) => gl.deleteBuffer(buffer));
        this.programs.forEach((program) => gl.deleteProgram(program.handle));
        gl.deleteVertexArray(this.vertexArray);
    }
}
