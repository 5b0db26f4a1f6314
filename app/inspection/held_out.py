"""How far a scene's values are from photos that it was not trained on."""

from collections.abc import Callable, Collection, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.inspection.draw_values import MeasuredScene, draw_values, value_of_colors
from shapeshift.app.progress import tracked
from shapeshift.app.training.evaluate import trained_downscale
from shapeshift.renderer.colors.palette import LUMINANCE
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import moved
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.inspection.marks_file import HeldOutError

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

HALF = 128  # alpha of a photo's pixel that shows the scene, as of a value that is known


def held_out_error(
    renderer: "Renderer", measured: MeasuredScene, document: Document, capture: Capture,
    one_by_one: Callable[[Collection, str], Iterable[Any]] = tracked,
) -> HeldOutError:  # fmt: skip
    """Over all pixels of the held-out photos where both know a value; one_by_one: goes through
    them, the usual one with a bar.

    Photos are made smaller as in the training.  Raises BadFile, UsageError.
    """
    from shapeshift.training.calibration.extrinsics import rig_of, with_extrinsics
    from shapeshift.training.photos import choose_downscale, read

    if document.file is not None:
        raise UsageError("--capture is of one model; a scene file has none of its own.")
    provenance = document.models[0].provenance
    capture = with_extrinsics(capture, rig_of(provenance))
    if measured.parts:
        raise UsageError(
            f"'{measured.stop.name}' is by formula and has no photos; its stops have: --stop "
            f"{measured.parts[0][1].stop.name}."
        )
    photos = capture.of(measured.stop.name, "test")
    if not photos:
        raise BadFile(
            f"{capture.folder}: no photo of '{measured.stop.name}' is held out for testing; mark "
            "some with split 'test'."
        )
    factor = trained_downscale(provenance) or choose_downscale(capture.photos)
    assert measured.stop.value_range is not None  # measured_scene has seen to it
    low, high = measured.stop.value_range
    errors = []
    for photo in one_by_one(photos, "comparing with held-out photos"):
        loaded = read(photo, factor, "auto")
        (view,) = moved([loaded.view], (np.array(capture.origin) - document.origin).tolist())
        values = draw_values(renderer, measured, view)
        colors = loaded.rgba[..., :3] / 255.0
        share = (
            value_of_colors(colors, measured.colors)[0] if measured.colors else colors @ LUMINANCE
        )
        counts = values.known & (loaded.rgba[..., 3] >= HALF)
        if loaded.weight is not None:
            counts &= loaded.weight >= 0.5
        errors.append(np.abs(values.values - (low + (high - low) * share))[counts])
    every = np.concatenate(errors)
    if not len(every):
        raise BadFile(f"{capture.folder}: no held-out photo shows what the scene covers.")
    return HeldOutError(float(every.mean()), float(np.percentile(every, 95)), len(photos))
