#!/usr/bin/env bash
# gltf-transform 4.5.1 makes plain points of a splat GLB, and meshopt() scales places, not sizes.
#
# Expected: a library that is asked to read a glTF and to write it again keeps, or refuses, what it
# does not know; an operation that scales a node keeps what stands in the node's units.
# What happens: KHR_gaussian_splatting is dropped from the primitive and from extensionsUsed by
# reading and writing alone (the log says that an optional extension is missing), while the
# attributes KHR_gaussian_splatting:* stay: a viewer finds a cloud of points with odd attributes.
# meshopt() writes places as 16-bit steps under a node whose scale makes up for it and leaves the
# SCALE attribute as it was: a reader that knows the attributes and multiplies by the node, as the
# extension asks, draws every splat 3.5 times too large here.
# What it means: keep gltf-transform (and what is built on it) away from splat GLBs, or put the
# extension back and divide SCALE by the node's scale.
#
# Packages: npm @gltf-transform/core, /functions and /extensions 4.5.1, meshoptimizer 1.3.0.
# Seen in November 2026.
# Exit code: 0 while this holds, 1 when it has changed, 3 when a package cannot be had.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-fund --no-audit --ignore-scripts @gltf-transform/core@4.5.1 \
    @gltf-transform/functions@4.5.1 @gltf-transform/extensions@4.5.1 meshoptimizer@1.3.0 \
    >/dev/null 2>&1 || exit 3

cat >splats.mjs <<'JS'
import { NodeIO, Logger } from "@gltf-transform/core";
import { ALL_EXTENSIONS } from "@gltf-transform/extensions";
import { meshopt } from "@gltf-transform/functions";
import { MeshoptDecoder, MeshoptEncoder } from "meshoptimizer";

const KHR = "KHR_gaussian_splatting";
const count = 64;
const columns = [["POSITION", 3], [`${KHR}:ROTATION`, 4], [`${KHR}:SCALE`, 3],
                 [`${KHR}:OPACITY`, 1], [`${KHR}:SH_DEGREE_0_COEF_0`, 3]];
const types = { 1: "SCALAR", 3: "VEC3", 4: "VEC4" };
const arrays = columns.map(([, width]) => new Float32Array(count * width));
for (let i = 0; i < count; i++) {
    arrays[0].set([(i % 8) - 4, (i >> 3) - 4, i / 10], 3 * i);
    arrays[1].set([0, 0, 0, 1], 4 * i);
    arrays[2].set([-3, -3, -3], 3 * i);
    arrays[3][i] = 0.9;
}
let offset = 0;
const views = arrays.map((array) => {
    const view = { buffer: 0, byteOffset: offset, byteLength: array.byteLength };
    offset += array.byteLength;
    return view;
});
const json = {
    asset: { version: "2.0" }, extensionsUsed: [KHR], buffers: [{ byteLength: offset }],
    bufferViews: views,
    accessors: columns.map(([name, width], i) => ({
        bufferView: i, componentType: 5126, count, type: types[width],
        ...(name === "POSITION" && { min: [-4, -4, 0], max: [3, 3, Math.fround(6.3)] }),
    })),
    meshes: [{ primitives: [{
        mode: 0, attributes: Object.fromEntries(columns.map(([name], i) => [name, i])),
        extensions: { [KHR]: { kernel: "ellipse", colorSpace: "srgb_rec709_display" } },
    }] }],
    nodes: [{ mesh: 0 }], scenes: [{ nodes: [0] }], scene: 0,
};
const bytes = new Uint8Array(Buffer.concat(arrays.map((array) => Buffer.from(array.buffer))));
const io = new NodeIO().setLogger(new Logger(Logger.Verbosity.SILENT))
    .registerExtensions(ALL_EXTENSIONS)
    .registerDependencies({ "meshopt.encoder": MeshoptEncoder, "meshopt.decoder": MeshoptDecoder });

async function through(...steps) {
    const read = await io.readJSON({ json: structuredClone(json), resources: { "@glb.bin": bytes } });
    read.setLogger(new Logger(Logger.Verbosity.SILENT));
    await read.transform(...steps);
    const { json: written } = await io.writeJSON(read);
    const primitive = written.meshes[0].primitives[0];
    return {
        names: JSON.stringify(written).includes(`"${KHR}"`),
        attributes: Object.keys(primitive.attributes).filter((name) => name.startsWith(KHR)).length,
        place: written.accessors[primitive.attributes.POSITION].componentType,
        size: written.accessors[primitive.attributes[`${KHR}:SCALE`]].componentType,
        node: written.nodes[0].scale ?? [1, 1, 1],
    };
}
const still = await through();
const packed = await through(meshopt({ encoder: MeshoptEncoder }));
console.log("read and written:", JSON.stringify(still));
console.log("after meshopt():", JSON.stringify(packed));
const holds = !still.names && still.attributes === 4 && !packed.names && packed.attributes === 4 &&
    packed.place === 5122 && packed.size === 5126 && packed.node.every((scale) => scale === 3.5);
process.exit(holds ? 0 : 1);
JS
node splats.mjs
