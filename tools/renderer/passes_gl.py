"""The GL passes beside their floors, in CPU milliseconds of the process, all in one run.

    python3 tools/renderer/passes_gl.py [--splats 100000 400000 800000] > docs/bench/passes_gl.csv

project: a compute kernel that streams the same bytes.  sort: a counting sort of the same 16-bit
keys in compiled code.  draw: splats that fill the screen, with the fragments of tight quads.
stereo: two views of the full size each, beside one.  decode: the networks alone in onnxruntime, one
thread, as the package holds them.  On software GL CPU time is all of the work.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.renderer import layout  # noqa: E402
from shapeshift.renderer.gl.buffers import Arena, bind  # noqa: E402
from shapeshift.renderer.gl.context import open_context  # noqa: E402
from shapeshift.renderer.gl.gpu import Gpu, groups_for  # noqa: E402
from shapeshift.renderer.gl.project import Projector  # noqa: E402
from shapeshift.renderer.gl.quads import QuadsDrawing  # noqa: E402
from shapeshift.renderer.gl.sort_check import Sorter, quantize  # noqa: E402
from shapeshift.renderer.gl.splat import Splatter  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.renderer.settings import RenderSettings  # noqa: E402
from shapeshift.renderer.tiles.tiles import TilesDrawing  # noqa: E402
from shapeshift.runtime_models.evaluate import Evaluator, directions, evaluate  # noqa: E402
from shapeshift.scene.pose import View, look_at  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402
from tests.support.splat_scenes import random_model, shell  # noqa: E402

SIZE = (1280, 720)
EYES = [View(look_at(np.array([x, 0.3, 4.5]), np.array([x, 0, 0])),
             (-0.6, 0.6, -0.34, 0.34), 0.05, 50, SIZE)
        for x in (0.0, 0.064)]  # fmt: skip
EXACT = RenderSettings()
CULLS: dict[str, Any] = {"max_pixels": 8.0, "max_distance": 4.5, "min_pixels": 1.0}
PROJECTED = {  # name: (settings, number of views)
    "exact": (EXACT, 1),
    "culls": (RenderSettings(**CULLS), 1),
    "culls, faded": (RenderSettings(**CULLS, fade=0.2), 1),
    "by distance": (RenderSettings(order="distance"), 1),
    "16-bit keys": (RenderSettings(key_bits=16), 1),
    "two views": (EXACT, 2),
}
STREAM = """#version 430
layout(local_size_x = 256) in;
layout(std430, binding = 0) readonly buffer A { vec4 a[]; };
layout(std430, binding = 1) readonly buffer B { vec4 b[]; };
layout(std430, binding = 2) readonly buffer C { vec4 c[]; };
layout(std430, binding = 5) writeonly buffer D { vec4 d[]; };
layout(std430, binding = 6) writeonly buffer E { uint e[]; };
uniform uint count;
uniform uint views;
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) return;
    vec4 x = a[i], y = b[2u * i], z = b[2u * i + 1u], w = c[i];
    for (uint v = 0u; v < views; v++) {
        d[2u * (v * count + i)] = x + y;
        d[2u * (v * count + i) + 1u] = z + w;
    }
    e[i] = i;
}
"""
COUNTING_SORT = """
__kernel void counting_sort(int n, __global const ushort* key, __global uint* order,
                            __global uint* start) {
  for (int i = 0; i < 65536; i++) start[i] = 0;
  for (int i = 0; i < n; i++) start[key[i]]++;
  uint sum = 0;
  for (int i = 0; i < 65536; i++) { const uint c = start[i]; start[i] = sum; sum += c; }
  for (int i = 0; i < n; i++) order[start[key[i]]++] = i;
}
"""


class Passes:
    """One scene of `count` splats in an arena, and the least time of each pass over it."""

    def __init__(self, gpu: Gpu, count: int) -> None:
        self.gpu, self.count = gpu, count
        self.arena = Arena(gpu, [count])
        self.layers = shell(count)
        splats = evaluate(self.layers, 0.0, np.zeros(3))
        self.arena.write_geometry(0, splats.means, splats.scales, splats.wxyz, splats.opacity)
        self.arena.write_color(0, splats.color)
        self.arena.set_poses([np.eye(4)])
        self.projector, self.sorter = Projector(gpu), Sorter(gpu, "numpy")
        self.splatter = Splatter(gpu)
        self.arena.make_room(2)

    def least_ms(self, work: Callable[[], object], runs: int = 5) -> float:
        """CPU milliseconds of the process for one run of `work`, the least of several."""
        taken = []
        for _ in range(runs + 1):  # the first one compiles
            start = time.process_time()
            work()
            self.gpu.ctx.finish()
            taken.append(time.process_time() - start)
        return 1e3 * min(taken[1:])

    def project(self, settings: RenderSettings, views: int) -> None:
        frame = EYES[0].eye_from_world() if views > 1 else None
        self.projector.project(self.arena, EYES[:views], settings, frame)

    def stream(self, program, views: int) -> None:
        arrays = (self.arena.mean_opacity, self.arena.covariance, self.arena.color)
        for slot, buffer in enumerate(arrays):
            buffer.bind_to_storage_buffer(slot)
        bind(records=self.arena.records, keys=self.arena.keys)
        program["count"].value, program["views"].value = self.count, views
        program.run(groups_for(self.count, 256))

    def project_rows(self) -> list[tuple]:
        program = self.gpu.ctx.compute_shader(STREAM)
        rows = []
        for name, (settings, views) in PROJECTED.items():
            floor = self.least_ms(lambda n=views: self.stream(program, n), 9)
            ms = self.least_ms(lambda s=settings, n=views: self.project(s, n), 9)
            rows.append((f"project ({name})", ms, floor, 3.0))
        return rows

    def sort_row(self) -> tuple:
        settings = RenderSettings(key_bits=16)
        self.project(settings, 1)
        keys = quantize(np.frombuffer(self.arena.keys.read(), np.uint32)[: self.count])
        ms = self.least_ms(lambda: self.sorter.sort(self.arena, 16), 9)
        want = np.argsort(keys, kind="stable")
        return "sort, read and upload (16 bits)", ms, counting_sort_ms(self, keys, want), 6.0

    def draw_row(self) -> tuple:
        self.project(EXACT, 1)
        self.sorter.sort(self.arena, 32)
        ms = self.least_ms(lambda: self.splatter.draw(self.arena, 0, SIZE, 1 / 255), 3)
        fragments = self.fragments()
        floor = self.full_screen_ms(round(fragments / (SIZE[0] * SIZE[1])))
        limit = {100_000: 5.0, 400_000: 9.0, 800_000: 12.0}.get(self.count, 12.0)
        return f"draw {self.splatter.target} ({fragments / 1e6:.1f} M fragments)", ms, floor, limit

    def fragments(self) -> float:
        """Pixels of tight quads around all ellipses, which the triangles exceed by 30 %."""
        rows = np.frombuffer(self.arena.records.read(), np.uint32).reshape(-1, 8)[: self.count]
        keys = np.frombuffer(self.arena.keys.read(), np.uint32)[: self.count]
        rows = rows[keys != layout.CULLED_KEY]
        axes = np.ascontiguousarray(rows[:, 2:4]).view(np.float16).astype(np.float64)  # (n, 4)
        cutoff_sigmas = np.ascontiguousarray(rows[:, 7]).view(np.float32)
        lengths = np.hypot(axes[:, 0], axes[:, 1]) * np.hypot(axes[:, 2], axes[:, 3])
        return float((4 * cutoff_sigmas.astype(np.float64) ** 2 * lengths).sum())

    def full_screen_ms(self, splats: int) -> float:
        """The draw of so many splats whose triangles each cover the image."""
        width, height = SIZE
        with Arena(self.gpu, [splats]) as arena:
            row = np.zeros((splats, 8), np.uint32)
            row[:, :2] = np.array([width / 2, height / 2], np.float32).view(np.uint32)
            row[:, 2] = np.array([2 * width, 0], np.float16).view(np.uint32)
            row[:, 3] = np.array([0, 2 * height], np.float16).view(np.uint32)
            row[:, 4:6] = np.array([0.5, 0.5, 0.5, 0], np.float16).view(np.uint32)
            row[:, 6:] = np.array([0.5, 1.0], np.float32).view(np.uint32)  # opacity, cutoff_sigmas
            counts = np.zeros(layout.COUNTS_SIZE, np.uint32)
            counts[layout.COUNTS["SORTED"]] = splats
            for buffer, data in (
                (arena.records, row), (arena.counts, counts),
                (arena.order, np.arange(splats, dtype=np.uint32)),
                (arena.command, np.array([3 * splats, 1, 0, 0, 0], np.uint32)),
            ):  # fmt: skip
                buffer.write(data)
            with Splatter(self.gpu) as splatter:
                return self.least_ms(lambda: splatter.draw(arena, 0, SIZE, 1 / 255), 3)

    def stereo_row(self) -> tuple:
        """Whole frames, by the renderer."""
        with Renderer(self.gpu.ctx, "quads") as renderer:
            renderer.update(Scene((SceneObject("shell", self.layers),)))
            two = self.least_ms(lambda: renderer.draw(EYES), 3)
            one = self.least_ms(lambda: renderer.draw(EYES[:1]), 3)
        return "two views (beside one)", two, one, 1.5

    def decode_rows(self) -> list[tuple]:
        """All five networks of ten splats an anchor: the default back end of software GL (tiles),
        and into the arena of quads.
        """
        model, eye = random_model(self.count // 10), np.array([0.0, 0.3, 4.5])
        plain = Evaluator(model, threads=1, fold=False)
        seen = directions(model.anchors, eye)
        rows = []

        def networks_alone() -> None:
            for name in model.networks:
                plain._run(name, 0.4, seen if name == "color" else None)

        def decode(drawing: QuadsDrawing | TilesDrawing) -> None:
            drawing.decode_geometry(0, 0.4)
            cast(Any, drawing).decode_color(0, 0.4, eye)

        floor = self.least_ms(networks_alone)
        for drawing in (TilesDrawing(), QuadsDrawing(self.gpu, "onnxruntime", "numpy")):
            drawing.allocate([model])
            name = drawing.backends["drawing"].split()[0]
            ms = self.least_ms(partial(decode, drawing))
            rows.append((f"decode for {name} (beside the networks alone)", ms, floor, 1.2))
            drawing.close()
        return rows


def counting_sort_ms(passes: Passes, keys: np.ndarray, want: np.ndarray) -> float:
    import pyopencl as cl

    device = open_device()
    program = cl.Program(device.context, COUNTING_SORT).build()
    kernel = program.counting_sort
    key = device.upload(keys.astype(np.uint16))
    order, start = device.empty(len(keys), np.uint32), device.empty(65536, np.uint32)

    def run() -> None:
        device.launch(kernel, 1, 1, len(keys), key, order, start)
        device.queue.finish()

    ms = passes.least_ms(run, 9)
    if not np.array_equal(device.download(order), want):
        raise SystemExit("the counting sort is wrong; its time means nothing.")
    return ms


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--splats", type=int, nargs="+", default=[100_000, 400_000, 800_000])
    counts = parser.parse_args().splats
    with open_context() as ctx, Gpu(ctx) as gpu:
        lines = [
            "# python3 tools/renderer/passes_gl.py",
            f"# {ctx.info['GL_RENDERER']}; 1280x720; CPU ms; load {os.getloadavg()[0]:.1f}",
            "splats,pass,cpu_ms,floor_ms,over_floor,limit",
        ]
        for count in counts:
            passes = Passes(gpu, count)
            rows = [passes.draw_row(), passes.sort_row(), passes.stereo_row()]
            rows += passes.decode_rows()
            if count == 400_000:
                rows += passes.project_rows()
            for name, ms, floor, limit in rows:
                lines.append(f'{count},"{name}",{ms:.2f},{floor:.2f},{ms / floor:.2f},{limit:g}')
            passes.arena.release()
            passes.splatter.release()
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
