"""A block's trainer, as its coarse run saw the photos."""

from dataclasses import replace

from shapeshift.rasterizer.device import with_small_pool
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.blocks.block_start import ADVICE, BlockStart
from shapeshift.training.blocks.block_trainer import BlockTrainer
from shapeshift.training.calibration.extrinsics import with_extrinsics
from shapeshift.training.photo_store.open_photos import PhotoRoom
from shapeshift.training.settings import TrainSettings


def begin_block(
    device, start: BlockStart, capture: Capture, settings: TrainSettings,
    resume: tuple | None = None, room: PhotoRoom | None = None,
) -> BlockTrainer:  # fmt: skip
    """The trainer, before its first step.  Raises BadFile."""
    if resume is not None and resume[1].get("of_block") != start.notes["of_block"]:
        raise BadFile(
            f"the checkpoint is of another block, or of one that was cut otherwise; {ADVICE}, or "
            "leave out --resume."
        )
    color, factor = start.provenance.get("background"), start.provenance.get("downscale")
    settings = replace(settings, downscale=factor)
    if settings.background == "auto":  # a part of the photos could look otherwise than all do
        if color is None and not start.provenance.get("still_background"):
            settings = replace(settings, background="random")
        elif color is not None:
            capture = replace(capture, background=tuple(color))
    given = with_extrinsics(capture, settings.rig)
    device = with_small_pool(device)
    return BlockTrainer(device, start, given, settings, resume, room)
