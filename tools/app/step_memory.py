"""What a training step holds on the device: bytes an anchor, a slot (splat and tile), a pixel."""

from dataclasses import dataclass

from shapeshift.rasterizer.project import LOW_BITS, RECORD
from shapeshift.training.heads.networks import CHUNKS, HeadLayout, padded

FLOAT = 4  # bytes; every array of a step has entries of 4
SPLAT = 14  # floats: mean 3, scale 3, quaternion 4, opacity, colour 3
EVIDENCE = 2  # floats a splat and stop that densification sums up, and an anchor, twice and more
LISTS = 12  # ints a splat that sorting and binning hold: keys, orders, places


@dataclass(frozen=True)
class StepMemory:
    """Bytes a step of one layout holds for each thing that a scene has more or fewer of."""

    anchor: int
    slot: int  # a splat and a tile of its box
    pixel: int  # of one photo size
    photo_pixel: int  # of each photo that is kept as a target
    rest: int  # weights and what does not grow

    def total(self, anchors: int, slots: int, pixels: int, photos: int = 1) -> int:
        """Bytes; slots: of the view that has most of them."""
        by_pixel = self.pixel + photos * self.photo_pixel
        return self.rest + self.anchor * anchors + self.slot * slots + by_pixel * pixels


def step_memory(layout: HeadLayout, form: str = "cpu") -> StepMemory:
    """By the shapes of the arrays; the pool that lends them rounds each up by an eighth at most."""
    features, k = padded(layout.features), layout.splats
    units = 5 * padded(layout.hidden) * (2 if form == "gpu" else 1)
    own = sum(layout.own_widths.values())
    seen = sum(layout.widths[name] for name in layout.own)  # base colours of one stop
    by_anchor = 3 * (3 + features + own)  # values with their two moments
    by_anchor += 2 * (3 + features + seen)  # their gradients, and those that a view shows
    by_anchor += units + 2 * layout.raw_at[-1]  # raw outputs and gradients
    by_anchor += 2 * EVIDENCE + 3  # of one stop; reach, rows
    by_splat = 2 * SPLAT + 2 * RECORD + 1 + LISTS + layout.stops * EVIDENCE
    weights = layout.weights_at[-1]
    loss_planes = {"cpu": 18, "gpu": 24}[form]  # windowed maps, and a value a pixel
    return StepMemory(
        anchor=FLOAT * (by_anchor + k * by_splat),
        slot=FLOAT * (RECORD + {"cpu": 2, "gpu": 4}[form]),  # blocks; the sort has two of each
        pixel=FLOAT * (4 + 3 + loss_planes),
        photo_pixel=FLOAT * (9 + 1),  # the photo, its windowed maps, its bytes
        rest=FLOAT * ((5 + CHUNKS[form]) * weights + (8 << LOW_BITS)),
    )
