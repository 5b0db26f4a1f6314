"""Scenes into files of other programs and of our own, and into arrays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from shapeshift.api.arguments import PathText, Progress, X
from shapeshift.api.edit import regions_of
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import in_words_of_python, opened
from shapeshift.app.commands.exported import ExportLook, Part, bake_part, check_output, is_folder
from shapeshift.app.commands.exported import export as export_parts
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.runtime_models.model import AnchorModel, Finding
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.write_plain import merged, truncate_harmonics, writer_of
from shapeshift.scene.selectors.selector import Selector

PACKAGE = ".shift"
PAGES = (".html", ".zip")


@dataclass(frozen=True)
class Exported:
    """What was written: its path, its bytes on disk, its splats, and what was lost on the way.

    written = scene.export("heat.spz", x="Thermal")
    print(written.path, written.bytes)
    """

    path: Path
    bytes: int
    splats: int  # of a package: at every x
    findings: tuple[Finding, ...] = ()  # what the format had no place for, what was cut


def export(
    scene: PathText | OpenedScene,
    out: PathText,
    *,
    x: X | None = None,
    sh_degree: int = 3,
    palette: bool = True,
    only: Sequence[Selector] = (),
    object: str | None = None,
    label: int | str | None = None,
    eye: Sequence[float] | None = None,
    spz_axes: Literal["ply", "rub"] = "ply",
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Exported:
    """Writes a scene as it is shown at one x for other programs, all or nothing.

    out: its ending is the format: .ply, .compressed.ply, .spz, .glb, .splat, .usdz; .shift or a
    folder is our own package, which holds every x, and so does .html, a page for any browser (one
    file), or .zip, one for a server.  x: as of `Scene.at`.  sh_degree: 0 to 3, of the
    colours' spherical harmonics.  palette: value stops in their false colours.  only: what lies
    in one of these regions (their x means nothing here).  object: that object of a scene file
    alone.  label: what a labelled scene shows of that object alone, by its number or name; in a
    package, its anchors.  eye: (3,) metres, for scenes whose shape depends on it.  spz_axes: of
    an .spz, "ply", as most programs read it, or "rub", as the format's text says.  overwrite:
    replace an earlier file, never what is read.  progress: called with (what, part 0..1).

    Raises UsageError, BadFile; OSError where it cannot be written.

        ss.export("workshop.shift", "heat.spz", x="Thermal")
        ss.export(scene, "part.ply", only=[ss.Sphere(centre=(0, 1, 0), radius=0.5, x=0)])
    """
    scene, out = opened(scene), plain(out)
    if is_folder(out) or out.suffix.lower() == PACKAGE:
        if x is not None or only or object is not None or eye is not None:
            raise UsageError("a package holds every x and every part; give out= another ending.")
        return save(scene, out, overwrite, label)
    if out.suffix.lower() in PAGES:
        refuse_parts(only, object, label, eye)
        return export_page(scene.at(x), out, overwrite, progress or (lambda what, part: None))
    writer_of(out)  # before any work
    check_output(out, [scene.path] if scene.path and scene.path.exists() else [], overwrite, "")
    objects = tuple(scene.at(x).objects)
    if object is not None:
        objects = (scene.at(x).object(object),)
    view = scene.subject.view((640, 360))
    if scene.subject.file is None and scene.path is not None:
        objects = tuple(replace(obj, name=scene.path.stem or "scene") for obj in objects)
    parts = [
        Part(obj, regions_of(only, obj.model, view) or None, label)
        for obj in objects
        if obj.visible or object is not None
    ]
    if not parts:
        raise UsageError("all objects are hidden; name one of them: object=.")
    look = look_of(sh_degree, palette, eye, tuple(map(float, scene.origin)), spz_axes)
    splats = export_parts(parts, look, out, progress or (lambda what, part: None))
    return Exported(out, out.stat().st_size, len(splats.means), splats.findings)


def refuse_parts(*parts: Any) -> None:
    """Raises UsageError where a part is asked for."""
    if any(part is not None and part != () for part in parts):
        raise UsageError("a page shows a scene whole; export the part first, then that.")


def export_page(scene: OpenedScene, out: Path, overwrite: bool, progress: Progress) -> Exported:
    """A page for browsers, with a pace between its stops, as the command writes it."""
    from shapeshift.app.page.page_file import export_page as write_page
    from shapeshift.app.page.page_scene import PageSettings
    from shapeshift.renderer.pace import measure_pace
    from shapeshift.scene.scene import Scene as DrawnScene

    path = scene.path
    check_output(out, [path] if path and path.exists() else [], overwrite, "")
    document = scene.subject
    if not document.file:
        (obj,) = document.scene.objects
        if isinstance(obj.model, AnchorModel) and not obj.model.pace:
            model = replace(obj.model, pace=measure_pace(obj.model))
            document = replace(document, scene=DrawnScene((replace(obj, model=model),)))
    name = path.name if path else "scene"
    settings = PageSettings(name.removesuffix(".scene.json").rsplit(".", 1)[0])
    size = write_page(document, out, settings, progress)
    return Exported(out, size, sum(obj.model.splat_count for obj in document.scene.objects))


@dataclass(frozen=True)
class WrittenLevels:
    """Levels of detail that were written: the folder, the bytes of all, and each level.

    levels: of streamed SOG {"splats"}, finest first; of a package, whose finest is itself,
    {"anchors", "from_pixels", "error_db", "steps"}, coarser ones alone.

        written = ss.lod("scan.ply", "levels")
        [level["splats"] for level in written.levels]
    """

    path: Path
    bytes: int
    levels: tuple[dict[str, Any], ...]
    leaves: int = 0  # of streamed SOG
    left_out: tuple[dict[str, Any], ...] = ()  # of a package: good enough at no size
    findings: tuple[Finding, ...] = ()  # what was lost on the way


def lod(
    scene: PathText | OpenedScene,
    out: PathText,
    *,
    x: X | None = None,
    sh_degree: int = 3,
    leaf: int = 4096,
    distill: float = 30.0,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> WrittenLevels:
    """Writes levels of detail.  out without an ending: streamed SOG of the splats at x, each level
    half of the one before, for viewers that load what is seen (docs/formats.md).  NAME.lod, of a
    package: coarser anchors that follow x and are drawn where it is small (docs/package.md).

    x: as of `Scene.at`.  sh_degree: 0 to 3, at most.  leaf: splats of a leaf at the finest level,
    64 to 524288.  distill: processor seconds that the coarser levels of a package learn.
    overwrite: replace an earlier folder, never what is read.  progress: called with (what, part
    0..1).  Raises UsageError, BadFile.

        ss.lod("scan.ply", "levels"); ss.load("levels", budget="500k")
        ss.lod("scene.shift", "scene.lod", distill=60)
    """
    from shapeshift.app.streaming.lod import (
        PACKAGE_LEVELS,
        Options,
        bytes_of,
        check_folder,
        check_numbers,
        stream,
    )

    out, tell = plain(out), progress or (lambda what, part: None)
    named = Options(Path("scene"), out, sh_degree=sh_degree, leaf=leaf, distill=distill)
    with in_words_of_python():
        check_numbers(named)
        if out.suffix.lower() == PACKAGE_LEVELS:
            return lod_of_package(opened(scene), named, x, overwrite, tell)
        shown = opened(scene).at(x)
        options = replace(named, scene=shown.path or named.scene, overwrite=overwrite)
        check_folder(options, [options.scene] if options.scene.exists() else [], "")
        objects = [obj for obj in shown.objects if obj.visible]
        if not objects:
            raise UsageError("all objects are hidden; show one of them.")
        if shown.subject.file is None:
            name = options.scene.stem or options.scene.name
            objects = [replace(objects[0], name=name)]
        splats, sizes = stream(objects, shown.subject, options, tell)
    levels = tuple({"splats": count} for count in sizes.levels)
    return WrittenLevels(out, bytes_of(out), levels, sizes.leaves, findings=splats.findings)


def lod_of_package(
    scene: OpenedScene, options: Any, x: X | None, overwrite: bool, progress: Progress
) -> WrittenLevels:
    """Coarser levels of a package; options: of the command."""
    from shapeshift.app.streaming.lod import check_package_levels, package_levels

    if x is not None:
        raise UsageError("x is of streamed SOG; levels of a package follow x, leave it out.")
    if scene.path is None:
        raise UsageError("levels of a package are made of its file; save the scene first.")
    options = replace(options, scene=scene.path, overwrite=overwrite)
    check_package_levels(options, "")
    made, size = package_levels(scene.model, options, progress)
    rows = [
        [
            {"anchors": len(level.anchors.anchors), "from_pixels": level.errors.pixels,
             "error_db": dict(level.errors.db), "steps": level.steps}
            for level in levels
        ]
        for levels in (made.levels, made.left_out)
    ]  # fmt: skip
    return WrittenLevels(options.out, size, tuple(rows[0]), left_out=tuple(rows[1]))


def save(
    scene: OpenedScene, path: PathText, overwrite: bool, label: int | str | None = None
) -> Exported:
    """What Scene.save does; label: of the anchors of that object alone."""
    from shapeshift.app.commands.exported import label_of
    from shapeshift.runtime_models.package.feature_codes import EXACT
    from shapeshift.runtime_models.package.write_package import write_package
    from shapeshift.runtime_models.parts import labelled_anchors

    path = plain(path)
    subject = scene.subject
    if subject.file is not None or not isinstance(subject.scene.objects[0].model, AnchorModel):
        what = "objects of a scene file" if subject.file is not None else "plain splats"
        raise UsageError(
            f"{what} cannot become a package, which is anchors and five networks; export them as "
            ".ply, .spz or .glb."
        )
    if not (is_folder(path) or path.suffix.lower() == PACKAGE):
        raise UsageError(f"{path} has no ending of a package; name it NAME.shift or a folder.")
    check_output(path, [scene.path] if scene.path and scene.path.exists() else [], overwrite, "")
    model = scene.model
    assert isinstance(model, AnchorModel)
    if label is not None:
        name = subject.scene.objects[0].name
        model = labelled_anchors(model, label_of(model, label, name))
    size = write_package(model, path, EXACT)
    return Exported(path, size, model.splat_count)


def look_of(
    sh_degree: int, palette: bool, eye: Sequence[float] | None, origin: tuple = (0.0, 0.0, 0.0),
    spz_axes: str = "ply",
) -> ExportLook:  # fmt: skip
    """How splats are baked.  Raises UsageError."""
    if spz_axes not in ("ply", "rub"):
        raise UsageError(f"spz_axes is {spz_axes!r}, expected 'ply' or 'rub'.")
    if sh_degree not in range(4):
        raise UsageError(f"sh_degree is {sh_degree}, expected 0 to 3.")
    if eye is None:
        return ExportLook(sh_degree, palette, None, origin, spz_axes)
    place = tuple(map(float, eye))
    if len(place) != 3 or not np.isfinite(place).all():
        raise UsageError(f"eye is {place}; three numbers in metres are wanted.")
    return ExportLook(sh_degree, palette, (place[0], place[1], place[2]), origin, spz_axes)


def bake_scene(
    scene: OpenedScene, sh_degree: int, palette: bool, eye: Sequence[float] | None
) -> PlainSplats:
    """What Scene.splats gives: arrays that nothing else holds."""
    look = look_of(sh_degree, palette, eye)
    baked = [bake_part(Part(obj), look) for obj in scene.objects if obj.visible]
    if not baked:
        raise UsageError("all objects are hidden; nothing is there to be taken.")
    splats = truncate_harmonics(merged(baked), sh_degree)
    arrays: dict[str, Any] = {
        name: np.array(getattr(splats, name), np.float32)
        for name in ("means", "scales", "wxyz", "opacity", "sh")
    }
    return replace(splats, **arrays)
