"""What a frame of the OpenCL tiles costs, pass by pass and as a whole, mono and stereo.

    python tools/renderer/tiles.py LEG_FOLDER --out docs/bench/tiles.csv

CPU ms are those of this process with all its threads, so that other load does not count; wall ms
do on a quiet machine only.  "frame" is project + sort + bin + raster without waiting in between;
"stereo" is the same of two parallel eyes, one sort for both.  "frame+colour" decodes the spherical
harmonics, too.  The error is that of one small picture of the same splats to the float64 oracle.
--prototype FILE (a raster.cl from before this program) is timed in turns with ours, from the same
records: its rows are the yardstick of the issue.
"""

import argparse
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE)]

from hidden import eyes_of  # noqa: E402
from peers import make_views  # noqa: E402

from shapeshift.app.charts.chart_rows import write_lines  # noqa: E402
from shapeshift.rasterizer.bin import bin_tiles, sort_order  # noqa: E402
from shapeshift.rasterizer.colors import shade_sh, upload_sh  # noqa: E402
from shapeshift.rasterizer.device import Device, open_device  # noqa: E402
from shapeshift.rasterizer.pack import pack  # noqa: E402
from shapeshift.rasterizer.program import build  # noqa: E402
from shapeshift.rasterizer.project import Projected, grid_of  # noqa: E402
from shapeshift.rasterizer.project_arena import SortFrames, project_arena  # noqa: E402
from shapeshift.rasterizer.raster import rasterize_rgba_views  # noqa: E402
from shapeshift.renderer.reference import reference_image  # noqa: E402
from shapeshift.renderer.settings import RenderSettings  # noqa: E402
from shapeshift.renderer.tiles.tiles import camera_of  # noqa: E402
from shapeshift.runtime_models.evaluate import Evaluator  # noqa: E402
from shapeshift.runtime_models.model import SplatLayers, Stop  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.cameras.framing import frame_points  # noqa: E402
from shapeshift.scene.metrics import psnr  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402

SIZES = ((640, 360), (1280, 720))
ORACLE_SIZE = (256, 144)
WARM_UP = 3
COLUMNS = (
    "scene,splats,size,pass,cpu_ms_p50,cpu_ms_p95,wall_ms_p50,wall_ms_p95,stereo_over_mono,"
    "ours_over_prototype,psnr_db"
)


@dataclass(frozen=True)
class Arena:
    """A scene as project_arena takes it, colours of degree 0 to 3 on the device."""

    device: Device
    model: SplatLayers
    mean_opacity: Any
    covariance: Any
    color: Any
    object_index: Any
    sh: Any

    @staticmethod
    def of(device: Device, model: SplatLayers) -> "Arena":
        count = model.splat_count
        mean_opacity, covariance = device.zeros((count, 4)), device.zeros((count, 8))
        pack(device, Evaluator(model).geometry(1.0), 0, mean_opacity, covariance)
        rest = device.zeros((count, 4)), device.zeros(count, np.int32), upload_sh(device, model.sh)
        return Arena(device, model, mean_opacity, covariance, *rest)

    def shade(self, view: View) -> None:
        eye, rows = view.world_from_eye.position, slice(0, self.model.splat_count)
        shade_sh(self.device, self.sh, eye, rows, self.mean_opacity, self.color)

    def project(self, views: list[View], into: list[Projected] | None) -> list[Projected]:
        cameras = [camera_of(view) for view in views]
        sort = SortFrames((cameras[0].camera_from_world,))  # parallel eyes: the depths of either
        arrays = (self.mean_opacity, self.covariance, self.color, self.object_index)
        return project_arena(
            self.device, *arrays, np.eye(4)[None], cameras, sort=sort, into=into
        )  # fmt: skip

    def frame(self, views: list[View], into: list[Projected] | None) -> tuple:
        projected = self.project(views, into)
        scratch = projected[0].scratch
        assert scratch is not None
        order = sort_order(self.device, scratch)
        size = views[0].size
        binned = [(p, bin_tiles(self.device, p, size, order=order)) for p in projected]
        return projected, rasterize_rgba_views(self.device, binned, size)


class Times:
    """CPU and wall milliseconds by the name of a pass, one of each a pose."""

    def __init__(self, device: Device) -> None:
        self.device, self.ms = device, {}

    def add(self, name: str, run):
        """What run() gives; the device is idle before and after."""
        self.device.queue.finish()
        wall, cpu = time.perf_counter(), time.process_time()
        result = run()
        self.device.queue.finish()
        took = (time.process_time() - cpu, time.perf_counter() - wall)
        self.ms.setdefault(name, []).append(np.multiply(took, 1e3))
        return result

    def cpu(self, name: str) -> float:
        return float(np.median(self.ms[name][WARM_UP:], axis=0)[0])

    def columns(self, name: str) -> str:
        ms = np.array(self.ms[name][WARM_UP:])
        (cpu, wall), (cpu_95, wall_95) = np.median(ms, axis=0), np.percentile(ms, 95, axis=0)
        return f"{cpu:.2f},{cpu_95:.2f},{wall:.2f},{wall_95:.2f}"


class Prototype:
    """The forward kernels that these tiles grew from, fed with our records."""

    def __init__(self, device: Device, file: Path) -> None:
        options = ["-cl-fast-relaxed-math", "-cl-mad-enable"]
        self.kernels = build(device.context, file, options)
        self.device = device

    def draw(self, projected: Projected, size: tuple[int, int]) -> None:
        """Sort by 16 bits in numpy, bin, rasterize: its best way of before."""
        d, k, count = self.device, self.kernels, projected.depth.shape[0]
        width, height = size
        grid = grid_of(size)
        record = d.view(projected.record)
        depth = d.view(projected.depth)
        near, far = depth.min(), depth[depth < 1e30].max()
        key = np.minimum((depth - near) * (65534 / (far - near)), 65535).astype(np.uint16)
        order = d.upload(np.argsort(key, kind="stable").astype(np.int32))
        mean, extent = d.upload(record[:, :2]), d.upload(record[:, 9:11])
        rect, counts = d.empty((count, 4), np.int32), d.empty(count, np.int32)
        offsets, starts = d.empty(count + 1, np.int32), d.empty(grid[0] * grid[1] + 1, np.int32)
        total, cursor = d.empty(1, np.int32), d.empty(grid[0] * grid[1], np.int32)
        d.launch(k["rects"], count, 64, count, *grid, mean, extent, rect, counts)
        d.launch(k["bin1"], 1, 1, count, *grid, rect, offsets, starts, total)
        splats, slots = (d.empty(int(d.view(total)[0]), np.int32) for _ in range(2))
        d.launch(k["bin2"], 1, 1, count, *grid, order, rect, offsets, starts, cursor, splats, slots)
        image, through = d.empty((3, height, width)), d.empty((height, width))
        d.launch(
            k["fwd"], grid[0] * grid[1], 1,
            width, height, grid[0], starts, splats, projected.record, 0.0, 0.0, 0.0, image,
            through, cursor,
        )  # fmt: skip


def side_by_side(model: SplatLayers, copies: int) -> SplatLayers:
    """Copies of a model along x, one layer, colours of degree 0: about three times the splats."""
    _, radius = frame_points(model.means, model.opacity)
    steps = 1.2 * radius * (np.arange(copies) - (copies - 1) / 2)
    means = np.concatenate([model.means + np.array([s, 0, 0]) for s in steps]).astype(np.float32)
    again = [
        np.concatenate([a] * copies)
        for a in (model.scales, model.wxyz, model.opacity, model.sh[:, :1])
    ]
    count = copies * model.splat_count
    layer = np.zeros(count, np.int32)
    return SplatLayers(means, *again, layer=layer, stops=(Stop("all", 1.0),))


def measure(arena: Arena, views: list[View], prototype: Prototype | None) -> Times:
    """Every pass at every pose, in turns: the machine's moods meet them all."""
    device, times = arena.device, Times(arena.device)
    centre, _ = frame_points(arena.model.means, arena.model.opacity)
    mono = stereo = None
    size = views[0].size
    for view in [*views[:1] * WARM_UP, *views]:
        arena.shade(view)
        mono, _ = times.add("frame", lambda view=view, into=mono: arena.frame([view], into))
        both = eyes_of(view, centre)
        stereo, _ = times.add(
            "frame stereo", lambda both=both, into=stereo: arena.frame(both, into)
        )
        times.add(
            "frame+colour",
            lambda view=view, into=mono: (arena.shade(view), arena.frame([view], into)),
        )
        mono = times.add("project", lambda view=view, into=mono: arena.project([view], into))
        order = times.add("sort", lambda p=mono: sort_order(device, p[0].scratch))
        tiles = times.add("bin", lambda p=mono, o=order: bin_tiles(device, p[0], size, order=o))
        times.add(
            "raster",
            lambda p=mono, t=tiles: rasterize_rgba_views(device, [(p[0], t)], size),
        )
        if prototype:
            times.add("prototype", lambda p=mono: prototype.draw(p[0], size))
    return times


def error_db(arena: Arena, view: View) -> float:
    """PSNR of a frame to the float64 oracle, premultiplied colour and coverage."""
    arena.shade(view)
    _, (image,) = arena.frame([view], None)
    scene = Scene((SceneObject("scene", arena.model, x=1.0),))
    return psnr(image, reference_image(scene, view, RenderSettings()))


def rows_of(name: str, arena: Arena, poses: int, prototype: Prototype | None) -> list[str]:
    """CSV rows of one scene."""
    rows = []
    db = error_db(arena, make_views(arena.model, poses, ORACLE_SIZE)[0])
    for size in SIZES:
        times = measure(arena, make_views(arena.model, poses, size), prototype)
        stereo = times.cpu("frame stereo") / times.cpu("frame")
        for pass_name in times.ms:
            after = ["", "", ""]
            if pass_name == "frame":
                after[2] = f"{db:.1f}"
            if pass_name == "frame" and prototype:
                drawn = sum(times.cpu(k) for k in ("sort", "bin", "raster"))
                after[1] = f"{drawn / times.cpu('prototype'):.2f}"
            if pass_name == "frame stereo":
                after[0] = f"{stereo:.2f}"
            about = f"{name},{arena.model.splat_count},{size[0]}x{size[1]},{pass_name}"
            rows.append(f"{about},{times.columns(pass_name)},{','.join(after)}")
            sys.stderr.write(rows[-1] + "\n")
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("leg", type=Path, help="folder of PLY layers, joined at x = 1")
    parser.add_argument("--out", type=Path, help="CSV file; default: the terminal")
    parser.add_argument("--poses", type=int, default=12)
    parser.add_argument("--prototype", type=Path, help="raster.cl of the prototype, a yardstick")
    options = parser.parse_args()
    device = open_device("cpu")
    prototype = None
    if options.prototype and options.prototype.is_file():
        prototype = Prototype(device, options.prototype)
    elif options.prototype:
        sys.stderr.write(f"The prototype is left out: there is no {options.prototype}.\n")
    leg = read_model(options.leg)
    assert isinstance(leg, SplatLayers)
    three = side_by_side(leg, 3)
    sys.stderr.write("The scene of 410k splats is the first one three times, without SH.\n")
    words = f"python tools/renderer/tiles.py {options.leg.name} --poses {options.poses}"
    words += " --prototype raster.cl" if prototype else ""
    words += f" --out {options.out.name}" if options.out else ""
    load = f"load average {os.getloadavg()[0]:.1f} at the start"
    rows = [f"# {words}", f"# {device.platform}, {device.units} units; {load}", COLUMNS]
    for name, model in (("leg SH3", leg), ("3 legs SH0", three)):
        rows += rows_of(name, Arena.of(device, model), options.poses, prototype)
    write_lines(options.out, rows)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
