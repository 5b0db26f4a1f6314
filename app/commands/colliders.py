"""launch.py colliders: what "hulls" asks for, made once and written into files beside a scene file.

python3 launch.py colliders room.scene.json --out room.made.scene.json
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shapeshift.app.command_line import POSITIONAL, Opt
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import full
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.runtime_models.model import Model
    from shapeshift.scene.colliders.collider import Collider
    from shapeshift.scene.document.scene_file import SceneFile, SceneItem

FOLDER = "colliders"  # beside the scene file that is written
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Options:
    """Make the colliders of a scene file once, into files that travel with it."""

    scene: Annotated[Path, POSITIONAL]
    """A scene file with objects whose collider is "hulls"."""
    out: Path
    """The scene file to write, which names the colliders in the folder "colliders" beside it."""
    shape: Annotated[tuple[str, ...], Opt(metavar="[NAME=]SHAPE")] = ()
    """One convex piece in place of up to 16, which costs the physics less: hull, box, cylinder,
    sphere or capsule. Boxes and cylinders stand upright. NAME=SHAPE for one object.
    Default: the pieces."""
    overwrite: bool = False
    """Replace files that are there."""


def run(options: Options) -> int:
    make_colliders(options)
    say(f"{full(options.out)} names them.")
    return 0


def make_colliders(
    options: Options, hear: Callable[..., object] = say, progress: Progress | None = None
) -> dict[str, Path]:
    """Makes and writes them and the scene file; the file of each object's, by its name.

    hear: told of each; progress: (what, part 0..1) in place of stderr.  Raises BadFile, UsageError.
    """
    from shapeshift.app.commands.simulate import refuse_model
    from shapeshift.app.scene_files import open_scene_file
    from shapeshift.scene.colliders.collider_files import collider_key
    from shapeshift.scene.document.scene_file import HULLS
    from shapeshift.scene.document.write_scene_file import write_scene_file

    refuse_model(options.scene, "colliders makes what is touched")
    file, models, _ = open_scene_file(options.scene, ReadingOptions(), not progress, progress)
    paths = paths_of(file, options.out)
    refuse(options, file, list(paths.values()))
    shapes = shapes_of(options.shape, list(paths))
    made: dict[tuple, Path] = {}  # objects of one model at one x share a file
    named: dict[str, Path] = {}
    for item in file.all_items:
        if item.collider != HULLS:
            continue
        shape = shapes.get(item.name)
        key = (*collider_key(item, models[item.name]), shape, *(item.wxyz if shape else ()))
        if key not in made:
            made[key] = paths[item.name]
            collider = make_one(file, item, models[item.name], shape, progress)
            hear(f"{item.name}: {write_one(collider, made[key])} in {full(made[key])}")
        named[item.name] = made[key]
        file = naming(file, item.name, made[key])
    write_scene_file(file, options.out)
    return named


def shapes_of(asked: tuple[str, ...], names: list[str]) -> dict[str, str]:
    """The shape of each object that is to have one; what is said by name counts before the rest.

    names: of the objects whose colliders are made.  Raises UsageError.
    """
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.colliders.primitives import SHAPES
    from shapeshift.scene.document.scene_file import BACKGROUND

    of_all: dict[str, str] = {}
    of_one: dict[str, str] = {}
    for text in asked:
        name, separator, shape = text.rpartition("=")
        if shape not in SHAPES:
            raise UsageError(f"--shape is '{text}'; one of {', '.join(SHAPES)} is wanted.")
        if not separator:
            of_all = {n: shape for n in names if n != BACKGROUND}  # a room is hollow
        elif name in names and name != BACKGROUND:
            of_one[name] = shape
        else:
            known = ", ".join(n for n in names if n != BACKGROUND)
            raise UsageError(f"--shape {text}: its object is none of {known or 'those made'}.")
    return of_all | of_one


def paths_of(file: "SceneFile", out: Path) -> dict[str, Path]:
    """Where the collider of each object that asks for one is written."""
    from shapeshift.app.paths import file_name
    from shapeshift.scene.document.scene_file import HULLS

    found: dict[str, Path] = {}
    for number, item in enumerate(file.all_items):
        if item.collider == HULLS:
            path = out.parent / FOLDER / f"{file_name(item.name)}.glb"
            taken = path in found.values()
            found[item.name] = path.with_stem(f"{path.stem}-{number}") if taken else path
    return found


def refuse(options: Options, file: "SceneFile", paths: list[Path]) -> None:
    """Before minutes of work.  Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.scene.document.scene_file import ENDING

    if not paths:
        raise UsageError(f'no object of {options.scene.name} has "hulls" as its collider.')
    if not options.out.name.lower().endswith(ENDING):
        raise UsageError(f"--out is {options.out.name}; name a file that ends in {ENDING}.")
    inputs = {file.path(item.model).resolve() for item in file.all_items}
    for path in (options.out, *paths):
        if path.resolve() in inputs | {options.scene.resolve()}:
            raise UsageError(f"{path} is read in this run; choose another --out.")
        if path.exists() and not options.overwrite:
            raise UsageError(f"{path} exists; choose another --out or add --overwrite.")


def make_one(
    file: "SceneFile", item: "SceneItem", model: "Model", shape: str | None,
    progress: Progress | None,
) -> "Collider":  # fmt: skip
    """What "hulls" of an object stands for, or one piece of that shape; progress: None is stderr's
    bar.  Raises BadFile.
    """
    from contextlib import nullcontext

    from shapeshift.app.opening import PATIENCE_S, progress_after
    from shapeshift.scene.colliders.collider import MOST_PARTS, Making
    from shapeshift.scene.colliders.collider_files import one_collider
    from shapeshift.scene.colliders.primitives import UP, collider_of_shape

    with nullcontext(progress) if progress else progress_after(PATIENCE_S) as shown:
        most = 1 if shape else MOST_PARTS  # of a shape the mesh alone is asked
        collider = one_collider(file, item, model, Making(most_parts=most, progress=shown))
    if shape is None:
        return collider
    up_in_object = item.pose.matrix()[:3, :3].T @ UP
    return collider_of_shape(collider.mesh, shape, up_in_object)


def write_one(collider: "Collider", path: Path) -> str:
    """Writes it; in words what it is."""
    from shapeshift.runtime_models.files.whole_file import make_folders
    from shapeshift.scene.colliders.collider_pieces import write_collider

    make_folders(path.parent.parent, path.parent.name)
    write_collider(collider.parts, collider.mesh, path)
    count = len(collider.parts)
    return f"{count} convex piece{'s' * (count > 1)}, {len(collider.mesh.faces):,} faces"


def naming(file: "SceneFile", name: str, path: Path) -> "SceneFile":
    """The file with that path as the collider of an object."""
    from shapeshift.scene.document import edits

    try:
        text = Path(os.path.relpath(path, file.folder)).as_posix()
    except ValueError:  # on another drive of Windows
        text = path.absolute().as_posix()
    return edits.change(file, name, collider=text)
