// Reads mutated scenes as a page does: each ends in numbers or in one sentence, and soon.
//     node broken_scene.mjs scene.bin COUNT SEED < nothing
import { readFileSync } from "node:fs";
import { checkScene, inflate, readContainer } from "../../../web/renderer/container.js";

const [path, count, start] = process.argv.slice(2), whole = readFileSync(path);
let seed = Number(start);
const random = (most) => (seed = (seed * 1103515245 + 12345) % 2147483648) % most;
const head = 12 + whole.readUInt32LE(8), told = { refused: 0, opened: 0, odd: [], slowest: 0 };
const HOSTILE = ["NaN", "-1", "1e999", "4294967296", "null", "[]", "{}", '""', "1e9", "0", "0.5", "true", '"__proto__"'];

function mutated(n) {
    const kind = n % 4;
    if (kind === 0) return whole.subarray(0, random(whole.length));
    if (kind === 1) {
        const bytes = Buffer.from(whole);
        for (let k = 0; k <= random(4); k++) bytes[random(head)] = random(256);
        return bytes;
    }
    if (kind === 2) {  // a number of the table of contents becomes another
        const text = whole.subarray(12, head).toString(), spots = [...text.matchAll(/-?[\d.e+]+|"[^"]*"|null|true|false/g)], at = spots[random(spots.length)];
        const changed = text.slice(0, at.index) + HOSTILE[random(HOSTILE.length)] + text.slice(at.index + at[0].length);
        return packed(changed);
    }
    const table = JSON.parse(whole.subarray(12, head).toString()), walk = (value) => {  // something is missing
        const keys = Object.keys(value), key = keys[random(keys.length)];
        if (value[key] && typeof value[key] === "object" && random(3)) return walk(value[key]);
        delete value[key];
    };
    walk(table);
    return packed(JSON.stringify(table));
}

function packed(text) {
    const json = Buffer.from(text), length = Buffer.alloc(4);
    length.writeUInt32LE(json.length);
    const begin = Buffer.concat([whole.subarray(0, 8), length, json]);
    return Buffer.concat([begin, Buffer.alloc(-begin.length & 3), whole.subarray((head + 3) & ~3)]);
}

for (let n = 0; n < Number(count); n++) {
    const bytes = mutated(n), began = performance.now();
    try {
        const container = readContainer(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
        checkScene(container);
        for (const model of container.scene.models) {
            for (const name of ["positions", "features", "scales", "wxyz", "opacity", "sh", "shRest"])
                if (model[name]) container.table(model[name], model.anchors);
            if (model.layer) container.array(model.layer);
        }
        told.opened++;
    } catch (error) {
        if (error.constructor.name === "BadScene" && error.message && !error.message.includes("\n")) told.refused++;
        else told.odd.push(`${n}: ${error.stack}`.slice(0, 300));
    }
    told.slowest = Math.max(told.slowest, performance.now() - began);
}

// A few bytes that inflate to very many: it stops at the bound.
const { deflateSync } = await import("node:zlib");
const bomb = deflateSync(Buffer.alloc(64e6)), began = performance.now();
told.bomb = await inflate(new Blob([bomb]).stream(), 1e6).then(() => "inflated", (error) => error.message);
told.bombMs = performance.now() - began;
process.stdout.write(JSON.stringify(told));
