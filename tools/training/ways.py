"""What programs with rows of trainings share: their runs as tasks, and ways that are compared.

Each run is its program again, with --only, done by who --cluster says; rows of runs lie in OUT.runs
until all are there, so the same command goes on after Ctrl-C and trains nothing twice.  Imported by
programs that have put the project's folder on the path.
"""

import argparse
import csv
import io
import json
import shlex
import shutil
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from shapeshift.app.charts.chart_rows import write_text
from shapeshift.app.cluster.open_cluster import open_cluster
from shapeshift.app.cluster.run_task import BAD_INPUT
from shapeshift.app.cluster.task import Task, forget
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import file_name
from shapeshift.app.progress import lines
from shapeshift.app.terminal import say
from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.photos import LoadedPhoto, choose_downscale, load_photos
from shapeshift.training.settings import SIZES, TrainSettings, suited
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.synthetic.workshop import make_workshop

ROOT = Path(__file__).resolve().parents[2]
PLACES = ("--out", "--cluster", "--certificates", "--gpus")  # none of which changes a row
Rows = Iterable[dict[str, object]]  # by column
Way = dict[str, Any] | Callable[[TrainSettings], dict[str, Any]]  # what it changes of the settings


@dataclass(frozen=True)
class Turn:
    """One run to make."""

    about: dict[str, object]  # capture, way and seed, as columns
    capture: Capture
    settings: TrainSettings
    photos: dict[str, list[LoadedPhoto]]  # of the splits train and test


def parser_of(doc: str | None, ways: Mapping[str, Way]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("captures", nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, help="a run; or give --iterations")
    parser.add_argument("--iterations", type=int)
    parser.add_argument("--max-anchors", type=int, help="default: what suits the capture")
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
    """What every way of a table has in common, before it is made to suit a capture."""
    return TrainSettings(
        iterations=options.iterations, seconds=options.seconds, downscale=options.downscale,
        max_anchors=options.max_anchors or TrainSettings().max_anchors,
    )  # fmt: skip


def without(attribute: str) -> Way:
    """Anchors that lack what they have of the capture's default: frame, color or light."""

    def lacking(settings: TrainSettings) -> dict[str, Any]:
        have = settings.anchor_attributes.split(",")
        return {"anchor_attributes": ",".join(name for name in have if attribute not in name)}

    return lacking


def measure_ways(
    options: argparse.Namespace, columns: tuple[str, ...], settings: TrainSettings,
    ways: Mapping[str, Way], rows_of: Callable[[Turn], Rows],
) -> None:  # fmt: skip
    """Rows of every capture with every seed with every way into --out, by who --cluster says.

    settings: what all ways have in common.  They are made to suit each capture as `train` does it,
    and then a way changes them.
    """
    made = {
        "balls": partial(make_balls, size=options.size), "workshop": make_workshop,
        "rig": partial(make_balls, size=options.size, rig=True),
    }  # fmt: skip
    places, runs = captures_of(options, made), {}
    for folder in places.values():
        for seed in options.seeds:
            for way in options.ways:
                about = {"capture": folder.name, "way": way, "seed": seed}
                seeded = replace(settings, seed=seed)
                runs[" ".join(map(str, about.values()))] = partial(
                    rows_of_turn, about, folder, options, seeded, ways[way], rows_of
                )
    sweep(options, columns, runs, places)


def rows_of_turn(
    about: dict, folder: Path, options: argparse.Namespace, settings: TrainSettings, way: Way,
    rows_of: Callable[[Turn], Rows],
) -> Rows:  # fmt: skip
    capture = read_capture(folder)
    given = [name for name in SIZES if getattr(options, name, None) is not None]
    settings = suited(settings, given, capture)
    settings = replace(settings, **(way(settings) if callable(way) else way))
    factor = options.downscale or choose_downscale(capture.photos)
    photos = {
        split: load_photos(capture, split, factor, settings.masks) for split in ("train", "test")
    }
    return rows_of(Turn(about, capture, settings, photos))


def add_cluster(parser: argparse.ArgumentParser) -> None:
    """Who does the runs: as of the commands."""
    parser.add_argument("--cluster", default="none", help="who does the runs: docs/cluster.md")
    parser.add_argument("--certificates", type=Path, help="for a cluster of other machines")
    parser.add_argument("--gpus", type=int, default=0, help="that local workers share")


def add_sweep(parser: argparse.ArgumentParser) -> None:
    """The same for programs that `sweep`."""
    add_cluster(parser)
    parser.add_argument("--only", default="", help="this run alone; --out is then its rows as JSON")


def runs_folder(out: Path) -> Path:
    return out.absolute().with_name(out.name + ".runs")


def captures_of(
    options: argparse.Namespace, made: Mapping[str, Callable[[Path], object]]
) -> dict[str, Path]:
    """The folder of each capture by its word; made: writes those of ours, unless they are there."""
    places = {}
    for word in options.captures:
        places[word] = Path(word).absolute()
        if word in made:
            places[word] = runs_folder(options.out) / "captures" / word
            if not (places[word] / "transforms.json").is_file():
                made[word](places[word])
    if len({place.name for place in places.values()}) < len(options.captures):
        raise SystemExit("two captures have one name; give each once, in a folder of its own name.")
    return places


def sweep(
    options: argparse.Namespace, columns: tuple[str, ...],
    runs: Mapping[str, Callable[[], Rows]], captures: Mapping[str, Path], device: str | None = None,
) -> None:  # fmt: skip
    """Writes the rows of all runs to --out, in their order; with --only those of one as JSON.

    runs: by name, what measures; captures: words of the command line, and the folders that they
    stand for; device: the kind that measures.  Exits with a sentence where a run fails.
    """
    if options.only:
        write_one(options.out, runs[options.only], device)
        return
    folder = runs_folder(options.out)
    tasks = [task_of(options, name, folder, captures) for name in runs]
    kept = f"What is done lies in {folder}; the same command goes on."
    try:
        with lines("sweep"), open_cluster(
            options.cluster, options.certificates, options.gpus
        ) as cluster:  # fmt: skip
            cluster.run(tasks)
    except UsageError as error:
        raise SystemExit(f"{error}  {kept}") from None
    except KeyboardInterrupt:
        say(kept)
        raise SystemExit(130) from None
    found = [json.loads(Path(task.writes[0]).read_text()) for task in tasks]
    machines = dict.fromkeys(facts["machine"] for facts in found)
    head = [f"python3 {program().relative_to(ROOT)} {command(captures)}", *machines]
    write_rows(options.out, head, columns, [row for facts in found for row in facts["rows"]])
    for task in tasks:
        Path(task.writes[0]).unlink()
    forget(tasks)
    shutil.rmtree(folder)


def write_one(out: Path, run: Callable[[], Rows], device: str | None) -> None:
    """Rows of a run, and what they were made by.  Exits with a sentence where it is refused."""
    try:
        rows = [{k: "" if v is None else str(v) for k, v in row.items()} for row in run()]
    except (BadFile, UsageError) as error:
        say(str(error))
        raise SystemExit(BAD_INPUT) from None
    opened = open_device(device)
    facts = {"machine": f"{opened.name}, {opened.platform}", "rows": rows}
    write_text(out, json.dumps(facts) + "\n")


def program() -> Path:
    return Path(sys.argv[0]).resolve()


def task_of(
    options: argparse.Namespace, name: str, folder: Path, captures: Mapping[str, Path]
) -> Task:
    """The program with the same words, but for where its captures lie, and --only."""
    words, given = [], iter(sys.argv[1:])
    for word in given:
        if word in PLACES:
            next(given)
        elif word.partition("=")[0] not in PLACES:
            words.append(str(captures.get(word, word)))
    out = str(folder / f"{file_name(name)}.json")
    read = dict.fromkeys(
        [str(program()), str(Path(__file__).resolve()), *map(str, captures.values())]
    )
    argv = (str(program()), *words, "--out", out, "--only", name)
    slots = {"gpu": 1} if options.gpus else {}
    return Task(name, argv, tuple(read), (out,), slots)


def command(captures: Mapping[str, Path]) -> str:
    """As it was typed, without the places where captures lie and without who did the runs."""
    words, given = [], iter(sys.argv[1:])
    for word in given:
        if word == "--out":
            words += [word, next(given)]
        elif word in PLACES:
            next(given)
        elif word.partition("=")[0] not in PLACES:
            words.append(Path(word).name if word in captures else word)
    return shlex.join(words)


def write_rows(path: Path, head: list[str], columns: tuple[str, ...], rows: list[dict]) -> None:
    text = io.StringIO()
    text.writelines(f"# {line}\n" for line in head)
    table = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    write_text(path, text.getvalue())
