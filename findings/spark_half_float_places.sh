#!/usr/bin/env bash
# Spark 2.2.0 keeps places as half floats: a scene far from its origin falls onto a grid.
#
# Expected: a splat that is put at 1000.3 m is drawn at 1000.3 m, give or take a millimetre: the
# files (PLY, .spz, SOG) hold it that well.
# What happens: PackedSplats, Spark's usual store, has 16 bits for a coordinate.  1.3 m comes back
# as 1.2998, 100.3 as 100.25, 1000.3 as 1000, 2049.3 as 2048, and beyond 65504 as infinity.  No
# message is given.  Sizes are held to e^9, about 8,103: a splat of 20,000 (a sky) shrinks to that.
# What it means: move a georeferenced scan to the origin before it is shown in Spark, and give
# differences of pictures between Spark and other viewers a look at the distance from the origin
# first: within 8 m the grid is 4 mm, within 1 km half a metre.
#
# Packages: npm @sparkjsdev/spark 2.2.0 and three 0.187.0, in Node without a GPU (the store alone is
# asked; nothing is drawn).  Seen in November 2026.
# Exit code: 0 while this holds, 1 when it has changed, 3 when a package cannot be had.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-fund --no-audit --ignore-scripts \
    @sparkjsdev/spark@2.2.0 three@0.187.0 >/dev/null 2>&1 || exit 3

cat >store.mjs <<'JS'
globalThis.self ??= globalThis;
globalThis.window ??= globalThis;
globalThis.document ??= { createElement: () => ({ getContext: () => null, style: {} }),
                          createElementNS: () => ({ style: {} }) };
const { PackedSplats } = await import("@sparkjsdev/spark");
const { Color, Quaternion, Vector3 } = await import("three");
const wanted = [1.3, 10.3, 100.3, 1000.3, 2049.3, 70000];
const seen = [1.2998046875, 10.296875, 100.25, 1000, 2048, Infinity];
const store = new PackedSplats();
const sizes = new Vector3(0.01, 0.01, 20000);
for (const x of wanted) {
    store.pushSplat(new Vector3(x, 0, 0), sizes, new Quaternion(), 0.5, new Color(0.5, 0.5, 0.5));
}
let holds = true;
store.forEachSplat((i, center, scales) => {
    console.log(`x ${wanted[i]} m -> ${center.x}; size 20000 -> ${scales.z.toFixed(1)}`);
    holds &&= center.x === seen[i] && Math.abs(scales.z - Math.exp(9)) < 1;
});
process.exit(holds ? 0 : 1);
JS
node store.mjs 2>/dev/null
