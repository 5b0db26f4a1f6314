"""Measures a renderer: frame times on an orbit, mono and stereo in turns, an x sweep, the error."""

import math
import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from importlib.metadata import version
from itertools import pairwise

import numpy as np

from shapeshift.app.document import Document
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import FrameStats
from shapeshift.renderer.streaming.stream import has_leaves
from shapeshift.runtime_models.files.json_fields import control_row
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.cameras.framing import distances_from, orbit_path
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import View, eyes_apart, stereo_pair
from shapeshift.scene.scene import Scene

WARM_UP = 3  # frames that do not count: first use compiles and allocates
QUALITY_VIEWS = 3
# The draw pass: what finds the pixels of a splat and fills them.  A GL driver does both in one.
DRAW_PASSES = ("bin", "splat")
MOST_DB = 200.0  # for pictures that are equal: JSON has no infinity
PERCENTILES = (50, 95, 99)
VERSIONS = ("numpy", "onnxruntime", "pyopencl", "moderngl")  # that matter for a time


class Measure:
    """One scene at one size in one renderer."""

    def __init__(
        self, renderer: Renderer, ctx, subject: Document, x: Control | None, size: tuple[int, int]
    ) -> None:
        """x: of all objects on the orbit; None: each at its own."""
        self.renderer, self.ctx, self.subject, self.size = renderer, ctx, subject, size
        self.x = subject.x if x is None else x
        self.centre, self.radius = subject.bounds()

    @property
    def by_budget(self) -> bool:
        """Whether a budget says which splats are drawn."""
        return any(has_leaves(obj.model) for obj in self.subject.scene.objects)

    def scene(self, x: Control | None) -> Scene:
        return self.subject.at(x)

    def all(
        self,
        frames: int,
        sweep: int,
        quality_size: tuple[int, int],
        progress: Callable[[str], None] = lambda text: None,
    ) -> dict:
        """The rows that `launch.py bench` prints and writes; `progress` hears what is going on."""
        progress(f"{frames} frames of an orbit, mono and stereo in turns")
        mono, stereo, passes, sorts, stats = self.orbit(frames)
        progress(f"{sweep} frames from x = 0 to 1")
        sweep_ms = self.sweep(sweep)
        against = "all splats" if self.by_budget else "the float64 reference"
        progress(f"pictures of {against}")
        errors = self.errors(quality_size)
        drawing = sum(passes[name]["p50"] for name in DRAW_PASSES if name in passes)
        return {
            "gl_renderer": gl_renderer(self.ctx),
            "frame_ms": percentiles(mono),
            "stereo_ms": percentiles(stereo),
            "sweep_ms": percentiles(sweep_ms),
            "passes": passes,
            "stereo_over_mono": float(np.median(stereo) / np.median(mono)),
            "psnr_db": worst(errors),
            "psnr_against": against,
            "budget": stats.streaming.budget if stats.streaming else None,
            "in_pages": stats.streaming.shown if stats.streaming else None,
            "sweep_worst_ms": max(sweep_ms),
            "splats": self.subject.scene.splat_count,
            "drawn": stats.drawn,
            "culled": stats.culled,
            "hidden": stats.hidden,
            "sorts": float(np.mean(sorts)),
            "draw_passes": [name for name in passes if name in DRAW_PASSES],
            "draw_pass_ratio": float(np.median(mono) / drawing) if drawing else None,
            "x": None if self.x is None else control_row(self.x),
            "objects": len(self.subject.scene.objects),
            "size": f"{self.size[0]}x{self.size[1]}",
            "quality_size": f"{quality_size[0]}x{quality_size[1]}",
            "quality_images": len(errors),
            "frames": frames,
            "sweep": sweep,
            "warm_up": WARM_UP,
            "settings": finite(asdict(self.renderer.settings)),
            "backends": self.renderer.backends,
            "machine": machine(self.ctx),
        }

    def orbit(
        self, frames: int
    ) -> tuple[list[float], list[float], dict[str, dict[str, float]], list[int], FrameStats]:
        """ms of mono and stereo frames, drawn in turns so that other load meets both alike.

        Then ms of the passes, sorts and the last stats, all of mono.
        """
        self.renderer.update(self.scene(self.x))
        count = frames + WARM_UP
        path = (count, self.centre, self.radius, self.size)
        views = orbit_path(*path)
        # Half a step further on, so that neither finds the colours of the other's eye ready.
        between = orbit_path(*path, start=np.pi / count)
        distance = eyes_apart(distances_from(self.subject.points(), views[0]))
        frames_of = [
            frame
            for i, (view, other) in enumerate(zip(views, between, strict=True))
            for frame in ((i, stereo_pair(other, distance)), (i, [view]))
        ]
        settings = self.renderer.settings
        if settings.resort_frames != 1 or settings.recolor_degrees > 0:
            # What is kept from frame to frame is kept for one kind of frame: no turns then.
            frames_of.sort(key=lambda frame: -len(frame[1]))
        times: dict[int, list[float]] = {1: [], 2: []}  # ms by the number of eyes
        sorts: list[int] = []
        pass_times: dict[str, list[float]] = {}  # ms
        for i, eyes in frames_of:
            ms, frame_stats = self.timed(eyes)
            if i < WARM_UP:
                continue
            times[len(eyes)].append(ms)
            if len(eyes) == 2:
                continue
            stats = frame_stats
            sorts.append(stats.sorts)
            for name, pass_ms in stats.ms.items():
                pass_times.setdefault(name, []).append(pass_ms)
        passes = {name: percentiles(times_ms) for name, times_ms in pass_times.items()}
        return times[1], times[2], passes, sorts, stats

    def timed(self, views: list[View]) -> tuple[float, FrameStats]:
        """ms until the pixels are there, which for GL means until the driver has finished."""
        start = time.perf_counter()
        self.renderer.draw(views)
        if self.ctx is not None:
            self.ctx.finish()
        ms = (time.perf_counter() - start) * 1e3
        return ms, self.renderer.exact_stats()

    def sweep(self, count: int) -> list[float]:
        """ms of each frame while x of all objects goes from 0 to 1; all networks run in each."""
        view = self.subject.view(self.size)
        times = []
        for i, x in enumerate([0.0] * WARM_UP + np.linspace(0, 1, count).tolist()):
            start = time.perf_counter()
            self.renderer.update(self.scene(x))
            self.timed([view])
            if i >= WARM_UP:
                times.append((time.perf_counter() - start) * 1e3)
        return times

    def errors(self, size: tuple[int, int]) -> list[float]:
        """PSNR in dB of small pictures against the float64 reference, at the same settings; of a
        scene that is drawn by a budget against all of its splats in the same renderer.

        From several sides at the orbit's x, then from the first side at every stop and half way
        between: speed at one x says nothing about the picture at another.
        """
        stops = self.subject.stops
        views = orbit_path(QUALITY_VIEWS, self.centre, self.radius, size)
        others = sorted({*stops, *((a + b) / 2 for a, b in pairwise(stops))} - {self.x})
        pairs = [*((self.x, view) for view in views), *((x, views[0]) for x in others)]
        if self.by_budget:
            return self.errors_of_budget(pairs)
        return [self.error(*pair) for pair in pairs]

    def errors_of_budget(self, pairs: list[tuple[Control | None, View]]) -> list[float]:
        """PSNR in dB of the pictures of controls and views, with the budget and with all splats."""
        renderer, pictures = self.renderer, []
        settings = renderer.settings
        for budget in (settings.budget, self.subject.scene.splat_count):
            renderer.settings = replace(settings, budget=budget)
            for x, view in pairs:
                renderer.update(self.scene(x))
                renderer.draw([view])
                pictures.append(renderer.image(0).copy())
        renderer.settings = settings
        drawn, whole = pictures[: len(pairs)], pictures[len(pairs) :]
        return [min(psnr(*pair), MOST_DB) for pair in zip(drawn, whole, strict=True)]

    def error(self, x: Control | None, view: View) -> float:
        """PSNR in dB of the premultiplied colours and the alpha of one picture, as it was drawn."""
        self.renderer.update(self.scene(x))
        self.renderer.draw([view])
        got = self.renderer.image(0)
        drawn = view.resized(got.shape[1::-1])  # smaller where settings.render_scale is
        return min(
            psnr(got, reference_image(self.scene(x), drawn, self.renderer.settings)), MOST_DB
        )


def worst(decibels: list[float]) -> float | None:
    """The smallest; None where a picture held NaN, which is no number of decibels."""
    return None if any(map(math.isnan, decibels)) else min(decibels)


def finite(settings: dict) -> dict:
    """Settings as JSON can hold them: no limit is null."""
    return {
        name: None if isinstance(value, float) and math.isinf(value) else value
        for name, value in settings.items()
    }


def percentiles(values: list[float]) -> dict[str, float]:
    return {f"p{p}": float(np.percentile(values, p)) for p in PERCENTILES}


def draws_on_cpu(drawing: str, ctx) -> bool:
    """Whether the processor makes the pixels: then its time is what a frame costs."""
    from shapeshift.rasterizer.device import open_device
    from shapeshift.renderer.gl.context import is_software

    return open_device().kind == "cpu" if drawing == "tiles" else is_software(ctx)


def gl_renderer(ctx) -> str:
    from shapeshift.renderer.gl.context import describe

    return describe(ctx)["gl_renderer"] if ctx is not None else "none (OpenCL tiles)"


def machine(ctx) -> dict[str, object]:
    """What a reader needs in order to compare: processor, drivers, versions."""
    from shapeshift.rasterizer.device import NoDevice, open_device
    from shapeshift.renderer.gl.context import describe

    try:
        device = open_device()
        opencl = f"{device.platform}: {device.name}"
    except NoDevice:
        opencl = "none"
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(terse=True),
        "python": platform.python_version(),
        "gl_version": describe(ctx)["gl_version"] if ctx is not None else "none",
        "opencl": opencl,
        **{name: version(name) for name in ("numpy", "moderngl", "onnxruntime", "pyopencl")},
    }


def machine_line(ctx) -> str:
    """Processor, cores, drivers and versions, as they matter for a time."""
    facts = machine(ctx) | {"gl": gl_renderer(ctx)}
    words = [f"{facts['processor']}, {facts['cores']} cores", f"OpenCL {facts['opencl']}",
             f"GL {facts['gl']}", *(f"{name} {facts[name]}" for name in VERSIONS)]  # fmt: skip
    return "; ".join(words)


def processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.split(":", 1)[1].strip() for line in file if "model name" in line]
    except OSError:
        names = []
    return names[0] if names else platform.processor()
