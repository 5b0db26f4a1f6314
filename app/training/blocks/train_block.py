"""launch.py train --block, --cut: one part of a training in blocks, as a command of its own."""

from functools import partial
from typing import TYPE_CHECKING

from shapeshift.app.errors import UsageError, as_typed
from shapeshift.app.opening import open_capture
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.app.training.blocks.train_in_blocks import OF_BLOCKS, most_anchors, wanted_of
from shapeshift.app.training.run_loop import INTERRUPTED, READING, decibels, describe, train
from shapeshift.app.training.train_options import Options, as_given

if TYPE_CHECKING:
    from shapeshift.training.blocks.block_start import BlockStart
    from shapeshift.training.settings import TrainSettings


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
    from shapeshift.training.blocks.begin_block import begin_block
    from shapeshift.training.blocks.block_start import BlockStart
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
