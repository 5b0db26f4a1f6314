"""A report of measured lengths alone: of any scene, whether it has heat or not."""

from dataclasses import dataclass

import numpy as np

from shapeshift.app.inspection.length_pictures import (
    LENGTHS_WORDS,
    Measured,
    length_rows,
    with_lengths,
)
from shapeshift.app.inspection.report import (
    InspectionReport,
    ReportHead,
    ReportView,
    camera_words,
    cameras_text,
)
from shapeshift.scene.inspection.lengths import Scale
from shapeshift.scene.pose import View


@dataclass(frozen=True, eq=False)
class SeenLengths:
    """A view with what was measured."""

    picture: np.ndarray  # (H, W, 3) display sRGB
    view: View
    measured: Measured
    scale: Scale  # of the lengths


def length_report(
    title: str, scene: str, seen: SeenLengths, origin: np.ndarray, x: str = ""
) -> InspectionReport:
    """scene: the name of its file; x: where the slider stands, "": as the scene opens.

    Raises ValueError, one sentence, where nothing was measured.
    """
    if not seen.measured:
        raise ValueError("nothing was measured yet; lay points on the surface first.")
    picture = with_lengths(np.clip(seen.picture, 0, 1), seen.view, seen.measured)
    view = ReportView("View", [("Picture", picture)], [], [], [], [])
    factor, error = seen.scale.factor, seen.scale.error
    scale = "as the scene has it" if factor == 1 else f"lengths times {factor:.6g} ± {error:.2%}"
    settings = [("scale", scale), ("camera", camera_words(seen.view, origin))]
    cameras = cameras_text([seen.view], ("View",), origin)
    return InspectionReport(
        ReportHead(f"Measurements: {title}"), [view], settings, LENGTHS_WORDS, scene, x, cameras,
        length_rows(seen.measured),
    )  # fmt: skip
