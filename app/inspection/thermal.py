"""launch.py thermal: values of a scene at marks, alarms over its photo, tables and reports."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from shapeshift.app.command_line import EXPERT, POSITIONAL, SIZE, Opt
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import full
from shapeshift.app.terminal import print_json, say

if TYPE_CHECKING:
    from shapeshift.app.document import Document
    from shapeshift.app.inspection.draw_values import MeasuredScene
    from shapeshift.app.inspection.inspect_view import InspectedView
    from shapeshift.app.inspection.pictures import ColorScale
    from shapeshift.renderer.renderer import Renderer
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.scene.inspection.marks_file import MarksFile
    from shapeshift.scene.pose import View

USUAL_SIZE = (640, 480)
MOST_VIEWS = 50
OF_OPENING = frozenset(  # options that a scene which is open does not take
    {"scene", "camera", "size", "drawing", "context", "fov_y",
     *(field.name for field in fields(ReadingOptions))}
)  # fmt: skip
OneByOne = Callable[[Collection, str], Iterable[Any]]  # through work that has a name


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Measure a scene of heat or other values: spots, boxes, circles and lines in the world,
    isotherms, a picture, a table, a report.  Values are those before the palette; -- says that
    nothing is known.

    A mark is [NAME=]numbers, by pixels of the view or by metres in the world.  Marks are kept in
    NAME.marks.json beside the scene where --save says so, and are read from there."""

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers or a scene file."""
    spot: Annotated[tuple[str, ...], Opt(metavar="MARK")] = ()
    """column,row or x,y,z: one place.  Default: none."""
    box: Annotated[tuple[str, ...], Opt(metavar="MARK")] = ()
    """column,row,column,row, a rectangle of the view and what it sees; or x,y,z,hx,hy,hz, a box in
    the world with half its size.  Default: none."""
    circle: Annotated[tuple[str, ...], Opt(metavar="MARK")] = ()
    """column,row,pixels or x,y,z,metres: all within this radius of a place.  Default: none."""
    line: Annotated[tuple[str, ...], Opt(metavar="MARK")] = ()
    """column,row,column,row or x,y,z,x,y,z: a line on the surface, with a profile.
    Default: none."""
    difference: Annotated[tuple[str, ...], Opt(metavar="A,B")] = ()
    """Names of two marks: the mean of A less that of B.  Default: none."""
    above: float | None = None
    """An isotherm: all that is hotter, or higher, is an alarm.  Default: none."""
    below: float | None = None
    """An isotherm: all that is colder, or lower.  Default: none."""
    between: tuple[float, float] | None = None
    """An isotherm: all from one value to another.  Default: none."""
    emissivity: Annotated[tuple[str, ...], Opt(metavar="[NAME=]NUMBER")] = ()
    """Of what is seen, 0.1 to 1, or of one mark's or object's surface, as Sp1=0.3: values become
    temperatures of surfaces.  Default: as the file of marks has it, else values as photographed."""
    reflected: float | None = None
    """The temperature of what surfaces mirror.  Default: that of the file of marks, else 20."""
    taken_with: tuple[float, float] | None = None
    """Emissivity and reflected temperature that the camera was set to, in whose values these are
    already.  Default: those of the file of marks, else 1, with which nothing was corrected."""
    air: tuple[float, float, float] | None = None
    """Metres, per cent of humidity and °C of the air between camera and surfaces at the photos.
    Default: that of the file of marks, else none."""
    taken_air: tuple[float, float, float] | None = None
    """The same as the camera was set to, of which its values are free already, as those of
    radiometric JPEG.  Default: that of the file of marks, else none."""
    taken_as: Path | None = None
    """One of the radiometric JPEGs that the scene was trained from, which says what the camera was
    set to; --emissivity, --reflected and --air are then as there, too, where they are not given.
    Default: none."""
    level: float | None = None
    """The value in the middle of the palette.  Default: that of the stop's range."""
    span: float | None = None
    """Values from one end of the palette to the other.  Default: all of the stop's range."""
    auto: bool = False
    """Level and span of what the view shows, its 1st to 99th percentile."""
    palette: str = ""
    """white-hot (gray), black-hot, ironbow, rainbow, arctic, turbo, perceptual, viridis or cividis.
    Default: the stop's."""
    camera: Annotated[str, Opt(metavar="CAMERA")] = "front"
    """front, auto (cameras that lie with the scene), or a file or folder of cameras
    (docs/cameras.md)."""
    view: tuple[int, ...] = (0,)
    """Which cameras of a file, counted from 0; new marks are laid in the first of them."""
    size: Annotated[str, SIZE] = ""
    """WIDTHxHEIGHT in pixels.  Default: 640x480, or what the camera file says."""
    out: Path | None = None
    """A .png: the photo, the heat with its marks, and the alarms over the photo.  Default: none."""
    csv: Path | None = None
    """A .csv of all readings; the profile of a line goes beside it, NAME.LINE.csv.
    Default: none."""
    report: tuple[Path, ...] = ()
    """A .html, one file that loads nothing from anywhere, or a .pdf, or both; the cameras go
    beside it as NAME.camera.json.  Default: none."""
    json: bool = False
    """Print all readings as JSON instead of tables."""
    save: bool = False
    """Keep all marks, differences, isotherms and the held-out error in the file of marks."""
    marks: Path | None = None
    """Another file of marks.  Default: NAME.marks.json beside the scene."""
    forget: Annotated[tuple[str, ...], Opt(metavar="NAME")] = ()
    """Leave these marks of the file out.  Default: none."""
    remark: Annotated[tuple[str, ...], Opt(metavar="NAME=TEXT")] = ()
    """A note of a mark, for tables and reports.  Default: as the file of marks has them."""
    mark_photo: Annotated[tuple[str, ...], Opt(metavar="NAME=FILE")] = ()
    """A photo of what a mark is at, for reports; it is kept small.  Default: as in the file."""
    capture: Path | None = None
    """The photos that the scene was trained on: the held-out ones give the stated error.
    Default: the error that the file of marks has, else none is stated."""
    title: str = ""
    """What the report is called.  Default: Thermal inspection, or by the stop of other values."""
    client: str = ""
    """For whom the report is.  Default: nobody is named."""
    inspector: str = ""
    """Who measured.  Default: nobody is named."""
    note: str = ""
    """A paragraph at the top of the report.  Default: none."""
    date: str = ""
    """The day that the report names.  Default: today, as 2026-11-23."""
    stop: str = ""
    """The stop that is measured.  Default: the first thermal one, else the first of other
    values."""
    range: tuple[float, float] | None = None
    """The values that black and white of the stop stand for.  Default: what the scene says."""
    unit: str = ""
    """Of these values.  Default: what the scene says."""
    colors: str = ""
    """For a stop whose colours are already those of this palette: values are looked up in it, and
    the error that this makes is said.  Default: the stop holds values."""
    photo: str = ""
    """The stop that is shown as the photo, or none.  Default: the first that shows no values."""
    overwrite: bool = False
    """Replace files of the same names."""
    fov_y: Annotated[float, EXPERT] = 0.0
    """Degrees from top to bottom, for a camera file that says nothing about the lens; 0: not
    known."""
    drawing: Annotated[Literal["auto", "quads", "tiles"], EXPERT] = "auto"
    """What draws the splats: OpenGL quads, or OpenCL tiles, which need no GPU."""
    context: Annotated[Literal["auto", "egl", "surfaceless", "osmesa", "none"], EXPERT] = "auto"
    """Where the OpenGL context without a window comes from."""


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was measured in some views."""

    views: "tuple[InspectedView, ...]"  # with their readings
    file: "MarksFile"  # marks, differences, isotherms, error: in metres of the document
    measured: "MeasuredScene"
    scale: "ColorScale"  # of its pictures
    left_out: tuple[str, ...] = ()  # a sentence each of the marks that lie nowhere


def run(options: Options) -> int:
    from shapeshift.app.camera_files import named_cameras
    from shapeshift.app.document import open_document
    from shapeshift.app.drawing import open_renderer, parse_size
    from shapeshift.app.inspection.inspect_view import readings_json
    from shapeshift.app.inspection.mark_options import open_marks
    from shapeshift.app.inspection.outputs import print_readings
    from shapeshift.app.opening import open_capture
    from shapeshift.app.progress import tracked

    check_outputs(options)
    size = parse_size(options.size) if options.size else None
    cameras = None
    if options.camera != "front":
        cameras = named_cameras(options.camera, options.scene, options, size)
    path, file = open_marks(options)
    document = open_document(options.scene, options)
    subject = subject_of(options, file, document)
    capture = open_capture(options.capture, options.memory or None) if options.capture else None
    views = choose_views(options, document, cameras, size)
    with open_renderer(options.context, options.drawing) as (renderer, _):
        found = inspect(renderer, options, subject, views, capture, tracked)
    for sentence in found.left_out:
        say(f"Left out: {sentence}")
    if options.json:
        print_json(readings_json(found.views, found.file, document.origin))
    else:
        print_readings(found.views, found.file, found.measured, document.origin)
    write_all(options, found, path, document, say)
    return 0


@dataclass(frozen=True, eq=False)
class InspectionSubject:
    """What is inspected, chosen before anything is drawn."""

    document: "Document"
    measured: "MeasuredScene"
    file: "MarksFile"  # as it lies there, with the emission that was chosen
    emissivities: dict[str, float]  # of marks, by name
    photo: str  # the stop that is shown as the photo; "": none


def subject_of(options: Options, file: "MarksFile", document: "Document") -> InspectionSubject:
    """What the options say of a document and a file of marks.  Raises UsageError, BadFile."""
    from shapeshift.app.inspection.draw_values import ValueChoice, measured_scene
    from shapeshift.app.inspection.emission_options import choose_emission

    choice = ValueChoice(options.stop, options.range, options.unit, options.colors)
    measured = measured_scene(document, choice)
    emission, own = choose_emission(options, file, measured.stop.temperature_unit)
    photo = photo_stop(options, document, measured)
    return InspectionSubject(document, measured, replace(file, emission=emission), own, photo)


def inspect(
    renderer: "Renderer", options: Options, subject: InspectionSubject, views: "Sequence[View]",
    capture: "Capture | None", one_by_one: OneByOne,
) -> Inspection:  # fmt: skip
    """Draws the views and reads them at all marks.  Raises UsageError, BadFile, one sentence."""
    from shapeshift.app.inspection.emission_options import with_emissivities
    from shapeshift.app.inspection.held_out import held_out_error
    from shapeshift.app.inspection.inspect_view import inspect_view, with_readings
    from shapeshift.app.inspection.mark_options import with_new_marks, with_remarks

    document, measured, file = subject.document, subject.measured, subject.file
    renderer.settings = replace(renderer.settings, background=document.background)
    shown = [
        inspect_view(renderer, document, measured, subject.photo, view)
        for view in one_by_one(views, "measuring")
    ]
    new, left_out = with_new_marks(options, file, shown[0], document)
    objects = [obj.name for obj in document.scene.objects]
    file = with_emissivities(new, subject.emissivities, objects, left_out)
    file = with_remarks(file, options.remark, options.mark_photo, left_out)
    if capture is not None:
        error = held_out_error(renderer, measured, document, capture, one_by_one)
        file = replace(file, held_out=error)
    shown = [with_readings(each, file) for each in shown]
    scale = choose_scale(options, measured, shown)
    return Inspection(tuple(shown), file, measured, scale, tuple(left_out.values()))


def write_all(
    options: Options, found: Inspection, marks: Path, document: "Document",
    hear: Callable[[str], object],
) -> None:  # fmt: skip
    """The files that the options name; hear: told where each is.  Raises UsageError."""
    from shapeshift.app.inspection.outputs import write_picture, write_tables

    if options.out is not None:
        write_picture(options.out, found.views, found.scale, hear)
    if options.csv is not None:
        write_tables(options.csv, found.views, document.origin, hear)
    if options.report:
        write_reports(options, found, document, hear)
    if options.save:
        keep_marks(marks, found.file, document, hear)


def check_outputs(options: Options) -> None:
    """Before the scene is read.  Raises UsageError, one sentence."""
    from shapeshift.app.errors import UsageError

    wanted: list[tuple[str, Path | None, tuple[str, ...]]]
    wanted = [("--out", options.out, (".png",)), ("--csv", options.csv, (".csv",))]
    wanted += [("--report", path, (".html", ".pdf")) for path in options.report]
    for name, path, endings in wanted:
        if path is None:
            continue
        if path.suffix.lower() not in endings:
            raise UsageError(f"{name} is {path}; a file {' or '.join(endings)} is wanted.")
        if path.exists() and not options.overwrite:
            raise UsageError(f"{path} exists; name another file or add --overwrite.")
    if options.span is not None and not 0 < options.span < 1e6:
        raise UsageError(f"--span is {options.span:g}, expected a number above 0.")
    if options.auto and (options.level is not None or options.span is not None):
        raise UsageError("--auto chooses level and span; leave it or those two out.")
    looks = {"--level": options.level, "--span": options.span, "--auto": options.auto or None,
             "--palette": options.palette or None}  # fmt: skip
    if options.palette:
        refuse_unknown_palette(options.palette)
    chosen = [name for name, value in looks.items() if value is not None]
    if chosen and options.out is None and not options.report:
        raise UsageError(f"{chosen[0]} is of pictures; add --out FILE.png or --report FILE.")
    if not 1 <= len(options.view) <= MOST_VIEWS:
        raise UsageError(f"--view names {len(options.view)} cameras, expected 1 to {MOST_VIEWS}.")


def choose_views(options: Options, document: "Document", cameras, size) -> "list[View]":
    """The views that --view names of --camera.  Raises UsageError."""
    from shapeshift.app.errors import UsageError

    if cameras is None:
        if options.view != (0,):
            raise UsageError("--view chooses cameras of a file; name one: --camera FILE.")
        return [document.view(size or USUAL_SIZE)]
    return picked(options, cameras.views if document.file else document.sees(cameras).views)


def picked(options: Options, views: "Sequence[View]") -> "list[View]":
    """Those of a file's cameras that --view names.  Raises UsageError."""
    from shapeshift.app.errors import UsageError

    for number in options.view:
        if not 0 <= number < len(views):
            raise UsageError(f"--view is {number}; the file has cameras 0 to {len(views) - 1}.")
    return [views[number] for number in options.view]


def photo_stop(options: Options, document: "Document", measured: "MeasuredScene") -> str:
    """The name of the stop that is shown as the photo; "": none.  Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.app.inspection.inspect_view import first_photo

    stops = [stop for model in document.models for stop in model.stops]
    if options.photo == "none":
        return ""
    if options.photo:
        named = [stop.name for stop in stops if stop.name.casefold() == options.photo.casefold()]
        if not named:
            names = ", ".join(dict.fromkeys(stop.name for stop in stops))
            raise UsageError(f"--photo is '{options.photo}'; the scene has {names}.")
        return named[0]
    return first_photo(document, measured)


def choose_scale(
    options: Options, measured: "MeasuredScene", shown: "list[InspectedView]"
) -> "ColorScale":
    """Which values the palette shows.  Raises UsageError."""
    import numpy as np

    from shapeshift.app.errors import UsageError
    from shapeshift.app.inspection.pictures import ColorScale, auto_ends

    palette = options.palette or measured.colors or measured.stop.palette
    refuse_unknown_palette(palette)
    low, high = shown[0].values.value_range
    if options.auto:
        try:
            every = np.concatenate([each.values.values.ravel() for each in shown])
            low, high = auto_ends(every, measured.stop.digits)
        except ValueError as error:
            raise UsageError(str(error)) from None
    level = (low + high) / 2 if options.level is None else options.level
    span = high - low if options.span is None else options.span
    if not -1e6 <= level <= 1e6:
        raise UsageError(f"--level is {level:g}, expected a value up to 1e6 either way.")
    return ColorScale(level - span / 2, level + span / 2, palette)


def refuse_unknown_palette(name: str) -> None:
    """Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.renderer.colors.palette import PALETTES

    if name not in PALETTES:
        raise UsageError(f"there is no palette '{name}'; known are {', '.join(PALETTES)}.")


def write_reports(
    options: Options, found: Inspection, document: "Document", hear: Callable[[str], object]
) -> None:
    """--report, each with the cameras of its views."""
    from shapeshift.app.drawing import make_folder
    from shapeshift.app.inspection.report import ReportHead, report_of, usual_title
    from shapeshift.app.inspection.report_pdf import write_report

    stop = found.measured.stop
    title = options.title or usual_title(stop)
    head = ReportHead(title, options.date, options.client, options.inspector, options.note)
    report = report_of(
        head, options.scene, stop, found.views, found.file, found.scale, document.origin
    )
    for path in options.report:
        make_folder(path.parent)
        write_report(report, path)
        hear(f"written to {full(path)}")


def keep_marks(
    path: Path, file: "MarksFile", document: "Document", hear: Callable[[str], object]
) -> None:
    """Writes the file of marks, in the world of the scene's own file."""
    from shapeshift.scene.inspection.marks_file import moved_marks, write_marks_file

    write_marks_file(moved_marks(file, document.origin), path)
    count = len(file.marks)
    hear(f"{count} mark{'s' * (count != 1)} kept in {full(path)}")
