"""launch.py train: posed photos of one or several modalities to a scene."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from app.terminal import say
from app.training.train_options import ModelOptions, PhotoOptions, SizeOptions, settings_of

if TYPE_CHECKING:
    from scene.capture import Capture
    from training.plain import PlainTrainer
    from training.settings import TrainSettings
    from training.train import Trainer

INTERRUPTED = 130  # exit code
SAVE_EVERY = 60.0  # seconds between checkpoints
LOOKS = 10  # at held-out photos in a run


@dataclass(frozen=True)
class RunOptions:
    """The run: of what, into what, how long, and how the anchors grow."""

    capture: Annotated[Path, tyro.conf.Positional]
    """A folder of posed photos: COLMAP, transforms.json or cameras.json."""
    out: Path
    """The package to write: NAME.shift or a folder.  NAME.checkpoint.npz comes to lie beside it."""
    seconds: float | None = None
    """Train for so long; the learning rates follow the time."""
    iterations: int | None = None
    """Train so many steps: the same bits on every run.  fast: 2000, paper: 30000."""
    model: Literal["anchors", "splats"] = "anchors"
    """splats: plain 3DGS splats, a set a modality, to compare with; --out is a folder of PLY files.
    The modalities share the budget."""
    separate: bool = False
    """One anchor model a modality, to compare with; --out is a folder of packages.  Each takes its
    share of the budget."""
    sh_degree: int | None = None
    """Of plain splats' colours: 0 to 3.  Default: 3."""
    splats: int | None = None
    """How many plain splats a modality starts with at most."""
    max_splats: int | None = None
    """Cap of growing plain splats, a modality."""
    preset: Literal["fast", "paper"] = "fast"
    """fast: minutes on a CPU.  paper: the numbers of the paper."""
    resume: bool = False
    """Go on from the checkpoint and its settings; --iterations or --seconds may be longer."""
    seed: int | None = None
    """Of everything random."""
    grow: bool | None = None
    """Add and remove anchors between 10 % and 60 % of the run."""
    max_anchors: int | None = None
    """Cap of growing."""
    max_mb: float | None = None
    """The same in megabytes of the package on disk; the start keeps within it, too."""
    growth: Literal["gradient", "absgrad", "error"] | None = None
    """What draws new anchors: the gradient by a splat's place on screen, that of every pixel
    without its sign, or the splat's share of the picture's error."""
    grow_threshold: float | None = None
    """Of what draws them: smaller grows more.  gradient: 2e-4, absgrad: 6e-4, error: 1.2 times the
    mean share."""
    grow_grids: int | None = None
    """Grids that new anchors fill: 1 a voxel, 2 also half a voxel, 3 also a quarter."""
    grow_each: bool | None = None
    """Grow at each modality by what its own photos say, not by the mean over all."""
    grow_replace: float | None = None
    """When the cap is reached, so many of all anchors at most make room: those that show least."""
    prune_opacity: float | None = None
    """An anchor whose splats have a smaller mean opacity goes."""
    prune_weight: float | None = None
    """An anchor that gives less to its pictures of every modality goes; pixels, for example 0.1."""
    prune_views: float | None = None
    """An anchor that is in a smaller share of all pictures goes, for example 0.01."""
    points: str | None = None
    """Where the first anchors stand: capture (COLMAP's points or the capture's own), depth (its
    depth photos), hull (of masks or a known background), random, or a cloud: PLY, LAS, LAZ, NPZ in
    the capture's world.  auto: the first of these that there is."""


@dataclass(frozen=True, kw_only=True)
class LossOptions:
    """What the training pulls at, how fast, and what it sees of the slider."""

    ssim_share: float | None = None
    """lambda: (1 - lambda) L1 + lambda D-SSIM.  Equation 8 read literally has 0.8."""
    opacity_share: float | None = None
    """lambda_alpha of equation 9."""
    scale_share: float | None = None
    """lambda_S of equation 9."""
    depth_share: float | None = None
    """Weight of the depth loss where photos have depth photos; 0: they are not used."""
    rate_scale: float | None = None
    """Times every learning rate."""
    rise: int | None = None
    """Steps over which the networks' rates rise, for scenes of which all would vanish at once."""
    revive: float | None = None
    """Weight of a pull on splats that are absent; 0: none. Default: 0.05."""
    control: int | None = None
    """Numbers of the control encoding; the last one stands for x = 1."""
    sigma: float | None = None
    """Width of each in x: wide ones let what lies between two stops learn from both."""
    encoding: Literal["even", "stops"] | None = None
    """stops: --control and --sigma by the capture: a number a stop, half as wide as stops lie
    apart, so that what lies between two stops learns from both."""
    between: Literal["none", "photos", "pictures", "splats"] | None = None
    """How x between two stops is learned: from blends of photos taken from one place, from blends
    of the model's own pictures, or by keeping splats on the straight way between the stops."""
    between_share: float | None = None
    """Of the steps, in which x lies between two stops."""
    between_pull: float | None = None
    """Weight of the pull of --between splats."""
    thermal_smooth: float | None = None
    """Weight of the roughness of thermal pictures, for example 0.6 (ThermalGaussian)."""
    balance: str | None = None
    """Steps of each modality beside the others', as RGB=3,Thermal=1.  Default: as many of each."""


@dataclass(frozen=True, kw_only=True)
class PictureOptions:
    """Which photos, of what size and seen from where."""

    coarse: int | None = None
    """Start with photos of 1/2, 1/4 or 1/8 of the sides; the next size comes step by step."""
    coarse_until: float | None = None
    """Share of the run after which the photos have all their pixels, 0 to 1."""
    calibrate: str | None = None
    """A modality whose cameras all sit a little beside their stated poses, as on a rig: that turn
    and shift is found first, from the photos.  `eval` knows it from the package."""


@dataclass(frozen=True)
class Options(PhotoOptions, PictureOptions, SizeOptions, LossOptions, ModelOptions, RunOptions):
    """Train a shape-shifting scene.  Where nothing is said, the preset decides."""


def run(options: Options) -> int:
    from app.training.keeping import kept_when_memory_ends, memory_for_training, refuse_place, save
    from rasterizer.device import open_device
    from runtime_models.write_package import refuse_foreign
    from scene.read_capture import read_capture
    from training.checkpoint import checkpoint_path, read_checkpoint
    from training.rig import with_found
    from training.suspects import hopeless, report, suspects
    from training.train import Trainer

    refuse_calibrating(options)
    if options.model == "splats" or options.separate:
        from app.training.train_baselines import run_baseline

        return run_baseline(options)
    refuse_plain_options(options)
    refuse_place(options.out)  # now, not after the training
    refuse_foreign(options.out)
    checkpoint = checkpoint_path(options.out)
    resume = read_checkpoint(checkpoint) if options.resume else None
    settings = settings_of(options, resume[1]["settings"] if resume else None)
    capture = read_capture(options.capture)
    device = open_device(options.device)
    say(f"{device.name}, {device.platform}")
    if options.calibrate is not None:
        settings = calibrated(device, capture, settings, options.calibrate)
    with memory_for_training():
        trainer = Trainer(device, with_found(capture, settings.rig), settings, resume)
    say(describe(trainer), *trainer.doubts)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with kept_when_memory_ends(trainer, options.out, checkpoint):
        interrupted = train(trainer, checkpoint)
    save(trainer, options.out, checkpoint)
    say(summary(trainer, options.out, interrupted))
    if not interrupted and (found := hopeless(trainer) or report(suspects(trainer))):
        say(found)
    return INTERRUPTED if interrupted else 0


def refuse_calibrating(options: Options) -> None:
    """Raises UsageError where --calibrate would do nothing, or could not be kept."""
    from app.errors import UsageError

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
    from app.progress import progress_bar
    from training.rig import noted
    from training.rig_search import calibrate

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
    from app.errors import UsageError

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

    from app.progress import progress_bar
    from app.training.keeping import save_on_the_way

    columns = ("{task.description}", "{task.fields[psnr]}", "{task.fields[loss]}")
    look, saved = 1 / LOOKS, time.monotonic()
    with (
        interrupts() as asked,
        progress_bar(
            BarColumn(24), *map(TextColumn, columns), TimeElapsedColumn(), transient=False
        ) as bar,
    ):  # fmt: skip
        task = bar.add_task("compiling kernels", total=1.0, psnr="", loss="")
        for now in trainer.steps():
            text = f"{now.iteration} steps, {now.anchors:,} {trainer.unit}"
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


def decibels(psnr: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.2f} dB" for name, value in psnr.items())


def summary(trainer: "Trainer", out: Path, interrupted: bool) -> str:
    psnr = decibels(trainer.held_out_psnr(most=len(trainer.held_out)))
    quality = f"held-out photos: {psnr}" if psnr else "no photo was held out"
    state = "interrupted, --resume goes on" if interrupted else "done"
    return (
        f"{out}: {state} after {trainer.iteration} steps in {trainer.elapsed:.1f} s, "
        f"{trainer.anchors_count:,} anchors; {quality}"
    )
