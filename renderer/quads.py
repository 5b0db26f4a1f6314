"""Draws with GL: compute passes and quads, made for a GPU; software GL runs the same.

Same life as renderer/tiles.py: allocate, decode what changed, place, draw.
"""

from itertools import pairwise

import moderngl
import numpy as np

from renderer.buffers import Arena
from renderer.decode import Decoder
from renderer.gpu import Gpu
from renderer.overdraw import count_overdraw
from renderer.project import Projector
from renderer.settings import RenderSettings
from renderer.sort import Sorter
from renderer.splat import Splatter
from renderer.timing import PassTimer
from runtime_models.model import AnchorModel, SplatLayers
from scene.pose import View


class QuadsDrawing:
    """The arena of all objects in GL buffers, and the passes that draw it."""

    def __init__(self, gpu: Gpu, mlps: str, sort: str, target: str) -> None:
        self.backends = {"drawing": f"quads ({target})", "mlps": mlps, "sort": sort}
        self.decodes_on_gpu = mlps == "gl"  # says which clock times the decoding
        self._gpu = gpu
        self._projector = Projector(gpu)
        self._sorter = Sorter(gpu, sort)
        self._splatter = Splatter(gpu, target)
        self.sorts = self.order_age = 0  # of the last frame, see FrameStats
        self._arena: Arena | None = None
        self._decoder: Decoder | None = None

    @property
    def allocations(self) -> int:
        """How many buffers and textures were ever made."""
        return self._gpu.allocations

    def allocate(self, models: list[AnchorModel | SplatLayers]) -> None:
        """Room for these objects; what was decoded before is gone."""
        self._release_arena()
        self._arena = Arena(self._gpu, [model.splat_count for model in models])
        self._decoder = Decoder(self._gpu, self._arena, models, self.backends["mlps"])

    def decode_geometry(self, i: int, x: float) -> None:
        """Means, covariances and opacities of object i at control value x."""
        self._decoder.geometry(i, x)

    def decode_color(self, i: int, x: float, eye_object: np.ndarray) -> None:
        """Colours of object i at x, towards an eye (3,) in the object's frame."""
        self._decoder.color(i, x, eye_object)

    def place(self, world_from_objects: list[np.ndarray]) -> None:
        """Poses (4, 4) of all objects; one full of NaN hides its object."""
        self._arena.place(np.reshape(world_from_objects, (-1, 4, 4)))

    def draw(self, views: list[View], settings: RenderSettings, timer: PassTimer) -> None:
        """Draws every view; view i is then image(i)."""
        self.sorts = len(views)
        for i, view in enumerate(views):
            self._draw_view(i, view, settings, timer)

    def _draw_view(self, i: int, view: View, settings: RenderSettings, timer: PassTimer) -> None:
        with timer.time("project"):
            self._projector.project(self._arena, [view], settings)
        with timer.time("sort", on_gpu=self._sorter.backend == "gl"):
            self._sorter.sort(self._arena, settings.key_bits)
        with timer.time("splat"):
            self._splatter.draw(self._arena, i, view.size, settings.min_alpha)

    def counts(self) -> dict[str, int]:
        """{drawn, opacity, size, distance, frustum} of the view drawn last."""
        return self._projector.counts(self._arena)

    def presentable(self, i: int) -> moderngl.Texture:
        """The float image of view i on the GPU, row 0 at the bottom."""
        return self._splatter.texture(i)

    def image(self, i: int) -> np.ndarray:
        """(H, W, 4) float32 premultiplied, row 0 on top, of the view last drawn as number i."""
        return self._splatter.image(i)

    def splat_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """mean_opacity (N, 4), object index (N,), covariance (N, 8), for debug views."""
        arena = self._arena
        owner = np.repeat(np.arange(len(arena.starts) - 1), np.diff(arena.starts))
        rows = [np.frombuffer(b.read(), np.float32) for b in (arena.mean_opacity, arena.covariance)]
        n = arena.count
        return rows[0][: 4 * n].reshape(n, 4), owner, rows[1][: 8 * n].reshape(n, 8)

    def write_colors(self, color: np.ndarray) -> None:
        """Replaces the colours of all splats, (N, 3) display sRGB, until they are decoded again."""
        for i, (start, end) in enumerate(pairwise(self._arena.starts)):
            self._arena.write_color(i, color[start:end])

    def overdraw(self, i: int, view: View, settings: RenderSettings) -> np.ndarray:
        """(H, W): how many splats each pixel of a view just drawn blends, for a debug view."""
        return count_overdraw(self._gpu, self._projector, self._arena, view, settings)

    def close(self) -> None:
        self._release_arena()
        for part in (self._splatter, self._sorter, self._projector):
            part.release()

    def _release_arena(self) -> None:
        for part in (self._decoder, self._arena):
            if part is not None:
                part.release()
        self._decoder = self._arena = None
