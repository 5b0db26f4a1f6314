#!/usr/bin/env bash
# splat-transform 3.7.0 writes a streamed scene's environment and does not read it back.
#
# Expected: lod-meta.json written from levels of detail and an environment (`--tag-lod -1`, a sky)
# gives all of them back when the same program reads it.
# What happens: the environment lies in the folder and is named in lod-meta.json, but reading takes
# the tree of levels alone: the sky's splats are gone from every output, exit code 0, no message.
# `--select-lod -1` does not ask for the environment either: it gives the coarsest level.
# What it means: a streamed scene that is edited or converted once more loses its sky; keep the
# source, or read env/meta.json as a file of its own and tag it again.
#
# Package: npm @playcanvas/splat-transform 3.7.0; Python's standard library makes the input.  Seen
# in November 2026.
# Exit code: 0 while this holds, 1 when it has changed, 3 when a package cannot be had.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-fund --no-audit @playcanvas/splat-transform@3.7.0 >/dev/null 2>&1 || exit 3

cat >write_ply.py <<'PY'
import random
import struct

names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"


def write(path, count, reach):
    lines = "".join(f"property float {name}\n" for name in names.split())
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{lines}end_header\n"
    with open(path, "wb") as file:
        file.write(header.encode())
        for _ in range(count):
            place = [random.uniform(-reach, reach) for _ in range(3)]
            file.write(struct.pack("<14f", *place, 0, 0, 0, 2, -3, -3, -3, 1, 0, 0, 0))


random.seed(0)
write("fine.ply", 1000, 5)
write("coarse.ply", 200, 5)
write("sky.ply", 30, 50)
PY
python3 write_ply.py

convert() { npx splat-transform -g cpu -w -q "$@"; }
count_of() { head -c 400 "$1" | grep -a -m1 "^element vertex" | cut -d" " -f3; }
convert fine.ply -l 0 coarse.ply -l 1 sky.ply -l -1 lod/lod-meta.json
convert lod/lod-meta.json all.ply
convert -L 0 lod/lod-meta.json finest.ply
convert -L -1 lod/lod-meta.json minus_one.ply
convert lod/env/meta.json environment.ply

grep -q '"environment":"env/meta.json"' lod/lod-meta.json && named=yes || named=no
echo "lod-meta.json names its environment: $named; in env/: $(count_of environment.ply) splats"
echo "read back: $(count_of all.ply) splats, level 0: $(count_of finest.ply), '-L -1': $(count_of minus_one.ply)"
[ "$named" = yes ] && [ "$(count_of environment.ply)" = 30 ] && [ "$(count_of all.ply)" = 1000 ] &&
    [ "$(count_of finest.ply)" = 1000 ] && [ "$(count_of minus_one.ply)" = 200 ]
