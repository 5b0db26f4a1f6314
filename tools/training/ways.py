"""What tables of ways to train share: options, captures by name, and runs of which ways take turns.

Imported by growth.py, blended_shapes.py and ../colors/light.py, which have put the project's folder
on the path.
"""

import argparse
import csv
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

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


def turns(
    options: argparse.Namespace, settings: TrainSettings, ways: dict[str, dict]
) -> Iterator[Turn]:
    """Every capture with every seed with every way; the photos of a capture are read once."""
    with tempfile.TemporaryDirectory() as folder:
        for name in options.captures:
            capture = read_capture(made(name, Path(folder), options.size))
            factor = options.downscale or choose_downscale(capture.photos)
            photos = {
                split: load_photos(capture, split, factor, settings.masks)
                for split in ("train", "test")
            }
            for seed in options.seeds:
                for way in options.ways:
                    about = {"capture": Path(name).name, "way": way, "seed": seed}
                    changed = replace(settings, seed=seed, **ways[way])
                    yield Turn(about, capture, changed, photos)


def made(name: str, folder: Path, size: int) -> Path:
    """The folder of a capture, which is made first where the name is that of one of ours."""
    if name == "balls":
        make_balls(folder / name, size)
    elif name == "rig":
        make_balls(folder / name, size, rig=True)
    elif name == "workshop":
        make_workshop(folder / name)
    else:
        return Path(name)
    return folder / name


@contextmanager
def table(
    options: argparse.Namespace, columns: tuple[str, ...], device
) -> Iterator[Callable[[Iterable[dict]], None]]:
    """Rows into --out, a run at a time, below the command and the machine."""
    with options.out.open("w", newline="") as file:
        words = [Path(w).name if w in options.captures else w for w in sys.argv[1:]]
        program = Path(sys.argv[0]).resolve().relative_to(Path(__file__).resolve().parents[2])
        file.write(f"# python3 {program} {shlex.join(words)}\n")
        file.write(f"# {device.name}, {device.platform}\n")
        rows = csv.DictWriter(file, columns, lineterminator="\n")
        rows.writeheader()

        def add(found: Iterable[dict]) -> None:
            rows.writerows(found)
            file.flush()

        yield add
