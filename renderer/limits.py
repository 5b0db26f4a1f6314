"""How many splats a device can hold, and one sentence for a scene that has more."""

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import RECORD
from shapeshift.runtime_models.model import BadFile, Model, SplatLayers

MOST_INDEX = 2**31 - 1  # the kernels count floats with 32 bits and a sign


class TooLarge(BadFile):
    """A scene does not fit a device's buffers.  The message says which limit and what fits."""


def too_many(count: int, most: int, limit: str, instead: str) -> TooLarge:
    """The refusal of `count` splats where `most` fit; `limit` names what they do not fit into,
    `instead` the other way of drawing.
    """
    return TooLarge(
        f"the scene has {count:,} splats and this driver draws {most:,} at most ({limit}); open it "
        f"with --max-splats {most} to see it with neighbours merged, or draw it with "
        f"--drawing {instead}."
    )


def arena_rows(model: Model) -> int:
    """Rows that the model has in the arena for good: none where a budget says which are there."""
    return 0 if isinstance(model, SplatLayers) and model.leaves is not None else model.splat_count


def check_tiles(device: Device, models: list[Model], more: int = 0) -> None:
    """Raises TooLarge where an array of these objects' splats is longer than the device allows.

    more: rows for what a budget draws.
    """
    count = sum(map(arena_rows, models)) + more
    most = MOST_INDEX // RECORD
    if not count <= most:
        raise too_many(count, most, "the kernels count with 32 bits", "quads")
    sh = [model.sh for model in models if isinstance(model, SplatLayers)]
    largest = 4 * max([RECORD, *(3 * array.shape[1] for array in sh)])  # bytes a splat
    most = device.most_bytes // largest
    if device.most_bytes and not count <= most:
        limit = f"CL_DEVICE_MAX_MEM_ALLOC_SIZE is {device.most_bytes:,} bytes"
        raise too_many(count, most, f"{limit}, a splat takes {largest} of one array", "quads")
