"""How good a scene is: its pictures compared with held-out photos of a capture."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.rasterizer.bin import Tiles, bin_tiles
from shapeshift.rasterizer.project import LEAST_ALPHA, Projected, project
from shapeshift.rasterizer.raster import RasterFrame, rasterize
from shapeshift.rasterizer.surface import rasterize_depth, surface
from shapeshift.runtime_models.evaluate import Evaluator, follows_eye
from shapeshift.runtime_models.model import BadFile, Model, Stop
from shapeshift.scene.cameras.camera_list import moved
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.pose import View
from shapeshift.training.drawing import Color, camera_of
from shapeshift.training.evaluation.metrics import psnr, ssim
from shapeshift.training.photos import BLACK, LoadedPhoto, choose_downscale, is_masked, read
from shapeshift.training.supervision.backgrounds import choose_background
from shapeshift.training.supervision.exposure import fitted_psnr
from shapeshift.training.supervision.still_background import (
    PICTURE_PHOTOS,
    StillBackground,
    StillPicture,
    chosen,
    key_of,
    still_background,
    still_share,
)

MOST_LOOKED_AT, LOOKED_AT_PX = 12, 64  # held-out photos, for the colour behind them
# Fields of ModalityScore that not every photo has.
SOME_HAVE = ("vgg", "depth_error", "fitted_db", "whole_db")


@dataclass(frozen=True)
class ModalityScore:
    psnr_db: float
    ssim: float
    photos: int
    alive: int  # splats of this stop that are not absent
    each: dict[str, float]  # PSNR of every photo, dB, by its path in the capture
    vgg: float | None = None  # training.vgg_distance; None: not measured
    depth_error: float | None = None  # of photos with depth: ModelRenderer.depth_error
    whole_db: float | None = None  # PSNR of whole photos, before what stands still behind, if any
    fitted_db: float | None = None  # of right halves, colours fitted on left ones: fitted_psnr
    unknown: float = 0.0  # share of the pixels that have no value, and count for nothing
    blank: tuple[str, ...] = ()  # photos of which no pixel has one; they are in no mean

    @property
    def median_db(self) -> float:
        """Of all photos: what a single one that nothing can explain does not move."""
        return float(np.median(list(self.each.values())))


class ModelRenderer:
    """Draws a model as a package holds it, through onnxruntime and the rasterizer."""

    def __init__(self, device, model: Model) -> None:
        self.device, self.evaluator = device, Evaluator(model)
        self.x = math.nan  # none yet
        self.geometry: tuple[Any, Any, Any, Any]  # means, scales, wxyz, opacity on the device

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
        means, scales, wxyz, opacity = (
            self.device.upload(np.asarray(a, np.float32)) for a in geometry
        )
        self.geometry = means, scales, wxyz, opacity
        return int((geometry[3] >= LEAST_ALPHA).sum())

    def picture(self, view: View, background: tuple[float, float, float]) -> np.ndarray:
        """(H, W, 3) float32 of the model at the last control value."""
        _, _, frame = self.draw(view, background)
        return self.device.download(frame.image).transpose(1, 2, 0)

    def draw(
        self, view: View, background: tuple[float, float, float]
    ) -> tuple[Projected, Tiles, RasterFrame]:
        """The model at the last control value: what was projected, its tiles, and the frame."""
        if follows_eye(self.evaluator.model):
            self._decode(view.world_from_eye.position)
        color = self.evaluator.color(self.x, view.world_from_eye.position)
        color = self.device.upload(np.asarray(color, np.float32))
        means, scales, wxyz, opacity = self.geometry
        camera = camera_of(view)
        projected = project(self.device, means, scales, wxyz, opacity, color, camera)
        tiles = bin_tiles(self.device, projected, view.size)
        frame = rasterize(self.device, projected, tiles, view.size, background)
        return projected, tiles, frame

    def depth_error(self, photo: LoadedPhoto) -> float | None:
        """Mean |depth - d| / d over the depths d that a photo knows; None where it knows none.

        Where less than half of a pixel is covered there is no depth: that counts as 1.
        """
        if photo.depth is None or not (known := photo.depth > 0).any():
            return None
        view, device = photo.view, self.device
        projected, tiles, _ = self.draw(view, BLACK)
        means, scales, wxyz, _ = self.geometry
        surfaces = surface(device, means, scales, wxyz, camera_of(view), projected)
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
    masks: str = "auto",
    background: str = "auto",
    distance: Callable[..., float] | None = None,
) -> dict[str, ModalityScore]:
    """Of every modality, over its held-out photos.  Raises BadFile where there are none.

    Model and capture may be about zeros of their own (survey coordinates): cameras are moved.
    distance: what ModalityScore.vgg is the mean of, a function of (picture, photo, weight).
    """
    factor = downscale or choose_downscale(capture.photos)
    tests = [photo for photo in capture.photos if photo.split == "test"]
    if not tests:
        raise BadFile(
            f"{capture.folder}: no photo is held out for testing; mark some with split 'test'."
        )
    known = known_background(model, capture)
    shown = []  # few and small photos, which tell the colour behind them; below one is in memory
    if background == "auto" and known is None:
        for photo in tests[:: math.ceil(len(tests) / MOST_LOOKED_AT)]:
            smaller = math.ceil(max(photo.view.size) / LOOKED_AT_PX)
            shown += with_values([photo], max(factor, smaller), masks)
    behind = choose_background(background, known, shown) or BLACK
    still = StillBackground()
    if background == "auto" and known is None and behind == BLACK:
        still = still_of(capture, factor, masks, model.provenance.get("still_background"))
    apart = np.subtract(capture.origin, getattr(model, "origin", BLACK))  # metres
    renderer, scores = ModelRenderer(device, model), {}
    for stop in capture.stops:
        alive = renderer.set_control(stop_for(model, stop).x)
        names, found, blank = [], [], []
        unknown = pixels = 0
        for photo in capture.of(stop.name, "test"):
            loaded = read(photo, factor, masks)  # one at a time is in memory
            if loaded.is_blank:
                blank.append(name_in(capture, loaded))
                continue
            unknown, pixels = unknown + loaded.unknown, pixels + math.prod(loaded.view.size)
            loaded = replace(loaded, view=moved([loaded.view], apart.tolist())[0])
            names.append(name_in(capture, loaded))
            found.append(photo_scores(renderer, still.cut(loaded), behind, distance))
            if (picture := still.pictures.get(key_of(loaded))) is not None:
                found[-1]["whole_db"] = whole_psnr(renderer, loaded, picture)
        if blank and not found:
            raise BadFile(
                f"{capture.folder}: no pixel of the photos of '{stop.name}' that are held out has "
                "a value (no data, or NaN); mark others with split 'test'."
            )
        if found:
            score = mean_score(names, found, alive)
            scores[stop.name] = replace(score, unknown=unknown / pixels, blank=tuple(blank))
    return scores


def mean_score(names: list[str], found: list[dict[str, float]], alive: int) -> ModalityScore:
    """Of what photo_scores found of photos of these names."""
    each = {name: of["psnr_db"] for name, of in zip(names, found, strict=True)}
    psnr_db, ssim_mean = (mean_of(found, key) or 0.0 for key in ("psnr_db", "ssim"))
    some: dict[str, Any] = {key: mean_of(found, key) for key in SOME_HAVE}
    return ModalityScore(psnr_db, ssim_mean, len(found), alive, each, **some)


def still_of(capture: Capture, factor: int, masks: str, known: object) -> StillBackground:
    """What stands still behind the subject of a capture, by its training photos.

    known: whether its model was trained without, as far as it says so; else a small look tells.
    """
    cameras: dict[tuple, list[Photo]] = {}
    for photo in capture.photos:
        if photo.split == "train":
            cameras.setdefault((photo.modality, photo.view.size), []).append(photo)
    if known is False or any(is_masked(photo, masks) for photo in capture.photos):
        return StillBackground()
    looked = [chosen(mine, PICTURE_PHOTOS) for mine in cameras.values()]
    for mine in looked:
        smaller = math.ceil(max(mine[0].view.size) / LOOKED_AT_PX)
        if known is True or still_share(with_values(mine, max(factor, smaller), masks)):
            return still_background(with_values([p for m in looked for p in m], factor, masks))
    return StillBackground()


def with_values(photos: list[Photo], factor: int, masks: str) -> list[LoadedPhoto]:
    """Photos as `read` gives them, without those of which no pixel has a value."""
    loaded = (read(photo, factor, masks) for photo in photos)
    return [photo for photo in loaded if not photo.is_blank]


def whole_psnr(renderer: ModelRenderer, photo: LoadedPhoto, still: StillPicture) -> float:
    """Decibels of a photo as it is, of the model before what stands still behind it."""
    _, _, frame = renderer.draw(photo.view, BLACK)
    return float(psnr(before(renderer.device, frame, still), photo.over(BLACK), photo.weight))


def before(device, frame: RasterFrame, still: StillPicture) -> np.ndarray:
    """(H, W, 3) a frame that was drawn over black, before a picture that stands still."""
    through = device.download(frame.transmittance)[..., None]
    return device.download(frame.image).transpose(1, 2, 0) + through * still.rgb / np.float32(255)


def known_background(model: Model, capture: Capture) -> tuple | None:
    """The capture's background, or the one that a training found in its photos."""
    found = model.provenance.get("background")
    if capture.background is not None or not isinstance(found, list | tuple):
        return capture.background
    good = len(found) == 3 and all(isinstance(v, int | float) and 0 <= v <= 1 for v in found)
    return tuple(map(float, found)) if good else None


def photo_scores(
    renderer: ModelRenderer,
    photo: LoadedPhoto,
    behind: Color,
    distance: Callable[..., float] | None,
) -> dict[str, float]:
    """What ModalityScore has the means of, of one photo; without what it has not."""
    picture, wanted = renderer.picture(photo.view, behind), photo.over(behind)
    found = {
        "psnr_db": float(psnr(picture, wanted, photo.weight)),
        "ssim": float(ssim(picture, wanted, photo.weight)),
        "fitted_db": fitted_psnr(picture, photo, wanted),
    }
    if distance is not None:
        found["vgg"] = float(distance(picture, wanted, photo.weight))
    if (error := renderer.depth_error(photo)) is not None:
        found["depth_error"] = error
    return found


def mean_of(found: list[dict[str, float]], key: str) -> float | None:
    """Over the photos that have it; None where none does."""
    values = [of[key] for of in found if key in of]
    return float(np.mean(values)) if values else None


def name_in(capture: Capture, photo: LoadedPhoto) -> str:
    """A photo's path as seen from its capture."""
    path = Path(photo.name)
    return path.relative_to(capture.folder).as_posix() if path.is_absolute() else photo.name


def bytes_on_disk(path: Path) -> int:
    """Size of a file, or of all files in a folder."""
    if path.is_dir():
        return sum(p.stat().st_size for p in path.rglob("*") if p.is_file())
    return path.stat().st_size


def report(path: Path | None, scores: dict[str, ModalityScore], started: float) -> dict:
    """What `eval --json` writes; `started` is time.perf_counter() at the beginning.

    path: of the scene, None where it lies nowhere on disk.
    """
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
            | ({"unknown": round(s.unknown, 6)} if s.unknown else {})
            | ({"photos_without_value": list(s.blank)} if s.blank else {})
            | ({} if s.vgg is None else {"vgg_distance": round(s.vgg, 5)})
            | ({} if s.whole_db is None else {"whole_db": round(s.whole_db, 4)})
            | ({} if s.depth_error is None else {"depth_error": round(s.depth_error, 5)})
            for name, s in scores.items()
        },
        "alive": {name: s.alive for name, s in scores.items()},
        "bytes": bytes_on_disk(path) if path else None,
        "seconds": round(time.perf_counter() - started, 3),
    }
