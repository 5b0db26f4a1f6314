"""A block's trainer, as its coarse run saw the photos."""

from dataclasses import replace
from typing import Any

import numpy as np

from shapeshift.rasterizer.device import with_small_pool
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.blocks.block_start import ADVICE, BlockStart
from shapeshift.training.calibration.extrinsics import with_extrinsics
from shapeshift.training.density.densify import NewAnchors
from shapeshift.training.photo_store.open_photos import PhotoRoom
from shapeshift.training.settings import TrainSettings
from shapeshift.training.train import Trainer

# Trains one block: goes on from its part of the coarse run, with heads of its own.

MARGIN = 4.0  # voxels that the box is enlarged by for new anchors: a splat reaches two


class BlockTrainer(Trainer):
    """Anchors outside of the block are there because its photos show them; they learn, too, and do
    not leave the run."""

    def __init__(
        self, device, start: BlockStart, capture: Capture, settings: TrainSettings,
        resume: tuple | None = None, room: PhotoRoom | None = None,
    ) -> None:  # fmt: skip
        """settings: with the downscale and the background of the coarse run; resume: of a
        checkpoint of this very block."""
        self.start = start
        if resume is None:
            length = {"run_length": settings.iterations}
            resume = start.state, start.notes | length
        super().__init__(device, start.capture_of(capture), settings, resume, room=room)
        self.targets.most = 0  # made at each use, 2 % of a step: a block sees half of all photos

    def lay_out(self) -> None:
        super().lay_out()
        self.most_inside = self.anchor_cap  # of anchors within the enlarged box

    def inside(self, places: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """(N,) bool: which places (N, 3) are the block's, enlarged by so many voxels."""
        return self.start.place.holds(places, margin * self.voxel)

    def densify(self) -> None:
        """As ever for the anchors inside; those outside neither go nor ask for others."""
        outside = ~self.inside(self.device.download(self.adam["anchors"]), MARGIN)
        self.anchor_cap = self.most_inside + int(outside.sum())
        state = self.stats.state()
        grad2d = state["densify.grad2d"]
        grad2d.reshape(len(grad2d), len(outside), -1)[:, outside] = 0
        state["densify.opacity"][outside] = 0
        state["densify.contribution"][:, outside] = 0
        self.stats.load(state)
        super().densify()

    def allowed(self, kept: np.ndarray, new: NewAnchors) -> tuple[np.ndarray, NewAnchors]:
        inside = self.inside(new.anchors, MARGIN)
        return kept, NewAnchors(new.anchors[inside], new.parents[inside])

    def checkpoint(self) -> tuple[dict[str, np.ndarray], dict]:
        state, notes = super().checkpoint()
        return state, notes | {"of_block": self.start.notes["of_block"]}

    def model(self) -> AnchorModel:
        """The anchors that stand in the block.  Raises BadFile where none does."""
        whole = super().model()
        rows = np.flatnonzero(self.inside(whole.anchors))
        if not len(rows):
            raise BadFile(
                "no anchor of this block is left in its box; train with fewer blocks, or with more "
                "photos of that place."
            )
        return replace(whole.with_anchors(rows), provenance=self.provenance(whole.provenance))

    def provenance(self, own: dict[str, Any]) -> dict[str, Any]:
        """Of the block; the first look is that at the whole."""
        whole = {name: v for name, v in self.start.provenance.items() if name == "view"}
        photos = sum(len(found) for found in self.schedule.photos.values())
        rest = {name: v for name, v in own.items() if name != "view"}
        return rest | whole | {"block_photos": photos}


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
