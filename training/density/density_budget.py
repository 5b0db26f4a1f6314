"""How many anchors a budget of megabytes allows: --max-mb is of the package on disk."""

import numpy as np

from shapeshift.runtime_models.model import BadFile, ControlEncoding, Stop
from shapeshift.runtime_models.package.package_files import LIGHT
from shapeshift.runtime_models.package.write_package import package_files, zip_files
from shapeshift.training.export import model_of
from shapeshift.training.heads.networks import HeadLayout, initial_weights, padded
from shapeshift.training.settings import TrainSettings

POSITION_BYTES, NUMBER_BYTES = 12, 2  # of an anchor, and of each of its other numbers but light
NOTES_BYTES = 4096  # provenance and names in the manifest
GROWN = 1.02  # times the networks of the start: trained weights may compress less


def bytes_without_anchors(
    layout: HeadLayout, encoding: ControlEncoding, stops: tuple[Stop, ...]
) -> int:
    """At most, of a package whose networks have this layout."""
    state = {
        "weights.value": initial_weights(layout, np.random.default_rng(0)),
        "anchors.value": np.zeros((1, 3), np.float32),
        "features.value": np.zeros((1, padded(layout.features)), np.float32),
    }
    for name, width in layout.own_widths.items():
        state[f"{name}.value"] = np.ones((1, width), np.float32)
    one = model_of(state, layout, 1.0, encoding, stops, {})
    return int(GROWN * len(zip_files(package_files(one, "float16")))) + NOTES_BYTES


def anchor_cap(
    settings: TrainSettings,
    layout: HeadLayout,
    encoding: ControlEncoding,
    stops: tuple[Stop, ...],
) -> int:
    """The cap of growing, from the number and the megabytes (1,000,000 bytes) that are allowed.

    Raises BadFile where no anchor would fit.
    """
    if settings.max_mb is None:
        return settings.max_anchors
    fixed = bytes_without_anchors(layout, encoding, stops)
    widths = layout.own_widths
    numbers = layout.features + sum(width for name, width in widths.items() if name != LIGHT)
    size = POSITION_BYTES + NUMBER_BYTES * numbers + widths.get(LIGHT, 0)  # light: a byte each
    fits = int((settings.max_mb * 1e6 - fixed) // size)
    if fits < 1:
        raise BadFile(
            f"--max-mb {settings.max_mb:g} leaves no room for anchors: the networks alone take up "
            f"to {fixed / 1e6:.3f} MB; allow more, or make them smaller by the setting hidden."
        )
    return min(settings.max_anchors, fits)
