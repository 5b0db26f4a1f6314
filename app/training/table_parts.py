"""The models of a comparison one by one: what `table --only` trains, and tasks of it.

`options` are those of table.py, which imports this.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapeshift.app.cluster.open_cluster import NONE, open_cluster
from shapeshift.app.cluster.task import Task
from shapeshift.app.cluster.words import words_for
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import file_name, full
from shapeshift.app.progress import working
from shapeshift.app.terminal import say
from shapeshift.app.training.run_loop import READING, describe, train
from shapeshift.app.training.train_baselines import (
    TrainedFile,
    describe_plain,
    plain_settings,
    result_line,
    share_of,
)
from shapeshift.app.training.train_options import Options as TrainOptions
from shapeshift.app.training.train_options import settings_of

if TYPE_CHECKING:
    from shapeshift.scene.captures.capture import Capture

NOTES = "parts"  # in --out: what is done, and checkpoints
MOST_BYTES = 1 << 16


@dataclass(frozen=True)
class TablePart:
    """One model of a comparison."""

    method: str  # joint | separate | splats
    modality: str  # "": all of them
    file: Path  # that is trained
    notes: Path

    @property
    def name(self) -> str:
        """As --only has it."""
        return f"{self.method}:{self.modality}" if self.modality else self.method

    @property
    def trained(self) -> Path:
        """Seconds and steps."""
        return self.notes / f"{file_name(self.name)}.trained.json"

    @property
    def checkpoint(self) -> Path:
        return self.notes / f"{file_name(self.name)}.checkpoint.npz"

    def result(self) -> TrainedFile:
        """What its training left behind."""
        from shapeshift.runtime_models.files.json_fields import saved_object

        facts = saved_object(self.trained, MOST_BYTES)
        return TrainedFile(self.file, float(facts.get("seconds", 0.0)), int(facts.get("steps", 0)))


def parts_of(capture: "Capture", out: Path, methods: Sequence[str]) -> list[TablePart]:
    """All models of some methods."""
    from shapeshift.runtime_models.splats.layers.write_layer_list import layer_name

    notes, parts = out / NOTES, []
    for method in methods:
        if method == "joint":
            parts.append(TablePart("joint", "", out / "joint.shift", notes))
            continue
        ending = ".ply" if method == "splats" else ".shift"
        for number, stop in enumerate(capture.stops):
            file = out / method / layer_name(number, stop, ending)
            parts.append(TablePart(method, stop.name, file, notes))
    return parts


def chosen_part(capture: "Capture", options: Any) -> TablePart:
    """The one that --only names.  Raises UsageError."""
    parts = parts_of(capture, options.out, ("joint", "separate", "splats"))
    for part in parts:
        if part.name == options.only:
            return part
    known = ", ".join(part.name for part in parts)
    raise UsageError(f"--only is '{options.only}', expected one of {known}.")


def train_part(part: TablePart, device, capture: "Capture", asked: TrainOptions, rig: str,
               resume: bool) -> bool:  # fmt: skip
    """Its model and facts on disk, the bytes that the whole comparison makes; False after Ctrl-C.

    asked: as of train; rig: of TrainSettings, what the capture's cameras were moved by; resume: go
    on from the checkpoint of an earlier attempt.
    """
    from shapeshift.runtime_models.files.whole_file import write_whole

    part.file.parent.mkdir(parents=True, exist_ok=True)
    part.notes.mkdir(parents=True, exist_ok=True)
    plain = part.method == "splats"
    trained = train_splats_part if plain else partial(train_anchors_part, rig=rig, resume=resume)
    facts = trained(part, device, capture, asked)
    if facts is None:
        return False
    write_whole(part.trained, json.dumps(facts).encode() + b"\n")
    return True


def train_splats_part(
    part: TablePart, device, capture: "Capture", asked: TrainOptions
) -> dict | None:
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from shapeshift.training.baselines.plain import PlainTrainer, one_modality

    settings = share_of(plain_settings(asked), capture)
    with working(READING) as report:
        trainer = PlainTrainer(device, one_modality(capture, part.modality), settings, report)
    say(describe_plain(trainer), *trainer.warnings)
    if train(trainer):
        return None
    write_ply(trainer.splats(), part.file)
    say(result_line(trainer, trainer.count), *trainer.exposures.warnings())
    return {"seconds": trainer.elapsed, "steps": trainer.iteration}


def train_anchors_part(
    part: TablePart, device, capture: "Capture", asked: TrainOptions, rig: str, resume: bool
) -> dict | None:
    from shapeshift.app.training.saving import save_checkpoint
    from shapeshift.runtime_models.package.write_package import refuse_foreign, write_package
    from shapeshift.training.baselines.plain import one_modality
    from shapeshift.training.checkpoint import read_checkpoint
    from shapeshift.training.train import Trainer

    refuse_foreign(part.file)
    settings = replace(settings_of(asked.asked), rig=rig)
    if part.modality:
        settings = share_of(settings, capture)
        capture = one_modality(capture, part.modality)
    state = read_checkpoint(part.checkpoint) if resume else None
    with working(READING) as report:
        trainer = Trainer(device, capture, settings, state, report=report)
    say(describe(trainer), *trainer.warnings)
    save = partial(save_checkpoint, trainer, part.checkpoint)
    if train(trainer, save):
        save()
        return None
    write_package(trainer.model(), part.file)
    part.checkpoint.unlink(missing_ok=True)
    say(result_line(trainer, trainer.anchors_count), *trainer.exposures.warnings())
    return {"seconds": trainer.elapsed, "steps": trainer.iteration}


def train_by_cluster(
    capture: "Capture", options: Any, methods: Sequence[str]
) -> dict[str, dict[str, TrainedFile]]:
    """method: modality: what its training left, of all models by the workers of --cluster."""
    from shapeshift.runtime_models.splats.layers.write_layer_list import (
        refuse_other_folder,
        write_list,
    )

    parts, out = parts_of(capture, options.out, methods), options.out / "splats"
    begun = any(part.trained.exists() for part in parts if part.method == "splats")
    if "splats" in methods and not begun:
        refuse_other_folder(out)  # now, not after the training
    if options.seconds is not None:
        say("With --seconds a faster worker gets further; --iterations gives the same bytes.")
    with open_cluster(options.cluster, options.certificates, options.gpus) as cluster:
        cluster.run([task_of(part, options) for part in parts])
    runs: dict[str, dict[str, TrainedFile]] = {}
    for part in parts:
        names = [part.modality] if part.modality else [stop.name for stop in capture.stops]
        runs.setdefault(part.method, {}).update({name: part.result() for name in names})
    if "splats" in methods:
        names = [part.file.name for part in parts if part.method == "splats"]
        write_list(capture.stops, names, out)
    return runs


def task_of(part: TablePart, options: Any) -> Task:
    """`table --only` of it."""
    words = replace(
        options, only=part.name, cluster=NONE, certificates=None, gpus=0,
        methods=type(options).methods, vgg=None,
    )  # fmt: skip
    reads = [full(options.capture)]
    if options.calibrate is not None:
        reads.append(full(options.out / "rig.json"))
    resumes = part.method != "splats"
    return Task(
        part.name, words_for("table", words), tuple(reads), (full(part.file), full(part.trained)),
        {"gpu": 1} if options.device == "gpu" else {},
        full(part.checkpoint) if resumes else "", ("--resume",) if resumes else (),
        full(part.notes),
    )  # fmt: skip
