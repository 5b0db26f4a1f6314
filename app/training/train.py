"""launch.py train: posed photos of one or several modalities to a scene."""

import shlex
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.cluster.open_cluster import NONE, check_gpus
from shapeshift.app.cluster.task import is_task
from shapeshift.app.errors import UsageError, as_typed
from shapeshift.app.inspection.capture_facts import print_files
from shapeshift.app.opening import open_capture
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.app.training.run_loop import (
    INTERRUPTED,
    READING,
    calibrated,
    decibels,
    describe,
    train,
    used,
)
from shapeshift.app.training.train_in_blocks import OF_BLOCKS, most_anchors, wanted_of
from shapeshift.app.training.train_options import Options, as_given, settings_of, with_settings
from shapeshift.runtime_models.program import program

if TYPE_CHECKING:
    from shapeshift.training.blocks.block_start import BlockStart
    from shapeshift.training.settings import TrainSettings
    from shapeshift.training.train import Trainer

USUAL_STEPS = 2000  # those of TrainSettings
FEW_STEPS = USUAL_STEPS // 2  # scenes that are worth looking at need about so many


# launch.py train --block, --cut: one part of a training in blocks, as a command of its own.


def run_cut(options: Options) -> int:
    """Cuts the coarse run at --cut into the folder --out.  Raises UsageError, BadFile."""
    from shapeshift.app.progress import progress_bar
    from shapeshift.app.training.saving import check_writable
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.package.read_package import read_package
    from shapeshift.training.blocks.starts import Coarse, CutRules, make_starts
    from shapeshift.training.calibration.extrinsics import with_extrinsics
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint

    assert options.cut is not None, "asked for"
    check_writable(options.out)
    state, notes = read_checkpoint(checkpoint_path(options.cut))
    coarse = Coarse(read_package(options.cut), state, notes)
    rules = CutRules(wanted_of(options.blocks), options.block_photos, most_anchors(options))
    capture = open_capture(options.capture, options.memory)
    capture = with_extrinsics(capture, notes["settings"]["rig"])
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with progress_bar() as bar:
        task = bar.add_task("looking which photos show which block", total=len(capture.photos))

        def report(done: int, count: int) -> None:
            bar.update(task, completed=done)

        found = make_starts(
            open_device(options.device), capture, coarse, rules, options.out, report
        )
    say(f"{full(options.out)}: {len(found.blocks)} blocks")
    return 0


def run_block(options: Options) -> int:
    """Trains the block that begins with the file at --block.  Raises UsageError, BadFile."""
    from shapeshift.app.progress import working
    from shapeshift.app.training.saving import (
        check_writable,
        memory_for_training,
        room_of,
        save,
        save_checkpoint,
        saved_when_it_fails,
    )
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.package.write_package import refuse_foreign
    from shapeshift.training.blocks.block_start import BlockStart, begin_block
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint

    assert options.block is not None, "asked for"
    check_writable(options.out)
    refuse_foreign(options.out)
    start, checkpoint = BlockStart.read(options.block), checkpoint_path(options.out)
    resume = read_checkpoint(checkpoint) if options.resume else None
    settings = settings_of_block(options, start, resume)
    capture = open_capture(options.capture, options.memory)
    device = open_device(options.device)
    say(f"{device.name}, {device.platform}")
    with memory_for_training(), working(READING):
        room = room_of(options.out, options.photo_mb)
        trainer = begin_block(device, start, capture, settings, resume, room)
    say(describe(trainer))
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with saved_when_it_fails(trainer, options.out, checkpoint):
        interrupted = train(trainer, partial(save_checkpoint, trainer, checkpoint))
    save(trainer, options.out, checkpoint)
    state = "interrupted, --resume goes on" if interrupted else "done"
    psnr = decibels(trainer.held_out_psnr(most=len(trainer.held_out)))
    where = f"; held-out photos where they show it: {psnr}" if psnr else ""
    inside = int(trainer.inside(device.download(trainer.adam["anchors"])).sum())
    say(
        f"{full(options.out)}: {state} after {trainer.iteration} steps, {inside:,} anchors of "
        f"{trainer.anchors_count:,} are the block's{where}"
    )
    trainer.photos.close(keep=interrupted)
    return INTERRUPTED if interrupted else 0


def settings_of_block(
    options: Options, start: "BlockStart", resume: tuple | None
) -> "TrainSettings":
    """Those of the coarse run, or of the block's checkpoint, with a budget of its own."""
    from shapeshift.training.settings import TrainSettings, adjusted, resumed

    for name in options.asked:
        if name not in OF_BLOCKS:
            raise UsageError(
                f"{as_given(name)}: a block has the settings of its coarse run; leave it out."
            )
    try:
        if resume is not None:
            return resumed(TrainSettings(), resume[1]["settings"], options.asked, "--")
        usual = {"iterations": TrainSettings().iterations}
        return adjusted(TrainSettings(**start.notes["settings"]), usual | options.asked)
    except ValueError as error:
        raise as_typed(error, TrainSettings) from None


def run(options: Options) -> int:
    options = with_settings(options)
    check_calibrate(options)
    in_blocks = part_in_blocks(options)
    return in_blocks(options) if in_blocks is not None else run_whole(options)


def run_whole(options: Options) -> int:
    """One run of all photos."""
    from shapeshift.app.pace import pace_package
    from shapeshift.app.progress import working
    from shapeshift.app.training.saving import (
        check_writable,
        memory_for_training,
        room_of,
        save,
        save_checkpoint,
        saved_when_it_fails,
    )
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.package.write_package import refuse_foreign
    from shapeshift.training.calibration.extrinsics import with_extrinsics
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint
    from shapeshift.training.settings import suited
    from shapeshift.training.train import Trainer

    room = room_of(options.out, options.photo_mb)
    if options.model == "splats" or options.separate:
        from shapeshift.app.training.train_baselines import run_baseline

        return run_baseline(options, replace(room, folder=None))
    check_plain_options(options)
    check_writable(options.out)  # now, not after the training
    refuse_foreign(options.out)
    checkpoint = checkpoint_path(options.out)
    resume = read_checkpoint(checkpoint) if options.resume else None
    settings = settings_of(options.asked, resume[1]["settings"] if resume else None)
    capture = open_capture(options.capture, options.memory)
    print_files(capture.files)
    if resume is None:
        settings = suited(settings, options.asked, capture)
    device = open_device(options.device)
    say(f"{device.name}, {device.platform}")
    if options.calibrate is not None:
        settings = calibrated(device, capture, settings, options.calibrate)
    with memory_for_training(), working(READING) as shown:
        given = with_extrinsics(capture, settings.rig)
        trainer = Trainer(device, given, settings, resume, report=shown, room=room)
    say(describe(trainer), *trainer.warnings)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    began, before = time.monotonic(), trainer.iteration
    with saved_when_it_fails(trainer, options.out, checkpoint):
        interrupted = train(trainer, partial(save_checkpoint, trainer, checkpoint))
    step_s = seconds_a_step(trainer, before, time.monotonic() - began)
    save(trainer, options.out, checkpoint)
    if not interrupted:
        pace_package(options.out, capture.formulas)
    more = [*refined(trainer, options.out), *trainer.exposures.warnings()]
    say(summary(trainer, options.out, interrupted), *more)
    lines, ended = what_next(options, trainer.iteration, step_s, interrupted), False
    if not interrupted:
        found, ended = doubts(trainer)
        lines = [*found, *lines]
    if lines:
        say(*lines)
    trainer.photos.close(keep=interrupted)
    return INTERRUPTED if interrupted or ended else 0


def part_in_blocks(options: Options) -> Callable[[Options], int] | None:
    """What runs in the place of a run of the whole.  Raises UsageError."""

    if options.block is not None and options.cut is not None:
        raise UsageError("--block and --cut are two parts of --blocks; give one of them.")
    if options.block is not None or options.cut is not None:
        return run_cut if options.cut is not None else run_block
    if options.blocks.strip() != "1":
        from shapeshift.app.training.train_in_blocks import run_blocks

        return run_blocks
    if options.coarse_iterations is not None:
        raise UsageError("--coarse-iterations is of --blocks; add --blocks, or leave it out.")
    if not options.block_photos >= 0:
        raise UsageError(f"--block-photos is {options.block_photos}; it has to be at least 0.")
    check_gpus(NONE, options.gpus)
    if options.cluster != NONE:
        raise UsageError("--cluster shares out blocks; add --blocks, or leave it out.")
    return None


def check_calibrate(options: Options) -> None:
    """Raises UsageError where --calibrate would do nothing, or could not be kept."""

    if options.calibrate is None:
        return
    if options.model == "splats":
        raise UsageError(
            "--calibrate: PLY files of plain splats cannot keep the offset that eval needs; leave "
            "it out with --model splats."
        )
    if options.resume:
        raise UsageError("--resume goes on with the checkpoint's offset; leave out --calibrate.")


def check_plain_options(options: Options) -> None:
    """Raises UsageError for what only plain splats have."""

    for name in options.splats:
        raise UsageError(f"{name} is of plain splats; add --model splats, or leave it out.")


def doubts(trainer: "Trainer") -> tuple[list[str], bool]:
    """What the photos say against a finished scene, and whether Ctrl-C ended the look at them."""
    from shapeshift.app.progress import tracked
    from shapeshift.training.calibration.outlier_views import (
        failed_modalities,
        find_outlier_views,
        report,
    )

    try:
        if lost := failed_modalities(trainer):
            return lost, False
        look = partial(tracked, what="looking for photos that do not fit")
        return report(find_outlier_views(trainer, look)), False
    except KeyboardInterrupt:
        return ["The scene is complete; not every photo was looked at for what does not fit."], True


def seconds_a_step(trainer: "Trainer", before: int, waited_s: float) -> float:
    """By the clock of this run, which began after `before` steps.  Where a checkpoint was at its
    end already, those of the runs before: of a core, the clock's are not kept.
    """
    done = trainer.iteration - before
    return waited_s / done if done > 0 else trainer.elapsed / max(trainer.iteration, 1)


def what_next(options: Options, steps: int, step_s: float, interrupted: bool) -> list[str]:
    """The last lines: how to train on where that was little, and how to look at the scene.

    step_s: by the clock, which is what a person waits.
    """
    if is_task():
        return []
    again = [program(), "train", shlex.quote(full(options.capture))]
    out = shlex.quote(full(options.out))
    again += ["--out", out, "--resume"]
    usual, lines = USUAL_STEPS, []
    if interrupted:
        lines = [f"go on: {' '.join(again)}"]
    elif steps < FEW_STEPS:
        more = step_s * (usual - steps)
        took = f"{more / 60:.0f} minutes" if more >= 90 else f"{more:.0f} seconds"
        lines = [
            f"{steps} steps are few: {usual:,} are usual, about {took} more on this machine. "
            f"Go on: {' '.join(again)} --iterations {usual}"
        ]
    return [*lines, f"look: {program()} {out}"]


def refined(trainer: "Trainer", out: Path) -> list[str]:
    """How far cameras were moved, where their poses were refined."""
    from shapeshift.app.training.saving import cameras_path

    if not trainer.poses.photos:
        return []
    turn_deg, shift_m = trainer.poses.moves()
    return [
        f"poses: cameras stand {turn_deg:.2f} degrees and {shift_m:.4f} m beside the stated ones "
        f"(median); {full(cameras_path(out))} has them"
    ]


def summary(trainer: "Trainer", out: Path, interrupted: bool) -> str:
    psnr = decibels(trainer.held_out_psnr(most=len(trainer.held_out)))
    quality = f"held-out photos: {psnr}" if psnr else "no photo was held out"
    state = "interrupted, --resume goes on" if interrupted else "done"
    return (
        f"{full(out)}: {state} after {trainer.iteration} steps in {used(trainer)}, "
        f"{trainer.anchors_count:,} anchors; {quality}"
    )
