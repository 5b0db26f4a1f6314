"""launch.py demo: the bundled demo again, from its ray-traced capture to its package."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from shapeshift.app.command_line import EXPERT, SIZE
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.app.training.train_options import Asked

MOST_BYTES = 2_000_000  # the package lies in the repository
ITERATIONS = 10000  # 7 minutes of a core
MOST_ANCHORS = 18000
LEAST_SIDE = 16  # pixels of a photo: below it nothing is to be seen
BLENDED_SHAPES = 0.5  # see TrainSettings
ATTRIBUTES = "frame,stop_color"  # what several modalities have without being asked


@dataclass(frozen=True)
class Options:
    """Photograph the workshop (minutes), train it (minutes), write its package."""

    out: Path = Path("out/workshop")
    """Folder for the capture, workshop.shift and its checkpoint."""
    package: Path | None = None
    """Copy the package to this file, too; the bundled one is assets/workshop.shift.  Default: no
    copy."""
    seconds: float | None = None
    """Train for this long instead of --iterations.  Default: no limit."""
    iterations: int = ITERATIONS
    """Steps of training; the same number gives the same bits."""
    size: Annotated[str, SIZE] = "384x288"
    """WIDTHxHEIGHT of the photos."""
    views: Annotated[int, EXPERT] = 72
    """Photos of each stop to train on."""
    test_views: Annotated[int, EXPERT] = 8
    """Photos of each stop that are held out."""
    processes: Annotated[int, EXPERT] = 0
    """Processes that trace rays at the same time; 0: one for each core, at most 8."""


def run(options: Options) -> int:
    from shapeshift.app.drawing import parse_size
    from shapeshift.app.training import train

    size = parse_size(options.size)
    check(options, size)
    folder = options.out / "capture"
    recipe = {"size": list(size), "views": options.views, "test_views": options.test_views}
    if made_before(folder, recipe):
        say(f"Using the photos that are in {full(folder)}; delete it to trace them again.")
    else:
        photograph(folder, size, options)
    package = options.out / "workshop.shift"
    length: Asked = {"iterations": options.iterations}
    if options.seconds is not None:
        length = {"seconds": options.seconds}
    code = train.run(
        train.Options(
            capture=folder,
            out=package,
            asked={
                "max_anchors": MOST_ANCHORS,
                "blended_shapes": BLENDED_SHAPES,
                "anchor_attributes": ATTRIBUTES,
            }
            | length,
        )
    )
    if code == 0 and options.package is not None:
        publish(package, options.package)
    return code


def check(options: Options, size: tuple[int, int]) -> None:
    """Raises UsageError before photos are taken, which lasts minutes, for what is no demo."""
    from shapeshift.app.errors import UsageError
    from shapeshift.app.training.train_options import settings_of

    if min(size) < LEAST_SIDE:
        raise UsageError(f"--size is {options.size}; each side must be {LEAST_SIDE} or more.")
    for name, value, least in (
        ("views", options.views, 2),
        ("test-views", options.test_views, 1),
        ("processes", options.processes, 0),
    ):
        if value < least:
            raise UsageError(f"--{name} is {value}, expected {least} or more.")
    seconds = {} if options.seconds is None else {"seconds": options.seconds}
    settings_of({"iterations": options.iterations, **seconds})


def publish(package: Path, target: Path) -> None:
    """The finished package to where it is wanted, whole or not at all."""
    from shapeshift.app.errors import UsageError
    from shapeshift.runtime_models.files.whole_file import write_whole

    data = package.read_bytes()
    if len(data) > MOST_BYTES:
        raise UsageError(
            f"{package} has {len(data):,} bytes, more than the {MOST_BYTES:,} that a bundled "
            "package may have; lower MOST_ANCHORS"
        )
    write_whole(target, data)
    say(f"{full(target)}: {len(data) / 1e6:.2f} MB")


def made_before(folder: Path, recipe: dict) -> bool:
    """Whether a finished capture made by the same recipe lies in the folder."""
    from shapeshift.scene.captures.read_capture import read_capture

    if not (folder / "transforms.json").is_file():
        return False
    return read_capture(folder).notes.get("recipe") == recipe


def photograph(folder: Path, size: tuple[int, int], options: Options) -> None:
    from shapeshift.app.progress import progress_bar
    from shapeshift.training.synthetic.workshop import make_workshop

    processes = options.processes or min(os.cpu_count() or 1, 8)
    with progress_bar(transient=False) as progress:
        task = progress.add_task("photographing the workshop")

        def report(done: int, all_of_them: int) -> None:
            progress.update(task, completed=done, total=all_of_them)

        make_workshop(folder, size, options.views, options.test_views, processes, report)
