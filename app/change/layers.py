"""The two visits and their change as one folder that the viewer opens: a stop each on one slider.

The change is a stop of values: a palette, a range and a unit, as heat has them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.app.change.draw_visits import Visit
from shapeshift.app.change.find_change import FoundChange
from shapeshift.runtime_models.bake import bake
from shapeshift.runtime_models.colors.spherical_harmonics import basis
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.shapes import three
from shapeshift.runtime_models.splats.layers.layer_list import write_layer_list
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_splats
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.write_plain import merged
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.change.places import SurfaceCells, color_distance
from shapeshift.scene.change.similarity import Similarity

NEAR = 2.0  # cells from a splat to the cell that says what changed there
ENDS = 99.5  # percentile of the changes that the end of a range is at, at least
TIMES = 4.0  # of the least change that counts, that a range reaches at least
DEGREE = 1  # of the harmonics that are kept of the colours
DC = float(basis(np.array([[0.0, 0.0, 1.0]]), 1)[0, 0])  # of spherical harmonics of degree 0


def write_layers(found: FoundChange, folder: Path) -> int:
    """Before, After and a stop a measure of change, in the world of A's file; returns bytes."""
    a_from_b = found.change.registration.a_from_b
    before = baked(found.before, Similarity.identity())
    after = baked(found.after, a_from_b)
    layers: list[tuple[str, str, PlainSplats, tuple[float, float] | None]]
    layers = [("Before", "", before, None), ("After", "", after, None)]
    union = with_what_is_gone(before, after, found)
    for name, unit, values, least in measures(found, union.means):
        low, high = reach_of(values, least)
        share = np.clip((values - low) / (high - low), 0, 1)
        sh = ((share[:, None, None] - 0.5) / DC).repeat(3, axis=2).astype(np.float32)
        layers.append((name, unit, replace(union, sh=sh), (low, high)))
    stops = [
        Stop(name, i / (len(layers) - 1), "layer")
        if ends is None
        else Stop(name, i / (len(layers) - 1), kind_of(name), "turbo", ends, unit)
        for i, (name, unit, _, ends) in enumerate(layers)
    ]
    origin = np.asarray(found.before.document.origin)
    splats = [replace(s, origin=three(np.add(s.origin, origin))) for _, _, s, _ in layers]
    return write_layer_list(list(zip(stops, splats, strict=True)), folder)


def kind_of(name: str) -> str:
    """Of a stop of change: other values than heat have digits of their own."""
    return "values" if name == "Change of values" else "thermal"


def baked(visit: Visit, a_from_b: Similarity) -> PlainSplats:
    """A visit's splats at the stop of its shape, in A's own metres, without other columns."""
    model = visit.document.models[0]
    stop = visit.photo or (visit.measured.stop if visit.measured else model.stops[0])
    eye = default_view(model, (640, 360)).world_from_eye.position
    splats = bake(model, stop.x, eye, DEGREE)
    splats = replace(splats, origin=(0.0, 0.0, 0.0), extra={}, labels=None)
    splats = rotate_splats(splats, a_from_b.rotation)
    scale, shift = np.float32(a_from_b.scale), a_from_b.shift.astype(np.float32)
    return replace(splats, means=splats.means * scale + shift, scales=splats.scales * scale)


def with_what_is_gone(before: PlainSplats, after: PlainSplats, found: FoundChange) -> PlainSplats:
    """The later visit with those splats of the earlier one that have no surface there any more."""
    gone = [p.points for p in found.change.places if p.kind == "vanished"]
    gone += [p.before for p in found.change.places if p.kind == "moved"]
    if not gone:
        return after
    from scipy.spatial import cKDTree

    reach = found.change.settings.cell_m
    away = cKDTree(np.concatenate(gone)).query(before.means, distance_upper_bound=reach)[0]
    rows = np.isfinite(away)
    fields = {n: getattr(before, n)[rows] for n in ("means", "scales", "wxyz", "opacity", "sh")}
    return merged([after, replace(before, **fields)]) if rows.any() else after


def measures(found: FoundChange, means: np.ndarray) -> list[tuple[str, str, np.ndarray, float]]:
    """(stop, unit, (n,) values of splats at means (n, 3), least that counts) of all compared."""
    before, after = found.cells
    settings, unit = found.change.settings, found.change.unit
    rows = [("Change of shape", "mm", 1000 * shape_change(before, found),
             1000 * shape_change(after, found), 1000 * settings.least_m)]  # fmt: skip
    for word in {"heat", "values"} & set(found.change.compared):
        pair = before.value_change, -after.value_change
        rows.append((f"Change of {word}", unit, *pair, settings.least_value))
    if "colour" in found.change.compared:
        pair = color_distance(before.color_change), color_distance(after.color_change)
        rows.append(("Change of colour", "Lab", *pair, settings.least_color))
    points = np.concatenate([before.points, after.points])
    return [
        (name, said, spread(points, np.concatenate([first, second]), means, settings.cell_m), least)
        for name, said, first, second, least in rows
    ]


def shape_change(cells: SurfaceCells, found: FoundChange) -> np.ndarray:
    """(m,) metres to the other visit's surface where that sees through, else 0."""
    reach = found.before.document.bounds()[1]
    return np.where(cells.through >= 0.5, np.minimum(cells.away_m, reach), 0.0)


def spread(points: np.ndarray, values: np.ndarray, means: np.ndarray, cell_m: float) -> np.ndarray:
    """(n,) of the largest change among the cells around each of means; 0 where none is known."""
    from scipy.spatial import cKDTree

    good = np.isfinite(values)
    if not good.any():
        return np.zeros(len(means))
    values = values[good]
    away, near = cKDTree(points[good]).query(
        means, k=min(4, len(values)), distance_upper_bound=NEAR * cell_m
    )
    away, near = away.reshape(len(means), -1), near.reshape(len(means), -1)
    held = np.where(np.isfinite(away), values[np.minimum(near, len(values) - 1)], np.nan)
    known = np.isfinite(held).any(axis=1)
    out = np.zeros(len(means))
    out[known] = np.nanmedian(held[known], axis=1)
    return out


def reach_of(values: np.ndarray, least: float) -> tuple[float, float]:
    """The range of a stop: from nothing, or as far down as up where values have a sign."""
    high = max(float(np.percentile(np.abs(values), ENDS)), TIMES * least)
    high = float(f"{high:.2g}")
    return (-high if (values < 0).any() else 0.0), high
