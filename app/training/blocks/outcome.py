"""What a training in blocks has cost, and how its scene looks: what a run of the whole says."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.training.blocks.train_in_blocks import (
    COARSE,
    describe_cut,
    train_blocks,
    trained,
    work_folder,
)
from shapeshift.app.training.train_options import Options

if TYPE_CHECKING:
    from shapeshift.runtime_models.model import AnchorModel
    from shapeshift.training.blocks.starts import CutList


@dataclass(frozen=True)
class TrainOutcome:
    """What a training has cost and reached: of one run, or of that of the whole and all blocks."""

    steps: int
    seconds: float
    start_seconds: float  # of these, before first steps
    anchors: int
    warnings: tuple[str, ...]
    psnr_db: dict[str, float]  # of held-out photos, by modality; {} where none is held out


def train_quietly(
    options: Options, pace: bool, progress: Callable[[str], object] | None
) -> tuple["AnchorModel", Path, TrainOutcome]:
    """The scene, where it is, and how its training went, without a word on the terminal.

    progress: hears what is under way.  Raises UsageError, BadFile, in the words of Python.
    """
    from shapeshift.app.cluster.run_task import board_of_words

    def hear(*lines: str) -> None:
        for line in lines:
            if progress is not None:
                progress(line)

    found, model = train_blocks(options, hear, board_of_words(hear), "", pace)
    return model, options.out, outcome_of(options, found, model)


def outcome_of(options: Options, found: "CutList", model: "AnchorModel") -> TrainOutcome:
    """Out of the files of the work, and of looks at the held-out photos."""
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint

    work = work_folder(options.out)
    parts = [work / COARSE, *(work / f"{number}.shift" for number, _ in trained(found))]
    notes = [read_checkpoint(checkpoint_path(part))[1] for part in parts]
    start_s = sum(note["start_s"] for note in notes)
    stay = [line for line, row in zip(describe_cut(found)[1:], found.blocks, strict=True)
            if row.coarse]  # fmt: skip
    return TrainOutcome(
        sum(note["iteration"] for note in notes), sum(note["elapsed"] for note in notes) + start_s,
        start_s, len(model.anchors), tuple(stay), decibels_of(options, model),
    )  # fmt: skip


def decibels_of(options: Options, model: "AnchorModel") -> dict[str, float]:
    """Of every modality that has held-out photos, as `eval` scores them."""
    from shapeshift.app.opening import open_capture
    from shapeshift.app.training.evaluate import only, trained_downscale
    from shapeshift.rasterizer.device import open_device
    from shapeshift.training.calibration.extrinsics import rig_of, with_extrinsics
    from shapeshift.training.evaluation.evaluate import evaluate_model

    capture = open_capture(options.capture, options.memory, lambda *said: None)  # was said before
    capture = with_extrinsics(capture, rig_of(model.provenance))
    factor, device = trained_downscale(model.provenance), open_device(options.device)
    masks = options.asked.get("masks", "auto")
    found = {}
    for stop in capture.stops:
        if capture.of(stop.name, "test"):
            one = only(capture, stop.name)
            scores = evaluate_model(
                device, model, one, factor, masks, options.asked.get("background", "auto")
            )
            found[stop.name] = scores[stop.name].psnr_db
    return found
