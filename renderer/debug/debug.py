"""Debug pictures of a frame: settings.DEBUG_VIEWS.

The drawings give what they hold (splat_points), take other colours (write_colors) and count
fragments (overdraw); everything else is numpy on the CPU, the same for quads and tiles.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.debug.debug_map import (
    Points,
    birdseye,
    classify,
    dim,
    dot_size,
    eye_places,
    paint_points,
    runs,
)
from shapeshift.renderer.settings import (
    CULL_REASONS,
    EDGES,
    FrameStats,
    RenderSettings,
)
from shapeshift.renderer.streaming.stream import has_leaves
from shapeshift.runtime_models.model import Model, is_antialiased
from shapeshift.runtime_models.parts import name_of, splat_labels
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.four_views import color_of
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene

# Told apart with any colour vision, by their lightness where not by their hue.
REASON_COLORS = {
    "drawn": (0.17, 1.00, 0.33),
    "opacity": (0.49, 0.21, 0.15),
    "distance": (1.00, 0.77, 0.86),
    "frustum": (0.61, 0.75, 0.47),
    "size": (0.11, 0.55, 0.99),
    "footprint": (0.27, 0.35, 0.48),
    "faded": (0.55, 0.47, 0.08),
}
REASON_TEXTS = {
    "drawn": "drawn",
    "opacity": "too faint",
    "distance": "too far",
    "frustum": "outside the view",
    "size": "too large",
    "footprint": "too small",
    "faded": "faded away",
}
# Ramps from 0 to 1, display sRGB: dark to bright in equal steps for the eye.
HEAT = np.asarray(
    [[0, 0, 0.02], [0.26, 0.04, 0.41], [0.58, 0.15, 0.40], [0.87, 0.32, 0.23], [0.99, 0.65, 0.04],
     [0.99, 1.0, 0.64]]
, np.float32)  # fmt: skip
DISTANT = np.asarray(
    [[0.27, 0.0, 0.33], [0.23, 0.32, 0.55], [0.13, 0.57, 0.55], [0.37, 0.79, 0.38],
     [0.99, 0.91, 0.14]]
, np.float32)  # fmt: skip
LEGEND_STEPS = 5  # rows that stand for a ramp
MOST_LABELS = 24  # rows of a legend
RECOLORED = ("depth", "object")  # drawn with other colours than the scene's


class DebugDrawing(Protocol):
    """What debug pictures need of QuadsDrawing and TilesDrawing."""

    def splat_points(self) -> Points: ...
    def write_colors(self, color: np.ndarray) -> None: ...
    def overdraw(self, i: int, view: View, settings: RenderSettings) -> np.ndarray: ...
    def image(self, i: int) -> np.ndarray: ...
    def edges(self, i: int, view: View, settings: RenderSettings, kind: str) -> np.ndarray: ...


def prepare_debug(drawing: DebugDrawing, views: list[View], scene: Scene, name: str) -> bool:
    """Before the draw: other colours for depth and object; True where the scene's are gone."""
    if name not in RECOLORED or not scene.splat_count:
        return False
    given = drawing.splat_points()
    points, rows = by_object(given)
    colors = np.zeros((len(given[1]), 3), np.float32)
    colors[rows] = splat_colors(points, views[0], scene, name)
    drawing.write_colors(colors)
    return True


def by_object(points: Points) -> tuple[Points, np.ndarray]:
    """The points of all objects, one object after the other, and which rows (n,) they were: in
    pages they lie anywhere, and pages that are free belong to object -1.
    """
    rows = np.argsort(points[1], kind="stable")
    rows = rows[np.searchsorted(points[1][rows], 0) :]
    mean_opacity, owner, covariance = (array[rows] for array in points)
    return (mean_opacity, owner, covariance), rows


def splat_colors(points: Points, view: View, scene: Scene, name: str) -> np.ndarray:
    """(N, 3) float32: depth as a part of the farthest one, or the object's colour."""
    depth = -eye_places(points, object_poses(scene), view.eye_from_world())[2]
    if name == "depth":
        part = np.clip(np.nan_to_num(depth / farthest_depth(depth)), 0, 1)
        return np.repeat(part[:, None], 3, axis=1)
    colors = np.empty((len(depth), 3), np.float32)
    ranks = [label_ranks(obj.model)[1] for obj in scene.objects]
    counts = [len(parts) for parts in object_parts(scene)]
    firsts = np.cumsum([0, *counts])
    for i, start, end in runs(points[1], len(scene.objects)):
        # Its near side bright and its far side dark, or an object would be a flat shape.
        mine = np.nan_to_num(depth[start:end])
        there = points[0][start:end, 3] > 0  # rows of a page that is not full are nowhere
        near, far = np.percentile(mine[there] if there.any() else mine, [2, 98])
        shade = 1 - 0.75 * np.clip((mine - near) / max(far - near, 1e-6), 0, 1)
        table = np.array([object_color(k) for k in range(firsts[i], firsts[i] + counts[i])])
        colors[start:end] = shade[:, None] * table[ranks[i]]
    return colors


def farthest_depth(depth: np.ndarray) -> np.float32:
    """By which depths in metres are divided; a power of two, so that nothing is rounded."""
    known = depth[np.abs(depth) < layout.HUGE]  # NaN is not
    return np.float32(2.0 ** np.ceil(np.log2(max(float(known.max(initial=0)), 1e-6))))


def debug_image(
    drawing: DebugDrawing, i: int, view: View, scene: Scene, settings: RenderSettings
) -> tuple[np.ndarray, dict[str, float]]:
    """After the draw: (H, W, 3) float32 display sRGB, row 0 on top, of view i as it was drawn;
    and what its legend says: counts, metres, the largest number.
    """
    rgba = drawing.image(i)
    if not scene.splat_count:
        return np.ascontiguousarray(rgba[..., :3]), {}
    if settings.debug == "overdraw":
        number = drawing.overdraw(i, view, settings)
        largest = float(number.max(initial=0))
        return ramp(HEAT, np.sqrt(number / max(largest, 1))), {"largest": largest}
    if settings.debug in EDGES:
        return drawing.edges(i, view, settings, settings.debug)[..., :3].copy(), {}
    if settings.debug == "object":
        there = shown_splats(by_object(drawing.splat_points())[0], len(scene.objects))
        return np.ascontiguousarray(rgba[..., :3]), object_counts(scene, there)
    points, poses = by_object(drawing.splat_points())[0], object_poses(scene)
    if settings.debug == "depth":
        return depth_picture(rgba, -eye_places(points, poses, view.eye_from_world())[2])
    antialiased = tuple(is_antialiased(obj.model) for obj in scene.objects)
    reason, pixel, depth = classify(points, poses, view, settings, antialiased)
    numbers = np.bincount(reason, minlength=len(CULL_REASONS) + 1)
    reasons = ("drawn", *CULL_REASONS)
    facts: dict[str, float] = dict(zip(reasons, map(float, numbers), strict=True))
    colors = np.asarray([REASON_COLORS[name] for name in ("drawn", *CULL_REASONS)], np.float32)
    if settings.debug == "birdseye":
        picture, metres = birdseye(points, poses, reason, colors, view, settings)
        return picture, facts | {"metres": metres}
    picture = dim(rgba[..., :3])
    seen = (depth > view.near) & np.isfinite(pixel).all(axis=0)
    unit = dot_size(view.size)
    # What is too large or too small lies on top: it is why somebody looks.
    for names, dot in (((3, 1), unit), ((0, 2), unit), ((5, 6), unit + 1), ((4,), unit + 1)):
        paint_points(picture, pixel, depth, reason, colors, seen & np.isin(reason, names), dot)
    return picture, facts


def depth_picture(rgba: np.ndarray, depth: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
    """Blended depth over coverage, near bright, between the 1st and 99th hundredth of it."""
    coverage = rgba[..., 3]
    scale = farthest_depth(depth)
    metres = rgba[..., 0] / np.maximum(coverage, np.float32(1e-6)) * scale
    solid = metres[coverage > 0.5]
    near, far = np.percentile(solid, [1, 99]) if solid.size else (0.0, float(scale))
    part = (metres - near) / max(far - near, 1e-6)
    picture = ramp(DISTANT, 1 - part) * np.minimum(coverage, 1)[..., None]
    return picture, {"nearest": float(near), "farthest": float(far)}


def debug_legend(
    name: str, stats: FrameStats | None = None
) -> list[tuple[str, tuple[float, float, float]]]:
    """Rows (text, display sRGB) for the legend of a debug picture; stats add the numbers."""
    facts = stats.debug if stats is not None else {}
    if name in ("culls", "birdseye"):
        rows = [
            (f"{text}: {int(facts[reason]):,}" if reason in facts else text, REASON_COLORS[reason])
            for reason, text in REASON_TEXTS.items()
        ]
        across = [(f"{facts['metres']:.3g} m across", (1.0, 1.0, 1.0))] if "metres" in facts else []
        return rows + across
    if name == "object":
        texts = [f"{key}: {int(n):,}" for key, n in facts.items()]
        return [(text, object_color(i)) for i, text in enumerate(texts)]
    if name not in ("depth", "overdraw"):
        return []
    steps = np.linspace(0, 1, LEGEND_STEPS)
    if name == "depth":
        near, far = facts.get("nearest", 0.0), facts.get("farthest", 1.0)
        texts = [f"{near + s * (far - near):.3g} m" for s in steps]
        colors = ramp(DISTANT, 1 - steps)
    else:
        largest = facts.get("largest", 0.0)
        texts = [f"{s * s * largest:,.0f} splats" for s in steps]
        texts[-1] += " (largest)"
        colors = ramp(HEAT, steps)
    return [(text, three(c)) for text, c in zip(texts, colors, strict=True)]


def ramp(table: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Colours (..., 3) float32 of values 0..1 along a table (K, 3)."""
    at = np.clip(np.nan_to_num(value), 0, 1) * (len(table) - 1)
    low = np.minimum(at.astype(int), len(table) - 2)
    part = (at - low)[..., None].astype(np.float32)
    return table[low] * (1 - part) + table[low + 1] * part


def opaque(picture: np.ndarray) -> np.ndarray:
    """(H, W, 4) of (H, W, 3): covers whatever it is presented over."""
    return np.concatenate([picture, np.ones_like(picture[..., :1])], axis=2)


def object_poses(scene: Scene) -> np.ndarray:
    """(O, 4, 4) world_from_object, NaN where hidden."""
    nowhere = np.full((4, 4), np.nan)
    poses = [o.world_from_object.matrix() if o.seen else nowhere for o in scene.objects]
    return np.reshape(poses, (-1, 4, 4))


def object_counts(scene: Scene, shown: Sequence[int]) -> dict[str, float]:
    """Splats of each part of each object by its name; equal names get a number.  Of objects whose
    splats come and go as many as are shown (O,).
    """
    counts: dict[str, float] = {}
    for i, (obj, parts) in enumerate(zip(scene.objects, object_parts(scene), strict=True)):
        for label, count in [(None, shown[i])] if has_leaves(obj.model) else parts:
            name = obj.name
            if label is not None:
                name += f", {name_of(obj.model, label) or f'label {label}'}"
            counts[name if name not in counts else f"{name} {i + 1}"] = float(count)
    return counts


def shown_splats(points: Points, objects: int) -> Sequence[int]:
    """(O,) splats of each object that are there."""
    mean_opacity, owner, _ = points
    return np.bincount(owner[mean_opacity[:, 3] > 0], minlength=objects).tolist()


def object_parts(scene: Scene) -> list[list[tuple[int | None, int]]]:
    """For each object (label, splats) of its commonest labels; one (None, all) without labels."""
    parts: list[list[tuple[int | None, int]]] = []
    for obj in scene.objects:
        labels, ranks = label_ranks(obj.model)
        counts = np.bincount(np.ravel(ranks), minlength=len(labels)).tolist()
        if labels:
            parts.append(list(zip(labels, counts, strict=True)))
        else:
            parts.append([(None, obj.model.splat_count)])
    return parts


def label_ranks(model: Model) -> tuple[list[int], np.ndarray | int]:
    """The labels in order, the commonest first, MOST_LABELS at most; and each splat's place there.

    What has a rarer label counts to the last one.  ([], 0) for a model without labels.
    """
    labels = splat_labels(model)
    if labels is None:
        return [], 0
    found, which, counts = np.unique(labels, return_inverse=True, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    ranks = np.empty(len(found), np.intp)
    ranks[order] = np.minimum(np.arange(len(found)), MOST_LABELS - 1)
    return found[order[:MOST_LABELS]].tolist(), ranks[which]


def object_color(i: int) -> tuple[float, float, float]:
    """Display sRGB of the i-th part of all objects: that of the first label, the second, ..."""
    return color_of(i + 1)
