"""The gate before a package is drawn: networks can ask for splats of any size."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.lint.lint_whole import (
    SAMPLE,
    fill_ratio,
    refuse_boundless,
    sample_of,
)
from shapeshift.runtime_models.lint.lint_whole import refuse_filling as refuse_sample
from shapeshift.runtime_models.model import AnchorModel


def refuse_filling(model: AnchorModel, file: str) -> None:
    """BadFile where the splats of a stop would lie over every pixel in thousands.

    A part of the anchors is decoded for it, at every stop.
    """
    step = max(-(-model.splat_count // SAMPLE), 1)
    few = model.with_anchors(slice(None, None, step))
    evaluator = Evaluator(few)
    fullest = None
    for stop in model.stops:
        with np.errstate(over="ignore", invalid="ignore"):
            means, scales, _, opacity = evaluator.geometry(stop.x)
        finite = np.isfinite(means).all(1) & np.isfinite(scales).all(1) & (opacity > 0)
        if not finite.any():
            continue
        sample = sample_of(means[finite], scales[finite], opacity[finite])
        refuse_boundless(file, sample)
        # of all rows that were decoded, times what was left out
        sample = replace(sample, part=sample.part * len(few.anchors) / len(model.anchors))
        if fullest is None or fill_ratio(sample) > fill_ratio(fullest):
            fullest = sample
    if fullest is not None:
        refuse_sample(file, fullest)
