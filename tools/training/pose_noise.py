"""Poses that are a little wrong: what `--poses refine` finds of them, and what it gives and costs.

    python3 tools/training/pose_noise.py CAPTURE ... --out docs/bench/poses.csv
        [--iterations 600] [--max-anchors 6000] [--downscale N] [--seeds 0 1] [--modality RGB]
        [--planted 0 0.3] [--percent 0.5]

CAPTURE is a folder of photos whose poses are exact, or `workshop`: the demo's bench, made on the
spot in small.  Every training photo's camera is turned by --planted degrees and shifted by
--percent of half of the cameras' spread for each 0.3 degrees, in random directions; held-out
photos keep their poses.  A similarity that brings the cameras nearest to their true places is taken
away: turn_deg, shift_percent and shift_px (of the capture's points, in pixels of the photos) are
means of what is left then.  psnr_db is of held-out photos from their stated poses, aligned_db from
there through that similarity.
"""

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[2])]

from ways import asked, captures_of, parser_of, settings_of, sweep  # noqa: E402

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.scene.pose import Pose, View  # noqa: E402
from shapeshift.training.baselines.plain import one_modality  # noqa: E402
from shapeshift.training.calibration.extrinsics import moved_by, offset_view  # noqa: E402
from shapeshift.training.first_anchors.views import pixel_of  # noqa: E402
from shapeshift.training.photos import (  # noqa: E402
    BLACK,
    LoadedPhoto,
    choose_downscale,
    load_photos,
)
from shapeshift.training.synthetic.workshop import make_workshop  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

COLUMNS = (
    "capture", "planted_deg", "planted_percent", "poses", "seed", "psnr_db", "aligned_db",
    "turn_deg", "shift_percent", "shift_px", "steps", "seconds",
)  # fmt: skip
WAYS = {way: {"poses": way} for way in ("stated", "refine")}
WORKSHOP = {"size": (192, 144), "views": 36, "test_views": 8}
SOME_POINTS = 200  # of the capture's
Similarity = tuple[
    float, np.ndarray, np.ndarray
]  # scale, turn (3, 3), shift (3,) of p -> s R p + t


def disturbed(photos: list[LoadedPhoto], turn_deg: float, shift_m: float) -> list[LoadedPhoto]:
    """Each camera turned and shifted by so much, the same way in every run."""
    rng, out = np.random.default_rng(7), []
    for photo in photos:
        turn, shift = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        six = np.concatenate([np.deg2rad(turn_deg) * turn, shift_m * shift])
        out.append(replace(photo, view=offset_view(photo.view, moved_by(six))))
    return out


def positions(views: list[View]) -> np.ndarray:
    return np.array([view.world_from_eye.position for view in views])  # (V, 3) metres


def similarity(start: np.ndarray, goal: np.ndarray) -> Similarity:
    """The one that brings places (V, 3) nearest to others (Umeyama 1991)."""
    middle, there = start.mean(axis=0), goal.mean(axis=0)
    left, values, right = np.linalg.svd((goal - there).T @ (start - middle))
    signs = np.array([1, 1, np.sign(np.linalg.det(left @ right))])
    turn = left * signs @ right
    scale = float((values * signs).sum() / ((start - middle) ** 2).sum())
    return scale, turn, there - scale * turn @ middle


def through(view: View, found: Similarity) -> View:
    """A view of the true world in the world that a similarity leads from."""
    scale, turn, shift = found
    matrix = view.world_from_eye.matrix()
    matrix[:3, 3] = turn.T @ (matrix[:3, 3] - shift) / scale
    matrix[:3, :3] = turn.T @ matrix[:3, :3]
    return replace(view, world_from_eye=Pose.from_matrix(matrix))


def errors(now: list[View], true: list[View], points: np.ndarray) -> tuple[Similarity, list]:
    """The similarity, and mean degrees, metres and pixels that cameras are off behind it."""
    found = similarity(positions(now), positions(true))
    turns, shifts, pixels = [], [], []
    for view, right in zip(now, true, strict=True):
        right = through(right, found)
        away = np.linalg.inv(right.world_from_eye.matrix()) @ view.world_from_eye.matrix()
        turns.append(np.rad2deg(np.arccos(np.clip((np.trace(away[:3, :3]) - 1) / 2, -1, 1))))
        shifts.append(found[0] * np.linalg.norm(away[:3, 3]))
        scale, turn, shift = found
        (here, seen), (there, _) = (
            pixel_of(v, (points - shift) @ turn / scale) for v in (right, view)
        )
        if seen.any():
            pixels.append(np.linalg.norm(here - there, axis=1)[seen].mean())
    return found, [float(np.mean(values)) for values in (turns, shifts, pixels)]


def held_out(trainer: Trainer, found: Similarity) -> float:
    values, background = [], trainer.schedule.background or BLACK
    for photo in trainer.held_out:
        view, control = through(photo.view, found), trainer.control(photo.modality)
        drawing = trainer.step.draw(view, control, background)
        values.append(trainer.psnr_of(drawing, photo, background))
    return float(np.mean(values))


def run(device, capture: Capture, settings, photos: dict, turn: float, percent: float) -> dict:
    true = [photo.view for photo in photos["train"]]
    size = float(np.linalg.norm(np.ptp(positions(true), axis=0))) / 2
    given = disturbed(photos["train"], turn, percent / 100 * size)
    trainer = Trainer(device, capture, settings, loaded=photos | {"train": given})
    for _ in trainer.steps():
        pass
    points = capture.points[::SOME_POINTS].astype(float)
    found, off = errors([trainer.poses.view(photo) for photo in given], true, points)
    stated: Similarity = (1.0, np.eye(3), np.zeros(3))
    return {
        "psnr_db": f"{held_out(trainer, stated):.2f}",
        "aligned_db": f"{held_out(trainer, found):.2f}", "turn_deg": f"{off[0]:.3f}",
        "shift_percent": f"{100 * off[1] / size:.3f}", "shift_px": f"{off[2]:.3f}",
        "steps": trainer.iteration, "seconds": f"{trainer.elapsed:.1f}",
    }  # fmt: skip


def rows_of(
    folder: Path, options: argparse.Namespace, seed: int, turn: float, way: str
) -> list[dict]:
    capture = read_capture(folder)
    part = one_modality(capture, options.modality) if options.modality else capture
    factor = options.downscale or choose_downscale(part.photos)
    photos = {s: load_photos(part, s, factor, "object") for s in ("train", "test")}
    percent = options.percent * turn / 0.3
    settings = replace(settings_of(options), seed=seed, **WAYS[way])
    about = {
        "capture": folder.name, "planted_deg": turn, "poses": way, "seed": seed,
        "planted_percent": f"{percent:g}",
    }  # fmt: skip
    return [about | run(open_device(), part, settings, photos, turn, percent)]


def main() -> None:
    parser = parser_of(__doc__, WAYS)
    parser.add_argument("--planted", type=float, nargs="+", default=[0.0, 0.3], help="degrees")
    parser.add_argument("--percent", type=float, default=0.5, help="for each 0.3 degrees")
    parser.add_argument("--modality", help="default: all of the capture")
    options = asked(parser)
    places = captures_of(options, {"workshop": partial(make_workshop, **WORKSHOP, processes=1)})
    runs = {
        f"{folder.name} {seed} {turn:g} {way}": partial(rows_of, folder, options, seed, turn, way)
        for folder in places.values()
        for seed in options.seeds
        for turn in options.planted
        for way in options.ways
    }
    sweep(options, COLUMNS, runs, places)


if __name__ == "__main__":
    main()
