"""Prices one setting: its frames in turns with exact ones, from two renderers of the same scene."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import moderngl
import numpy as np

from shapeshift.app.charts.chart_scene import WARM_UP, ChartScene
from shapeshift.app.charts.chart_settings import Named, changed_settings, render_settings
from shapeshift.app.charts.comparison import MOST_DB, exact
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.scene.appearance import Background
from shapeshift.scene.metrics import psnr, ssim
from shapeshift.scene.pose import View, stereo_pair

SSIM_PATH, SSIM_SWEEP = 3, 2  # pictures whose SSIM is taken: it costs more than a frame does


@dataclass(frozen=True)
class ChartRow:
    """One setting on one scene, as rows.csv has it."""

    name: str
    eyes: int
    ms: float  # median frame of the path
    p95_ms: float
    exact_ms: float  # median of the exact frames drawn in turns with them
    ratio: float  # ms / exact_ms
    cpu_ms: float  # of the process, all threads, a frame (mean)
    exact_cpu_ms: float
    psnr_db: float  # worst picture of the path against the exact one
    psnr_mean_db: float
    sweep_psnr_db: float  # worst over x
    sweep_psnr_mean_db: float
    ssim: float  # worst of a few pictures of path and sweep
    ssim_mean: float
    drawn: int  # splats of a frame (mean)
    splats: int
    sorts: float  # a frame (mean)
    changes: str  # fields that differ from RenderSettings()

    @property
    def db(self) -> float:
        """The worst that was seen, over path and sweep."""
        return float(np.min([self.psnr_db, self.sweep_psnr_db]))  # NaN stays NaN


class Pricing:
    """Two renderers that hold the same scene: one stays exact, the other takes every setting.

    One renderer would forget its order and its colours at each change of the settings.
    """

    def __init__(
        self, renderers: tuple[Renderer, Renderer], ctx: moderngl.Context | None,
        chart_scene: ChartScene, background: Background,
    ) -> None:  # fmt: skip
        self._exact, self._trial = renderers
        self._ctx, self._stage, self._background = ctx, chart_scene, background
        self.drawing = self._exact.backends["drawing"].split()[0]
        self._exact.settings = exact(RenderSettings(background=background), self.drawing)
        self._walked = False

    def settings(self, named: Named) -> RenderSettings:
        return render_settings(named, self._background, self.drawing, self._stage.distances)

    def row(self, named: Named, pictures: bool = True) -> ChartRow:
        """Measures one setting; without `pictures` no SSIM is taken."""
        self._trial.settings = self.settings(named)
        self._walk()
        path = self._path(named, pictures)
        sweep, sweep_ssim = self._sweep(named, pictures)
        alike = path.ssim + sweep_ssim or [float("nan")]
        return ChartRow(
            name=named.name,
            eyes=named.eyes,
            ms=_rounded(np.median(path.ms)),
            p95_ms=_rounded(np.percentile(path.ms, 95)),
            exact_ms=_rounded(np.median(path.exact_ms)),
            ratio=_rounded(np.median(path.ms) / np.median(path.exact_ms)),
            cpu_ms=_rounded(np.mean(path.cpu_ms)),
            exact_cpu_ms=_rounded(np.mean(path.exact_cpu_ms)),
            psnr_db=_rounded(np.min(path.db)),
            psnr_mean_db=_rounded(np.mean(path.db)),
            sweep_psnr_db=_rounded(np.min(sweep)),
            sweep_psnr_mean_db=_rounded(np.mean(sweep)),
            ssim=_rounded(np.min(alike)),
            ssim_mean=_rounded(np.mean(alike)),
            drawn=round(np.mean([stats.drawn for stats in path.stats])),
            splats=path.stats[0].splats,
            sorts=_rounded(np.mean([stats.sorts for stats in path.stats])),
            changes=changed_settings(self._trial.settings),
        )

    def _walk(self) -> None:
        """Before the first row both go the whole path once: drivers compile a kernel anew where a
        view has other sizes, and the row that came first would have that in its frames.
        """
        if not self._walked:
            for view in self._stage.path:
                for renderer in (self._exact, self._trial):
                    self._timed(renderer, [view])
        self._walked = True

    def _path(self, named: Named, pictures: bool) -> "_Frames":
        """Every view of the path exactly and as set; who comes first changes every frame."""
        out = _Frames()
        counted = len(self._stage.path) - WARM_UP
        compared = set(np.linspace(0, counted - 1, SSIM_PATH).astype(int)) if pictures else set()
        for number, view in enumerate(self._stage.path, -WARM_UP):
            trial_views = self._views(view, named.eyes)
            exact_views = trial_views[: named.beside_eyes or named.eyes]
            jobs = [(self._exact, exact_views), (self._trial, trial_views)]
            done = [self._timed(*job) for job in (jobs if number % 2 else jobs[::-1])]
            (exact_ms, exact_cpu, _), (ms, cpu, stats) = done if number % 2 else done[::-1]
            if number < 0:
                continue
            out.ms.append(ms)
            out.exact_ms.append(exact_ms)
            out.cpu_ms.append(cpu)
            out.exact_cpu_ms.append(exact_cpu)
            out.stats.append(stats)
            self._compare(len(exact_views), number in compared, out.db, out.ssim)
        return out

    def _sweep(self, named: Named, pictures: bool) -> tuple[list[float], list[float]]:
        """PSNR at every x, SSIM at a few, from the middle of the path; then back to the scene."""
        xs, views = self._stage.xs, self._views(self._stage.middle, named.eyes)
        exact_views = views[: named.beside_eyes or named.eyes]
        compared = set(np.linspace(0, len(xs) - 1, SSIM_SWEEP + 2).astype(int)[1:-1])
        decibels: list[float] = []
        alike: list[float] = []
        # The last x once before: the jump from the end of the path is no motion of the sweep.
        for number, x in enumerate((xs[-1], *xs), -1):
            for renderer, seen in ((self._exact, exact_views), (self._trial, views)):
                renderer.update(self._stage.at(x))
                renderer.draw(seen)
            if number >= 0:
                with_ssim = pictures and number in compared
                self._compare(len(exact_views), with_ssim, decibels, alike)
        return decibels, alike

    def _views(self, view: View, eyes: int) -> list[View]:
        return [view] if eyes == 1 else stereo_pair(view, self._stage.eye_distance)

    def _timed(self, renderer: Renderer, views: list[View]) -> tuple[float, float, FrameStats]:
        """Wall ms, CPU ms of the process and stats of a whole frame."""
        start, start_cpu = time.perf_counter(), time.process_time()
        renderer.update(self._stage.scene)
        renderer.draw(views)
        if self._ctx is not None:
            self._ctx.finish()
        cpu = (time.process_time() - start_cpu) * 1e3
        return (time.perf_counter() - start) * 1e3, cpu, renderer.exact_stats()

    def _compare(self, views: int, with_ssim: bool, db: list[float], alike: list[float]) -> None:
        """Adds the worse eye's PSNR, and its SSIM, of what both renderers have just drawn."""
        pairs = [(self._exact.resolved(i), self._trial.resolved(i)) for i in range(views)]
        db.append(float(np.min([MOST_DB, *(psnr(*pair) for pair in pairs)])))  # NaN stays NaN
        if with_ssim:
            alike.append(float(np.min([ssim(*pair) for pair in pairs])))


class _Frames:
    """What was measured along the path."""

    def __init__(self) -> None:
        self.ms: list[float] = []
        self.exact_ms: list[float] = []
        self.cpu_ms: list[float] = []
        self.exact_cpu_ms: list[float] = []
        self.stats: list[FrameStats] = []
        self.db: list[float] = []
        self.ssim: list[float] = []


def _rounded(value: float | np.floating) -> float:
    """Four digits: more of a time mean nothing, and files stay readable."""
    return float(f"{value:.4g}")


@contextmanager
def open_pair(context: str, drawing: str) -> Iterator[tuple]:
    """((Renderer, Renderer), context or None): two of the same kind in one context."""
    from shapeshift.app.drawing import open_renderer

    with open_renderer(context, drawing) as (first, ctx):
        with twin_of(first, ctx) as second:
            yield (first, second), ctx


def twin_of(renderer: Renderer, ctx: moderngl.Context | None) -> Renderer:
    """Another renderer with the same back ends."""
    return Renderer(ctx, renderer.backends["drawing"].split()[0])
