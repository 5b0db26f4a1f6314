"""launch.py train: posed photos of one or several modalities to a scene."""

import shlex
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import EXPERT, MODALITY, POSITIONAL, Opt
from shapeshift.app.opening import open_capture
from shapeshift.app.paths import full
from shapeshift.app.program import program
from shapeshift.app.terminal import say
from shapeshift.app.training.train_options import (
    ModelOptions,
    PhotoOptions,
    SizeOptions,
    preset_defaults,
    settings_of,
)

if TYPE_CHECKING:
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.training.baselines.plain import PlainTrainer
    from shapeshift.training.settings import TrainSettings
    from shapeshift.training.train import Trainer

INTERRUPTED = 130  # exit code
SAVE_EVERY = 60.0  # seconds between checkpoints
LOOKS = 10  # at held-out photos in a run
FEW_STEPS = 1000  # half of what is usual: scenes that are worth looking at need about so many


@dataclass(frozen=True)
class RunOptions:
    """The run: of what, into what, how long, and how the anchors grow."""

    capture: Annotated[Path, POSITIONAL]
    """A folder of posed photos: COLMAP, transforms.json or cameras.json (docs/capture.md)."""
    out: Path
    """The package to write: NAME.shift or a folder.  NAME.checkpoint.npz is written beside it."""
    seconds: float | None = None
    """Train for so many seconds of one core: processor time of all threads, so that nothing else
    that runs takes from it, and two cores take half as long.  On a GPU, seconds by the clock.
    Loading, compiling and looking at held-out photos do not count.  Learning rates follow it."""
    iterations: int | None = None
    """Train for this many steps; the same number gives the same bits."""
    preset: Literal["fast", "paper"] = "fast"
    """fast: minutes on a CPU.  paper: the numbers of the paper."""
    resume: bool = False
    """Continue from the checkpoint with its settings; --iterations or --seconds may be larger."""
    max_mb: float | None = None
    """Most megabytes of the package on disk, from the start on."""
    points: Annotated[str | None, Opt(metavar="WHERE")] = None
    """Where the first anchors stand: capture (COLMAP's points or the capture's own), depth (its
    depth photos), hull (of masks or a known background), random, or a point cloud in the capture's
    world (PLY, LAS, LAZ, NPZ).  auto: the first of these that there is."""
    model: Annotated[Literal["anchors", "splats"], EXPERT] = "anchors"
    """splats: plain 3DGS splats, one set for each modality, to compare with; --out is a folder of
    PLY files, and the modalities share the budget."""
    separate: Annotated[bool, EXPERT] = False
    """Train one anchor model for each modality, to compare with; --out is a folder of packages, and
    the modalities share the budget."""
    sh_degree: Annotated[int | None, EXPERT] = None
    """Degree of the spherical harmonics of plain splats, 0 to 3."""
    splats: Annotated[int | None, EXPERT] = None
    """Most plain splats that a modality starts with."""
    max_splats: Annotated[int | None, EXPERT] = None
    """Most plain splats that growing may reach, for each modality."""
    seed: Annotated[int | None, EXPERT] = None
    """Seed of all random numbers."""
    grow: Annotated[bool | None, EXPERT] = None
    """Add anchors and move the least useful ones to where pictures need them, up to 80 % of the
    run; --no-grow: keep the first ones."""


@dataclass(frozen=True, kw_only=True)
class LossOptions:
    """What the loss consists of, how fast is learned, and how x is encoded."""

    ssim_share: Annotated[float | None, EXPERT] = None
    """Share of D-SSIM in the image loss: lambda in (1 - lambda) L1 + lambda D-SSIM.  Equation 8 of
    the paper, read literally, has 0.8."""
    opacity_share: Annotated[float | None, EXPERT] = None
    """Weight of the opacity loss, lambda_alpha in equation 9."""
    scale_share: Annotated[float | None, EXPERT] = None
    """Weight of the scale loss, lambda_S in equation 9."""
    depth_share: Annotated[float | None, EXPERT] = None
    """Weight of the depth loss where photos have depth photos; 0: those are not used."""
    rate_scale: Annotated[float | None, EXPERT] = None
    """Factor on every learning rate."""
    rise: Annotated[int | None, EXPERT] = None
    """Steps of learning-rate warm-up for the networks, for scenes of which all splats would vanish
    at once."""
    revive: Annotated[float | None, EXPERT] = None
    """Weight of a loss that keeps absent splats from staying absent; 0: none."""
    control: Annotated[int | None, EXPERT] = None
    """Numbers of the control encoding; the last one stands for x = 1."""
    sigma: Annotated[float | None, EXPERT] = None
    """Width in x of each number of the control encoding; with wide ones, what lies between two
    stops learns from both."""
    encoding: Annotated[Literal["even", "stops"] | None, EXPERT] = None
    """stops: --control and --sigma follow from the capture, one number for each stop, half as wide
    as stops are apart.  even: as --control and --sigma say."""
    between: Annotated[Literal["none", "photos", "pictures", "shapes", "splats"] | None, EXPERT] = (
        None
    )
    """How x between two stops is learned: photos, from blends of photos taken from one place;
    pictures, from blends of the model's own pictures; shapes, from photos on shapes that are on
    their way to the next stop; splats, by keeping splats on the straight way between the stops."""
    between_share: Annotated[float | None, EXPERT] = None
    """Share of the steps, 0 to 1, in which x lies between two stops."""
    between_pull: Annotated[float | None, EXPERT] = None
    """Weight of the loss of --between splats."""
    thermal_smooth: Annotated[float | None, EXPERT] = None
    """Weight of the smoothness loss of thermal pictures; ThermalGaussian uses 0.6."""
    balance: Annotated[str | None, EXPERT] = None
    """Steps of each modality in proportion to the others', as RGB=3,Thermal=1."""


@dataclass(frozen=True, kw_only=True)
class PictureOptions:
    """Which photos, of what size and seen from where."""

    calibrate: Annotated[str | None, MODALITY] = None
    """A modality whose cameras all sit a little beside their stated poses, as on a rig: that turn
    and shift is found first, from the photos.  `eval` reads it from the package.  Default: none."""
    coarse: Annotated[int | None, EXPERT] = None
    """Start with photos of 1/2, 1/4 or 1/8 of the sides; the larger sizes follow step by step."""
    coarse_until: Annotated[float | None, EXPERT] = None
    """Share of the run, 0 to 1, after which the photos have all their pixels."""


@dataclass(frozen=True)
class Options(PhotoOptions, PictureOptions, SizeOptions, LossOptions, ModelOptions, RunOptions):
    """Train a shape-shifting scene.

    A first run needs only --out; options that are left out take the numbers of --preset.
    """


def defaults() -> dict[str, str]:
    """What --help says of options that are left to the preset."""
    return preset_defaults()


def run(options: Options) -> int:
    from shapeshift.app.pace import pace_package
    from shapeshift.app.progress import working
    from shapeshift.app.training.keeping import (
        kept_when_memory_ends,
        memory_for_training,
        refuse_place,
        save,
    )
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.package.write_package import refuse_foreign
    from shapeshift.training.calibration.extrinsics import with_found
    from shapeshift.training.calibration.outlier_views import hopeless, report, suspects
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint
    from shapeshift.training.train import Trainer

    refuse_calibrating(options)
    if options.model == "splats" or options.separate:
        from shapeshift.app.training.train_baselines import run_baseline

        return run_baseline(options)
    refuse_plain_options(options)
    refuse_place(options.out)  # now, not after the training
    refuse_foreign(options.out)
    checkpoint = checkpoint_path(options.out)
    resume = read_checkpoint(checkpoint) if options.resume else None
    settings = settings_of(options, resume[1]["settings"] if resume else None)
    capture = open_capture(options.capture, options.memory)
    device = open_device(options.device)
    say(f"{device.name}, {device.platform}")
    if options.calibrate is not None:
        settings = calibrated(device, capture, settings, options.calibrate)
    with memory_for_training(), working("reading photos, finding the first anchors"):
        trainer = Trainer(device, with_found(capture, settings.rig), settings, resume)
    say(describe(trainer), *trainer.doubts)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    began, before = time.monotonic(), trainer.iteration
    with kept_when_memory_ends(trainer, options.out, checkpoint):
        interrupted = train(trainer, checkpoint)
    step_s = (time.monotonic() - began) / max(trainer.iteration - before, 1)
    save(trainer, options.out, checkpoint)
    if not interrupted:
        pace_package(options.out)
    say(summary(trainer, options.out, interrupted), *trainer.exposures.remarks())
    if not interrupted and (found := hopeless(trainer) or report(suspects(trainer))):
        say(*found)
    for line in what_next(options, trainer.iteration, step_s, interrupted):
        say(line)
    return INTERRUPTED if interrupted else 0


def refuse_calibrating(options: Options) -> None:
    """Raises UsageError where --calibrate would do nothing, or could not be kept."""
    from shapeshift.app.errors import UsageError

    if options.calibrate is None:
        return
    if options.model == "splats":
        raise UsageError(
            "--calibrate: PLY files of plain splats cannot keep the offset that eval needs; leave "
            "it out with --model splats."
        )
    if options.resume:
        raise UsageError("--resume goes on with the checkpoint's offset; leave out --calibrate.")


def calibrated(
    device, capture: "Capture", settings: "TrainSettings", modality: str
) -> "TrainSettings":
    """The settings with the offset of a modality's cameras, which is looked for now."""
    from shapeshift.app.progress import progress_bar
    from shapeshift.training.calibration.calibrate import calibrate
    from shapeshift.training.calibration.extrinsics import noted

    say(f"looking for the offset of the cameras of {modality} ...")
    with progress_bar() as bar:
        task = bar.add_task("compiling kernels", total=1.0)

        def tell(what: str, done: float) -> None:
            bar.update(task, description=what, completed=done)

        found = calibrate(device, capture, settings, modality, tell=tell)
    say(
        f"{modality}: cameras sit {found.turn_deg:.2f} degrees and {found.shift_m:.4f} m beside "
        "their stated poses, each in its own axes; its photos fit "
        f"{found.gain_db:.1f} dB better so.  Trained with that."
    )
    return replace(settings, rig=noted(modality, found))


def refuse_plain_options(options: Options) -> None:
    """Raises UsageError for what only plain splats have."""
    from shapeshift.app.errors import UsageError

    for name in ("sh_degree", "splats", "max_splats"):
        if getattr(options, name) is not None:
            option = f"--{name.replace('_', '-')}"
            raise UsageError(f"{option} is of plain splats; add --model splats, or leave it out.")


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
    """A list that a first Ctrl-C puts something into; a second one interrupts as usual."""
    asked: list = []

    def note(signum, frame) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.append(signum)
        say("Stopping; the work is kept.  Ctrl-C again to stop at once.")

    before = signal.signal(signal.SIGINT, note)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)


def train(trainer: "Trainer | PlainTrainer", checkpoint: Path | None) -> bool:
    """The run with its progress on standard error; True when Ctrl-C ended it early.

    checkpoint: written to every SAVE_EVERY seconds; None: never.
    """
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    from shapeshift.app.progress import progress_bar
    from shapeshift.app.training.keeping import save_on_the_way

    columns = ("{task.description}", "{task.fields[psnr]}", "{task.fields[loss]}")
    look, saved = 1 / LOOKS, time.monotonic()
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
            text += f"{now.anchors:,} {trainer.unit}"
            bar.update(task, completed=min(now.fraction, 1.0), description=text)
            if now.loss is not None:
                bar.update(task, loss=f"loss {now.loss:.4f}")
            if now.fell_back:
                bar.console.print(
                    f"step {now.iteration}: the picture was lost; back to the last good state "
                    "with half the learning rates",
                    soft_wrap=True,
                )
            if now.fraction >= look and trainer.settled:
                look += 1 / LOOKS
                bar.update(task, psnr=decibels(trainer.held_out_psnr()))
            if checkpoint is not None and time.monotonic() - saved > SAVE_EVERY:
                if failed := save_on_the_way(trainer, checkpoint):
                    bar.console.print(failed, soft_wrap=True)
                saved = time.monotonic()
            if asked and trainer.settled:
                return True
    return False


def what_next(options: Options, steps: int, step_s: float, interrupted: bool) -> list[str]:
    """The last lines: how to train on where that was little, and how to look at the scene.

    step_s: by the clock, which is what a person waits.
    """
    from shapeshift.training.settings import preset

    again = [program(), "train", shlex.quote(full(options.capture))]
    out = shlex.quote(full(options.out))
    again += ["--out", out, "--resume"]
    usual, lines = preset(options.preset).iterations, []
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


def time_unit(device) -> str:
    """What the seconds of training are: see training.run.clock_of."""
    return "core s" if device.kind == "cpu" else "s"


def decibels(psnr: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.2f} dB" for name, value in psnr.items())


def summary(trainer: "Trainer", out: Path, interrupted: bool) -> str:
    psnr = decibels(trainer.held_out_psnr(most=len(trainer.held_out)))
    quality = f"held-out photos: {psnr}" if psnr else "no photo was held out"
    state = "interrupted, --resume goes on" if interrupted else "done"
    return (
        f"{full(out)}: {state} after {trainer.iteration} steps in "
        f"{trainer.elapsed:.1f} {time_unit(trainer.device)}, "
        f"{trainer.anchors_count:,} anchors; {quality}"
    )
