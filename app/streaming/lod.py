"""launch.py lod: levels of detail of a scene at one control value, as streamed SOG."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from shapeshift.app.cluster.open_cluster import NONE, ClusterOptions, open_cluster
from shapeshift.app.cluster.task import Task, forget, words_for
from shapeshift.app.command_line import CONTROL, EXPERT, POSITIONAL, Opt
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import PATIENCE_S, ReadingOptions, progress_after, sentence
from shapeshift.app.paths import full
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.app.document import Document
    from shapeshift.app.streaming.package_levels import MadeLevels
    from shapeshift.runtime_models.model import Model
    from shapeshift.runtime_models.splats.plain_splats import PlainSplats
    from shapeshift.runtime_models.splats.sog.write_streamed import StreamedSizes
    from shapeshift.scene.scene import SceneObject

LEAST_LEAF = 64  # splats: of smaller ones the tree would take more bytes than they
MOST_LEAF = 1 << 19  # a leaf lies in one file
BAKED = 0.01  # of the time: colours of splats are copied
FITTED = 0.3  # those of anchors are fitted
PACKAGE_LEVELS = ".lod"  # as level_files.py has it, which is loaded when it is asked for


@dataclass(frozen=True)
class Options(ClusterOptions, ReadingOptions):
    """Write levels of detail.  Of splats, each with half of the splats of the one before, made by
    merging neighbours: a folder in PlayCanvas's streamed SOG, with the errors that its engine
    spends its budget by; this program reads the finest level that --max-splats allows.  Of a
    package, with --out NAME.lod: coarser anchors for the same networks, which opens like the
    package, follows x at every level, and draws less of it where it is small on screen.
    """

    scene: Annotated[Path, POSITIONAL]
    """A package, splats of any known format, a folder of layers or a scene file."""
    out: Path
    """The folder to write: NAME.lod of a package, which stays one; without an ending streamed SOG,
    with lod-meta.json in it."""
    more: Annotated[tuple[Path, ...], Opt(positional=True, metavar="MORE")] = ()
    """More of them: each becomes a folder of its name in --out.  Default: none."""
    x: Annotated[str, CONTROL] = ""
    """Where the slider stands: a stop by its name, or a number from 0 to 1.  Default: the first
    stop, and in a scene file what it says for each object."""
    sh_degree: int = 3
    """Degree of the colours' spherical harmonics, at most; 0: one colour from all sides."""
    leaf: Annotated[int, EXPERT] = 4096
    """Splats of a leaf at the finest level, at most; viewers choose a level for each leaf."""
    distill: float = 30.0
    """Processor seconds that the coarser levels of a package learn to look like it; 0: they are
    averages of its anchors."""
    overwrite: bool = False
    """Replace an earlier folder; never what is read."""


def run(options: Options) -> int:
    from shapeshift.app.document import open_document

    check_numbers(options)
    if options.more or options.cluster != NONE:
        return write_several(options)
    if options.out.suffix.lower() == PACKAGE_LEVELS:
        return write_package_levels(options)
    check_folder(options, [options.scene])
    with progress_after(PATIENCE_S) as progress:
        document = open_document(options.scene, options)
        splats, sizes = stream(visible_objects(document, options), document, options, progress)
    for finding in splats.findings:
        say(sentence(finding))
    counts = ", ".join(f"{count:,}" for count in sizes.levels)
    say(
        f"{full(options.out)}: {sizes.leaves:,} leaves, {len(sizes.levels)} levels of {counts} "
        f"splats, {bytes_of(options.out):,} bytes."
    )
    return 0


def check_numbers(options: Options) -> None:
    """Raises UsageError."""
    from shapeshift.app.errors import UsageError

    if not LEAST_LEAF <= options.leaf <= MOST_LEAF:
        raise UsageError(f"--leaf is {options.leaf}, expected {LEAST_LEAF} to {MOST_LEAF}.")
    if not 0 <= options.sh_degree <= 3:
        raise UsageError(f"--sh-degree is {options.sh_degree}, expected 0 to 3.")


def check_folder(options: Options, inputs: list[Path], said: str = "--") -> None:
    """Raises UsageError where streamed SOG cannot be written; said: before names, where typed."""
    from shapeshift.app.commands.exported import check_output
    from shapeshift.app.errors import UsageError
    from shapeshift.app.training.saving import check_writable

    if options.out.suffix:
        raise UsageError(
            f"--out {options.out} is no folder's name; leave its ending out, or name one with "
            f"{PACKAGE_LEVELS} for a package."
        )
    check_output(options.out, inputs, options.overwrite, said)
    check_writable(options.out)


def stream(
    objects: "Sequence[SceneObject]", document: "Document", options: Options,
    progress: Callable[[str, float], None],
) -> "tuple[PlainSplats, StreamedSizes]":  # fmt: skip
    """Writes these objects of a document as streamed SOG; all of their splats, with what was found
    while they were baked, and the sizes.  Raises BadFile, UsageError.
    """
    splats, baked = bake_scene(objects, document, options, progress)

    def report(part: float) -> None:
        progress(f"merging and writing {len(splats.means):,} splats", baked + (1 - baked) * part)

    return splats, write_folder(splats, options, report)


def bytes_of(folder: Path) -> int:
    """Of all files in it."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def write_package_levels(options: Options) -> int:
    """The same package with coarser levels of anchors.  Raises BadFile and UsageError."""
    from time import process_time

    from shapeshift.app.opening import open_model
    from shapeshift.app.streaming.level_errors import WHERE

    check_package_levels(options)
    start = process_time()
    model = open_model(options.scene, options)
    with progress_after(PATIENCE_S) as progress:
        made, size = package_levels(model, options, progress)
    for level in made.levels:
        errors, steps = level.errors, level.steps
        db = ", ".join(f"{value:.1f} dB {WHERE[at]}" for at, value in errors.db.items())
        say(
            f"{len(level.anchors.anchors):,} anchors where the scene is up to {errors.pixels:.0f} "
            f"pixels across: {db}, a switch changes its pixels by {errors.change:.1f}/255 in the "
            f"mean ({steps:,} steps)."
        )
    for level in made.left_out:
        say(
            f"{len(level.anchors.anchors):,} anchors are good enough at no size, and left out: at "
            f"{level.errors.pixels:.0f} pixels {' and '.join(level.errors.lacks)}, after "
            f"{level.steps:,} steps; --distill with more seconds lets them learn longer."
        )
    seconds = process_time() - start
    say(f"{full(options.out)}: {size:,} bytes, {seconds:.0f} s of processor time.")
    return 0


def check_package_levels(options: Options, said: str = "--") -> None:
    """Raises UsageError before the package is read; said: before names, where they are typed."""
    import math

    from shapeshift.app.commands.exported import check_output
    from shapeshift.app.errors import UsageError
    from shapeshift.app.streaming.package_levels import refuse_foreign_folder
    from shapeshift.app.training.saving import check_writable

    if not 0 <= options.distill < math.inf:
        raise UsageError(f"--distill is {options.distill}, expected processor seconds, 0 or more.")
    if options.x:
        raise UsageError("--x is of streamed SOG; levels of a package follow x, leave it out.")
    check_output(options.out, [options.scene], options.overwrite, said)
    refuse_foreign_folder(options.out)
    check_writable(options.out)


def package_levels(
    model: "Model", options: Options, progress: Callable[[str, float], None]
) -> "tuple[MadeLevels, int]":
    """Makes and writes them: what they are, and the bytes of all.  Raises BadFile, UsageError."""
    from shapeshift.app.streaming.package_levels import make_levels, refuse_other, write_made

    package = refuse_other(model, options.scene)
    check_room(options.scene, options.out)
    made = make_levels(package, options.distill, progress)
    return made, write_made(made, options.scene, options.out)


def check_room(package: Path, out: Path) -> None:
    """Raises UsageError where not even the package itself would fit: now, not after minutes."""
    import shutil

    from shapeshift.app.errors import UsageError

    files = [package] if package.is_file() else package.rglob("*")
    wanted = sum(file.stat().st_size for file in files if file.is_file())
    there = next(folder for folder in out.absolute().parents if folder.exists())
    free = shutil.disk_usage(there).free
    if free < wanted:
        raise UsageError(
            f"--out {out}: {free:,} bytes are free there, and the package alone has {wanted:,}; "
            "make room, or name another place."
        )


def visible_objects(document: "Document", options: Options) -> "list[SceneObject]":
    """What of a document is written, each object at its x.  Raises UsageError."""
    from dataclasses import replace

    from shapeshift.app.commands.export import choose_x
    from shapeshift.app.errors import UsageError

    objects = [obj for obj in document.scene.objects if obj.visible]
    if not objects:
        raise UsageError(f"{options.scene}: all objects are hidden; show one of them.")
    if not document.file:
        (obj,) = objects
        name = options.scene.stem or options.scene.name
        objects = [replace(obj, name=name, x=choose_x(options.x, obj.model))]
    elif options.x:
        objects = [obj for obj in document.placed(options.x).scene.objects if obj.visible]
    return objects


def bake_scene(
    objects: "Sequence[SceneObject]", document: "Document", options: Options,
    progress: Callable[[str, float], None],
) -> "tuple[PlainSplats, float]":  # fmt: skip
    """The objects as plain splats, where they stand, and how much of the time that was.

    Raises BadFile and UsageError.
    """
    from dataclasses import replace

    import numpy as np

    from shapeshift.app.commands.exported import ExportLook, Part, bake_part
    from shapeshift.runtime_models.model import SplatLayers
    from shapeshift.runtime_models.shapes import three
    from shapeshift.runtime_models.splats.write_plain import merged

    parts = []
    share = BAKED if all(isinstance(obj.model, SplatLayers) for obj in objects) else FITTED
    for number, obj in enumerate(objects):
        progress(f"baking {obj.name}", share * number / len(objects))
        parts.append(bake_part(Part(obj), ExportLook(options.sh_degree)))
    splats = merged(parts)
    return replace(splats, origin=three(np.add(splats.origin, document.origin))), share


def write_folder(
    splats: "PlainSplats", options: Options, progress: Callable[[float], None]
) -> "StreamedSizes":
    """The folder, all or nothing."""
    from shapeshift.runtime_models.files.whole_file import whole_folder
    from shapeshift.runtime_models.splats.sog.write_streamed import write_streamed

    options.out.parent.mkdir(parents=True, exist_ok=True)
    with whole_folder(options.out) as folder:
        return write_streamed(splats, folder, options.leaf, "shapeshift lod", progress)


# lod of several scenes: each a task of a cluster, a folder in --out.
#
# `options` are those of lod.py, which imports this.


def write_several(options: Any) -> int:
    """The folders of all scenes; those that an interrupted run has left are not made again."""
    from shapeshift.app.commands.exported import check_output

    if options.out.suffix:
        raise UsageError(f"--out {options.out} is no folder's name; several scenes want one.")
    scenes = (options.scene, *options.more)
    outs = [options.out / scene.stem for scene in scenes]
    twice = {out.name for out in outs if outs.count(out) > 1}
    if twice:
        raise UsageError(f"two scenes are called {min(twice)}, and so would be their folders.")
    for scene in scenes:
        if not scene.exists():
            raise UsageError(f"{scene}: there is no such file.")
    tasks = [task_of(options, scene, out) for scene, out in zip(scenes, outs, strict=True)]
    for task, out in zip(tasks, outs, strict=True):
        if not task.is_done(task.key()):
            check_output(out, scenes, options.overwrite)
    with open_cluster(options.cluster, options.certificates, options.gpus) as cluster:
        cluster.run(tasks)
    forget(tasks)
    say(f"{len(tasks)} folders in {full(options.out)}")
    return 0


def task_of(options: Any, scene: Path, out: Path) -> Task:
    """`lod` of one scene."""
    one = replace(options, scene=scene, more=(), out=out, cluster=NONE, certificates=None, gpus=0)
    return Task(
        scene.stem, words_for("lod", one), (full(scene),), (full(out),),
        notes=f"{full(options.out)}.tasks",
    )  # fmt: skip
