"""launch.py update: a part of a scene trained anew from a later visit, the rest as it was."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shapeshift.app.command_line import POSITIONAL, FieldsOf, Opt
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import ReadingOptions, open_capture, open_model
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.app.training.run_loop import INTERRUPTED, decibels, train, used
from shapeshift.app.training.train_options import (
    SETTINGS,
    Asked,
    MachineOptions,
    settings_of,
    with_settings,
)
from shapeshift.runtime_models.files.plain_text import json_text
from shapeshift.runtime_models.model import AnchorModel, Model
from shapeshift.runtime_models.package.feature_codes import EXACT
from shapeshift.runtime_models.package.write_package import package_files
from shapeshift.runtime_models.program import program
from shapeshift.scene.change.similarity import Similarity, read_change
from shapeshift.scene.sections.section_texts import read_box
from shapeshift.training.settings import TrainSettings
from shapeshift.training.styles.add_style import refuse_plain
from shapeshift.training.update.regions import UpdateRegion
from shapeshift.training.update.update_trainer import UpdateBase

if TYPE_CHECKING:
    from shapeshift.training.update.update_trainer import UpdateTrainer

USUAL = ("seconds", "iterations", "points", "downscale", "masks", "background")
EXPERTS = ("seed", "max_anchors")
LINES = ("depth_share", "normal_share", "min_scale_px")  # as of train
READING = "reading photos, finding the first points"


@dataclass(frozen=True)
class Options(MachineOptions):
    """Train a part of a scene anew from the photos of a later visit; all else stays as it was.

    The networks and all anchors outside stay to the bit.
    """

    scene: Annotated[Path, POSITIONAL]
    """The scene of the earlier visit: a package of train."""
    capture: Annotated[Path, POSITIONAL]
    """The photos of the later visit, posed: what train takes, with photos of every stop."""
    out: Path
    """The package to write: NAME.shift or a folder."""
    where: Annotated[tuple[str, ...], Opt(metavar="BOX")] = ()
    """What may change, metres of the scene's world: box:x,y,z:hx,hy,hz (centre, half its sides),
    one or several.  Default: the places that --change names."""
    change: Path | None = None
    """The folder that `change SCENE LATER --out` wrote: its places, and how the capture's world
    lies in the scene's.  Default: both are one world."""
    asked: Annotated[Asked, FieldsOf(TrainSettings, USUAL, EXPERTS, LINES)] = field(
        default_factory=dict
    )
    settings: Annotated[Path | None, SETTINGS] = None
    """A TOML file with a setting a line, as of train.  Default: none."""
    resume: bool = False
    """Continue from the checkpoint beside --out, with the same scene, capture and places."""
    overwrite: bool = False
    """Replace an existing file."""


def run(options: Options) -> int:
    from shapeshift.app.commands.exported import check_output
    from shapeshift.app.errors import UsageError
    from shapeshift.app.progress import working
    from shapeshift.app.training.saving import (
        check_writable,
        memory_for_training,
        save,
        save_checkpoint,
        saved_when_it_fails,
    )
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.package.write_package import refuse_foreign
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint
    from shapeshift.training.update.regions import moved_capture
    from shapeshift.training.update.update_trainer import begin_update

    options = with_settings(options)
    check_output(options.out, [options.scene], options.overwrite or options.resume)
    check_writable(options.out)
    refuse_foreign(options.out)
    region, a_from_b = region_of(options.where, options.change)
    checkpoint = checkpoint_path(options.out)
    resume = read_checkpoint(checkpoint) if options.resume else None
    settings = settings_of(options.asked, resume[1]["settings"] if resume else None)
    base = base_of(open_model(options.scene, ReadingOptions()), region)
    capture = open_capture(options.capture, options.memory)
    if a_from_b is not None:
        capture = moved_capture(capture, a_from_b)
    device = open_device(options.device)
    say(f"{device.name}, {device.platform}")
    with memory_for_training(), working(READING) as shown:
        try:
            trainer = begin_update(device, base, capture, settings, resume, shown)
        except ValueError as error:
            raise UsageError(str(error)) from None
    say(describe(trainer), *trainer.warnings)
    before = trainer.psnr_before()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with saved_when_it_fails(trainer, options.out, checkpoint):
        interrupted = train(trainer, partial(save_checkpoint, trainer, checkpoint))
    save(trainer, options.out, checkpoint)
    say(*summary(trainer, options.out, before, interrupted))
    return INTERRUPTED if interrupted else 0


def describe(trainer: "UpdateTrainer") -> str:
    photos = sum(len(found) for found in trainer.schedule.photos.values())
    return (
        f"{len(trainer.inside.anchors):,} anchors in the region, {trainer.fixed:,} outside stay; "
        f"{trainer.anchors_count - trainer.fixed:,} begin; {photos} photos see it, "
        f"{len(trainer.held_out)} held out"
    )


def summary(
    trainer: "UpdateTrainer", out: Path, before: dict[str, float], interrupted: bool
) -> list[str]:
    state = "interrupted, --resume goes on" if interrupted else "done"
    lines = [
        f"{full(out)}: {state} after {trainer.iteration} steps in {used(trainer)}; "
        f"{trainer.anchors_count - trainer.fixed:,} anchors in the "
        f"region, all else as it was"
    ]
    if after := trainer.held_out_psnr(most=len(trainer.held_out)):
        lines.append(
            f"held-out photos where they see the region: {decibels(before)} before, "
            f"{decibels(after)} now"
        )
    return [*lines, f"look: {program()} {full(out)}"]


# Where `update` and ss.update train anew: boxes that are typed, or the places of `change`.


def region_of(
    where: Sequence[str], change: Path | None, said: str = "--"
) -> tuple[UpdateRegion, Similarity | None]:
    """What may change, and the scene's world from the capture's; None: they are one.

    said: what stands before a name where it is typed.  Raises BadFile, UsageError.
    """
    known = None if change is None else read_change(change)
    try:
        boxes = tuple(read_box(text) for text in where)
    except ValueError as error:
        raise UsageError(f"{said}where {error}") from None
    if not boxes and known is None:
        raise UsageError(
            f"nothing says what may change; give {said}where box:x,y,z:hx,hy,hz in metres, or "
            f"{said}change with the folder that `change` wrote."
        )
    if not boxes and known is not None and not known.boxes:
        raise UsageError(f"{change} names no place that changed; there is nothing to update.")
    chosen = boxes or (known.boxes if known is not None else ())
    return UpdateRegion(chosen), None if known is None else known.a_from_b


def base_of(model: Model, region: UpdateRegion) -> UpdateBase:
    """The scene with what a run is known by when it resumes.  Raises BadFile."""
    anchors: AnchorModel = refuse_plain(model)
    digest = hashlib.sha256()
    for name, data in sorted(package_files(anchors, EXACT).items()):
        digest.update(name.encode() + data)
    boxes = [[box.centre, box.half, box.wxyz] for box in region.boxes]
    digest.update(json_text(boxes).encode())
    return UpdateBase(anchors, region, digest.hexdigest())
