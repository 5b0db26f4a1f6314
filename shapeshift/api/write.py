"""Scenes into files of other programs and of our own, and into arrays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from shapeshift.api.arguments import PathText, Progress, X
from shapeshift.api.edit import regions_of
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import opened
from shapeshift.app.commands.exported import ExportLook, Part, bake_part, check_output, is_folder
from shapeshift.app.commands.exported import export as export_parts
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.runtime_models.model import AnchorModel, Finding
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.write_plain import merged, truncate_harmonics, writer_of
from shapeshift.scene.selectors.selector import Selector

PACKAGE = ".shift"


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
    folder is our own package, which holds every x.  x: as of `Scene.at`.  sh_degree: 0 to 3, of the
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
    if spz_axes not in ("ply", "rub"):
        raise UsageError(f"spz_axes is {spz_axes!r}, expected 'ply' or 'rub'.")
    look = look_of(sh_degree, palette, eye, tuple(map(float, scene.origin)))
    look = replace(look, spz_axes=spz_axes)
    splats = export_parts(parts, look, out, progress or (lambda what, part: None))
    return Exported(out, out.stat().st_size, len(splats.means), splats.findings)


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
    sh_degree: int, palette: bool, eye: Sequence[float] | None, origin: tuple = (0.0, 0.0, 0.0)
) -> ExportLook:
    """How splats are baked.  Raises UsageError."""
    if sh_degree not in range(4):
        raise UsageError(f"sh_degree is {sh_degree}, expected 0 to 3.")
    if eye is None:
        return ExportLook(sh_degree, palette, None, origin)
    place = tuple(map(float, eye))
    if len(place) != 3 or not np.isfinite(place).all():
        raise UsageError(f"eye is {place}; three numbers in metres are wanted.")
    return ExportLook(sh_degree, palette, (place[0], place[1], place[2]), origin)


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
