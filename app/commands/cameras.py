"""launch.py cameras: what is in a file of cameras, or the same in another form."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import POSITIONAL
from shapeshift.app.paths import full
from shapeshift.app.terminal import open_console, print_json, say

if TYPE_CHECKING:
    from shapeshift.scene.cameras.camera_list import CameraList


@dataclass(frozen=True)
class Options:
    """List the cameras of a file or folder, or write them in another form."""

    cameras: Annotated[Path, POSITIONAL]
    """JSON of our own, 3DGS's cameras.json, transforms.json, nerfstudio's camera_path.json,
    splatapult's _vr.json, a COLMAP model, or a folder with one of them."""
    out: Path | None = None
    """File to write, or for COLMAP the folder that gets sparse/0.  Default: the list is printed."""
    to: Literal["", "ours", "inria", "transforms", "nerfstudio", "vr", "colmap-bin",
                "colmap-txt"] = ""  # fmt: skip
    """Form to write.  Default: our own, or COLMAP's where --out has no ending."""
    fov_y: float = 0.0
    """Degrees from top to bottom, for a file that says nothing about the lens; 0: not known."""
    up: Literal["", "+X", "-X", "+Y", "-Y", "+Z", "-Z"] = ""
    """The axis of the file that points up.  Default: the one that its format says."""
    flip: bool = False
    """Turn the cameras upside down, as --flip does with a scene."""
    json: bool = False
    """The list as JSON on standard output."""
    overwrite: bool = False
    """Replace what --out names; the input itself is never replaced."""


def run(options: Options) -> int:
    from shapeshift.app.camera_files import camera_reading
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.cameras.read_cameras import read_camera_list

    if options.to and options.out is None:
        raise UsageError("--to wants --out, the file or folder to write.")
    cameras = read_camera_list(options.cameras, camera_reading(options))
    for note in cameras.notes:
        say(note)
    if options.out is not None:
        write(options, options.out, cameras)
    elif options.json:
        print_json(facts_of(cameras))
    else:
        print_table(cameras)
    return 0


def write(options: Options, out: Path, cameras: "CameraList") -> None:
    """Writes the views in the wished form, beside what is there, never over the input."""
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.cameras.write_cameras import (
        COLMAP_FORMS,
        paths_of,
        stale_paths,
        write_cameras,
    )
    from shapeshift.scene.captures.colmap_tables import find_model

    form = options.to or ("ours" if out.suffix else "colmap-bin")
    stale = stale_paths(out, form)
    for path in (*paths_of(out, form), *stale):
        if path.exists() and is_part(path.resolve(), options.cameras.resolve()):
            raise UsageError(f"{path} belongs to what is read; choose another --out.")
    for path in paths_of(out, form):
        if path.exists() and not options.overwrite:
            raise UsageError(f"{path} exists; choose another --out or add --overwrite.")
    if stale and not options.overwrite:
        raise UsageError(
            f"{stale[0]} is of another model and would contradict what is written; choose another "
            "--out, or add --overwrite to remove it."
        )
    written = write_cameras(cameras, out, form)
    if form in COLMAP_FORMS and (found := find_model(out)) and found[0] != written[0].parent:
        say(
            f"{full(found[0])} has more images: who names {out.name} reads that; remove it, or "
            f"name {out.name}/sparse/0."
        )
    if stale:
        say(f"Removed, as of an older model: {', '.join(path.name for path in stale)}.")
    count = len(cameras.views)
    if form == "vr" and count > 1:
        say(f"A floor has one view: the first of {count} is taken.")
        count = 1
    names = full(written[0] if len(written) == 1 else written[0].parent)
    say(f"{count} camera{'s' * (count > 1)} in {names}")


def is_part(path: Path, source: Path) -> bool:
    """Whether a file is what is read, lies in it, or is another table of the same COLMAP model."""
    tables = ("cameras", "images", "points3D", "rigs", "frames")
    beside = path.parent == source.parent and path.suffix == source.suffix != ".json"
    beside = beside and path.stem in tables
    return path == source or source in path.parents or (beside and source.stem in tables)


def facts_of(cameras) -> dict:
    """What --json prints: our own list, and what is known about the file."""
    from shapeshift.scene.cameras.own_cameras import own_rows

    return {
        "format": cameras.format,
        "count": len(cameras.views),
        "fps": cameras.fps,
        "notes": list(cameras.notes),
        "cameras": own_rows(cameras),
    }


def print_table(cameras) -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(title=f"{cameras.format}, {len(cameras.views)} cameras", title_justify="left")
    for name in ("", "name", "place, metres", "looks along", "degrees", "pixels"):
        table.add_column(name)
    for i, (view, name) in enumerate(zip(cameras.views, cameras.names, strict=True)):
        pose, (_, _, low, high) = view.world_from_eye, view.tangents
        degrees = math.degrees(math.atan(high) - math.atan(low))
        ahead = -pose.matrix()[:3, 2]
        table.add_row(
            str(i),
            Text(name),  # names may hold brackets
            " ".join(f"{c:.3f}" for c in pose.position),
            " ".join(f"{c:+.2f}" for c in ahead),
            f"{degrees:.1f}",
            f"{view.size[0]}x{view.size[1]}",
        )
    open_console(stderr=False).print(table)
