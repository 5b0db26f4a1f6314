"""train --model splats and --separate: what a shape-shifting model is compared with."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from shapeshift.app.errors import UsageError
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
from shapeshift.app.training.train_options import Options, settings_of

if TYPE_CHECKING:
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.training.baselines.plain import PlainTrainer
    from shapeshift.training.baselines.plain_settings import PlainSettings
    from shapeshift.training.photo_store.open_photos import PhotoRoom
    from shapeshift.training.settings import TrainSettings
    from shapeshift.training.train import Trainer

    Kind = TypeVar("Kind", TrainSettings, PlainSettings)


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

    if options.resume:
        raise UsageError(
            "--resume goes on with the one shape-shifting model; --model splats and --separate "
            "train several models and begin anew."
        )
    if options.separate and options.model == "splats":
        raise UsageError("plain splats are one model a modality already; leave out --separate.")
    plain = plain_settings(options) if options.model == "splats" else None
    settings = settings_of(options.asked) if plain is None else None
    capture, device = open_capture(options.capture, options.memory), open_device(options.device)
    say(f"{device.name}, {device.platform}")
    if settings is not None and options.calibrate is not None:
        settings = calibrated(device, capture, settings, options.calibrate)
        capture = with_extrinsics(capture, settings.rig)
    if plain is not None:
        outcome = train_splats(device, capture, plain, options.out, room)
    elif settings is not None:
        outcome = train_separate(device, capture, settings, options.out, room)
    say(outcome_line(outcome, capture, options.out))
    return INTERRUPTED if outcome.interrupted else 0


def plain_settings(options: Options) -> "PlainSettings":
    """The settings of plain splats, out of the options.  Raises UsageError."""
    from shapeshift.training.baselines.plain_settings import PlainSettings

    names = {f.name for f in fields(PlainSettings)}
    for name in options.asked:
        if name not in names:
            option = f"--{name.replace('_', '-')}"
            raise UsageError(f"{option} is of anchor models; leave it out with --model splats.")
    chosen = options.asked | options.splats
    if "seconds" in chosen and "iterations" not in chosen:
        chosen["iterations"] = None
    try:
        return PlainSettings(**chosen)
    except ValueError as error:
        raise UsageError(str(error)) from None


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


def train_splats(
    device,
    capture: "Capture",
    settings: "PlainSettings",
    out: Path,
    room: "PhotoRoom | None" = None,
) -> Outcome:
    """Plain splats of every modality into the folder `out`: a PLY each and layers.json."""
    from shapeshift.runtime_models.splats.layers.write_layer_list import (
        layer_name,
        refuse_other_folder,
        write_layer_list,
    )
    from shapeshift.training.baselines.plain import PlainTrainer, one_modality

    refuse_other_folder(out)  # now, not after the training
    settings, parts = share_of(settings, capture), each_modality(capture, one_modality)
    layers, runs, interrupted = [], {}, False
    for number, part in enumerate(parts):
        with working(READING) as report:
            trainer = PlainTrainer(device, part, settings, report, room)
        say(describe_plain(trainer), *trainer.warnings)
        interrupted = train(trainer)
        layers.append((trainer.stop, trainer.splats()))
        file = out / layer_name(number, trainer.stop)
        runs[trainer.stop.name] = trained_file(file, trainer)
        say(result_line(trainer, trainer.count), *trainer.exposures.warnings())
        trainer.photos.close()
        if interrupted:
            break
    write_layer_list(layers, out)
    return Outcome(runs, interrupted)


def train_separate(
    device,
    capture: "Capture",
    settings: "TrainSettings",
    out: Path,
    room: "PhotoRoom | None" = None,
) -> Outcome:
    """An anchor model of every modality into the folder `out`: a package each."""
    from shapeshift.runtime_models.package.write_package import refuse_foreign, write_package
    from shapeshift.runtime_models.splats.layers.write_layer_list import layer_name
    from shapeshift.training.baselines.plain import one_modality
    from shapeshift.training.train import Trainer

    if out.is_file() or out.suffix == ".shift":
        raise UsageError(f"{out}: --separate writes several packages; name a folder for them.")
    files = {
        stop.name: (out / layer_name(number, stop)).with_suffix(".shift")
        for number, stop in enumerate(capture.stops)
    }
    for file in files.values():
        refuse_foreign(file)  # now, not after the training
    settings, parts = share_of(settings, capture), each_modality(capture, one_modality)
    runs, interrupted = {}, False
    for part in parts:
        with working(READING) as report:
            trainer = Trainer(device, part, settings, report=report, room=room)
            name = part.stops[0].name
        say(describe(trainer), *trainer.warnings)
        interrupted = train(trainer)
        write_package(trainer.model(), files[name])
        runs[name] = trained_file(files[name], trainer)
        say(result_line(trainer, trainer.anchors_count), *trainer.exposures.warnings())
        trainer.photos.close()
        if interrupted:
            break
    return Outcome(runs, interrupted)


def each_modality(capture: "Capture", one_modality) -> list["Capture"]:
    """A capture a modality; all are checked before the first is trained.  Raises BadFile."""
    return [one_modality(capture, stop.name) for stop in capture.stops]


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
        return f"{where}: interrupted after {outcome.seconds:.1f} s{rest}"
    return f"{where}: done after {outcome.steps} steps in {outcome.seconds:.1f} s"
