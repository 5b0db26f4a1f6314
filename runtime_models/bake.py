"""Any model at one control value as plain splats: what an export writes."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import COEFFICIENTS
from shapeshift.runtime_models.evaluate import Evaluator, follows_eye
from shapeshift.runtime_models.eyes import eyes_of
from shapeshift.runtime_models.fit_harmonics import (
    Recolor,
    fit_colors,
    fit_seen_colors,
    recolored,
)
from shapeshift.runtime_models.model import BadFile, Finding, Model, ScaffoldModel, SplatLayers
from shapeshift.runtime_models.parts import splat_labels
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.stop_weights import Controls

LEAST_ALPHA = 1 / 255  # no renderer draws a fainter splat


def bake(
    model: Model,
    x: Controls,
    eye: np.ndarray | None = None,
    sh_degree: int = 3,
    recolor: Recolor | None = None,
    keep: np.ndarray | None = None,
) -> PlainSplats:
    """The splats of a model at x, one value or one an anchor (layers: a splat), that are there.

    Colours that depend on the direction become spherical harmonics of `sh_degree`, the best in
    least squares over the directions from which the model's photos were taken (`eyes_of`), or where
    it knows none over all directions alike; trained harmonics are cut at that degree, which is the
    latter.  recolor: false colours, laid over before that.  eye (3,), metres in the object's frame:
    where a model is seen from whose shape depends on it; the others need none.  keep (N,) bool: of
    the model's splats no others are written.  Raises BadFile.
    """
    if follows_eye(model) and eye is None:
        raise BadFile("the splats of such a scene depend on the eye; say from where it is seen.")
    if sh_degree not in range(len(COEFFICIENTS)):
        raise BadFile(f"spherical harmonics of degree {sh_degree} are asked for; 0 to 3 are known.")
    count = COEFFICIENTS[sh_degree]
    evaluator = Evaluator(model)
    means, scales, wxyz, opacity = evaluator.geometry(x, eye=eye)
    there = find_present(means, scales, wxyz, opacity)
    if not there.any():
        raise BadFile(f"none of {len(there):,} splats is there at this x; choose another one.")
    absent = int(len(there) - there.sum())
    if keep is not None:
        there &= keep
    if not there.any():
        raise BadFile("nothing of what was chosen is there at this x; choose another one.")
    if isinstance(model, SplatLayers):
        sh = of_rows(model.sh[:, :count], there)
        if recolor:
            sh = recolored(sh, lambda at, rows: recolor(at, np.flatnonzero(there)[rows]))
    else:
        rows = np.flatnonzero(there)

        def along(direction: np.ndarray) -> np.ndarray:
            def color_at(control: Controls) -> np.ndarray:
                return evaluator.color_along(control, direction, eye)[rows]

            return recolor(color_at, rows) if recolor else color_at(x)

        eyes = eyes_of(model)
        if len(eyes):
            of_anchor = rows // model.splats_per_anchor
            sh = fit_seen_colors(along, model.anchors, of_anchor, eyes, count)
        else:
            sh = fit_colors(along, len(model.anchors), count, len(rows))
    return as_plain(
        model, [of_rows(a, there) for a in (means, scales, wxyz, opacity)], sh, there, absent
    )


def find_present(
    means: np.ndarray, scales: np.ndarray, wxyz: np.ndarray, opacity: np.ndarray
) -> np.ndarray:
    """(N,) bool: finite, and opaque enough to be drawn."""
    there = opacity >= LEAST_ALPHA  # NaN is not; what is absent has 0 or less
    for array in (means, scales, wxyz):
        there &= np.isfinite(array).all(axis=1)
    return there


def of_rows(array: np.ndarray, there: np.ndarray) -> np.ndarray:
    """The rows of an array that are there; the array itself, not a copy, where all are."""
    return array if there.all() else array[there]


def as_plain(
    model: Model,
    geometry: list[np.ndarray],
    sh: np.ndarray,
    there: np.ndarray,
    absent: int,
) -> PlainSplats:
    """The rows that are there, with what the model knows about them."""
    findings: tuple[Finding, ...] = ()
    if absent:
        findings = (Finding(f"{absent:,} splats are absent at this x", absent, "left out"),)
    means, scales, wxyz, opacity = geometry
    opacity = np.minimum(opacity, 1)
    plain = PlainSplats(means, scales, wxyz, opacity, sh, findings=findings, format="baked")
    if isinstance(model, ScaffoldModel):
        return replace(plain, origin=model.origin)
    labels = splat_labels(model)
    plain = replace(plain, labels=None if labels is None else of_rows(labels, there))
    if not isinstance(model, SplatLayers):
        return plain
    return replace(
        plain,
        origin=model.origin,
        antialiased=model.antialiased,
        extra={name: of_rows(column, there) for name, column in model.extra.items()},
    )
