"""launch.py fit --only: one training of one trial, as a command of its own.

`options` are those of fit.py, which imports this.
"""

import json
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapeshift.app.cluster.task import is_task
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import open_capture
from shapeshift.app.paths import full
from shapeshift.app.progress import working
from shapeshift.app.terminal import say
from shapeshift.app.training.run_loop import INTERRUPTED, READING, describe, train
from shapeshift.app.training.train_options import as_given

if TYPE_CHECKING:
    from shapeshift.training.settings import TrainSettings

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
    from shapeshift.training.fit.fit import refuse_unsettled
    from shapeshift.training.fit.read_settings import read_settings
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
