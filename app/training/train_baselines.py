"""train --model splats and --separate: what a shape-shifting model is compared with."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from shapeshift.app.errors import UsageError, as_typed
from shapeshift.app.inspection.capture_facts import print_files
from shapeshift.app.opening import open_capture
from shapeshift.app.paths import full
from shapeshift.app.progress import working
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
from shapeshift.app.training.train_options import Asked, Options, as_given, settings_of

if TYPE_CHECKING:
    import numpy as np

    from shapeshift.scene.captures.capture import Capture
    from shapeshift.training.baselines.plain import PlainTrainer
    from shapeshift.training.baselines.plain_settings import PlainSettings
    from shapeshift.training.photo_store.open_photos import PhotoRoom
    from shapeshift.training.settings import TrainSettings
    from shapeshift.training.train import Trainer

    Kind = TypeVar("Kind", TrainSettings, PlainSettings)
    Checkpoint = tuple[dict[str, np.ndarray], dict]


@dataclass(frozen=True)
class TrainedFile:
    """What the training of one model left behind."""

    file: Path
    seconds: float  # what the run used of its budget
    steps: int
    start_s: float = 0.0  # of these, before the first step


def trained_file(file: Path, trainer: "Trainer | PlainTrainer") -> TrainedFile:
    return TrainedFile(file, trainer.seconds, trainer.iteration, trainer.start_s)


@dataclass(frozen=True)
class Outcome:
    """What the training of a model a modality left behind."""

    runs: dict[str, TrainedFile]  # of every modality that was trained
    interrupted: bool

    @property
    def seconds(self) -> float:
        return sum(run.seconds for run in self.runs.values())

    @property
    def steps(self) -> int:
        return sum(run.steps for run in self.runs.values())


def run_baseline(options: Options, room: "PhotoRoom") -> int:
    """room: for the photos of each model in turn."""
    from shapeshift.rasterizer.device import open_device
    from shapeshift.training.calibration.extrinsics import with_extrinsics
    from shapeshift.training.settings import suited

    if options.separate and options.model == "splats":
        raise UsageError("plain splats are one model a modality already; leave out --separate.")
    plain = plain_settings(options) if options.model == "splats" else None
    settings = settings_of(options.asked) if plain is None else None
    capture, device = open_capture(options.capture, options.memory), open_device(options.device)
    print_files(capture.files)
    if settings is not None:
        settings = suited(settings, options.asked, capture)
    say(f"{device.name}, {device.platform}")
    if settings is not None and options.calibrate is not None:
        settings = calibrated(device, capture, settings, options.calibrate)
    if plain is not None:
        outcome = train_splats(device, capture, options, plain, room)
    elif settings is not None:
        rig = rig_of_checkpoints(capture, options) if options.resume else settings.rig
        capture = with_extrinsics(capture, rig)
        outcome = train_separate(device, capture, options, settings, room)
    say(outcome_line(outcome, capture, options.out))
    return INTERRUPTED if outcome.interrupted else 0


def rig_of_checkpoints(capture: "Capture", options: Options) -> str:
    """TrainSettings.rig of the models that --resume goes on with."""
    from shapeshift.training.checkpoint import read_checkpoint

    for file in files_of(capture, options.out, ".shift"):
        if (path := checkpoint_of(options.out, file)).exists():
            return read_checkpoint(path)[1]["settings"].get("rig", "")
    return ""


def plain_settings(options: Options) -> "PlainSettings":
    """The settings of plain splats, out of the options.  Raises UsageError."""
    from shapeshift.training.baselines.plain_settings import PlainSettings

    names = {f.name for f in fields(PlainSettings)}
    for name in options.asked:
        if name not in names:
            raise UsageError(
                f"{as_given(name)} is of anchor models; leave it out with --model splats."
            )
    chosen = options.asked | options.splats
    if "seconds" in chosen and "iterations" not in chosen:
        chosen["iterations"] = None
    try:
        return PlainSettings(**chosen)
    except ValueError as error:
        raise as_typed(error, PlainSettings) from None


def share_of(settings: "Kind", capture: "Capture") -> "Kind":
    """The settings of one modality's model: its share of the budget, photos as small as all are."""
    from shapeshift.training.photos import choose_downscale

    count = len(capture.stops)
    steps, seconds = settings.iterations, settings.seconds
    return replace(
        settings,
        iterations=None if steps is None else max(round(steps / count), 1),
        seconds=None if seconds is None else seconds / count,
        downscale=settings.downscale or choose_downscale(capture.photos),
    )


@dataclass(frozen=True)
class ModelRun:
    """How runs of one kind of model begin, and what they leave."""

    begin: Callable[..., Any]  # (device, capture, checkpoint | None, report, room) -> its trainer
    describe: Callable[[Any], str]
    write: Callable[[Any, Path], object]  # the trainer's model into a file
    count: str  # what the trainer calls the number of its primitives


def splats_run(settings: "PlainSettings", asked: Asked) -> ModelRun:
    """asked: what of the settings was given by name, which a checkpoint has to agree with."""
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from shapeshift.training.baselines.plain import PlainTrainer

    def begin(device, part: "Capture", state: "Checkpoint | None", report, room) -> "PlainTrainer":
        chosen = begun_or_resumed(settings, asked, state)
        return PlainTrainer(device, part, chosen, report, room, state)

    def write(trainer: "PlainTrainer", file: Path) -> None:
        write_ply(trainer.splats(), file)

    return ModelRun(begin, describe_plain, write, "count")


def anchors_run(settings: "TrainSettings", asked: Asked) -> ModelRun:
    """The same for anchor models."""
    from shapeshift.runtime_models.package.write_package import write_package
    from shapeshift.training.train import Trainer

    def begin(device, part: "Capture", state: "Checkpoint | None", report, room) -> "Trainer":
        chosen = begun_or_resumed(settings, asked, state)
        return Trainer(device, part, chosen, state, report=report, room=room)

    def write(trainer: "Trainer", file: Path) -> None:
        write_package(trainer.model(), file)

    return ModelRun(begin, describe, write, "anchors_count")


def begun_or_resumed(settings: "Kind", asked: Asked, state: "Checkpoint | None") -> "Kind":
    """The settings, or those of a checkpoint with their budget.  Raises UsageError."""
    from shapeshift.training.settings import resumed

    if state is None:
        return settings
    given = {name: getattr(settings, name) for name in asked if name != "rig"}
    given = {name: value for name, value in given.items() if value is not None}
    try:
        return resumed(settings, state[1]["settings"], given, "--")
    except ValueError as error:
        raise as_typed(error, type(settings)) from None


def train_model(
    device, capture: "Capture", run: ModelRun, checkpoint: Path, state: "Checkpoint | None",
    room: "PhotoRoom | None" = None,
) -> tuple[Any, bool]:  # fmt: skip
    """(the trainer after its run, whether Ctrl-C ended it early).

    checkpoint: written on the way; state: what an earlier run left there.
    """
    from shapeshift.app.training.saving import save_checkpoint

    with working(READING) as report:
        trainer = run.begin(device, capture, state, report, room)
    say(run.describe(trainer), *trainer.warnings)
    interrupted = train(trainer, partial(save_checkpoint, trainer, checkpoint))
    say(result_line(trainer, getattr(trainer, run.count)), *trainer.exposures.warnings())
    return trainer, interrupted


def train_splats(
    device, capture: "Capture", options: Options, settings: "PlainSettings", room: "PhotoRoom"
) -> Outcome:
    """Plain splats of every modality into the folder --out: a PLY each and layers.json."""
    from shapeshift.runtime_models.splats.layers.layer_list import (
        refuse_other_folder,
        write_list,
    )

    out, files = options.out, files_of(capture, options.out, ".ply")
    if not is_unfinished(out, files):
        refuse_other_folder(out)  # now, not after the training
    run = splats_run(share_of(settings, capture), options.asked | options.splats)
    outcome = train_each(device, capture, run, files, options, room)
    names = [made.file.name for made in outcome.runs.values()]
    write_list(capture.stops[: len(names)], names, out)
    return outcome


def is_unfinished(out: Path, files: list[Path]) -> bool:
    """Whether a folder holds what a run left that was killed: models with checkpoints, no list."""
    from shapeshift.runtime_models.files.whole_file import sweep

    if not out.is_dir():
        return False
    sweep(out)
    return all(path in files and checkpoint_of(out, path).is_file() for path in out.iterdir())


def train_separate(
    device, capture: "Capture", options: Options, settings: "TrainSettings", room: "PhotoRoom"
) -> Outcome:
    """An anchor model of every modality into the folder --out: a package each."""
    from shapeshift.runtime_models.package.write_package import refuse_foreign

    if options.out.is_file() or options.out.suffix == ".shift":
        raise UsageError(
            f"{options.out}: --separate writes several packages; name a folder for them."
        )
    files = files_of(capture, options.out, ".shift")
    for file in files:
        refuse_foreign(file)  # now, not after the training
    run = anchors_run(share_of(settings, capture), options.asked)
    return train_each(device, capture, run, files, options, room)


def files_of(capture: "Capture", out: Path, ending: str) -> list[Path]:
    """One a modality."""
    from shapeshift.runtime_models.splats.layers.layer_list import layer_name

    return [out / layer_name(n, stop, ending) for n, stop in enumerate(capture.stops)]


def train_each(
    device, capture: "Capture", run: ModelRun, files: list[Path], options: Options,
    room: "PhotoRoom",
) -> Outcome:  # fmt: skip
    """A model of every modality into its file, until Ctrl-C; --resume: from their checkpoints."""
    from shapeshift.app.training.saving import save_checkpoint
    from shapeshift.training.baselines.plain import one_modality
    from shapeshift.training.checkpoint import read_checkpoint

    parts = [one_modality(capture, stop.name) for stop in capture.stops]  # all refused before
    checkpoints = [checkpoint_of(options.out, file) for file in files]
    begun = [path.exists() for path in checkpoints]
    if options.resume and not any(begun):
        read_checkpoint(checkpoints[0])  # which says so
    options.out.mkdir(parents=True, exist_ok=True)
    runs, interrupted = {}, False
    for part, file, checkpoint, there in zip(parts, files, checkpoints, begun, strict=True):
        state = read_checkpoint(checkpoint) if options.resume and there else None
        trainer, interrupted = train_model(device, part, run, checkpoint, state, room)
        run.write(trainer, file)
        if failed := save_checkpoint(trainer, checkpoint):
            say(failed)
        runs[part.stops[0].name] = trained_file(file, trainer)
        trainer.photos.close()
        if interrupted:
            break
    return Outcome(runs, interrupted)


def checkpoint_of(out: Path, file: Path) -> Path:
    """Of a model of several in the folder `out`: beside it, where nothing looks for models."""
    from shapeshift.training.checkpoint import checkpoint_path

    return checkpoint_path(out.with_name(f"{out.name}.{file.stem}"))


def describe_plain(trainer: "PlainTrainer") -> str:
    photos = trainer.schedule.photos[trainer.stop.name]
    width, height = photos[0].view.size
    return (
        f"{len(photos)} x {trainer.stop.name} of {width}x{height} pixels; "
        f"{len(trainer.held_out)} held out; {trainer.count:,} splats from {trainer.origin}, "
        f"{trainer.voxel:.4g} m apart, SH degree {trainer.settings.sh_degree}"
    )


def result_line(trainer: "Trainer | PlainTrainer", count: int) -> str:
    psnr = decibels(trainer.held_out_psnr(most=len(trainer.held_out)))
    return f"{trainer.iteration} steps in {used(trainer)}, {count:,} {trainer.primitive}; " + (
        f"held-out photos: {psnr}" if psnr else "no photo was held out"
    )


def outcome_line(outcome: Outcome, capture: "Capture", out: Path) -> str:
    where = full(out)
    missing = [s.name for s in capture.stops if s.name not in outcome.runs]
    if outcome.interrupted:
        rest = f"; not trained: {', '.join(missing)}" if missing else ""
        return f"{where}: interrupted after {outcome.seconds:.1f} s{rest}; --resume goes on"
    return f"{where}: done after {outcome.steps} steps in {outcome.seconds:.1f} s"
