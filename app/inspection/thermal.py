"""launch.py thermal: values of a scene at marks, alarms over its photo, tables and reports."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import EXPERT, POSITIONAL, SIZE, Opt
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import full
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    import numpy as np

    from shapeshift.app.document import Document
    from shapeshift.app.inspection.draw_values import MeasuredScene
    from shapeshift.app.inspection.inspect_view import InspectedView
    from shapeshift.app.inspection.pictures import ColorScale
    from shapeshift.scene.inspection.marks import Isotherm
    from shapeshift.scene.inspection.marks_file import MarksFile
    from shapeshift.scene.pose import View

USUAL_SIZE = (640, 480)
MOST_VIEWS = 50


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
    emissivity: Annotated[tuple[str, ...], Opt(metavar="[MARK=]NUMBER")] = ()
    """Of what is seen, 0.1 to 1, or of one mark's surface, as Sp1=0.3: values become temperatures
    of surfaces.  Default: what the file of marks has, else values are as photographed."""
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


def run(options: Options) -> int:
    from shapeshift.app.camera_files import named_cameras
    from shapeshift.app.document import open_document
    from shapeshift.app.drawing import open_renderer, parse_size
    from shapeshift.app.inspection.draw_values import ValueChoice, measured_scene
    from shapeshift.app.inspection.emission_options import choose_emission, with_emissivities
    from shapeshift.app.inspection.held_out import held_out_error
    from shapeshift.app.inspection.inspect_view import inspect_view, with_readings
    from shapeshift.app.inspection.mark_options import with_remarks
    from shapeshift.app.inspection.outputs import print_readings, write_picture, write_tables
    from shapeshift.app.opening import open_capture
    from shapeshift.app.progress import tracked

    check_outputs(options)
    size = parse_size(options.size) if options.size else None
    cameras = None
    if options.camera != "front":
        cameras = named_cameras(options.camera, options.scene, options, size)
    path, file = open_marks(options)
    document = open_document(options.scene, options)
    choice = ValueChoice(options.stop, options.range, options.unit, options.colors)
    measured = measured_scene(document, choice)
    emission, own = choose_emission(options, file, measured.stop.temperature_unit)
    file = replace(file, emission=emission)
    capture = open_capture(options.capture, options.memory or None) if options.capture else None
    views = choose_views(options, document, cameras, size)
    photo = photo_stop(options, document, measured)
    with open_renderer(options.context, options.drawing) as (renderer, _):
        renderer.settings = replace(renderer.settings, background=document.background)
        shown = [
            inspect_view(renderer, document, measured, photo, view, emission)
            for view in tracked(views, "measuring")
        ]
        file = with_emissivities(with_new_marks(options, file, shown[0], document), own)
        file = with_remarks(file, options.remark, options.mark_photo)
        if capture is not None:
            error = held_out_error(renderer, measured, document, capture)
            file = replace(file, held_out=error)
    shown = [with_readings(each, file) for each in shown]
    scale = choose_scale(options, measured, shown)
    print_readings(shown, file, measured, document.origin)
    if options.out is not None:
        write_picture(options.out, shown, scale)
    if options.csv is not None:
        write_tables(options.csv, shown, document.origin)
    if options.report:
        write_reports(options, measured, shown, file, scale, document.origin)
    if options.save:
        keep_marks(path, file, document.origin)
    return 0


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


def open_marks(options: Options) -> "tuple[Path, MarksFile]":
    """Where the marks lie, and what is there, without those that --forget names.

    Raises BadFile, UsageError.
    """
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.inspection.marks_file import MarksFile, marks_path, read_marks_file

    path = options.marks or marks_path(options.scene)
    if options.marks and not path.exists() and not options.save:
        raise UsageError(f"{path} does not exist; name a file of marks, or add --save to begin it.")
    file = read_marks_file(path) if path.exists() else MarksFile()
    names = [mark.name for mark in file.marks]
    for name in options.forget:
        if name not in names:
            raise UsageError(
                f"--forget: no mark is called '{name}'; there are {', '.join(names) or 'none'}."
            )
    kept = tuple(mark for mark in file.marks if mark.name not in options.forget)
    pairs = tuple(pair for pair in file.differences if not set(pair) & set(options.forget))
    return path, replace(file, marks=kept, differences=pairs)


def choose_views(options: Options, document: "Document", cameras, size) -> "list[View]":
    """The views that --view names of --camera.  Raises UsageError."""
    from shapeshift.app.errors import UsageError

    if cameras is None:
        if options.view != (0,):
            raise UsageError("--view chooses cameras of a file; name one: --camera FILE.")
        return [document.view(size or USUAL_SIZE)]
    views = cameras.views if document.file else document.sees(cameras).views
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


def with_new_marks(
    options: Options, file: "MarksFile", inspected: "InspectedView", document: "Document"
) -> "MarksFile":
    """The file's marks in the scene's own metres, with those of the options; one of the same name
    is replaced.  Raises UsageError.
    """
    from shapeshift.app.errors import UsageError
    from shapeshift.app.inspection.mark_texts import make_mark
    from shapeshift.scene.inspection.marks import KINDS, MOST_MARKS
    from shapeshift.scene.inspection.marks_file import moved_marks

    marks = {mark.name: mark for mark in moved_marks(file, -document.origin).marks}
    bounds = document.bounds()
    for kind in KINDS:
        for text in getattr(options, kind):
            mark = make_mark(kind, text, marks, inspected.values, document.origin, bounds)
            marks[mark.name] = mark
    if len(marks) > MOST_MARKS:
        raise UsageError(f"{len(marks):,} marks are too many; at most {MOST_MARKS:,} fit one file.")
    pairs = list(file.differences)
    for text in options.difference:
        first, _, second = (word.strip() for word in text.partition(","))
        for name in (first, second):
            if name not in marks:
                known = ", ".join(marks) or "none"
                raise UsageError(
                    f"--difference is '{text}': no mark is called '{name}'; there are {known}."
                )
        pairs.append((first, second))
    isotherms = tuple(dict.fromkeys((*file.isotherms, *choose_isotherms(options))))
    pairs = list(dict.fromkeys(pairs))
    return replace(file, marks=tuple(marks.values()), differences=tuple(pairs), isotherms=isotherms)


def choose_isotherms(options: Options) -> "list[Isotherm]":
    """Those of the options.  Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.inspection.marks import Bound, Isotherm

    asked: dict[Bound, dict[str, float]] = {}
    if options.above is not None:
        asked["above"] = {"low": options.above}
    if options.below is not None:
        asked["below"] = {"high": options.below}
    if options.between is not None:
        asked["between"] = {"low": options.between[0], "high": options.between[1]}
    found = []
    for kind, ends in asked.items():
        try:
            found.append(Isotherm(kind, **ends))
        except ValueError as error:
            raise UsageError(f"--{kind}: {error}") from None
    return found


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
    options: Options,
    measured: "MeasuredScene",
    shown: "list[InspectedView]",
    file: "MarksFile",
    scale: "ColorScale",
    origin: "np.ndarray",
) -> None:
    """--report, each with the cameras of its views."""
    from shapeshift.app.drawing import make_folder
    from shapeshift.app.inspection.report import ReportHead, report_of, usual_title
    from shapeshift.app.inspection.report_pdf import write_report

    title = options.title or usual_title(measured.stop)
    head = ReportHead(title, options.date, options.client, options.inspector, options.note)
    report = report_of(head, options.scene, measured.stop, shown, file, scale, origin)
    for path in options.report:
        make_folder(path.parent)
        write_report(report, path)
        say(f"written to {full(path)}")


def keep_marks(path: Path, file: "MarksFile", origin: "np.ndarray") -> None:
    """Writes the file of marks, in the world of the scene's own file."""
    from shapeshift.scene.inspection.marks_file import moved_marks, write_marks_file

    write_marks_file(moved_marks(file, origin), path)
    count = len(file.marks)
    say(f"{count} mark{'s' * (count != 1)} kept in {full(path)}")
