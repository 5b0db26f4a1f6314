"""Parts of a labelled model: one object is the rows of its label, under the same networks.

So it keeps its slider, and adds nothing to the disk.
"""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import (
    AnchorModel,
    BadFile,
    CoarserAnchors,
    Model,
    SplatLayers,
)
from shapeshift.runtime_models.program import program
from shapeshift.runtime_models.shapes import three

BACKGROUND = 0  # its label
DECIMALS = 6  # of metres: what a scene file's pose keeps, so that both say the same
MOST_TOLD = 12  # labels of a message
Place = tuple[float, float, float]  # metres


def splat_labels(model: Model) -> np.ndarray | None:
    """(N,) int32 label of each splat, 0 the background's; None of a model without labels."""
    if isinstance(model, SplatLayers):
        return model.labels
    if not isinstance(model, AnchorModel) or model.labels is None:
        return None
    return np.repeat(model.labels.astype(np.int32), model.splats_per_anchor)


def name_of(model: Model, label: int) -> str:
    """What an object is called; "" where it has no name."""
    known = model.objects if isinstance(model, AnchorModel) else ()
    return next((each.name for each in known if each.label == label), "")


def find_label(model: Model, part: int | str, where: str) -> int:
    """The label that some row has, of a part given by its label or by the name of an object.

    A text of digits is a name, where an object is called so.  Raises BadFile; `where` is the file.
    """
    labels = model.labels if isinstance(model, AnchorModel | SplatLayers) else None
    if labels is None:
        raise BadFile(
            f"{where} has no labels of objects, so no parts; `{program()} segment` makes them."
        )
    objects = model.objects if isinstance(model, AnchorModel) else ()
    label = part
    if isinstance(part, str):
        named = (each.label for each in objects if each.name == part)
        label = next(named, int(part) if part.isdecimal() else part)
    there = [int(each) for each in np.unique(labels)]
    if isinstance(label, int) and label in there:
        return label
    known = [f"{each} {name_of(model, each)}".strip() for each in there[:MOST_TOLD]]
    more = ", ..." if len(there) > MOST_TOLD else ""
    raise BadFile(f"nothing of {where} is {part!r:.60}; it has {', '.join(known)}{more}.")


def part_of(model: Model, label: int) -> tuple[Model, Place]:
    """The rows of one label in a frame of their own, and where its zero lies in the model's.

    The zero is the mean of the rows' places, and of the background the model's own: moving all
    anchors is exact, since networks see features, control, direction and light by direction alone.
    `find_label` says whether there are such rows.
    """
    if isinstance(model, AnchorModel):
        part = labelled_anchors(model, label)
        middle = middle_of(part.anchors, label)
        moved = replace(part, anchors=(part.anchors - middle).astype(np.float32))
        coarser = coarser_part(model, part, middle, label)
        return moved.with_coarser(coarser) if coarser else moved, three(middle)
    assert isinstance(model, SplatLayers) and model.labels is not None, "find_label refuses others"
    few = model.with_rows(model.labels == label)
    middle = middle_of(few.means, label)
    origin = three(np.add(few.origin, middle))
    return replace(few, means=(few.means - middle).astype(np.float32), origin=origin), three(middle)


def coarser_part(
    model: AnchorModel, part: AnchorModel, middle: np.ndarray, label: int
) -> tuple[CoarserAnchors, ...]:
    """The part's rows of each level of detail, which keep labels apart, as far as they have any.

    A level was measured by the size of the whole: the part takes it at as many pixels a metre.
    """
    if not model.coarser:
        return ()
    _, whole = frame_points(model.anchors, np.ones(len(model.anchors)))
    _, mine = frame_points(part.anchors, np.ones(len(part.anchors)))
    out = []
    for level, one in zip(model.levels[1:], model.coarser, strict=True):
        assert level.labels is not None, "a level has labels where its model has"
        rows = level.with_anchors(np.flatnonzero(level.labels == label))
        if not len(rows.anchors):
            break
        pixels, anchors = one.from_pixels * mine / whole, rows.anchors - middle
        columns = {name: getattr(rows, name) for name in ("features", "frames", "labels", "light")}
        out.append(replace(one, anchors=anchors.astype(np.float32), from_pixels=pixels, **columns))
    return tuple(out)


def labelled_anchors(model: AnchorModel, label: int) -> AnchorModel:
    """The anchors of one label, where they are, with its name alone."""
    objects = tuple(each for each in model.objects if each.label == label)
    assert model.labels is not None, "find_label refuses others"
    return replace(model.with_anchors(np.flatnonzero(model.labels == label)), objects=objects)


def middle_of(places: np.ndarray, label: int) -> np.ndarray:
    """(3,) float64 metres, of so many decimals as a pose in a file has."""
    if label == BACKGROUND:
        return np.zeros(3)
    return np.round(places.mean(axis=0, dtype=np.float64), DECIMALS) + 0.0  # never -0


# Robust bounds of splats: where they are, and how far they reach.

MIN_OPACITY = 0.1  # fainter splats are mostly floaters; they do not count for the bounds
PERCENTILES = (2, 98)
SMALLEST_RADIUS, SMALLEST_PART = 1e-30, 1e-9  # metres; of how far from zero the centre is
FALLBACK_RADIUS = 1.0  # metres, when nothing is there to be framed


def frame_points(means: np.ndarray, opacity: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (3,) and radius in metres of splats with means (N, 3) and opacity (N,).

    The 2nd to 98th percentile of what can be seen: a few far floaters move neither.  With nothing
    that opaque every finite mean counts; with no mean at all, a metre about the origin.
    """
    points = seen_points(means, opacity)  # (P, 3)
    if not len(points):
        return np.zeros(3), FALLBACK_RADIUS
    low, high = np.percentile(points, PERCENTILES, axis=0)
    centre = (low + high) / 2
    radius = float(np.percentile(np.linalg.norm(points - centre, axis=1), PERCENTILES[1]))
    # next to its numbers a smaller one is lost in rounding: the eye would lie in what it looks at
    least = max(SMALLEST_PART * float(np.abs(centre).max()), SMALLEST_RADIUS)
    return centre, radius if radius > least else max(FALLBACK_RADIUS, 1000 * least)


def seen_points(means: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """(P, 3) float64 means that count for the bounds."""
    finite = np.isfinite(means).all(axis=1)
    seen = finite & (opacity > MIN_OPACITY)  # NaN opacity is not seen
    return means[seen if seen.any() else finite].astype(np.float64)
