"""launch.py measure: distances, polylines, angles and areas on a scene's surfaces."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL, SIZE, Opt
from shapeshift.app.opening import ReadingOptions

if TYPE_CHECKING:
    import numpy as np

    from shapeshift.app.document import Document
    from shapeshift.scene.inspection.lengths import Measurement, Point, Scale
    from shapeshift.scene.inspection.value_picture import ValuePicture
    from shapeshift.scene.pose import View

USUAL_SIZE = (640, 480)
KINDS = ("distance", "polyline", "angle", "area")


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Measure a scene between places: each is column,row of a view, on the surface there, or x,y,z
    in metres of the scene's file, which counts as exact.  Values come with one standard deviation.
    """

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers or a scene file."""
    distance: Annotated[tuple[str, ...], Opt(metavar="PLACE")] = ()
    """Two places.  Default: not measured."""
    polyline: Annotated[tuple[str, ...], Opt(metavar="PLACE")] = ()
    """Two places or more: the length of the way along them.  Default: not measured."""
    angle: Annotated[tuple[str, ...], Opt(metavar="PLACE")] = ()
    """Three places: degrees at the second.  Default: not measured."""
    area: Annotated[tuple[str, ...], Opt(metavar="PLACE")] = ()
    """Three places or more: the corners of a polygon, in order.  Default: not measured."""
    known: tuple[str, str, str] | None = None
    """Two places and the metres between them: all lengths are scaled so.  Default: the scale in
    NAME.marks.json beside the scene, else lengths are those of the scene."""
    save: bool = False
    """Keep the scale of --known in NAME.marks.json beside the scene."""
    keep: bool = False
    """Keep what is measured there, too, under names of its own: L1, Way1, Angle1, Area1."""
    unit: Literal["m", "cm", "mm", "ft", "in"] | None = None
    """Of lengths; areas in its square, each with the digits that are uncertain.
    Default: m, with four digits behind the point."""
    report: tuple[Path, ...] = ()
    """A .html, one file that loads nothing, or a .pdf, or both: the view with all that was
    measured and kept, and a table.  Default: none."""
    overwrite: bool = False
    """Replace reports of the same names."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands: shapes may differ.  Default: the first stop, and in a scene file
    what it says for each object."""
    camera: Annotated[str, Opt(metavar="CAMERA")] = "front"
    """front, auto (cameras that lie with the scene), or a file or folder of cameras
    (docs/cameras.md)."""
    view: int = 0
    """Which camera of a file, counted from 0."""
    size: Annotated[str, SIZE] = ""
    """WIDTHxHEIGHT in pixels.  Default: 640x480, or what the camera file says."""
    json: bool = False
    """Print one object instead of lines."""
    fov_y: Annotated[float, EXPERT] = 0.0
    """Degrees from top to bottom, for a camera file that says nothing about the lens; 0: not
    known."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""


def run(options: Options) -> int:
    from shapeshift.app.camera_files import named_cameras
    from shapeshift.app.document import open_document
    from shapeshift.app.drawing import open_renderer, parse_size
    from shapeshift.app.errors import UsageError
    from shapeshift.app.inspection.draw_values import depth_picture
    from shapeshift.app.inspection.measure_outputs import (
        check_reports,
        keep_file,
        kept_lengths,
        picture_of,
        with_lengths_of,
        write_length_reports,
    )
    from shapeshift.app.terminal import print_json, print_text

    if options.save and options.known is None:
        raise UsageError("--save keeps the scale of a known length; name one: --known A B METRES.")
    check_reports(options.report, options.overwrite)
    if options.keep and not any(getattr(options, kind) for kind in KINDS):
        raise UsageError("--keep keeps what is measured; add --distance or another of them.")
    wanted = options.save or options.report or any(getattr(options, kind) for kind in KINDS)
    if not wanted:
        raise UsageError(f"nothing is to be measured; add --{', --'.join(KINDS[:-1])} or --area.")
    size = parse_size(options.size) if options.size else None
    cameras = None
    if options.camera != "front":
        cameras = named_cameras(options.camera, options.scene, options, size)
    document = open_document(options.scene, options)
    document = document.placed(options.x) if options.x else document
    view = choose_view(options, document, cameras, size)
    with open_renderer(options.context, options.drawing) as (renderer, _):
        picture = depth_picture(renderer, document.scene, view)
        drawn = picture_of(renderer, document, view) if options.report else None
    found, laid, scale = measurements(options, picture, document.origin)
    file = kept_lengths(options.scene, document.origin)
    new = with_lengths_of(file, laid, scale)
    if drawn is not None:
        unit = options.unit or "m"
        scene = (options.scene, drawn, view, new, unit, document.origin, options.x)
        write_length_reports(options.report, *scene)
    if options.save or options.keep:
        kept = new if options.keep else with_lengths_of(file, [], scale)
        keep_file(options.scene, kept, document.origin)
    if options.json:
        rows = [{"kind": m.kind, "value": m.value, "uncertainty": m.uncertainty, "unit": m.unit}
                for m in found]  # fmt: skip
        print_json({"measurements": rows})
    elif found:
        words = (each.words(options.unit) if options.unit else str(each) for each in found)
        lines = (f"{each.kind}: {text}" for each, text in zip(found, words, strict=True))
        print_text("\n".join(lines))
    return 0


def choose_view(options: Options, document: "Document", cameras, size) -> "View":
    """The view in which pixels are meant.  Raises UsageError."""
    from shapeshift.app.errors import UsageError

    if cameras is None:
        if options.view:
            raise UsageError("--view chooses a camera of a file; name one: --camera FILE.")
        return document.view(size or USUAL_SIZE)
    views = cameras.views if document.file else document.sees(cameras).views
    if not 0 <= options.view < len(views):
        raise UsageError(f"--view is {options.view}; the file has cameras 0 to {len(views) - 1}.")
    return views[options.view]


def measurements(
    options: Options, picture: "ValuePicture", origin: "np.ndarray"
) -> "tuple[list[Measurement], list[tuple[str, list[Point]]], Scale]":
    """What the options ask for, in the order of KINDS, its points, and the scale of its lengths.

    Raises UsageError, BadFile, one sentence.
    """
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.inspection.lengths import measure

    try:
        scale = known_scale(options, picture, origin)
        laid = [
            (kind, [point_of(text, picture, origin, f"--{kind}") for text in texts])
            for kind in KINDS
            if (texts := getattr(options, kind))
        ]
        return [measure(kind, points, scale) for kind, points in laid], laid, scale
    except ValueError as error:
        raise UsageError(str(error)) from None


def known_scale(options: Options, picture: "ValuePicture", origin: "np.ndarray") -> "Scale":
    """What --known says, else the marks beside the scene.  Raises UsageError, BadFile,
    ValueError.
    """
    from shapeshift.app.errors import UsageError
    from shapeshift.app.inspection.mark_options import parse_numbers
    from shapeshift.app.terminal import say
    from shapeshift.scene.inspection.lengths import Scale
    from shapeshift.scene.inspection.marks_file import kept_scale, marks_path

    if options.known is None:
        scale = kept_scale(options.scene)
        if scale.factor != 1:
            name = marks_path(options.scene).name
            say(f"Lengths are multiplied by {scale.factor:.6g}, as {name} says.")
        return scale
    numbers = parse_numbers(options.known[2], "--known")
    if len(numbers) != 1:
        raise UsageError(f"--known ends with '{options.known[2]}', expected metres.")
    ends = [point_of(text, picture, origin, "--known") for text in options.known[:2]]
    return Scale.of_known(ends, numbers[0])


def point_of(text: str, picture: "ValuePicture", origin: "np.ndarray", said: str) -> "Point":
    """A place: picked in the view with its uncertainty, or exact.  Raises UsageError."""
    import numpy as np

    from shapeshift.app.errors import UsageError
    from shapeshift.app.inspection.mark_options import parse_numbers
    from shapeshift.scene.inspection.lengths import Point

    numbers = parse_numbers(text, said)
    if len(numbers) == 3:
        return Point(np.array(numbers) - origin, np.zeros((3, 3)))
    if len(numbers) != 2:
        raise UsageError(f"{said} has the place '{text}', expected column,row or x,y,z.")
    point = picture.picked((numbers[0], numbers[1]))
    if not np.isfinite(point.metres).all():
        raise UsageError(
            f"{said} has the place {text}, where the scene covers less than half of a pixel or "
            "the picture ends; move it."
        )
    return point
