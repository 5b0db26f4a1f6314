"""--max-splats for a Scaffold-GS or Octree-GS model: whole anchors go, the least shown first."""

from dataclasses import replace

import numpy as np

from runtime_models.evaluate_scaffold import ScaffoldEvaluator
from runtime_models.model import Finding, ScaffoldModel
from runtime_models.thin import largest

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
        whole = np.count_nonzero(np.cumsum(counts) <= keep)
        rows = np.flatnonzero(model.octree.level <= levels[max(whole - 1, 0)])
    if len(rows) > keep:
        rows = rows[largest(shown_of(pick(model, rows)), keep)]
    kept = pick(model, rows)
    found = Finding(
        f"{model.splat_count:,} splats, --max-splats asks for {most_splats:,}",
        0,
        f"{kept.splat_count:,} that show most are kept",
        file=", ".join(model.provenance.get("files", ())[:1]),
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
    low, high = np.percentile(model.anchors, (2, 98), axis=0)
    centre, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    if model.octree is not None:
        model = replace(model, octree=replace(model.octree, standard_m=np.inf))  # every level
    evaluator = ScaffoldEvaluator(model)
    shown = np.zeros(model.offsets.shape[:2])
    for direction in EYES:
        _, scales, _, opacity = evaluator.geometry(centre + AWAY * radius * direction)
        area = np.sort(scales, axis=1)[:, 1:].prod(axis=1)
        shown += (np.maximum(opacity, 0) * area).reshape(shown.shape)
    return shown.sum(axis=1)
