"""Photos to a scene, to a part of one anew, and to the smallest one that shows them as well."""

import time
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapeshift.api.arguments import Kind, PathText
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import in_words_of_python, opened
from shapeshift.api.scene import Scene
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.runtime_models.model import AnchorModel, BadFile

if TYPE_CHECKING:
    from shapeshift.app.training.fit import Options as FitOptions
    from shapeshift.app.training.train_in_blocks import TrainOutcome
    from shapeshift.rasterizer.device import Device
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.training.fit.fit import FitReport
    from shapeshift.training.run import Progress
    from shapeshift.training.settings import TrainSettings
    from shapeshift.training.train import Trainer

OF_BLOCKS = ("coarse_iterations", "block_photos", "cluster", "certificates", "gpus")
NO_OUT = "resume goes on from the checkpoint beside out; give out, too."
SAVE_EVERY_S = 60.0  # between checkpoints


class TrainedScene(Scene):
    """A scene that was just trained, and how that went.

    model = ss.train("capture", seconds=60); model.save("scene.shift")
    model.psnr_db  # {"RGB": 31.2, "Thermal": 33.0}
    """

    def __init__(self, model: AnchorModel, path: Path | None, outcome: "TrainOutcome") -> None:
        super().__init__(Document.of(model), path)
        self.steps: int = outcome.steps
        self.seconds: float = outcome.seconds  # with ...
        self.start_seconds: float = outcome.start_seconds  # ... what passed before the first step
        self.anchors: int = outcome.anchors
        # held-out photos: decibels of each modality, {} where none is held out
        self.psnr_db: dict[str, float] = outcome.psnr_db
        self.warnings: tuple[str, ...] = outcome.warnings  # about the capture, in sentences


def train(
    capture: PathText,
    out: PathText | None = None,
    *,
    seconds: float | None = None,
    iterations: int | None = None,
    resume: bool = False,
    device: Kind | None = None,
    calibrate: str | None = None,
    pace: bool = True,
    photo_mb: float | None = None,
    blocks: int | str = 1,
    progress: "Callable[[Any], object] | None" = None,
    **settings: Any,
) -> TrainedScene:
    """Trains a shape-shifting scene of posed photos of one or several modalities (docs/capture.md).

    seconds or iterations: how long; without either 2,000 iterations.  Seconds are of one core, the
    processor time of all threads, the start among them; on a GPU by the clock.  The same iterations
    give the same bits on one device.  out: a package, NAME.shift or a folder, that is written with
    its checkpoint beside it, also every minute and when Ctrl-C ends the run; resume goes on from
    there.  calibrate: a modality whose cameras all sit beside their stated poses, as on a rig.
    pace: measure how evenly the slider moves, a second a pair of stops.  photo_mb: MB of memory
    that photos may take; what does not fit is read when its step comes, to the same bits; None:
    half of what files may take.  progress: called after every step with (iteration, fraction, loss,
    anchors); False from it ends the run with what there is.  settings: any field of
    `shapeshift.training.settings.TrainSettings`, such as max_anchors or downscale.

    blocks: as --blocks of the command (docs/training.md, "Blocks"), a number, "auto" or a grid such
    as "4x2"; out is a folder NAME.blocks, with the command's bytes, and after any end the same call
    goes on.  settings may have coarse_iterations, block_photos, cluster, certificates and gpus then
    and progress gets sentences, on a cluster from another thread; figures are of all runs together.

    The model and its losses: the paper's equations 1 to 9.  Raises BadFile, UsageError, NoDevice.

        model = ss.train("capture", seconds=60, max_anchors=4000)
        model.save("scene.shift"); model.render("Thermal")
    """
    path = None if out is None else plain(out)
    settings |= {"iterations": iterations, "seconds": seconds}
    if str(blocks).strip() != "1":
        more = {"device": device, "calibrate": calibrate, "photo_mb": photo_mb}
        return train_in_blocks(capture, path, str(blocks), settings, more, pace, progress)
    for name in settings.keys() & OF_BLOCKS:
        raise UsageError(f"{name} is of blocks; give blocks, or leave it out.")
    trainer = trainer_of(capture, path, settings, resume, device, calibrate, photo_mb)
    run(trainer, path, progress)
    return finished(trainer, path, pace)


def train_in_blocks(
    capture: PathText, out: Path | None, blocks: str, settings: dict[str, Any],
    more: dict[str, Any], pace: bool, progress: "Callable[[Any], object] | None",
) -> TrainedScene:  # fmt: skip
    """As train --blocks.  more: other options of the command."""
    from shapeshift.app.training.train_in_blocks import train_quietly
    from shapeshift.app.training.train_options import EXPERTS, LINES, USUAL, Options

    if out is None:
        raise UsageError("blocks wants out, a folder NAME.blocks.")
    given = {name: value for name, value in settings.items() if value is not None}
    more |= {name: given.pop(name) for name in OF_BLOCKS if name in given}
    if "certificates" in more:
        more["certificates"] = plain(more["certificates"])
    settings_of(given, None)  # refused now, not after the run of the whole
    for name in given:
        if name not in (*USUAL, *EXPERTS, *LINES):
            raise UsageError(f"{name}: blocks are trained by commands, which have no such option.")
    options = Options(plain(capture), out, given, blocks=blocks, **more)
    return TrainedScene(*train_quietly(options, pace, progress))


def trainer_of(
    capture: PathText, path: Path | None, settings: dict[str, Any], resume: bool,
    device: Kind | None, calibrate: str | None, photo_mb: float | None,
) -> "Trainer":  # fmt: skip
    """The run before its first step."""
    from shapeshift.app.training.saving import memory_for_training, room_of
    from shapeshift.rasterizer.device import open_device
    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.training.calibration.extrinsics import with_extrinsics
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint
    from shapeshift.training.settings import suited
    from shapeshift.training.train import Trainer

    if path is not None:
        refuse_place(path)
    elif resume:
        raise UsageError(NO_OUT)
    room = room_of(path, photo_mb, "photo_mb")
    before = read_checkpoint(checkpoint_path(path)) if resume and path is not None else None
    wished = settings_of(settings, before[1]["settings"] if before else None)
    found, on = read_capture(plain(capture)), open_device(device)
    if before is None:
        given = [name for name, value in settings.items() if value is not None]
        wished = suited(wished, given, found)
    if calibrate is not None:
        if resume:
            raise UsageError("resume goes on with the checkpoint's offset; leave out calibrate.")
        wished = calibrated(on, found, wished, calibrate)
    with memory_for_training():
        return Trainer(on, with_extrinsics(found, wished.rig), wished, before, room=room)


def calibrated(
    device: "Device", capture: "Capture", settings: "TrainSettings", modality: str
) -> "TrainSettings":
    """The settings with the offset of a modality's cameras.  Raises BadFile."""
    from shapeshift.training.calibration.calibrate import calibrate
    from shapeshift.training.calibration.extrinsics import rig_json

    found = calibrate(device, capture, settings, modality, report=lambda what, part: None)
    return replace(settings, rig=rig_json(modality, found))


def settings_of(asked: dict[str, Any], before: dict | None) -> "TrainSettings":
    """The usual settings with those that were asked for; or a checkpoint's with another budget.

    None stands for what was not asked.  Raises UsageError.
    """
    from shapeshift.app.command_line import nearest
    from shapeshift.training.settings import TrainSettings, adjusted, left_setting, resumed

    asked = {name: value for name, value in asked.items() if value is not None}
    known = [field.name for field in fields(TrainSettings)]
    for name in asked:
        if name not in known:
            if now := left_setting(name):
                raise UsageError(f"{name} left the program: {now}.")
            meant = nearest(name, known)
            hint = f"did you mean {meant}?" if meant else f"there are {', '.join(known)}."
            raise UsageError(f"there is no setting '{name}' of a training; {hint}")
    try:
        if before is not None:
            return resumed(TrainSettings(), before, asked)
        return adjusted(TrainSettings(), asked)
    except ValueError as error:
        raise UsageError(str(error)) from None


def run(
    trainer: "Trainer", path: Path | None, progress: "Callable[[Progress], object] | None"
) -> None:
    """The steps; what there is is written every minute, and when anything ends them early."""
    from shapeshift.app.training.saving import memory_errors, save, save_checkpoint
    from shapeshift.training.checkpoint import checkpoint_path

    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
    saved = time.monotonic()
    ends: tuple[type[BaseException], ...] = (KeyboardInterrupt, BadFile, *memory_errors())
    try:
        for now in trainer.steps():
            if progress is not None and progress(now) is False and trainer.settled:
                break
            if path is not None and time.monotonic() - saved > SAVE_EVERY_S:
                save_checkpoint(trainer, checkpoint_path(path))
                saved = time.monotonic()
    except ends:
        if path is not None and trainer.iteration:
            save(trainer, path, checkpoint_path(path))
        trainer.photos.close(keep=path is not None)
        raise


def finished(trainer: "Trainer", path: Path | None, pace: bool) -> TrainedScene:
    """The scene of a run that has ended, written where it was asked for."""
    from shapeshift.app.training.saving import save
    from shapeshift.app.training.train_in_blocks import TrainOutcome
    from shapeshift.renderer.pace import measure_pace
    from shapeshift.runtime_models.package.write_package import write_package
    from shapeshift.runtime_models.stops.formula_stop import with_placed_formulas
    from shapeshift.training.checkpoint import checkpoint_path

    trainer.restore_last_good()
    if path is not None:
        save(trainer, path, checkpoint_path(path))  # before anything else can go wrong
    model = with_placed_formulas(trainer.model(), trainer.capture.formulas)
    paced = pace and len(model.stops) > 1
    if paced:
        model = replace(model, pace=measure_pace(model))
    if path is not None and (paced or trainer.capture.formulas):
        write_package(model, path)
    psnr_db = trainer.held_out_psnr(most=len(trainer.held_out))
    outcome = TrainOutcome(
        trainer.iteration, trainer.seconds, trainer.start_s, trainer.anchors_count,
        tuple(trainer.warnings), psnr_db,
    )  # fmt: skip
    scene = TrainedScene(model, path, outcome)
    trainer.photos.close()
    return scene


def update(
    scene: PathText | OpenedScene,
    capture: PathText,
    *,
    where: str | Sequence[str] = (),
    change: PathText | None = None,
    out: PathText | None = None,
    seconds: float | None = None,
    iterations: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    device: Kind | None = None,
    progress: "Callable[[Progress], object] | None" = None,
    **settings: Any,
) -> TrainedScene:
    """Trains a part of a scene anew from the photos of a later visit; the networks and all anchors
    outside stay to the bit, and so does every pixel that no splat touches which left or came.

    where: one or several boxes of the scene's world, box:x,y,z:hx,hy,hz in metres: centre and half
    the sides.  change: the folder that `ss.change(scene, later, out=...)` wrote; its places are
    where nothing else is named, and its registration moves the capture into the scene's world.
    capture: posed photos of every stop, as `train` takes them.  The rest as of `ss.train`; psnr_db
    of the result is of the held-out photos where they see the region.  Raises BadFile, UsageError,
    NoDevice.

        ss.change("march.shift", "june.shift", out="changed")
        scene = ss.update("march.shift", "photos/june", change="changed", iterations=1000)
    """
    from shapeshift.app.commands.exported import check_output
    from shapeshift.app.training.saving import memory_for_training
    from shapeshift.app.training.update import base_of, region_of
    from shapeshift.rasterizer.device import open_device
    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint
    from shapeshift.training.update.regions import moved_capture
    from shapeshift.training.update.update_trainer import begin_update

    given = opened(scene)
    path = None if out is None else plain(out)
    if path is not None:
        check_output(path, [given.path] if given.path else [], overwrite or resume, "")
        refuse_place(path)
    elif resume:
        raise UsageError(NO_OUT)
    boxes = (where,) if isinstance(where, str) else tuple(where)
    region, a_from_b = region_of(boxes, None if change is None else plain(change), "")
    before = read_checkpoint(checkpoint_path(path)) if resume and path is not None else None
    asked = settings | {"iterations": iterations, "seconds": seconds}
    wished = settings_of(asked, before[1]["settings"] if before else None)
    photos = read_capture(plain(capture))
    photos = photos if a_from_b is None else moved_capture(photos, a_from_b)
    with memory_for_training():
        base = base_of(given.model, region)
        trainer = begin_update(open_device(device), base, photos, wished, before)
    run(trainer, path, progress)
    return finished(trainer, path, pace=False)


class FittedScene(Scene):
    """The smallest scene that shows a capture as well as the largest one, and why.

    model = ss.fit("capture", "scene.shift")
    [(part["part"], part["verdict"]) for part in model.need["parts"]]
    """

    def __init__(self, model: AnchorModel, path: Path | None, need: dict[str, Any]) -> None:
        super().__init__(Document.of(model), path)
        self.need = need  # the report, as `shapeshift fit --json` writes it


def fit(
    capture: PathText,
    out: PathText | None = None,
    *,
    tolerance_db: float = 0.1,
    seeds: int = 2,
    iterations: int | None = None,
    seconds: float | None = None,
    final_iterations: int | None = None,
    final_seconds: float | None = None,
    calibrate: str | None = None,
    device: Kind | None = None,
    progress: "Callable[[str, float], None] | None" = None,
    **settings: Any,
) -> FittedScene:
    """Takes away what a scene of a capture does not need: trains without one part after the other
    and compares the held-out photos (docs/fit.md).  `need` of the result says what each was worth.

    tolerance_db: dB that each modality may lose in all, error included.  seeds: trainings of every
    trial.  iterations or seconds: how long each takes, 600 iterations without either; final_...: of
    one more training of the chosen model.  out: a package that is written, the same bytes as the
    command's.  settings: as of `train`, of the largest model.  progress: called with (what, part
    0..1).  Raises BadFile, UsageError, NoDevice.

        model = ss.fit("capture", "scene.shift", tolerance_db=0.1, max_anchors=4000)
        print(model.need["fitted"]["bytes"], model.need["full"]["bytes"])
    """
    from shapeshift.app.training.fit import Options, budget, noted_model, write_fitted
    from shapeshift.renderer.pace import measure_pace

    path = None if out is None else plain(out)
    options = Options(
        plain(capture), path or Path("fitted.shift"), tolerance_db=tolerance_db, seeds=seeds,
        calibrate=calibrate, device=device,
    )  # fmt: skip
    longer = final_iterations, final_seconds
    with in_words_of_python():
        if path is not None:
            refuse_place(path)
        given = {name: value for name, value in settings.items() if value is not None}
        last = None if longer == (None, None) else given | budget(*longer)
        asked = given | budget(iterations, seconds), last
        need, found = fitted(options, given, asked, progress or (lambda what, part: None))
    model = noted_model(need, found)
    model = model if model.pace else replace(model, pace=measure_pace(model))
    if path is not None:
        write_fitted(model, need, path)
    return FittedScene(model, path, need.as_dict())


def fitted(
    options: "FitOptions", given: dict[str, Any],
    asked: tuple[dict[str, Any], dict[str, Any] | None], progress: "Callable[[str, float], None]",
) -> "tuple[FitReport, Capture]":  # fmt: skip
    """The search and the photos.  given: settings; asked: with the length of a trial, and of the
    last training, None: without one.
    """
    from shapeshift.app.training.fit import refuse_options, searched
    from shapeshift.rasterizer.device import open_device
    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.training.settings import suited

    refuse_options(options)
    wished, last = (None if each is None else settings_of(each, None) for each in asked)
    assert wished is not None, "a trial has a length"
    found, on = read_capture(options.capture), open_device(options.device)
    wished = suited(wished, given, found)
    if options.calibrate is not None:
        wished = calibrated(on, found, wished, options.calibrate)
    return searched(options, on, found, (wished, last), progress), found


def refuse_place(path: Path) -> None:
    """Where no package can be written, or something else would be lost.  UsageError, BadFile."""
    from shapeshift.app.training.saving import check_writable
    from shapeshift.runtime_models.package.write_package import refuse_foreign

    check_writable(path)
    refuse_foreign(path)
