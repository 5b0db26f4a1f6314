"""How every training runs: its offset and words before, its loop with progress and Ctrl-C."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from shapeshift.app.interrupts import answered, leave_terminal
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.training.baselines.plain import PlainTrainer
    from shapeshift.training.settings import TrainSettings
    from shapeshift.training.train import Trainer

INTERRUPTED = 130  # exit code
FIRST_SAVE_S, SAVE_EVERY_S = 10.0, 60.0  # until the first checkpoint, and between those later
READING = "reading photos, finding the first points"
LOOKS = 10  # at held-out photos in a run


def calibrated(
    device, capture: "Capture", settings: "TrainSettings", modality: str
) -> "TrainSettings":
    """The settings with the offset of a modality's cameras, which is looked for now."""
    from shapeshift.app.progress import progress_bar
    from shapeshift.training.calibration.calibrate import calibrate, still_warning
    from shapeshift.training.calibration.extrinsics import rig_json

    if doubt := still_warning(capture, settings, modality):
        say(doubt)  # before minutes of work, which end far away
    say(f"looking for the offset of the cameras of {modality} ...")
    with progress_bar() as bar:
        task = bar.add_task("compiling kernels", total=1.0)

        def report(what: str, done: float) -> None:
            bar.update(task, description=what, completed=done)

        found = calibrate(device, capture, settings, modality, report=report)
    say(
        f"{modality}: cameras sit {found.turn_deg:.2f} degrees and {found.shift_m:.4f} m beside "
        "their stated poses, each in its own axes; its photos fit "
        f"{found.gain_db:.1f} dB better so.  Trained with that."
    )
    return replace(settings, rig=rig_json(modality, found))


def describe(trainer: "Trainer") -> str:
    photos = trainer.schedule.photos
    size = next(iter(photos.values()))[0].view.size
    each = ", ".join(f"{len(found)} x {name}" for name, found in photos.items())
    smaller = f", made {trainer.factor} times smaller" if trainer.factor > 1 else ""
    return (
        f"{each} of {size[0]}x{size[1]} pixels{smaller}; {len(trainer.held_out)} held out; "
        f"{trainer.anchors_count:,} anchors from {trainer.origin}, "
        f"{trainer.voxel:.4g} m apart, {trainer.layout.splats} splats each"
    )


@contextmanager
def interrupts() -> Iterator[list]:
    """A list that a first Ctrl-C, SIGTERM or SIGHUP puts something into; a second one interrupts as
    usual.
    """
    asked: list = []

    def note(signum, frame) -> None:
        leave_terminal(signum)
        if asked:
            raise KeyboardInterrupt
        asked.append(signum)
        say("Stopping; the work is kept.  Ctrl-C again to stop at once.")

    with answered(note):
        yield asked


def train(
    trainer: "Trainer | PlainTrainer", save_checkpoint: Callable[[], str] | None = None
) -> bool:
    """The run with its progress on standard error; True when Ctrl-C ended it early.

    save_checkpoint: called after FIRST_SAVE_S and then every SAVE_EVERY_S seconds; returns why
    nothing was written, or "".
    """
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    from shapeshift.app.progress import progress_bar

    columns = ("{task.description}", "{task.fields[psnr]}", "{task.fields[loss]}")
    look, save_at_s, troubled = 1 / LOOKS, time.monotonic() + FIRST_SAVE_S, False
    most = "" if trainer.settings.seconds is None else f" of {trainer.settings.seconds:g}"
    with (
        interrupts() as asked,
        progress_bar(
            BarColumn(24), *map(TextColumn, columns), TimeElapsedColumn(), transient=False
        ) as bar,
    ):  # fmt: skip
        task = bar.add_task("compiling kernels", total=1.0, psnr="", loss="")
        for now in trainer.steps():
            text = f"{now.iteration} steps, {now.elapsed:.0f}{most} {time_unit(trainer.device)}, "
            text += f"{now.anchors:,} {trainer.primitive}"
            bar.update(task, completed=min(now.fraction, 1.0), description=text)
            if now.loss is not None:
                bar.update(task, loss=f"loss {now.loss:.4f}")
            if now.rolled_back:
                bar.console.print(
                    f"step {now.iteration}: the picture was lost; back to the last good state "
                    "with half the learning rates",
                    soft_wrap=True,
                )
            if trainer.photos.trouble and not troubled:
                troubled = True
                bar.console.print(trainer.photos.trouble, soft_wrap=True)
            if now.fraction >= look and trainer.settled:
                look += 1 / LOOKS
                bar.update(task, psnr=decibels(trainer.held_out_psnr()))
            if save_checkpoint is not None and time.monotonic() >= save_at_s:
                if failed := save_checkpoint():
                    bar.console.print(failed, soft_wrap=True)
                save_at_s = time.monotonic() + SAVE_EVERY_S
            if asked and trainer.settled:
                return True
    return False


def used(trainer: "Trainer | PlainTrainer") -> str:
    """What a run has used, in words: its budget, what of it the start took, and what is besides."""
    unit = time_unit(trainer.device)
    return (
        f"{trainer.seconds:.1f} {unit} (start {trainer.start_s:.1f}, training "
        f"{trainer.elapsed:.1f}; besides them reading photos {trainer.photos.read_s:.1f})"
    )


def time_unit(device) -> str:
    """What the seconds of training are: see training.run.clock_of."""
    return "core s" if device.kind == "cpu" else "s"


def decibels(psnr: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.2f} dB" for name, value in psnr.items())
