"""The trainings of fit as tasks of a cluster, in a folder beside the package that it writes.

`options` are those of fit.py, which imports this.
"""

import hashlib
import json
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapeshift.app.cluster.open_cluster import NONE, Cluster
from shapeshift.app.cluster.task import Task, digest_of, is_task, own_code, words_for
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import open_capture
from shapeshift.app.paths import full
from shapeshift.app.progress import working
from shapeshift.app.terminal import say
from shapeshift.app.training.run_loop import INTERRUPTED, READING, describe, train
from shapeshift.app.training.train_options import as_given

if TYPE_CHECKING:
    from shapeshift.scene.captures.capture import Capture
    from shapeshift.training.fit.fit import TrainedSeed
    from shapeshift.training.settings import TrainSettings

MOST_BYTES = 1 << 16  # of what a training notes


def trials_folder(out: Path) -> Path:
    """Where fit keeps the trainings whose scene is `out`."""
    return out.with_name(out.name + ".trials")


def check_places(options: Any) -> None:
    """Raises UsageError where trainings cannot write, or would change what the next one reads."""
    from shapeshift.app.training.saving import check_writable

    if Path(full(options.out)).is_relative_to(full(options.capture)):
        raise UsageError(
            f"--out {options.out} lies in the capture, whose files every training reads; with "
            "--cluster name a place outside of it."
        )
    check_writable(options.out)
    folder = trials_folder(options.out)
    if folder.exists() and not folder.is_dir():
        raise UsageError(
            f"{folder} is a file, where the trainings go; move it, or name another --out."
        )


def calibrated_once(
    device, capture: "Capture", settings: "TrainSettings", options: Any
) -> "TrainSettings":
    """The settings with the offset of --calibrate, looked for unless an earlier start has."""
    from shapeshift.app.charts.chart_rows import write_text
    from shapeshift.app.training.run_loop import calibrated
    from shapeshift.runtime_models.files.json_fields import saved_object

    assert options.calibrate is not None, "asked for"
    asked = [own_code(), digest_of(Path(full(options.capture))), settings.as_dict()]
    key = hashlib.sha256(json.dumps([*asked, options.calibrate]).encode()).hexdigest()
    kept = trials_folder(options.out) / "rig.json"
    noted = saved_object(kept, MOST_BYTES)
    if noted.get("key") == key and isinstance(noted.get("rig"), str):
        return replace(settings, rig=noted["rig"])
    found = calibrated(device, capture, settings, options.calibrate)
    kept.parent.mkdir(parents=True, exist_ok=True)
    write_text(kept, json.dumps({"key": key, "rig": found.rig}))
    return found


class Trials:
    """Trains what fit asks for, what an earlier start has trained not again."""

    def __init__(self, cluster: Cluster, options: Any) -> None:
        self.cluster, self.options = cluster, options
        self.folder = trials_folder(options.out)

    def train_seeds(self, asked: "dict[str, TrainSettings]") -> "list[TrainedSeed]":
        """TrainSeeds of training/fit/fit.py.  Raises TaskFailed."""
        self.folder.mkdir(parents=True, exist_ok=True)
        tasks = [self.task_of(name, settings) for name, settings in asked.items()]
        self.cluster.run(tasks)
        return [trained_by(task) for task in tasks]

    def task_of(self, name: str, settings: "TrainSettings") -> Task:
        """`fit --only` of them; its files are called after the settings, whoever asks for them."""
        from shapeshift.runtime_models.files.whole_file import write_whole
        from shapeshift.training.checkpoint import checkpoint_path

        text = json.dumps(settings.as_dict(), indent=1).encode() + b"\n"
        file = self.folder / f"{hashlib.sha256(text).hexdigest()[:16]}.settings.json"
        if not file.exists() or file.read_bytes() != text:
            write_whole(file, text)
        out = file.with_name(file.name.replace(".settings.json", ".shift"))
        words = type(self.options)(
            self.options.capture, out, only=file, device=self.options.device,
            memory=self.options.memory,
        )  # fmt: skip
        return Task(
            name, words_for("fit", words), (full(self.options.capture), full(file)),
            (full(out), full(trained_path(out))),
            {"gpu": 1} if self.options.device == "gpu" else {},
            full(checkpoint_path(out)), ("--resume",),
        )  # fmt: skip


def trained_by(task: Task) -> "TrainedSeed":
    """What the training left.  Raises BadFile."""
    from shapeshift.runtime_models.files.json_fields import Fields, read_json
    from shapeshift.runtime_models.package.read_package import read_package
    from shapeshift.training.fit.fit import TrainedSeed

    package, facts = task.writes
    noted = Fields(read_json(Path(facts), most_bytes=MOST_BYTES), facts, "delete it, train again")
    size = Path(package).stat().st_size
    return TrainedSeed(read_package(package), size, noted.number("seconds", low=0))


def say_of_clock(options: Any) -> None:
    """What makes two starts differ, where it does."""
    if options.cluster != NONE and (options.seconds, options.final_seconds) != (None, None):
        say("With --seconds a faster worker gets further; --iterations gives the same bytes.")


# launch.py fit --only: one training of one trial, as a command of its own.
#
# `options` are those of fit.py, which imports this.

MEANT = ("capture", "out", "only", "resume", "device", "memory")  # options that it has


def trained_path(out: Path) -> Path:
    """Seconds and steps of the training that wrote the package `out`."""
    return out.with_suffix(".trained.json")


def run_trial(options: Any) -> int:
    """Trains the settings of the file at --only into --out.  Raises UsageError, BadFile."""
    from shapeshift.app.training.saving import (
        check_writable,
        memory_for_training,
        save_checkpoint,
    )
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.files.whole_file import write_whole
    from shapeshift.runtime_models.package.feature_codes import FEATURES
    from shapeshift.runtime_models.package.write_package import refuse_foreign, write_package
    from shapeshift.training.calibration.extrinsics import with_extrinsics
    from shapeshift.training.checkpoint import checkpoint_path
    from shapeshift.training.fit.fit import read_settings, refuse_unsettled
    from shapeshift.training.train import Trainer

    assert options.only is not None, "asked for"
    refuse_others(options)
    check_writable(options.out)
    refuse_foreign(options.out)
    settings, checkpoint = read_settings(options.only), checkpoint_path(options.out)
    state = state_of(checkpoint, settings) if options.resume else None
    capture = with_extrinsics(open_capture(options.capture, options.memory), settings.rig)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    with memory_for_training(), working(READING) as report:
        device = open_device(options.device)
        trainer = Trainer(device, capture, settings, state, report=report)
    if not is_task():  # the photos are the same for all trainings: thirty times the same doubts
        say(describe(trainer), *trainer.warnings)
    save = partial(save_checkpoint, trainer, checkpoint)
    if train(trainer, save):
        save()
        say(f"{full(options.out)}: interrupted, --resume goes on")
        return INTERRUPTED
    refuse_unsettled(trainer)
    write_package(trainer.model(), options.out, FEATURES[0])
    facts = {"seconds": trainer.elapsed, "steps": trainer.iteration}
    write_whole(trained_path(options.out), json.dumps(facts).encode() + b"\n")
    checkpoint.unlink(missing_ok=True)
    if not is_task():
        say(f"{full(options.out)}: {trainer.iteration} steps, done")
    return 0


def refuse_others(options: Any) -> None:
    """The file says it all: no other option may say something else.  Raises UsageError."""
    from dataclasses import MISSING

    for each in fields(options):
        usual = each.default if each.default is not MISSING else {}
        if each.name not in MEANT and (given := getattr(options, each.name)) != usual:
            name = next(iter(given)) if each.name == "asked" else each.name
            raise UsageError(f"--only trains what its file says; leave out {as_given(name)}.")
    if options.out.suffix != ".shift":
        raise UsageError(f"--only writes one file; --out is {options.out}, expected NAME.shift.")


def state_of(checkpoint: Path, settings: "TrainSettings") -> tuple:
    """What --resume goes on from.  Raises UsageError, BadFile."""
    from shapeshift.training.checkpoint import read_checkpoint

    state = read_checkpoint(checkpoint)
    if state[1].get("settings") != settings.as_dict():
        raise UsageError(f"{checkpoint} is of other settings; leave out --resume to start anew.")
    return state
