"""A stage for the cases of `launch.py stability`: small scenes, few steps."""

from shapeshift.app.document import Document
from shapeshift.app.stability_cases.case_context import CaseContext
from shapeshift.runtime_models.model import SplatLayers
from tests.support.splat_scenes import random_layers

SIZE = (96, 64)


def make_case(renderer, ctx, reopen, model: SplatLayers | None = None, **choices) -> CaseContext:
    """A cloud of splats of random colours in two layers: the hardest scene for an old order."""
    model = model or random_layers(1500, seed=3, layers=2)
    return CaseContext(
        renderer, ctx, Document.of(model), SIZE, reopen, steps=12, rounds=20, **choices
    )


def failures(result) -> list[str]:
    return [
        f"{f.figure}: {f.measured:.6g}, bound {f.bound}"
        for f in result.findings
        if f.verdict == "FAILS"
    ]
