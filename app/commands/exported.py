"""What the command and the viewer's panel export: a scene as it is shown, as plain splats."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.app.errors import UsageError
from shapeshift.renderer.colors.false_colors import mixed_colors, shade_of
from shapeshift.renderer.colors.palette import palette_colors
from shapeshift.runtime_models.bake import bake
from shapeshift.runtime_models.evaluate import follows_eye
from shapeshift.runtime_models.fit_harmonics import ColorAt, Recolor
from shapeshift.runtime_models.lod.level_files import ENDING, LEVELS
from shapeshift.runtime_models.model import BadFile, Finding, Model, SplatLayers
from shapeshift.runtime_models.package.package_files import MANIFEST
from shapeshift.runtime_models.parts import find_label, splat_labels
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.sog.read_streamed import TREE
from shapeshift.runtime_models.splats.sog.sog_files import META
from shapeshift.runtime_models.splats.write_plain import (
    describe_losses,
    merged,
    placed,
    truncate_harmonics,
    writer_of,
)
from shapeshift.runtime_models.stop_weights import Controls
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.control import control_of, covered
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.selectors.selector import Selector

ANY_SIZE = (640, 360)  # of the view whose eye is asked for


@dataclass(frozen=True)
class Part:
    """What of one object is exported."""

    obj: SceneObject  # with its x, its regions and its pose
    inside: tuple[Selector, ...] | None = None  # what lies in any of them; None: all
    label: int | str | None = None  # the splats of this object within it, or its name; None: all


@dataclass(frozen=True)
class ExportLook:
    """How it is exported."""

    sh_degree: int = 3  # at most
    palette: bool = True  # value stops in their false colours, as they are shown
    eye: tuple[float, float, float] | None = None  # world metres, None: the first view's
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # float64 metres: where the files have
    #                                       the world's zero; far ones are shown nearer to it
    spz_axes: str = "ply"  # of an .spz: one of write_spz.AXES
    spz_version: int = 3  # of an .spz: one of write_spz.VERSIONS


def export(parts: Sequence[Part], look: ExportLook, path: Path, progress) -> PlainSplats:
    """Writes the parts into one file, all or nothing; gives back what was written.

    progress(what, part done 0..1).  Raises BadFile and UsageError.
    """
    writer = writer_of(path)
    look = replace(look, sh_degree=min(look.sh_degree, writer.sh_degree))
    baked = []
    for number, part in enumerate(parts):
        progress(f"baking {part.obj.name}", number / (len(parts) + 1))
        baked.append(bake_part(part, look))
    progress(f"writing {path.name}", len(parts) / (len(parts) + 1))
    splats = truncate_harmonics(merged(baked), look.sh_degree)
    x, y, z = np.add(splats.origin, look.origin).tolist()
    splats = replace(splats, origin=(x, y, z))
    path.parent.mkdir(parents=True, exist_ok=True)
    options = {"version": look.spz_version, "axes": look.spz_axes} if writer.name == "spz" else {}
    try:
        writer.write(splats, path, **options)
    except ValueError as error:  # the format cannot hold them
        raise UsageError(f"{writer.name}: {error}") from None
    lost = [replace(finding, file=path.name) for finding in describe_losses(splats, writer)]
    return replace(splats, findings=(*splats.findings, *lost))


def bake_part(part: Part, look: ExportLook) -> PlainSplats:
    """One object as plain splats, where it stands in the world."""
    obj = part.obj
    eye, said = eye_of(obj, look)
    x = control_of(obj)
    recolor = shown_colors(obj, x) if look.palette else None
    splats = bake(obj.model, x, eye, look.sh_degree, recolor, chosen_rows(part))
    named = [replace(finding, file=obj.name) for finding in (*splats.findings, *said)]
    pose = obj.world_from_object
    # Where a model's own zero lies in its file is in the pose already.
    splats = replace(splats, findings=tuple(named), origin=(0.0, 0.0, 0.0))
    return placed(splats, pose.matrix()[:3, :3], pose.position)


def eye_of(obj: SceneObject, look: ExportLook) -> tuple[np.ndarray | None, tuple[Finding, ...]]:
    """From where an object is seen (3,), in its frame, if that matters, and a word about it."""
    if not follows_eye(obj.model):
        return None, ()
    if look.eye is None:
        eye = default_view(obj.model, ANY_SIZE).world_from_eye.position
    else:
        object_from_world = np.linalg.inv(obj.world_from_object.matrix())
        eye = (object_from_world @ np.append(look.eye, 1.0))[:3]
    place = ",".join(f"{c:.4g}" for c in eye)
    what = "which splats there are and their shape depend on the eye"
    return eye, (Finding(what, 0, f"baked as seen from {place}; --eye chooses another place"),)


def shown_colors(obj: SceneObject, x: Controls) -> Recolor | None:
    """Mixes colours and what value stops have in them, in their palettes, as much as x asks."""
    model = obj.model
    shade = shade_of(model, x)
    if not shade.heats:
        return None
    for heat in shade.heats:
        palette_colors(heat.palette)  # an unknown one is refused before the work begins
    each = 1 if isinstance(model, SplatLayers) else model.splats_per_anchor

    def recolor(color_at: ColorAt, rows: np.ndarray) -> np.ndarray:
        return mixed_colors(shade.of_rows(rows, each), len(rows), color_at).astype(np.float32)

    return recolor


def chosen_rows(part: Part) -> np.ndarray | None:
    """(N,) bool of the model's splats that are inside and have the label; None: all.

    Anchors are inside or not, with all their splats, as regions take them.
    """
    model, keep = part.obj.model, None
    each = 1 if isinstance(model, SplatLayers) else model.splats_per_anchor
    if part.inside is not None:
        keep = np.repeat(covered(part.obj, part.inside) >= 0.5, each)
        if not keep.any():
            raise UsageError(f"nothing of {part.obj.name} lies inside; choose another place.")
    if part.label is None:
        return keep
    wanted, labels = label_of(model, part.label, part.obj.name), splat_labels(model)
    assert labels is not None, "label_of refuses models without"
    of_label: np.ndarray = np.equal(labels, wanted)
    return of_label if keep is None else keep & of_label


def label_of(model: Model, label: int | str, name: str) -> int:
    """The label that --label asks for, by itself or by an object's name.  Raises UsageError."""
    try:
        return find_label(model, label, name)
    except BadFile as error:
        raise UsageError(f"--label {label}: {error}") from None


def check_output(path: Path, inputs: Sequence[Path], overwrite: bool, said: str = "--") -> None:
    """Refuses a path that is an input under any name, and what exists unless it may be replaced.

    said: what stands before a name where it is typed.
    """
    out = f"{said}out {path}"
    folders = [given.parent for given in inputs if given.name in (MANIFEST, META, TREE, LEVELS)]
    for given in (*inputs, *folders):
        if given.is_dir() and path.resolve().is_relative_to(given.resolve()):
            raise UsageError(f"{out} lies in {given}, which is read; choose another folder.")
        if path.exists() and os.path.samefile(path, given):
            raise UsageError(f"{out} is the scene that is read; choose another name.")
    if path.exists() and not overwrite:
        raise UsageError(f"{out} exists; {said}overwrite replaces it.")
    folder = is_folder(path) or path.suffix.lower() == ENDING
    if path.is_dir() != folder and path.exists():
        raise UsageError(f"{out} is of another kind than what is written; choose another.")


def is_folder(path: Path) -> bool:
    """Whether a path without a known ending stands for a package in a folder."""
    return not path.suffix
