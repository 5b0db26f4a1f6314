"""How good a scene is: its pictures beside held-out photos of a capture."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rasterizer.bin import Tiles, bin_tiles
from rasterizer.project import LEAST_ALPHA, Projected, project
from rasterizer.raster import Frame, rasterize
from rasterizer.surface import rasterize_depth, surface
from runtime_models.evaluate import Evaluator, follows_eye
from runtime_models.model import BadFile, Model, Stop
from scene.capture import Capture
from scene.pose import View
from training.drawing import camera_of
from training.exposure import fitted_psnr
from training.metrics import psnr, ssim
from training.photos import BLACK, LoadedPhoto, choose_downscale, load_photos
from training.schedule import choose_background


@dataclass(frozen=True)
class Score:
    psnr_db: float
    ssim: float
    photos: int
    alive: int  # splats of this stop that are not absent
    each: dict[str, float]  # PSNR of every photo, dB, by its path in the capture
    vgg: float | None = None  # training.vgg_distance; None: not measured
    depth_error: float | None = None  # of photos with depth: Painter.depth_error
    fitted_db: float | None = None  # of right halves, colours fitted on left ones: fitted_psnr

    @property
    def median_db(self) -> float:
        """Of all photos: what a single one that nothing can explain does not move."""
        return float(np.median(list(self.each.values())))


class Painter:
    """Draws a model as a package holds it, through onnxruntime and the rasterizer."""

    def __init__(self, device, model: Model) -> None:
        self.device, self.evaluator = device, Evaluator(model)
        self.x: float | None = None

    def set_control(self, x: float) -> int:
        """Decode the geometry for x; returns how many splats are not absent.

        Of a model that follows the eye that is done for every picture, and all splats count.
        """
        if x != self.x:
            self.x = x
            self.alive = self.evaluator.model.splat_count
            if not follows_eye(self.evaluator.model):
                self.alive = self._decode(None)
        return self.alive

    def _decode(self, eye: np.ndarray | None) -> int:
        """Geometry at the last control value; returns how many splats are not absent."""
        geometry = self.evaluator.geometry(self.x, eye=eye)
        self.geometry = [self.device.upload(np.asarray(a, np.float32)) for a in geometry]
        return int((geometry[3] >= LEAST_ALPHA).sum())

    def picture(self, view: View, background: tuple[float, float, float]) -> np.ndarray:
        """(H, W, 3) float32 of the model at the last control value."""
        _, _, frame = self.draw(view, background)
        return self.device.download(frame.image).transpose(1, 2, 0)

    def draw(
        self, view: View, background: tuple[float, float, float]
    ) -> tuple[Projected, Tiles, Frame]:
        """The model at the last control value: what was projected, its tiles, and the frame."""
        if follows_eye(self.evaluator.model):
            self._decode(view.world_from_eye.position)
        color = self.evaluator.color(self.x, view.world_from_eye.position)
        color = self.device.upload(np.asarray(color, np.float32))
        projected = project(self.device, *self.geometry, color, camera_of(view))
        tiles = bin_tiles(self.device, projected, view.size)
        frame = rasterize(self.device, projected, tiles, view.size, background)
        return projected, tiles, frame

    def depth_error(self, photo: LoadedPhoto) -> float | None:
        """Mean |depth - d| / d over the depths d that a photo knows; None where it knows none.

        Where less than half of a pixel is covered there is no depth: that counts as 1.
        """
        known = None if photo.depth is None else photo.depth > 0
        if known is None or not known.any():
            return None
        view, device = photo.view, self.device
        projected, tiles, _ = self.draw(view, BLACK)
        surfaces = surface(device, *self.geometry[:3], camera_of(view), projected)
        drawn = rasterize_depth(device, projected, tiles, surfaces, view.size)
        coverage = 1 - device.download(drawn.frame.transmittance)
        depth = device.download(drawn.metres) / np.maximum(coverage, 1e-6)
        away = np.abs(depth[known] - photo.depth[known]) / photo.depth[known]
        return float(np.where(coverage[known] >= 0.5, away, 1).mean())


def stop_for(model: Model, capture_stop: Stop) -> Stop:
    """The model's stop of the same name as the capture's.  Raises BadFile."""
    for stop in model.stops:
        if stop.name == capture_stop.name:
            return stop
    names = ", ".join(f"'{s.name}'" for s in model.stops)
    raise BadFile(
        f"the scene has no stop '{capture_stop.name}' (it has {names}); "
        "evaluate it on the capture that it was trained on, or rename the modality."
    )


def evaluate_model(
    device,
    model: Model,
    capture: Capture,
    downscale: int | None = None,
    masks: str = "object",
    background: str = "auto",
    distance: Callable[..., float] | None = None,
) -> dict[str, Score]:
    """A Score for every modality over its held-out photos.  Raises BadFile where there are none.

    distance: what Score.vgg is the mean of, a function of (picture, photo, weight).
    """
    factor = downscale or choose_downscale(capture.photos)
    behind = choose_background(background, capture.background) or BLACK
    photos = load_photos(capture, "test", factor, masks)
    if not photos:
        raise BadFile(
            f"{capture.folder}: no photo is held out for testing; mark some with split 'test'."
        )
    painter, scores = Painter(device, model), {}
    for stop in capture.stops:
        alive = painter.set_control(stop_for(model, stop).x)
        mine = [p for p in photos if p.modality == stop.name]
        pairs = [(painter.picture(p.view, behind), p.over(behind), p.weight) for p in mine]
        errors = [e for p in mine if (e := painter.depth_error(p)) is not None]
        if pairs:
            each = [float(psnr(*pair)) for pair in pairs]
            scores[stop.name] = Score(
                float(np.mean(each)),
                float(np.mean([ssim(*pair) for pair in pairs])),
                len(pairs),
                alive,
                {name_in(capture, p): db for p, db in zip(mine, each, strict=True)},
                None if distance is None else float(np.mean([distance(*pair) for pair in pairs])),
                float(np.mean(errors)) if errors else None,
                float(np.mean([
                    fitted_psnr(picture, photo, wanted)
                    for photo, (picture, wanted, _) in zip(mine, pairs, strict=True)
                ])),
            )  # fmt: skip
    return scores


def name_in(capture: Capture, photo: LoadedPhoto) -> str:
    """A photo's path as seen from its capture."""
    path = Path(photo.name)
    return path.relative_to(capture.folder).as_posix() if path.is_absolute() else photo.name


def bytes_on_disk(path: Path) -> int:
    """Size of a file, or of all files in a folder."""
    if path.is_dir():
        return sum(p.stat().st_size for p in path.rglob("*") if p.is_file())
    return path.stat().st_size


def report(path: Path, scores: dict[str, Score], started: float) -> dict:
    """What `eval --json` writes; `started` is time.perf_counter() at the beginning."""
    return {
        "modalities": {
            name: {
                "psnr_db": round(s.psnr_db, 4),
                "median_db": round(s.median_db, 4),
                "ssim": round(s.ssim, 5),
                "photos": s.photos,
                "fitted_db": None if s.fitted_db is None else round(s.fitted_db, 4),
                "psnr_db_each": {photo: round(db, 3) for photo, db in s.each.items()},
            }
            | ({} if s.vgg is None else {"vgg_distance": round(s.vgg, 5)})
            | ({} if s.depth_error is None else {"depth_error": round(s.depth_error, 5)})
            for name, s in scores.items()
        },
        "alive": {name: s.alive for name, s in scores.items()},
        "bytes": bytes_on_disk(path),
        "seconds": round(time.perf_counter() - started, 3),
    }
