"""Draws with rasterizer/ where there is no GPU: OpenCL tiles, 5 to 8 times faster than software GL.

Same life as renderer/quads.py: allocate, decode what changed, place, draw.  No GL here.
"""

from dataclasses import dataclass

import numpy as np

from rasterizer.bin import bin_tiles
from rasterizer.device import Device, open_device
from rasterizer.pack import pack
from rasterizer.project import CULL_REASONS, Camera
from rasterizer.project_arena import Limits, project_arena
from rasterizer.raster import rasterize_rgba
from rasterizer.shade_sh import shade_sh, upload_sh
from renderer.settings import RenderSettings
from renderer.timing import PassTimer
from runtime_models.evaluate import Evaluator
from runtime_models.model import AnchorModel, SplatLayers
from scene.pose import View


@dataclass
class _Slot:
    """One object's rows of the arena."""

    start: int
    count: int
    evaluator: Evaluator
    sh: object | None  # device array of coefficients; None: the colour comes from a network


class TilesDrawing:
    """The arena of all objects on an OpenCL device, and the passes that draw it."""

    decodes_on_gpu = False  # says which clock times the decoding: GL's or the wall's

    def __init__(self, device: Device | None = None) -> None:
        self.device = device or open_device()
        self.backends = {
            "drawing": f"tiles ({self.device.platform})",
            "mlps": "onnxruntime",
            "sort": f"tiles ({self.device.platform})",
        }
        self.allocations = 0  # how often the arena was made: once for each set of objects
        self._slots: list[_Slot] = []
        self._images: dict[int, np.ndarray] = {}

    def allocate(self, models: list[AnchorModel | SplatLayers]) -> None:
        """Room for these objects; what was decoded before is gone."""
        counts = [model.splat_count for model in models]
        starts = np.concatenate([[0], np.cumsum(counts, dtype=int)])
        self.splats = int(starts[-1])
        self.allocations += 1
        device = self.device
        self._mean_opacity = device.zeros((self.splats, 4))
        self._covariance = device.zeros((self.splats, 8))
        self._color = device.zeros((self.splats, 4))
        self._staging = np.zeros((max(counts, default=0), 4), np.float32)
        self._object_index = device.upload(
            np.repeat(np.arange(len(models), dtype=np.int32), counts)
        )
        evaluators = {id(model): Evaluator(model) for model in models}
        sh = {id(m): upload_sh(device, m.sh) for m in models if isinstance(m, SplatLayers)}
        self._slots = [
            _Slot(int(start), count, evaluators[id(model)], sh.get(id(model)))
            for start, count, model in zip(starts, counts, models, strict=False)
        ]

    def decode_geometry(self, i: int, x: float) -> None:
        """Means, covariances and opacities of object i at control value x."""
        slot = self._slots[i]
        splats = slot.evaluator.geometry(x)
        pack(self.device, splats, slot.start, self._mean_opacity, self._covariance)
        self.device.queue.finish()

    def decode_color(self, i: int, x: float, eye_object: np.ndarray) -> None:
        """Colours of object i at x, towards an eye (3,) in the object's frame."""
        slot = self._slots[i]
        if slot.sh is not None:
            args = (slot.sh, eye_object, slot.start, self._mean_opacity, self._color)
            shade_sh(self.device, *args)
            self.device.queue.finish()
        elif slot.count:
            rows = self._staging[: slot.count]
            rows[:, :3] = slot.evaluator.color(x, eye_object)
            self._color[slot.start : slot.start + slot.count].set(rows)

    def place(self, world_from_objects: list[np.ndarray]) -> None:
        """Poses (4, 4) of all objects; one full of NaN hides its object."""
        self._world_from_objects = np.reshape(world_from_objects, (-1, 4, 4))

    def draw(self, views: list[View], settings: RenderSettings, timer: PassTimer) -> None:
        """Draws every view; view i is then image(i)."""
        if not self.splats:
            for i, view in enumerate(views):
                self._images[i] = np.zeros((view.size[1], view.size[0], 4), np.float32)
            return
        device = self.device
        for first in range(0, len(views), 2):
            pair = views[first : first + 2]
            with timer.time("project", on_gpu=False):
                self._projected = project_arena(
                    device,
                    self._mean_opacity,
                    self._covariance,
                    self._color,
                    self._object_index,
                    self._world_from_objects,
                    [Camera(*view.pinhole(), view.size, view.near) for view in pair],
                    limits_of(settings),
                )
                device.queue.finish()
            for i, (view, projected) in enumerate(zip(pair, self._projected, strict=True), first):
                with timer.time("bin", on_gpu=False):
                    tiles = bin_tiles(device, projected, view.size)
                    device.queue.finish()
                with timer.time("splat", on_gpu=False):
                    self._images[i] = rasterize_rgba(device, projected, tiles, view.size)

    def counts(self) -> dict[str, int]:
        """{drawn, opacity, distance, ...} of the view drawn last: gates in their order."""
        if not self.splats:
            return dict.fromkeys(("drawn", *CULL_REASONS), 0)
        culled = self._projected[-1].culled(self.device)
        return {"drawn": self.splats - sum(culled.values()), **culled}

    def presentable(self, i: int) -> np.ndarray:
        """What resolve takes: the image, row 0 on top."""
        return self._images[i]

    def image(self, i: int) -> np.ndarray:
        """(H, W, 4) float32 premultiplied, row 0 on top, of the view last drawn as number i."""
        return self._images[i]

    def close(self) -> None:
        self._slots.clear()
        self._images.clear()


def limits_of(settings: RenderSettings) -> Limits:
    """The culls of the settings as projection takes them."""
    return Limits(
        settings.min_alpha,
        settings.max_pixels,
        settings.max_distance,
        settings.min_pixels,
        settings.fade,
        settings.low_pass,
    )
