"""Cases of networks gone wrong: control values that no one trained, weights that are no numbers."""

from dataclasses import replace

import numpy as np

from shapeshift.app.stability_cases.case_context import CaseContext, difference
from shapeshift.app.stability_cases.finding import (
    Panel,
    Result,
    at_least,
    at_most,
    broken_pixels,
    clean,
    decibels,
)
from shapeshift.app.stability_cases.places import ORACLE_DB
from shapeshift.app.stability_cases.scenes import alone, front, small_model
from shapeshift.runtime_models.model import HEADS, SIZE_PER_SPLAT, AnchorModel, Mlp

OUTSIDE = (-0.1, -1e-3, 1.001, 1.1, 1e30, np.inf, -np.inf, np.nan)  # of 0..1, both sides


def extrapolated(case: CaseContext) -> Result:
    """x outside [0, 1] is refused with a sentence, and what was drawn before is drawn again."""
    scene, view = case.scene(), case.view()
    before = case.draw(scene, view)
    taken, silent = 0, 0
    for x in OUTSIDE:
        try:
            case.renderer.update(case.scene(x=float(x)))
        except ValueError as refusal:
            silent += not is_sentence(str(refusal))
        else:
            taken += 1
    after = case.draw(scene, view)
    findings = [
        clean(before, after),
        at_most(
            f"of {len(OUTSIDE)} values outside 0..1 (NaN too) that were taken", taken, 0,
            "nothing was trained there: networks may answer anything; sliders clamp, the renderer "
            "refuses",
        ),
        at_most(
            "refusals that are no sentence", silent, 0, "a person reads them",
        ),
        at_most(
            "largest change of the scene afterwards", np.abs(after - before).max(), 1e-6,
            "a refused value leaves everything as it was",
        ),
    ]  # fmt: skip
    panels = [case.panel("after the refusals", after), case.panel("before", before)]
    return Result(findings, panels)


def is_sentence(text: str) -> bool:
    """One line of several words that ends like a sentence."""
    return len(text.split()) >= 4 and "\n" not in text.strip() and text.strip().endswith(".")


def broken_heads(case: CaseContext) -> Result:
    """NaN and Inf in the weights or biases of one head at a time."""
    only = case.subject.models[0] if not case.subject.file else None
    model = only if isinstance(only, AnchorModel) else small_model()
    view = case.view() if model is only else front(case.size)
    whole = case.draw(alone(model), view)
    images, broken_by_name = {}, {}
    for head in HEADS:
        for what, value in (("NaN", np.nan), ("Inf", np.inf), ("-Inf", -np.inf)):
            for where in ("all weights", "one bias"):
                broken = with_broken_head(model, head, value, where)
                name = f"{what} in {where} of {head}"
                images[name] = case.draw(alone(broken), view)
                broken_by_name[name] = broken_pixels(images[name])
    worst = max(broken_by_name, key=lambda name: broken_by_name[name])
    one = case.draw(alone(small_model()), front(case.size))
    partly, known = half_broken(case)
    findings = [
        at_most(
            f"broken pixels in {len(images)} pictures (worst: {worst})",
            sum(broken_by_name.values()), 0,
            "what is not finite is not drawn: one NaN fragment would poison its pixel for good",
        ),
        at_least(
            "NaN in one splat's opacity of each anchor, against float64 without it, dB", partly,
            known, "the other splats stay as they are (16 bits leave 78 dB and more)",
        ),
        clean(whole, one),
    ]  # fmt: skip
    panels = [
        case.panel(worst, images[worst]),
        case.panel("whole networks", whole),
        Panel("8 times the difference", difference(images[worst], whole)),
    ]
    return Result(findings, panels)


def half_broken(case: CaseContext) -> tuple[float, float]:
    """dB of a small model of which one opacity output is NaN, and the least it may be."""
    model, view = small_model(), front((160, 96))
    broken = with_broken_head(model, "opacity", np.nan, "one bias")
    image = case.draw(alone(broken), view)
    return decibels(image, case.reference(alone(broken), view)), ORACLE_DB


def with_broken_head(model: AnchorModel, head: str, value: float, where: str) -> AnchorModel:
    """The model with one head's numbers replaced; `where`: "all weights" or "one bias"."""
    mlp = model.networks[head]
    weights, biases = list(mlp.weights), list(mlp.biases)
    if where == "all weights":
        weights[-1] = np.full_like(weights[-1], value)
    else:
        biases[-1] = biases[-1].copy()
        biases[-1][: SIZE_PER_SPLAT[head]] = value  # of the first splat of every anchor
    broken: Mlp = replace(mlp, weights=tuple(weights), biases=tuple(biases))
    return replace(model, networks=model.networks | {head: broken})
