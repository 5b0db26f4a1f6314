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
from shapeshift.app.cluster.task import Task, words_for
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import file_name, full
from shapeshift.app.terminal import open_console, say
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
    from shapeshift.runtime_models.splats.layers.layer_list import layer_name

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
    from shapeshift.runtime_models.splats.layers.layer_list import refuse_other_folder

    splats = [part for part in parts if part.method == "splats"]
    if splats and not any(part.trained.exists() for part in splats):
        refuse_other_folder(out / "splats")


def results_of(
    parts: Sequence[TablePart], capture: "Capture", out: Path
) -> dict[str, dict[str, TrainedFile]]:
    """method: modality: what its training left; splats get their layers.json."""
    from shapeshift.runtime_models.splats.layers.layer_list import write_list

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


# Rows of a comparison of methods, shown in the form of the paper's Tables 1 and 2.

MEAN = "mean"  # the modality of the row that sums a method up
NAMES = {
    "joint": "shape-shifting",
    "separate": "separate models",
    "splats": "3DGS splats",
    "spz": "the same as spz",
}

OTHERS = {"spz": "3DGS splats as spz"}  # where no line above says what is the same


@dataclass(frozen=True)
class TableRow:
    method: str
    modality: str  # MEAN: over all modalities, with the bytes and seconds of all files together
    psnr_db: float
    median_db: float  # of the photos' PSNR: one that nothing can explain does not move it
    ssim: float
    mb: float  # 1e6 bytes on disk of the file that shows this modality
    seconds: float  # that making this file used: of one core, where a processor computed
    start_s: float  # of these, before the first step
    steps: int
    splats: int  # that are there at this modality's stop
    photos: int  # held out


@dataclass(frozen=True)
class VggRow(TableRow):
    vgg_distance: float


def mean_row(rows: list[TableRow], runs: list) -> TableRow:
    """What a method gives on average, and what it takes in all."""
    from shapeshift.training.evaluation.evaluate import bytes_on_disk

    def mean(name: str, places: int) -> float:
        return round(sum(getattr(row, name) for row in rows) / len(rows), places)

    more = [mean("vgg_distance", 5)] if isinstance(rows[0], VggRow) else []
    return type(rows[0])(
        rows[0].method, MEAN, mean("psnr_db", 3), mean("median_db", 3), mean("ssim", 5),
        sum(bytes_on_disk(run.file) for run in runs) / 1e6,
        round(sum(round(run.seconds, 1) for run in runs), 1),  # of what the rows above say
        round(sum(round(run.start_s, 1) for run in runs), 1),
        sum(run.steps for run in runs),
        round(mean("splats", 1)), sum(row.photos for row in rows), *more,
    )  # fmt: skip


def finish(rows: list[TableRow], out: Path, head: list[str]) -> None:
    """table.md, and the same on standard error."""
    from rich.table import Table

    from shapeshift.app.charts.chart_rows import write_text

    columns, lines = cells(rows)
    shown = Table(*columns)
    for line in lines:
        shown.add_row(*line)
    console = open_console()
    console.print(shown)
    verdicts = compare(rows)
    for text in (*verdicts, head[2]):
        console.print(text, highlight=False, markup=False)
    page = [f"`{head[0]}`  ", f"{head[1]}  ", head[2], "", row_of(columns)]
    page += [row_of(["---"] * len(columns)), *map(row_of, lines), "", *verdicts]
    write_text(out / "table.md", "\n".join(page) + "\n")


def row_of(cells: list[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def cells(rows: list[TableRow]) -> tuple[list[str], list[list[str]]]:
    """Column names and lines as the paper has them: a method is named where its lines begin."""
    vgg = [] if not rows or not isinstance(rows[0], VggRow) else ["VGG distance"]
    columns = [
        "method",
        "modality",
        "PSNR dB",
        "median",
        "SSIM",
        *vgg,
        "splats",
        "MB",
        "steps",
        "seconds",
        "of these start",
    ]
    lines, before = [], ""
    for row in rows:
        more = [f"{row.vgg_distance:.4f}"] if isinstance(row, VggRow) else []
        name, before = NAMES[row.method] if row.method != before else "", row.method
        whole = row.method != "joint" or row.modality == MEAN  # one file for all: counted once
        size = [f"{row.mb:.2f}", f"{row.steps:,}", f"{row.seconds:.1f}", f"{row.start_s:.1f}"]
        size = size if whole else [""] * 4
        likeness = [f"{row.psnr_db:.2f}", f"{row.median_db:.2f}", f"{row.ssim:.4f}", *more]
        lines.append([name, row.modality, *likeness, f"{row.splats:,}", *size])
    return columns, lines


def compare(rows: list[TableRow]) -> list[str]:
    """What the one model gains and saves against each of the others, in a sentence."""
    means = {row.method: row for row in rows if row.modality == MEAN}
    if "joint" not in means:
        return []
    one, sentences = means["joint"], []
    for method in ("separate", "splats", "spz"):
        if method in means:
            other, name = means[method], OTHERS.get(method, NAMES[method])
            gain, time = one.psnr_db - other.psnr_db, one.seconds / max(other.seconds, 0.1)
            sentences.append(
                f"{NAMES['joint']} against {name}: {gain:+.2f} dB in the mean, "
                f"{one.mb / other.mb:.3f} of the bytes, {time:.2f} of the seconds."
            )
    return sentences
