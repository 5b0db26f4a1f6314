"""launch.py headless: the bundled demo, still and in motion: pictures, frame times, no window."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shapeshift.app.command_line import SIZE
from shapeshift.app.paths import DEMO
from shapeshift.app.terminal import print_json, say
from shapeshift.runtime_models.program import program

if TYPE_CHECKING:
    from shapeshift.app.document import Document
    from shapeshift.renderer.renderer import Renderer

TOUCH = "touch.png"
QUALITY_SIZE = (192, 128)  # of the pictures that are compared with the float64 reference
TURN = 0.6  # radians between the viewpoints


@dataclass(frozen=True)
class Options:
    """Draw a scene at its stops and between them, and time it; without --scene the bundled demo,
    also while the hand of its script is at work."""

    scene: Path = DEMO
    """What to draw.  Default: the bundled demo, still and in motion."""
    out: Path = Path("out/demo")
    """Folder for the pictures and bench.json; those of an earlier run are replaced."""
    size: Annotated[str, SIZE] = "480x320"
    """WIDTHxHEIGHT of one picture."""
    frames: int = 30
    """Frames that are timed, mono and stereo each, after 3 that do not count."""
    sweep: int = 30
    """Values of x that are timed from 0 to 1, after 3 that do not count."""


def run(options: Options) -> int:
    from shapeshift.app.commands.bench import (
        check_counts,
        check_result_path,
        measure,
        print_table,
        write_json,
    )
    from shapeshift.app.document import DARK, open_document
    from shapeshift.app.drawing import make_folder, open_renderer, parse_size
    from shapeshift.app.errors import UsageError
    from shapeshift.app.measure import Measure
    from shapeshift.app.opening import ReadingOptions

    size = parse_size(options.size)
    check_counts(options)
    if options.scene == DEMO and not DEMO.exists():
        raise UsageError(f"the bundled demo {DEMO} is missing; `{program()} demo` makes one.")
    subject = open_document(options.scene, ReadingOptions())
    result_path = options.out / "bench.json"
    make_folder(options.out)
    check_result_path(result_path)
    check_ours([options.out / TOUCH])
    with open_renderer("auto", "auto") as (renderer, ctx):
        renderer.settings = replace(renderer.settings, background=subject.background_or(DARK))
        draw_sheet(renderer, subject, size, options.out)
        result = measure(Measure(renderer, ctx, subject, None, size), options, QUALITY_SIZE)
        if options.scene == DEMO:
            result["touch"] = play_touch(renderer, ctx, size, options.out)
    print_table(result)
    write_json(result_path, result)
    say(f"{picture_words(result)} and bench.json are in {options.out.resolve()}")
    summary = {"out": str(options.out), "frame_ms": result["frame_ms"]}
    print_json(summary | {"psnr_db": result["psnr_db"], "touch": result.get("touch")}, indent=None)
    return 0


def play_touch(renderer, ctx, size: tuple[int, int], out: Path) -> dict | None:
    """The demo in motion; None, and why, where its bodies cannot be made here."""
    from shapeshift.app.commands.touch_film import film
    from shapeshift.runtime_models.model import BadFile

    try:
        return film(renderer, ctx, size, out / TOUCH)
    except BadFile as error:
        say(f"The demo in motion is left out: {error}")
        return None


def picture_words(result: dict) -> str:
    """What pictures there are, in words."""
    touch = f", {TOUCH} the demo in motion" if result.get("touch") else ""
    return f"Pictures (sheet.png shows all{touch})"


def draw_sheet(renderer: "Renderer", subject: "Document", size: tuple[int, int], out: Path) -> None:
    """A row a viewpoint; columns are the stops and the middles between them, of a scene file one:
    its objects each at its own x.
    """
    import numpy as np

    from shapeshift.app.drawing import save_png

    stops = list(subject.stops)
    between = [(a + b) / 2 for a, b in pairwise(stops)]
    controls: Sequence[float | None] = [None] if subject.file else sorted(stops + between)
    views = viewpoints(subject, size)
    names = [[picture_name(v, x) for x in controls] for v in range(len(views))]
    check_ours([out / name for row in names for name in row] + [out / "sheet.png"])
    rows: list[list[np.ndarray]] = [[] for _ in views]
    for column, x in enumerate(controls):  # geometry is decoded once a column
        renderer.update(subject.at(x))
        for row, view in enumerate(views):
            renderer.draw([view])
            rows[row].append(renderer.resolved(0))
            save_png(rows[row][column], out / names[row][column])
    save_png(np.concatenate([np.concatenate(row, axis=1) for row in rows]), out / "sheet.png")


def picture_name(view: int, x: float | None) -> str:
    return f"view{view}.png" if x is None else f"view{view}_x{x:.3f}.png"


def check_ours(paths: list[Path]) -> None:
    """Pictures of an earlier run are replaced, anybody else's files are not."""
    from shapeshift.app.drawing import is_our_png
    from shapeshift.app.errors import UsageError

    for path in paths:
        if path.exists() and not (path.is_file() and is_our_png(path)):
            raise UsageError(f"{path} was not made by this program; choose another --out.")


def viewpoints(subject, size: tuple[int, int]) -> list:
    """The first look at a scene, and from TURN to the left and right of it."""
    import numpy as np

    from shapeshift.scene.pose import Pose

    first, (centre, _) = subject.view(size), subject.bounds()
    views = [first]
    for angle in (TURN, -TURN):
        about_y = np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0])
        turn = Pose(np.zeros(3), about_y).matrix()
        turn[:3, 3] = centre - turn[:3, :3] @ centre
        pose = Pose.from_matrix(turn @ first.world_from_eye.matrix())
        views.append(replace(first, world_from_eye=pose))
    return views
