"""How much a Scaffold-GS or Octree-GS model draws: --max-splats, and the gate before any drawing.

What a splat shows depends on the eye; eyes outside the scene stand for all.
"""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.lint.lint_whole import MIN_ALPHA, MOST_LAYERS, SAMPLE, layers
from shapeshift.runtime_models.model import BadFile, Finding, ScaffoldModel
from shapeshift.runtime_models.scaffold.evaluate_scaffold import ScaffoldEvaluator
from shapeshift.runtime_models.splats.operations.prune_by_importance import largest

EYES = np.concatenate([np.eye(3), -np.eye(3)])  # directions from the middle
AWAY = 2.0  # times the radius


def within_budget(model: ScaffoldModel, most_splats: int) -> ScaffoldModel:
    """The model with no more splats than that; 0 = all.

    Octree: whole levels go, the finest first.  Then anchors, by what their splats show on average
    to six eyes around the middle: opacity times the product of the two larger scales.
    """
    if not most_splats or model.splat_count <= most_splats:
        return model
    keep, rows = max(most_splats // model.splats_per_anchor, 1), np.arange(len(model.anchors))
    if model.octree is not None:
        levels, counts = np.unique(model.octree.level, return_counts=True)
        whole = int(np.count_nonzero(np.cumsum(counts) <= keep))
        rows = np.flatnonzero(model.octree.level <= levels[max(whole - 1, 0)])
    if len(rows) > keep:
        rows = rows[largest(shown_of(pick(model, rows)), keep)]
    kept = pick(model, rows)
    found = Finding(
        f"{model.splat_count:,} splats, --max-splats asks for {most_splats:,}",
        0,
        f"{kept.splat_count:,} that show most are kept",
        file=", ".join(model.provenance.get("files", ())[:1]),
        repaired=False,
    )
    return replace(kept, findings=(*model.findings, found))


def pick(model: ScaffoldModel, rows: np.ndarray) -> ScaffoldModel:
    """The model of some anchors alone."""
    octree = model.octree
    if octree is not None:
        octree = replace(
            octree, level=octree.level[rows], extra=octree.extra[rows], places=octree.places[rows]
        )
    return replace(
        model, anchors=model.anchors[rows], features=model.features[rows],
        offsets=model.offsets[rows], scales=model.scales[rows], octree=octree,
    )  # fmt: skip


def shown_of(model: ScaffoldModel) -> np.ndarray:
    """(A,) m^2: what the splats of each anchor show on average."""
    evaluator = ScaffoldEvaluator(with_every_level(model))
    shown = np.zeros(model.offsets.shape[:2])
    for eye in eyes_around(model):
        _, scales, _, opacity = evaluator.geometry(eye)
        area = np.sort(scales, axis=1)[:, 1:].prod(axis=1)
        shown += (np.maximum(opacity, 0) * area).reshape(shown.shape)
    return shown.sum(axis=1)


def refuse_filling(model: ScaffoldModel, file: str) -> None:
    """BadFile where so many splats would lie over every pixel that drawing could halt a machine."""
    step = max(model.splat_count // SAMPLE, 1)
    few = pick(model, np.arange(0, len(model.anchors), step))
    evaluator = ScaffoldEvaluator(with_every_level(few))
    means, scales, _, opacity = evaluator.geometry(eyes_around(few)[0])
    ratio = layers(means, scales, opacity >= MIN_ALPHA) * len(model.anchors) / len(few.anchors)
    if not ratio <= MOST_LAYERS:
        raise BadFile(
            f"{file}: {ratio:,.0f} splats would lie over every pixel, at most {MOST_LAYERS:,.0f} "
            "are drawn: its scales are no logarithms of metres, or its networks are another "
            "cloud's; export it again, or add --allow-huge if this is meant."
        )


def eyes_around(model: ScaffoldModel) -> np.ndarray:
    """(6, 3) metres: outside the scene, one on each side."""
    low, high = np.percentile(model.anchors, (2, 98), axis=0)
    return (low + high) / 2 + AWAY * np.linalg.norm(high - low) / 2 * EYES


def with_every_level(model: ScaffoldModel) -> ScaffoldModel:
    """The model as seen from very near: no level of an octree is too fine."""
    if model.octree is None:
        return model
    return replace(model, octree=replace(model.octree, standard_m=np.inf))
