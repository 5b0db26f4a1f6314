"""launch.py export: a scene at one control value as a file for other programs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL, REGIONS, Opt
from shapeshift.app.opening import PATIENCE_S, ReadingOptions, open_model, progress_after, sentence
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.runtime_models.program import program

PACKAGE = ".shift"
LEVELS_ENDING = ".lod"
PAGES = (".html", ".zip")


@dataclass(frozen=True)
class Options(ReadingOptions):
    """Write a scene as it is shown at one x: plain splats that every viewer opens, or a package."""

    scenes: Annotated[tuple[Path, ...], POSITIONAL]
    """What to export; several become one file, where they stand when opened together, and the
    objects of a scene file where that puts them."""
    out: Path
    """The file to write; its ending is the format: .ply, .compressed.ply, .spz, .glb, .splat,
    .usdz (.usd, .usda, .usdc), our package, .shift or a folder (a name without an ending), or a
    page for any browser: .html, one file, or .zip, a folder for a server."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands: a stop by its name, or a number from 0 to 1.  Default: the first
    stop, and in a scene file what it says for each object."""
    sh_degree: int = 3
    """Degree of the colours' spherical harmonics, at most; 0: one colour from all sides."""
    palette: bool = True
    """Write value stops in their false colours, as they are shown; --no-palette: as the networks
    give them."""
    select: Annotated[tuple[str, ...], REGIONS] = ()
    """Regions with an X of their own (a stop's name or a number), in each object's frame:
    sphere:x,y,z:radius:X[:border] box:x,y,z:hx,hy,hz:X[:border] half:x,y,z:nx,ny,nz:X[:border]
    lens:degrees:X[:border].  Default: none."""
    only: Annotated[tuple[str, ...], REGIONS] = ()
    """Write only what lies in one of these: sphere:x,y,z:radius box:x,y,z:hx,hy,hz
    half:x,y,z:nx,ny,nz lens:degrees.  An anchor goes with all its splats.  Default: everything."""
    object: str = ""
    """Write only the scene of this number, counted from 1, or file name; of a scene file only the
    object of this name or label.  Default: all."""
    overwrite: bool = False
    """Replace an earlier file; never what is read."""
    label: Annotated[str, EXPERT] = ""
    """Write only the object of this label or name, where a scene has labels: a package that
    `segment` made, files of Gaussian Grouping.  Default: all."""
    eye: Annotated[str, Opt(expert=True, metavar="X,Y,Z")] = ""
    """Metres: from where a scene is seen whose shape depends on that (Scaffold-GS).  Default: the
    first view."""
    spz_axes: Literal["ply", "rub"] = "ply"
    """Of an .spz; ply: right, down, forward, as a PLY has it and most programs read it today; rub:
    right, up, back, as the format's text says (docs/formats.md has a table of who reads what)."""
    spz_version: Annotated[Literal["2", "3", "4"], EXPERT] = "3"
    """Of an .spz; 4 is newer, and known to fewer programs."""
    web: bool = False
    """Into a folder: a page for a server, which shows a coarse scene first; no package."""
    exact: Annotated[bool, EXPERT] = False
    """Of a page: its tables as float32 instead of 8 to 24 bits; about twice as large."""
    for_: Literal["any", "quest"] = "any"
    """Of a page; quest: in a headset that has no PC it leaves out what costs little, from 46 dB on,
    and says so (docs/headset.md)."""
    encoding: Annotated[Literal["kept", "stops"], EXPERT] = "kept"
    """Of a package; stops: the control encoding is written anew, a unit for each stop, so that
    programs which know of no blends of stops meet no jump between them either."""
    pace: Annotated[bool, EXPERT] = True
    """Of a package that has none: measures how fast the picture changes between any two stops, so
    that equal ways of the slider are equal changes; --no-pace: leaves it as it is."""


def run(options: Options) -> int:
    from shapeshift.app.commands.exported import ExportLook, check_output, export, is_folder
    from shapeshift.app.errors import UsageError
    from shapeshift.runtime_models.evaluate import follows_eye
    from shapeshift.runtime_models.splats.write_plain import writer_of

    scenes = choose_scenes(options)
    if not 0 <= options.sh_degree <= 3:
        raise UsageError(f"--sh-degree is {options.sh_degree}, expected 0 to 3.")
    page = options.web or options.out.suffix.lower() in PAGES
    package = not page and (is_folder(options.out) or options.out.suffix.lower() == PACKAGE)
    if options.encoding != "kept" and not package:
        raise UsageError("--encoding is of packages; name --out NAME.shift, or leave it out.")
    if options.out.suffix.lower() == LEVELS_ENDING:
        raise UsageError(f"--out {options.out}: levels of detail are written by `{program()} lod`.")
    if options.for_ != "any" and not page:
        raise UsageError(
            "--for is of pages; name --out NAME.html or .zip, or --web, or leave it out."
        )
    refuse_spz_options(options)
    if not package and not page:
        writer_of(options.out)  # before the scene is read
    check_output(options.out, options.scenes, options.overwrite)
    if page:
        return export_as_page(options, scenes)
    eye = parse_eye(options.eye)
    opened = [open_scene(path, options) for path in scenes]
    models = [obj.model for scene in opened for obj in scene.scene.objects]
    if any(getattr(model, "coarser", ()) for model in models):
        say("Coarser levels stay behind: what is written is of all anchors.")
    if package:
        return export_package(options, opened)
    if eye and not any(map(follows_eye, models)):
        say(
            "--eye changes nothing: the shapes of this scene are the same from everywhere, and its "
            "colours are written for all directions."
        )
    origin = opened[0].origin
    parts = [
        part
        for path, scene in zip(scenes, opened, strict=True)
        for part in parts_of(path, scene, scene.origin - origin, options)
    ]
    look = ExportLook(
        options.sh_degree, options.palette, eye, tuple(origin), options.spz_axes,
        int(options.spz_version),
    )  # fmt: skip
    with progress_after(PATIENCE_S) as progress:
        splats = export(parts, look, options.out, progress)
    for finding in splats.findings:
        say(sentence(finding))
    degree = round(splats.sh.shape[1] ** 0.5) - 1
    say(
        f"{full(options.out)}: {len(splats.means):,} splats, SH degree {degree}, "
        f"{options.out.stat().st_size:,} bytes, {x_words(parts)}."
    )
    return 0


def choose_scenes(options: Options) -> tuple[Path, ...]:
    """The scenes that are exported, or of which objects are.  Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.document.scene_file import is_scene_file

    scenes = options.scenes
    if not scenes:
        raise UsageError("no scene is given; name at least one.")
    if not options.object or (len(scenes) == 1 and is_scene_file(scenes[0])):
        return scenes
    numbered = {str(i): path for i, path in enumerate(scenes, 1)}
    named = {path.name: path for path in scenes}
    if options.object not in numbered | named:
        names = ", ".join(f"{i} {path.name}" for i, path in enumerate(scenes, 1))
        raise UsageError(f"--object is {options.object}; there are {names}.")
    return ((numbered | named)[options.object],)


def open_scene(path: Path, options: Options):
    """The Document of a file, of a scene file the chosen objects alone.  Raises UsageError."""
    from dataclasses import replace

    from shapeshift.app.commands.exported import check_output
    from shapeshift.app.document import Document, open_document
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.document.scene_file import HULLS, is_scene_file
    from shapeshift.scene.scene import Scene

    if not is_scene_file(path):
        return Document.of(open_model(path, options))
    subject = open_document(path, options)
    file = subject.file
    assert file is not None  # it is a scene file
    read = {name for item in file.all_items for name in (item.model, item.collider) if name}
    inputs = [file.path(name) for name in read if name != HULLS]
    check_output(options.out, inputs, options.overwrite)
    chosen = options.object if len(options.scenes) == 1 else ""
    objects = [
        obj
        for obj in subject.scene.objects
        if (chosen in (obj.name, str(obj.label)) if chosen else obj.visible)
    ]
    if exact := [obj for obj in objects if chosen and obj.name == chosen]:
        objects = exact  # a name that is a number, too
    if not objects and chosen:
        names = ", ".join(f"{obj.label} {obj.name}" for obj in subject.scene.objects)
        raise UsageError(f"--object is {chosen}; there are {names}.")
    if not objects:
        raise UsageError(f"{path}: all objects are hidden; --object NAME exports one of them.")
    return replace(subject, scene=Scene(tuple(objects)))


def parts_of(path: Path, subject, position, options: Options) -> list:
    """What of a scene is written; position (3,) metres is where its zero is put."""
    from dataclasses import replace

    from shapeshift.app.document import moved_object
    from shapeshift.scene.pose import Pose
    from shapeshift.scene.scene import IDENTITY

    if not subject.file:
        return [make_part(path, subject.scene.objects[0].model, position, options)]
    if options.x:
        subject = subject.placed(options.x)
    parts = []
    for obj in subject.scene.objects:
        part = make_part(path, obj.model, position, options, obj)
        placed = moved_object(obj, Pose(position, IDENTITY.wxyz))
        selectors = (*placed.selectors, *part.obj.selectors)
        parts.append(replace(part, obj=replace(placed, selectors=selectors)))
    return parts


def refuse_spz_options(options: Options) -> None:
    """Raises UsageError where the options of an .spz are given for another format."""
    from shapeshift.app.errors import UsageError

    given = (options.spz_axes, options.spz_version) != ("ply", "3")
    if given and options.out.suffix.lower() != ".spz":
        raise UsageError(
            "--spz-axes and --spz-version are of .spz; name --out NAME.spz, or leave them out."
        )


def parse_eye(text: str) -> tuple[float, float, float] | None:
    """Three numbers of a text.  Raises UsageError."""
    from math import isfinite

    from shapeshift.app.errors import UsageError

    if not text:
        return None
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not all(map(isfinite, numbers)):
        raise UsageError(f"--eye is '{text}', expected x,y,z in metres.")
    return numbers


def make_part(path: Path, model, position, options: Options, known=None):
    """What the options say about one model, which stands at position (3,) in metres: its x, its
    regions, what of it is written.  known: the object of a scene file, which has an x already.
    """
    from shapeshift.app.commands.exported import Part
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.cameras.framing import default_view
    from shapeshift.scene.pose import Pose
    from shapeshift.scene.scene import IDENTITY, SceneObject
    from shapeshift.scene.selectors.selector_texts import read_selector

    x = known.x if known else choose_x(options.x, model)
    eye = default_view(model, (640, 360)).world_from_eye
    try:
        selectors = tuple(read_selector(text, model.stops, eye) for text in options.select)
    except ValueError as error:
        raise UsageError(f"--select {error}") from None
    try:
        inside = tuple(read_selector(with_x(text), (), eye) for text in options.only)
    except ValueError as error:
        raise UsageError(f"--only {error}") from None
    pose = Pose(position, IDENTITY.wxyz)
    obj = SceneObject(path.stem or path.name, model, pose, x, selectors=selectors)
    return Part(obj, inside or None, options.label or None)


def choose_x(text: str, model):
    """The Control of one model.  Raises UsageError."""
    from shapeshift.app.document import control_of_text, pace_of

    if not text:
        return min((stop.x for stop in model.stops), default=0.0)
    return control_of_text(text, model.stops, pace=pace_of(model))


def with_x(text: str) -> str:
    """A selector of --only in the form that has a control value, which means nothing here."""
    from shapeshift.scene.selectors.selector_texts import FORMS

    kind, *parts = text.split(":")
    if kind not in FORMS:
        raise ValueError(f"'{text}' begins with '{kind}'; {', '.join(FORMS)} are known.")
    form = FORMS[kind].split("[")[0].removesuffix(":X")
    if len(parts) != form.count(":"):
        raise ValueError(f"'{text}' has {len(parts)} parts after '{kind}'; write {form}.")
    return f"{text}:0"


def x_words(parts: list) -> str:
    """x of what was written, with the stop's name where it is one."""
    from shapeshift.runtime_models.stop_weights import control_text

    obj = parts[0].obj
    if len({part.obj.x for part in parts}) > 1:
        return f"{len(parts)} objects, each at its own x"
    name = next((stop.name for stop in obj.model.stops if stop.x == obj.x), "")
    return f"x = {control_text(obj.x)}" + (f" ({name})" if name else "")


def export_package(options: Options, opened: list) -> int:
    """Writes a model of anchors and networks whole; nothing else can become one."""

    from shapeshift.app.errors import UsageError
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.runtime_models.package.feature_codes import EXACT
    from shapeshift.runtime_models.package.write_package import write_package

    asked = {
        "--x": options.x, "--select": options.select, "--only": options.only,
        "--eye": options.eye,
    }  # fmt: skip
    given = [name for name, value in asked.items() if value]
    if given:
        raise UsageError(
            f"a package holds every x and every part; leave {given[0]} out, or write plain splats "
            "(.ply, .spz, .glb ...)."
        )
    models = [obj.model for subject in opened for obj in subject.scene.objects]
    if len(models) != 1 or opened[0].file or not isinstance(models[0], AnchorModel):
        what = "several scenes" if len(models) != 1 else "plain splats"
        what = "objects of a scene file, which have places," if opened[0].file else what
        raise UsageError(
            f"{what} cannot become a package: it is anchors and five networks, which "
            f"`{program()} train` makes of photos; write .ply, .spz or .glb."
        )
    from shapeshift.app.commands.exported import label_of
    from shapeshift.app.pace import with_pace
    from shapeshift.runtime_models.package.refit_encoding import refit_encoding
    from shapeshift.runtime_models.parts import labelled_anchors

    model = models[0] if options.encoding == "kept" else refit_encoding(models[0])
    model = with_pace(model) if options.pace else model
    if options.label:
        model = labelled_anchors(
            model, label_of(model, options.label, opened[0].scene.objects[0].name)
        )
    size = write_package(model, options.out, EXACT)
    say(f"{full(options.out)}: {size:,} bytes, every x.")
    return 0


def export_as_page(options: Options, scenes: tuple[Path, ...]) -> int:
    """A page for browsers: one scene or scene file, every x."""
    from dataclasses import replace

    from shapeshift.app.errors import UsageError
    from shapeshift.app.pace import with_pace
    from shapeshift.app.page.page_file import export_page
    from shapeshift.app.page.page_scene import PageSettings
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.scene.scene import Scene

    asked = {"--select": options.select, "--only": options.only, "--eye": options.eye,
             "--label": options.label}  # fmt: skip
    if given := [name for name, value in asked.items() if value]:
        raise UsageError(
            f"a page shows a scene whole; leave {given[0]} out, or export that part first."
        )
    if len(scenes) != 1:
        raise UsageError("a page shows one scene or scene file; name one.")
    document = open_scene(scenes[0], options)
    if options.x:
        document = document.placed(options.x)
    if options.pace and not document.file:
        (obj,) = document.scene.objects
        if isinstance(obj.model, AnchorModel):
            document = replace(document, scene=Scene((replace(obj, model=with_pace(obj.model)),)))
    title = scenes[0].name.removesuffix(".scene.json").rsplit(".", 1)[0]
    settings = PageSettings(title, exact=options.exact, profile=options.for_)
    with progress_after(PATIENCE_S) as progress:
        size = export_page(document, options.out, settings, progress)
    splats = sum(obj.model.splat_count for obj in document.scene.objects)
    say(f"{full(options.out)}: {splats:,} splats, every x, {size:,} bytes.")
    return 0
