"""The GL project pass beside its floor: a compute kernel that streams the same bytes.

    python3 docs/bench/project_gl.py [--splats 400000] > docs/bench/project_gl.csv

CPU milliseconds of the process (on software GL all of the work), the least of several runs, all in
one run of this program; the load average is printed with them.
"""

import argparse
import os
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from splat_scenes import shell  # noqa: E402

from renderer.buffers import Arena, bind  # noqa: E402
from renderer.context import open_context  # noqa: E402
from renderer.gpu import Gpu, groups_for  # noqa: E402
from renderer.project import Projector  # noqa: E402
from renderer.settings import RenderSettings  # noqa: E402
from runtime_models.evaluate import evaluate  # noqa: E402
from scene.pose import View, look_at  # noqa: E402

RUNS = 9
STREAM = """#version 430
layout(local_size_x = 256) in;
layout(std430, binding = 0) readonly buffer A { vec4 a[]; };
layout(std430, binding = 1) readonly buffer B { vec4 b[]; };
layout(std430, binding = 2) readonly buffer C { vec4 c[]; };
layout(std430, binding = 5) writeonly buffer D { vec4 d[]; };
layout(std430, binding = 6) writeonly buffer E { uint e[]; };
uniform uint count;
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) return;
    vec4 x = a[i], y = b[2u * i], z = b[2u * i + 1u], w = c[i];
    d[2u * i] = x + y;
    d[2u * i + 1u] = z + w;
    e[i] = i;
}
"""
SETTINGS = {
    "exact": RenderSettings(),
    "culls": RenderSettings(max_pixels=8.0, max_distance=4.5, min_pixels=1.0),
    "culls, faded": RenderSettings(max_pixels=8.0, max_distance=4.5, min_pixels=1.0, fade=0.2),
    "by distance": RenderSettings(order="distance"),
    "16-bit keys": RenderSettings(key_bits=16),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--splats", type=int, default=400_000)
    count = parser.parse_args().splats
    splats = evaluate(shell(count), 0.0, np.zeros(3))
    eyes = [View(look_at((x, 0.3, 4.5), (x, 0, 0)), (-0.6, 0.6, -0.34, 0.34), 0.05, 50, (1280, 720))
            for x in (0.0, 0.064)]  # fmt: skip
    with open_context() as ctx, Gpu(ctx) as gpu, Arena(gpu, [count]) as arena:
        arena.write_geometry(0, splats.means, splats.scales, splats.wxyz, splats.opacity)
        arena.write_color(0, splats.color)
        arena.place([np.eye(4)])
        projector, stream = Projector(gpu), ctx.compute_shader(STREAM)
        stream["count"].value = count

        def floor() -> None:
            arrays = (arena.mean_opacity, arena.covariance, arena.color)
            for slot, buffer in enumerate(arrays):
                buffer.bind_to_storage_buffer(slot)
            bind(records=arena.records, keys=arena.keys)
            stream.run(groups_for(count, 256))

        load, least = os.getloadavg()[0], least_ms(ctx, floor)
        rows = [
            "# python3 docs/bench/project_gl.py",
            f"# {ctx.info['GL_RENDERER']}; {count:,} splats at 1280x720; load {load:.1f}",
            "setting,views,cpu_ms,over_floor,ns_a_splat,drawn",
            f"floor,,{least:.2f},1.00,{least / count * 1e6:.0f},",
        ]
        centre = eyes[0].eye_from_world()
        for name, settings in SETTINGS.items():
            for views in (eyes[:1], eyes):
                frame = None if len(views) == 1 else centre
                ms = least_ms(ctx, partial(projector.project, arena, views, settings, frame))
                drawn = projector.counts(arena)["drawn"]
                figures = f"{ms:.2f},{ms / least:.2f},{ms / count * 1e6:.0f},{drawn}"
                rows.append(f'"{name}",{len(views)},{figures}')
    sys.stdout.write("\n".join(rows) + "\n")


def least_ms(ctx, work) -> float:
    """CPU milliseconds of the process for one run of `work`, the least of several."""
    taken = []
    for _ in range(RUNS + 1):  # the first one compiles
        start = time.process_time()
        work()
        ctx.finish()
        taken.append(time.process_time() - start)
    return 1e3 * min(taken[1:])


if __name__ == "__main__":
    main()
