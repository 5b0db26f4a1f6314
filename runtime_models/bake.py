"""Any model at one control value as plain splats: what an export writes."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import COEFFICIENTS, basis
from shapeshift.runtime_models.evaluate import Evaluator, follows_eye
from shapeshift.runtime_models.model import BadFile, Finding, Model, ScaffoldModel, SplatLayers
from shapeshift.runtime_models.parts import splat_labels
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.stop_weights import Controls

LEAST_ALPHA = 1 / 255  # no renderer draws a fainter splat
DIRECTIONS = 64  # colours are asked for along so many: four times the functions of degree 3
BLOCK = 1 << 13  # splats at a time of what is colored anew: bounds the memory

ColorAt = Callable[[Controls], np.ndarray]  # (n, 3) as the model has them at a control
# (those of some splats, their rows in the model) -> colours (n, 3) as shown
Recolor = Callable[[ColorAt, np.ndarray], np.ndarray]


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
    least squares over all directions alike; trained harmonics are cut at that degree, which is the
    same.  recolor: false colours, laid over before that.  eye (3,), metres in the object's frame:
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

        def along(direction: np.ndarray) -> np.ndarray:
            rows = np.flatnonzero(there)

            def color_at(control: Controls) -> np.ndarray:
                return evaluator.color_along(control, direction, eye)[rows]

            return recolor(color_at, rows) if recolor else color_at(x)

        sh = fit_colors(along, len(model.anchors), count, int(there.sum()))
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


def spread_directions(count: int) -> np.ndarray:
    """(count, 3) float32 unit directions, evenly over the sphere (a golden spiral)."""
    step = np.arange(count) + 0.5
    z = 1 - 2 * step / count
    turn = np.pi * (1 + 5**0.5) * step
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], 1).astype(np.float32)


def fit_rows(count: int, number: int = DIRECTIONS) -> tuple[np.ndarray, np.ndarray]:
    """Directions (D, 3), and (D, count) what a colour along each adds to every coefficient."""
    directions = spread_directions(number)
    solve = np.linalg.pinv(basis(directions.astype(np.float64), count))  # (count, D)
    return directions, solve.T.astype(np.float32)


def fit_colors(
    color_along: Callable[[np.ndarray], np.ndarray], anchors: int, count: int, splats: int
) -> np.ndarray:
    """(splats, count, 3) harmonics of the colours (splats, 3) that are shown along directions
    (anchors, 3).

    One direction after the other for all anchors: the sum over directions is the least-squares
    solution, so that nothing but it and the colours of one direction is held.
    """
    sh = np.zeros((splats, count, 3), np.float32)
    for direction, parts in zip(*fit_rows(count), strict=True):
        color = color_along(np.tile(direction, (anchors, 1))) - np.float32(0.5)
        for coefficient, part in enumerate(parts):
            sh[:, coefficient] += part * color
    return sh


def recolored(sh: np.ndarray, recolor: Recolor) -> np.ndarray:
    """(N, M, 3) harmonics of what `recolor` makes of the colours of harmonics (N, M, 3)."""
    out = np.empty_like(sh)
    directions, parts = fit_rows(sh.shape[1], 4 * sh.shape[1])
    values = basis(directions, sh.shape[1])  # (D, M)
    for start in range(0, len(sh), BLOCK):
        rows = np.arange(start, min(start + BLOCK, len(sh)))
        color = np.maximum(values @ sh[rows] + np.float32(0.5), 0)  # (n, D, 3), as shade does
        every = np.repeat(rows, len(directions))
        flat = color.reshape(-1, 3)

        def color_at(control: Controls, flat: np.ndarray = flat) -> np.ndarray:
            return flat

        shown = recolor(color_at, every).reshape(color.shape)
        out[rows] = parts.T @ (shown - np.float32(0.5))
    return out
