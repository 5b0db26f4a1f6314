"""What tables of ways to train share: options, captures by name, and runs of which ways take turns.

Imported by growth.py, blended_shapes.py, ../colors/light.py and others, which have put the
project's folder on the path.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from sweep import Rows, add_sweep, captures_of, sweep

from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.photos import LoadedPhoto, choose_downscale, load_photos
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.synthetic.workshop import make_workshop


@dataclass(frozen=True)
class Turn:
    """One run to make."""

    about: dict[str, object]  # capture, way and seed, as columns
    capture: Capture
    settings: TrainSettings
    photos: dict[str, list[LoadedPhoto]]  # of the splits train and test


def parser_of(doc: str, ways: dict[str, dict]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("captures", nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, help="a run; or give --iterations")
    parser.add_argument("--iterations", type=int)
    parser.add_argument("--max-anchors", type=int, default=12000)
    parser.add_argument("--downscale", type=int)
    parser.add_argument("--ways", nargs="+", choices=list(ways), default=list(ways))
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--size", type=int, default=200, help="pixels of the photos of balls")
    add_sweep(parser)
    return parser


def asked(parser: argparse.ArgumentParser) -> argparse.Namespace:
    options = parser.parse_args()
    if options.seconds is None and options.iterations is None:
        parser.error("a run needs an end: give --seconds or --iterations")
    return options


def settings_of(options: argparse.Namespace) -> TrainSettings:
    """What every way of a table has in common."""
    return TrainSettings(
        iterations=options.iterations, seconds=options.seconds, max_anchors=options.max_anchors,
        downscale=options.downscale,
    )  # fmt: skip


def measure_ways(
    options: argparse.Namespace, columns: tuple[str, ...], settings: TrainSettings,
    ways: dict[str, dict], rows_of: Callable[[Turn], Rows],
) -> None:  # fmt: skip
    """Rows of every capture with every seed with every way into --out, by who --cluster says."""
    made = {
        "balls": partial(make_balls, size=options.size), "workshop": make_workshop,
        "rig": partial(make_balls, size=options.size, rig=True),
    }  # fmt: skip
    places, runs = captures_of(options, made), {}
    for folder in places.values():
        for seed in options.seeds:
            for way in options.ways:
                about = {"capture": folder.name, "way": way, "seed": seed}
                changed = replace(settings, seed=seed, **ways[way])
                runs[" ".join(map(str, about.values()))] = partial(
                    rows_of_turn, about, folder, options.downscale, changed, rows_of
                )
    sweep(options, columns, runs, places)


def rows_of_turn(
    about: dict, folder: Path, downscale: int | None, settings: TrainSettings,
    rows_of: Callable[[Turn], Rows],
) -> Rows:  # fmt: skip
    capture = read_capture(folder)
    factor = downscale or choose_downscale(capture.photos)
    photos = {
        split: load_photos(capture, split, factor, settings.masks) for split in ("train", "test")
    }
    return rows_of(Turn(about, capture, settings, photos))
