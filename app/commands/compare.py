"""launch.py compare: two scenes, two stops or two folders of pictures, in numbers and pictures."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np

from shapeshift.app.command_line import EXPERT, POSITIONAL, SIZE
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import full
from shapeshift.app.terminal import open_console, print_json, say

if TYPE_CHECKING:
    from shapeshift.app.commands.compared import SceneSide
    from shapeshift.scene.pose import View

VIEWS = 8  # of the orbit where no cameras are given
DEFAULT_SIZE = (640, 360)


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Compare two scenes, stops of a scene, or folders of pictures: PSNR, SSIM, differences."""

    a: Annotated[str, POSITIONAL]
    """A scene, a scene at a stop or x (scene.shift@Thermal, scene.shift@0.5; of a scene file all
    objects that have the stop), or a folder of pictures."""
    b: Annotated[str, POSITIONAL]
    """The same, to compare with it; pictures are matched by name, else in order."""
    cameras: Path | None = None
    """Views of both: a file or folder of cameras.  Default: 8 views on an orbit about A."""
    out: Path | None = None
    """Folder for a sheet of each view (A, B and their difference) and for the difference alone.
    Default: no pictures."""
    size: Annotated[str, SIZE] = ""
    """WIDTHxHEIGHT in pixels.  Default: 640x360, or what the camera file says."""
    background: tuple[float, float, float] | None = None
    """Red, green and blue behind both, 0 to 1 as displayed.  Default: what A was trained on, else
    black."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""
    json: bool = False
    """JSON on standard output instead of a table."""
    view: bool = False
    """Open both in the viewer, with a line between them that the mouse moves."""
    overwrite: bool = False
    """Replace pictures of the same name."""


@dataclass(frozen=True)
class Compared:
    """One view of both."""

    name: str
    a: np.ndarray  # (H, W, 3) float32 display sRGB
    b: np.ndarray

    def scores(self) -> dict:
        """PSNR in dB ("equal" where no pixel differs), SSIM, and the largest difference."""
        from shapeshift.scene.metrics import psnr, ssim

        db = psnr(self.a, self.b)
        largest = float(np.abs(self.a - self.b).max())
        return {
            "view": self.name, "psnr_db": db if math.isfinite(db) else "equal",
            "ssim": ssim(self.a, self.b), "largest": largest,
        }  # fmt: skip


def run(options: Options) -> int:
    from shapeshift.app.commands.compared import PictureSide, SceneSide, open_side
    from shapeshift.app.errors import UsageError
    from shapeshift.app.progress import working

    if options.view:
        return run_viewer(options)
    if options.background and not all(0 <= c <= 1 for c in options.background):
        raise UsageError(f"--background is {options.background}, expected three values in 0..1.")
    a, b = open_side(options.a, options), open_side(options.b, options)
    if isinstance(a, PictureSide) and isinstance(b, PictureSide):
        compared = picture_pairs(a, b)
    else:
        if isinstance(a, PictureSide) or (isinstance(b, PictureSide) and options.cameras is None):
            raise UsageError(
                "pictures are compared with a scene in this order: the scene first, then the "
                "pictures, and --cameras that says where they were taken from."
            )
        assert isinstance(a, SceneSide)
        compared = drawn_views(options, choose_views(options, a), a, b)
    with working("comparing") as progress:
        result = score(compared, (a.name, b.name), options, progress)
    if options.out is not None:
        say(f"{len(result['views'])} sheets in {full(options.out)}")
    if options.json:
        print_json(result)
    else:
        print_table(result)
    return 0


def run_viewer(options: Options) -> int:
    """The same two in a window."""
    from shapeshift.app.commands.compared import split_stop
    from shapeshift.app.editor import desktop
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.document.scene_file import is_scene_file

    shared = {name: getattr(options, name) for name in ReadingOptions.__dataclass_fields__}
    path, at = split_stop(options.a)
    if at and is_scene_file(path):
        raise UsageError(f"--view shows {path.name} as it says itself; leave @{at} out.")
    return desktop.run(desktop.Options(scenes=(path,), x=at, compare=options.b, **shared))


def picture_pairs(a, b) -> Iterator[Compared]:
    """Pictures of two folders; BadFile where two have not one size."""
    from shapeshift.app.commands.compared import match_pictures, read_picture
    from shapeshift.runtime_models.model import BadFile

    pairs, how = match_pictures(a, b)
    say(f"{len(pairs)} pictures, {how}")
    for name, file, other in pairs:
        one, two = read_picture(file), read_picture(other)
        if one.shape != two.shape:
            raise BadFile(
                f"{file} has {one.shape[1]}x{one.shape[0]} pixels and {other} "
                f"{two.shape[1]}x{two.shape[0]}; bring them to one size."
            )
        yield Compared(name, one, two)


def choose_views(options: Options, a: "SceneSide") -> list["View"]:
    """Views in A's own coordinates."""
    from shapeshift.app.camera_files import camera_reading
    from shapeshift.app.drawing import parse_size
    from shapeshift.scene.cameras.camera_list import moved
    from shapeshift.scene.cameras.framing import orbit_path
    from shapeshift.scene.cameras.read_cameras import read_camera_list

    size = parse_size(options.size) if options.size else None
    if options.cameras is not None:
        cameras = read_camera_list(options.cameras, camera_reading(options, size))
        return moved(cameras.views, (-a.subject.origin).tolist())
    return orbit_path(VIEWS, *a.subject.bounds(), size or DEFAULT_SIZE)


def drawn_views(options: Options, views: list, a, b) -> Iterator[Compared]:
    """Both from every view of A's; B may be pictures, which are in the order of the views."""
    from shapeshift.app.commands.compared import PictureSide, read_picture
    from shapeshift.app.drawing import open_renderer
    from shapeshift.renderer.renderer import Renderer
    from shapeshift.runtime_models.model import BadFile
    from shapeshift.scene.cameras.camera_list import moved

    files = b.files if isinstance(b, PictureSide) else None
    if files is not None and len(files) != len(views):
        raise BadFile(
            f"{b.name} holds {len(files)} pictures and {options.cameras} {len(views)} cameras; "
            "one picture a camera is wanted."
        )
    background = options.background or a.subject.background
    with open_renderer(options.context, options.drawing) as (renderer, ctx):
        draw_a = artist(renderer, a, background)
        if files is None:
            with Renderer(ctx, renderer.backends["drawing"].split()[0]) as other:
                draw_b = artist(other, b, background)
                shift = a.subject.origin - b.subject.origin  # pyright: ignore[reportAttributeAccessIssue]
                others = moved(views, shift)
                for i, (view, same) in enumerate(zip(views, others, strict=True)):
                    yield Compared(f"{i:04d}", draw_a(view), draw_b(same))
            return
        for view, file in zip(views, files, strict=True):
            picture = read_picture(file)
            size = picture.shape[1::-1]
            yield Compared(file.stem, draw_a(view.resized(size)), picture)


def artist(renderer, side, background):
    """view -> (H, W, 3): the side's scene alone in this renderer."""
    from dataclasses import replace

    renderer.settings = replace(renderer.settings, background=background)
    renderer.update(side.subject.scene)

    def draw(view) -> np.ndarray:
        renderer.draw([view])
        return renderer.resolved(0)

    return draw


def score(
    compared: Iterator[Compared], names: tuple[str, str], options: Options,
    progress: Callable[[str], None],
) -> dict:  # fmt: skip
    """What is printed; the sheets are written at the end.  progress: hears how far it is."""
    rows, kept = [], []
    for pair in compared:
        rows.append(pair.scores())
        progress(f"comparing: {len(rows)} views done")
        if options.out is not None:
            kept.append(pair)
    decibels = [row["psnr_db"] for row in rows]
    numbers = [db for db in decibels if db != "equal"]
    mean = {
        # equal pictures have no number of decibels: the mean is of those that differ
        "psnr_db": float(np.mean(numbers)) if numbers else "equal",
        "ssim": float(np.mean([row["ssim"] for row in rows])),
        "largest": max(row["largest"] for row in rows),
        "equal_views": len(rows) - len(numbers),
    }
    result: dict[str, object] = {"a": names[0], "b": names[1], "views": rows, "mean": mean}
    if options.out is not None:
        result["amplified"] = write_sheets(kept, names, options.out, options.overwrite)
    return result


def write_sheets(pairs: list[Compared], names: tuple[str, str], out: Path, overwrite: bool) -> int:
    """A sheet and a difference picture a view; returns by how much differences are amplified."""
    from shapeshift.app.commands.compared import (
        amplification,
        difference_picture,
        scale_text,
        sheet,
        written,
    )
    from shapeshift.app.drawing import make_folder, save_png
    from shapeshift.app.errors import UsageError

    paths = [
        (out / f"{pair.name}_sheet.png", out / f"{pair.name}_difference.png") for pair in pairs
    ]
    taken = [path for both in paths for path in both if path.exists()]
    if taken and not overwrite:
        raise UsageError(f"{taken[0]} exists; choose another --out or add --overwrite.")
    make_folder(out)
    amplify = amplification([pair.b - pair.a for pair in pairs])
    for pair, (both, alone) in zip(pairs, paths, strict=True):
        save_png(sheet(pair.a, pair.b, names, amplify), both)
        difference = difference_picture(pair.a, pair.b, amplify)
        save_png(written(difference, scale_text(amplify)), alone)
    return amplify


def print_table(result: dict) -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table("view", "PSNR dB", "SSIM", "largest of 255")
    rows = [(row["view"], row) for row in result["views"]] + [("mean", result["mean"])]
    for i, (name, row) in enumerate(rows):
        db = row["psnr_db"]
        db_text = db if db == "equal" else f"{db:.2f}"
        last = i >= len(rows) - 2
        cells = (Text(name), db_text, f"{row['ssim']:.4f}", f"{255 * row['largest']:.1f}")
        table.add_row(*cells, end_section=last)
    console = open_console(stderr=False)
    console.print(Text(f"A  {result['a']}\nB  {result['b']}"))
    console.print(table)
    equal = result["mean"]["equal_views"]
    if 0 < equal < len(result["views"]):
        say(f"{equal} views are equal; the mean PSNR is of the others.")
