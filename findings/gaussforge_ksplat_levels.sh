#!/usr/bin/env bash
# gaussforge 0.6.0 moves most splats of a compressed .ksplat by half a block.
#
# Expected: a .ksplat of compression level 1 or 2 read by gaussforge has its splats where the
# writer of the format, GaussianSplats3D 0.4.7, has them.
# What happens: levels 1 and 2 store a place as an unsigned 16-bit step from the corner of a block
# 5 units wide.  gaussforge takes the step as a signed number: every coordinate in the upper half of
# its range comes back 5 units too low.  Of splats spread evenly that is half of each axis, so 7 in 8
# splats are in a wrong place.  No error is given.  Level 0 (floats) is read to the bit.
# What it means: convert .ksplat files of level 1 and 2 with another program, and when two programs
# disagree about such a file, measure before the reader is blamed that does not follow gaussforge.
#
# Packages: npm @mkkellogg/gaussian-splats-3d 0.4.7 with three 0.160.0 (writes, and reads back),
# pip gaussforge 0.6.0, numpy 2.4.6.  Seen with these versions in November 2026.
# Exit code: 0 while this holds, 1 when it has changed, 3 when a package cannot be had.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-fund --no-audit --ignore-scripts \
    @mkkellogg/gaussian-splats-3d@0.4.7 three@0.160.0 >/dev/null 2>&1 || exit 3
python3 -m venv venv && venv/bin/pip install -q gaussforge==0.6.0 numpy==2.4.6 >/dev/null 2>&1 || exit 3

cat >write_ply.py <<'PY'
import numpy as np

names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"
random, count = np.random.default_rng(1), 2000
rows = np.zeros((count, 14), "<f4")
rows[:, :3] = random.uniform(-5, 5, (count, 3))
rows[:, 6], rows[:, 7:10], rows[:, 10] = 2, -4, 1
lines = "".join(f"property float {name}\n" for name in names.split())
header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{lines}end_header\n"
open("scene.ply", "wb").write(header.encode() + rows.tobytes())
PY

cat >write_ksplat.mjs <<'JS'
globalThis.self ??= globalThis;
globalThis.window ??= globalThis;
globalThis.document ??= { createElement: () => ({ style: {} }), createElementNS: () => ({ style: {} }) };
const { readFileSync, writeFileSync } = await import("node:fs");
const splats = await import("@mkkellogg/gaussian-splats-3d");
const { Vector3 } = await import("three");
const file = readFileSync("scene.ply");
const bytes = file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength);
const rows = splats.PlyParser.parseToUncompressedSplatArray(bytes, 0);
for (const level of [0, 1, 2]) {
    const generator = splats.SplatBufferGenerator.getStandardGenerator(1, level);
    const written = generator.generateFromUncompressedSplatArray(rows);
    writeFileSync(`${level}.ksplat`, Buffer.from(written.bufferData));
    const back = new splats.SplatBuffer(written.bufferData);
    const places = new Float32Array(3 * back.getSplatCount());
    const place = new Vector3();
    for (let i = 0; i < back.getSplatCount(); i++) {
        back.getSplatCenter(i, place);
        places.set(place.toArray(), 3 * i);
    }
    writeFileSync(`${level}.places`, Buffer.from(places.buffer));
}
JS

cat >compare.py <<'PY'
import gaussforge
import numpy as np

forge, wrong = gaussforge.GaussForge(), []
for level in (0, 1, 2):
    ply = bytes(forge.convert(open(f"{level}.ksplat", "rb").read(), "ksplat", "ply")["data"])
    body = ply.index(b"end_header\n") + len(b"end_header\n")
    columns = ply[:body].count(b"\nproperty ")
    read = np.frombuffer(ply[body:], "<f4").reshape(-1, columns)[:, :3]
    own = np.fromfile(f"{level}.places", "<f4").reshape(-1, 3)
    off = read - own
    moved = np.abs(off) > 0.01
    wrong.append(moved.any(axis=1).mean())
    steps = sorted({round(float(step), 2) for step in off[moved]})
    print(f"level {level}: {wrong[-1]:.1%} of {len(own)} splats elsewhere, by {steps or 0} units")
raise SystemExit(0 if wrong[0] == 0 and all(0.85 < share < 0.9 for share in wrong[1:]) else 1)
PY
venv/bin/python write_ply.py
node write_ksplat.mjs 2>/dev/null
venv/bin/python compare.py
