"""Few photos: what the defaults give with 3, 6, 12 of them, and what priors and ways to train add.

    python3 tools/training/sparse.py CAPTURE MODALITY [CAPTURE MODALITY ...]
        --out docs/bench/sparse.csv [--photos 3 6 12 0] [--iterations 600] [--max-anchors 7500]
        [--downscale N] [--seeds 0] [--ways default ...]

CAPTURE is a folder of posed photos, or `bench` RGB: the demo's closed bench with true depth and
normals, made on the spot.  MODALITY is trained alone, from so many photos, spread over all; 0 is
all.  They have their masks, and no points: those of a capture come from all of its photos.
psnr_db, ssim and depth_error (of what is seen, where the capture knows it) are of all held-out
photos, train_db of up to 8 of the photos that were learned from.  Ways take turns; those that want
what a capture does not have are left out.

  default        2 splats an anchor and light, as `train` has it from 16 photos of one modality on;
                 without depth and normals
  depth          with depth photos (depth_share = 0.3)
  normals        with normal maps (normal_share = 0.1)
  both           with both
  rough depth    depth as a network guesses it that was fitted to the scene: each photo's scaled by
                 chance, one sigma 5 %, and bent by 5 % from side to side
  rough normals  normals turned by 12 degrees in the mean, alike within a tenth of the photo
  rough both     both of these
  seen points    depth at the points that were triangulated out of these photos, alone
  alike          colours that do not see the eye (view_dependent)
  five           fewer anchors of 5 splats each, as many splats, without light by direction, as
                 `train` has it for fewer photos
  half           half of the anchors
  left out       each step leaves out a tenth of the anchors, drawn by chance (DropGaussian, 2025)
  early          half of the steps
  coarse         a slope on scales below two pixels of the finest photo (min_scale_px = 2)
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[2])]

from ways import add_sweep, sweep  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.training.baselines.plain import one_modality  # noqa: E402
from shapeshift.training.evaluation.metrics import ssim  # noqa: E402
from shapeshift.training.first_anchors.initial import initial_points  # noqa: E402
from shapeshift.training.photos import (  # noqa: E402
    BLACK,
    LoadedPhoto,
    choose_downscale,
    load_photos,
)
from shapeshift.training.settings import ONE_MODALITY, TrainSettings  # noqa: E402
from shapeshift.training.step import Visibility  # noqa: E402
from shapeshift.training.synthetic import workshop  # noqa: E402
from shapeshift.training.synthetic.tracer import depth_under, look, pixel_rays  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402
from tools.synthetic import one_shape  # noqa: E402

COLUMNS = (
    "capture", "modality", "photos", "way", "seed", "psnr_db", "ssim", "depth_error", "train_db",
    "steps", "anchors", "seconds",
)  # fmt: skip
LOOKED_AT = 8  # training photos
BENCH = {"size": (192, 144), "counts": (48, 8)}
COVERED = 0.5  # of a pixel from which it has a depth
NEAR = 3  # pixels within which a nearer point hides one that lies 5 % farther


@dataclass(frozen=True)
class Way:
    """What is other than by default."""

    settings: dict = field(default_factory=dict)  # shares are of what was there
    priors: tuple[str, ...] = ()
    rough: bool = False
    left_out: float = 0.0


class Thinned(Visibility):
    """Visible anchors less a share of them, others at every look."""

    share, looks = 0.0, 0

    def visible_rows(self, stop: int, camera, anchors):
        rows = super().visible_rows(stop, camera, anchors)
        self.looks += 1
        rows = np.arange(self.count) if rows is None else self.device.download(rows)
        rng = np.random.default_rng([5, self.looks])
        kept = rows[rng.random(len(rows)) >= self.share]
        return self.device.upload((kept if len(kept) else rows).astype(np.int32))


class ThinnedTrainer(Trainer):
    left_out = 0.0

    def fresh_statistics(self, count: int):
        stats, _ = super().fresh_statistics(count)
        seen = Thinned(self.device, count, len(self.stops), self.layout.splats)
        seen.share = self.left_out
        return stats, seen


WAYS = {
    "default": Way(),
    "depth": Way(priors=("depth",)),
    "normals": Way(priors=("normals",)),
    "both": Way(priors=("depth", "normals")),
    "rough depth": Way(priors=("depth",), rough=True),
    "rough normals": Way(priors=("normals",), rough=True),
    "rough both": Way(priors=("depth", "normals"), rough=True),
    "seen points": Way(priors=("points",)),
    "alike": Way({"view_dependent": False}),
    "five": Way({"splats_per_anchor": 5, "max_anchors": 0.4, "anchor_attributes": "frame,color"}),
    "half": Way({"max_anchors": 0.5}),
    "left out": Way(left_out=0.1),
    "early": Way({"iterations": 0.5}),
    "coarse": Way({"min_scale_px": 2}),
}


def part_of(capture: Capture, photos: int) -> Capture:
    """With so many training photos, spread over all, and without points; all held-out ones stay."""
    (stop,) = capture.stops
    mine = capture.of(stop.name, "train")
    some = np.unique(np.linspace(0, len(mine) - 1, photos or len(mine)).round().astype(int))
    kept = [mine[i] for i in some] + capture.of(stop.name, "test")
    return replace(capture, photos=tuple(kept), points=None, point_colors=None)


def bench(folder: Path) -> Capture:
    """The demo's closed bench in colours, each photo with what the tracer knows of its shape."""
    stop, (here, _) = one_shape.STOPS[0], workshop.place(False)
    made = (folder, (stop,), (False,), one_shape.radiance, BENCH["size"], BENCH["counts"], 1)
    capture, photos = workshop.photograph_bench(*made, lambda done, count: None), []
    for photo in capture.photos:
        depth, normals = (photo.path.with_suffix(f".{name}.npy") for name in ("depth", "normals"))
        width, height = photo.view.size
        rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:height, :width])
        rays = pixel_rays(photo.view, columns, rows)
        eye = np.broadcast_to(photo.view.world_from_eye.position, rays.shape)
        in_eye = look(here, eye, rays).normals @ photo.view.world_from_eye.matrix()[:3, :3]
        np.save(depth, depth_under(here, photo.view).astype(np.float32))
        np.save(normals, in_eye.reshape(height, width, 3).astype(np.float32))
        photos.append(replace(photo, depth=depth, normals=normals))
    return replace(capture, photos=tuple(photos))


def smooth_chance(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) of one sigma, alike within a tenth of the sides."""
    coarse = rng.normal(size=(11, 11, 3))
    y, x = (np.linspace(0, 10, side, endpoint=False) for side in shape)
    i, j = y.astype(int), x.astype(int)
    v, u = (y - i)[:, None, None], (x - j)[None, :, None]
    above = coarse[i][:, j] * (1 - u) + coarse[i][:, j + 1] * u
    below = coarse[i + 1][:, j] * (1 - u) + coarse[i + 1][:, j + 1] * u
    return (above * (1 - v) + below * v) * 1.5  # means of four have two thirds of the deviation


def roughened(photo: LoadedPhoto, rng: np.random.Generator) -> LoadedPhoto:
    """With priors as a network may guess them."""
    depth, normals = photo.depth, photo.normals
    if depth is not None:
        bend = np.linspace(-0.05, 0.05, depth.shape[1]) * rng.choice([-1, 1])
        depth = (depth * (1 + 0.05 * rng.normal() + bend)).astype(np.float32)
    if normals is not None:
        turned = normals[..., :3] / 127 + 0.17 * smooth_chance(rng, normals.shape[:2])
        turned /= np.maximum(np.linalg.norm(turned, axis=2, keepdims=True), 1e-9)
        steps = np.rint(127 * turned) * normals[..., 3:]
        normals = np.concatenate([steps, normals[..., 3:]], axis=2).astype(np.int8)
    return replace(photo, depth=depth, normals=normals)


def with_seen_points(photo: LoadedPhoto, points: np.ndarray) -> LoadedPhoto:
    """With a depth at the pixels of the points, but for those that nearer ones hide."""
    camera_from_world, fx, fy, cx, cy = photo.view.pinhole()
    x, y, z = (points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]).T
    width, height = photo.view.size
    with np.errstate(divide="ignore", invalid="ignore"):
        column, row = fx * x / z + cx, fy * y / z + cy
    seen = (z > photo.view.near) & (column >= 0) & (row >= 0) & (column < width) & (row < height)
    column, row, z = column[seen].astype(int), row[seen].astype(int), z[seen]
    nearest = np.full((height + 2 * NEAR, width + 2 * NEAR), np.inf)
    for down in range(2 * NEAR + 1):
        for right in range(2 * NEAR + 1):
            np.minimum.at(nearest, (row + down, column + right), z)
    front = z <= 1.05 * nearest[row + NEAR, column + NEAR]
    depth = np.zeros((height, width), np.float32)
    depth[row[front], column[front]] = z[front]
    alpha = photo.rgba[..., 3] >= 128
    return replace(photo, depth=np.where(alpha, depth, np.float32(0)))


def photos_of(
    part: Capture, way: Way, settings: TrainSettings, loaded: dict[str, list[LoadedPhoto]]
) -> dict[str, list[LoadedPhoto]]:
    """Of both splits, those to train on with the priors of a way and no others."""
    rng, train = np.random.default_rng([settings.seed, 7]), []
    for photo in loaded["train"]:
        bare = {name: None for name in ("depth", "normals") if name not in way.priors}
        kept = replace(photo, **bare)
        train.append(roughened(kept, rng) if way.rough else kept)
    if "points" in way.priors:
        first = initial_points(part, train, np.random.default_rng([settings.seed, 0]))
        train = [with_seen_points(photo, first.points) for photo in train]
    return {"train": train, "test": loaded["test"]}


def has(part: Capture, way: Way) -> bool:
    """Whether a capture has what a way wants."""
    return all(
        name == "points" or all(getattr(photo, name) for photo in part.photos)
        for name in way.priors
    )


def changed(settings: TrainSettings, way: Way) -> TrainSettings:
    """With a way's settings."""
    given = way.settings
    shares = {n: round(v * getattr(settings, n)) for n, v in given.items() if type(v) is float}
    return replace(settings, **(given | shares))


def fit_of(trainer: Trainer, photos: list[LoadedPhoto]) -> tuple[float, float, float]:
    """Mean dB, SSIM and error of depth, NaN where none is known, over photos."""
    background, values = trainer.schedule.background or BLACK, []
    for photo in photos:
        drawing = trainer.step.draw(photo.view, trainer.control(photo.modality), background, True)
        image = trainer.device.download(drawing.frame.image).transpose(1, 2, 0)
        likeness = ssim(image, photo.over(background), photo.weight)
        away = depth_error(trainer, drawing, photo)
        values.append((trainer.psnr_of(drawing, photo, background), likeness, away))
    psnr_db, likeness, away = np.mean(values, axis=0)
    return float(psnr_db), float(likeness), float(away)


def depth_error(trainer: Trainer, drawing, photo: LoadedPhoto) -> float:
    """As `eval` tells it: the mean of |depth - d| / d, 1 where too little covers a pixel."""
    if photo.depth is None:
        return np.nan
    metres, through = map(
        trainer.device.download, (drawing.depth_frame.metres, drawing.frame.transmittance)
    )
    covered, known = 1 - through, photo.depth > 0
    depth = metres / np.maximum(covered, COVERED)
    away = np.abs(depth - photo.depth)[known] / photo.depth[known]
    return float(np.where(covered[known] >= COVERED, away, 1).mean())


def rows_of(
    word: str, options: argparse.Namespace, modality: str, photos: int, seed: int, way: str
) -> Iterator[dict]:
    """One, or none where the capture has not what the way is about."""
    with tempfile.TemporaryDirectory() as folder:
        whole = bench(Path(folder)) if word == "bench" else read_capture(Path(word))
        part = part_of(one_modality(whole, modality), photos)
        settings = TrainSettings(
            iterations=options.iterations, seed=seed,
            downscale=options.downscale or choose_downscale(whole.photos),
        )  # fmt: skip
        settings = replace(settings, **ONE_MODALITY | {"max_anchors": options.max_anchors})
        loaded = {
            split: load_photos(part, split, settings.downscale or 1, settings.masks)
            for split in ("train", "test")
        }
        if has(part, WAYS[way]):
            about = {"capture": Path(word).name, "modality": modality, "photos": photos}
            row = measured(open_device(), part, WAYS[way], settings, loaded)
            yield about | {"way": way, "seed": seed} | row


def measured(
    device, part: Capture, way: Way, settings: TrainSettings, loaded: dict[str, list[LoadedPhoto]]
) -> dict:
    """What a run gives."""
    kind = type("", (ThinnedTrainer,), {"left_out": way.left_out}) if way.left_out else Trainer
    photos = photos_of(part, way, settings, loaded)
    trainer = kind(device, part, changed(settings, way), loaded=photos)
    for _ in trainer.steps():
        pass
    psnr_db, likeness, away = fit_of(trainer, trainer.held_out)
    train_db, *_ = fit_of(trainer, photos["train"][:LOOKED_AT])
    return {
        "psnr_db": f"{psnr_db:.2f}", "ssim": f"{likeness:.4f}",
        "depth_error": "" if np.isnan(away) else f"{away:.4f}", "train_db": f"{train_db:.2f}",
        "steps": trainer.iteration, "anchors": trainer.anchors_count,
        "seconds": f"{trainer.seconds:.1f}",
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", help="folder, or bench, and modality, in turns")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--photos", type=int, nargs="+", default=[3, 6, 12, 0])
    parser.add_argument("--iterations", type=int, default=600)
    parser.add_argument("--max-anchors", type=int, default=7500)
    parser.add_argument("--downscale", type=int)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--ways", nargs="+", choices=list(WAYS), default=list(WAYS))
    add_sweep(parser)
    options = parser.parse_args()
    pairs = zip(options.captures[::2], options.captures[1::2], strict=True)
    runs, places = {}, {}
    for word, modality in pairs:
        if word != "bench":
            places[word] = Path(word).absolute()
        for photos, seed, way in product(options.photos, options.seeds, options.ways):
            name = f"{Path(word).name} {modality} {photos} {seed} {way}"
            runs[name] = partial(rows_of, word, options, modality, photos, seed, way)
    sweep(options, COLUMNS, runs, places)


if __name__ == "__main__":
    main()
