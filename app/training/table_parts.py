"""The models of a comparison one by one: what `table --only` trains, and tasks of it.

`options` are those of table.py, which imports this.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapeshift.app.cluster.open_cluster import NONE, open_cluster
from shapeshift.app.cluster.run_task import do_once
from shapeshift.app.cluster.task import Task
from shapeshift.app.cluster.words import words_for
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import file_name, full
from shapeshift.app.terminal import say
from shapeshift.app.training.train_baselines import (
    ModelRun,
    TrainedFile,
    anchors_run,
    plain_settings,
    share_of,
    splats_run,
    train_model,
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
        seconds, start_s = (float(facts.get(name, 0.0)) for name in ("seconds", "start_s"))
        return TrainedFile(self.file, seconds, int(facts.get("steps", 0)), start_s)


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
    from shapeshift.app.training.saving import save_checkpoint
    from shapeshift.runtime_models.files.whole_file import write_whole
    from shapeshift.training.baselines.plain import one_modality
    from shapeshift.training.checkpoint import read_checkpoint

    run = run_of(part, capture, asked, rig)
    part.file.parent.mkdir(parents=True, exist_ok=True)
    part.notes.mkdir(parents=True, exist_ok=True)
    state = read_checkpoint(part.checkpoint) if resume else None
    photos = one_modality(capture, part.modality) if part.modality else capture
    trainer, interrupted = train_model(device, photos, run, part.checkpoint, state)
    if interrupted:
        save_checkpoint(trainer, part.checkpoint)
        return False
    run.write(trainer, part.file)
    part.checkpoint.unlink(missing_ok=True)
    facts = {"seconds": trainer.seconds, "steps": trainer.iteration, "start_s": trainer.start_s}
    write_whole(part.trained, json.dumps(facts).encode() + b"\n")
    return True


def run_of(part: TablePart, capture: "Capture", asked: TrainOptions, rig: str) -> ModelRun:
    from shapeshift.runtime_models.package.write_package import refuse_foreign
    from shapeshift.training.settings import suited

    if part.method == "splats":
        plain = share_of(plain_settings(asked), capture)
        return splats_run(plain, asked.asked | asked.splats)
    refuse_foreign(part.file)
    given = asked.asked
    settings = suited(settings_of(given), given, capture)  # of one model and of several
    settings = replace(settings, rig=rig)
    return anchors_run(share_of(settings, capture) if part.modality else settings, asked.asked)


def train_here(
    method: str, device, capture: "Capture", options: Any, asked: TrainOptions, rig: str
) -> dict[str, TrainedFile] | None:
    """What the training of each modality's model left; None where Ctrl-C ended it early.

    What an earlier start has trained stays, and what it began goes on, also if that was by a
    cluster.
    """
    parts = parts_of(capture, options.out, (method,))
    refuse_foreign_splats(parts, options.out)
    for part in parts:
        task = task_of(part, options)

        def work(words: tuple[str, ...], note: int, part=part, task=task) -> bool:
            return train_part(part, device, capture, asked, rig, resume=words != task.argv)

        if not do_once(task, task.key(), work, say):
            return None
    return results_of(parts, capture, options.out)[method]


def refuse_foreign_splats(parts: Sequence[TablePart], out: Path) -> None:
    """Raises BadFile where splats would go into a folder of others: now, not after the training."""
    from shapeshift.runtime_models.splats.layers.write_layer_list import refuse_other_folder

    splats = [part for part in parts if part.method == "splats"]
    if splats and not any(part.trained.exists() for part in splats):
        refuse_other_folder(out / "splats")


def results_of(
    parts: Sequence[TablePart], capture: "Capture", out: Path
) -> dict[str, dict[str, TrainedFile]]:
    """method: modality: what its training left; splats get their layers.json."""
    from shapeshift.runtime_models.splats.layers.write_layer_list import write_list

    runs: dict[str, dict[str, TrainedFile]] = {}
    for part in parts:
        names = [part.modality] if part.modality else [stop.name for stop in capture.stops]
        runs.setdefault(part.method, {}).update({name: part.result() for name in names})
    if names := [part.file.name for part in parts if part.method == "splats"]:
        write_list(capture.stops, names, out / "splats")
    return runs


def train_by_cluster(
    capture: "Capture", options: Any, methods: Sequence[str]
) -> dict[str, dict[str, TrainedFile]]:
    """method: modality: what its training left, of all models by the workers of --cluster."""
    parts = parts_of(capture, options.out, methods)
    refuse_foreign_splats(parts, options.out)
    if options.seconds is not None:
        say("With --seconds a faster worker gets further; --iterations gives the same bytes.")
    with open_cluster(options.cluster, options.certificates, options.gpus) as cluster:
        cluster.run([task_of(part, options) for part in parts])
    return results_of(parts, capture, options.out)


def task_of(part: TablePart, options: Any) -> Task:
    """`table --only` of it."""
    words = replace(
        options, only=part.name, cluster=NONE, certificates=None, gpus=0,
        methods=type(options).methods, vgg=None,
    )  # fmt: skip
    reads = [full(options.capture)]
    if options.calibrate is not None:
        reads.append(full(options.out / "rig.json"))
    if options.settings is not None:
        reads.append(full(options.settings))
    return Task(
        part.name, words_for("table", words), tuple(reads), (full(part.file), full(part.trained)),
        {"gpu": 1} if options.device == "gpu" else {},
        full(part.checkpoint), ("--resume",), full(part.notes),
    )  # fmt: skip
