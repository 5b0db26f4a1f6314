"""Pictures of places that changed: before, after, and what of it changed."""

from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.change.draw_pairs import draw_pair
from shapeshift.app.change.find_change import FoundChange
from shapeshift.app.commands.compare_sheet import written
from shapeshift.app.inspection.pictures import ColorScale, with_scale_bar
from shapeshift.renderer.colors.palette import LUMINANCE, palette_values
from shapeshift.scene.cameras.framing import view_from
from shapeshift.scene.change.places import HEAT_WORDS, VALUE_WORDS, ChangedPlace
from shapeshift.scene.change.seen_pair import SeenPair, SeenSide
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

COLORS = {"moved": (1.0, 0.85, 0.1), "appeared": (0.2, 0.85, 0.3), "vanished": (1.0, 0.2, 0.5),
          "hotter": (1.0, 0.45, 0.05), "colder": (0.15, 0.5, 1.0),
          "higher": (1.0, 0.45, 0.05), "lower": (0.15, 0.5, 1.0),
          "recoloured": (0.75, 0.4, 1.0)}  # fmt: skip
FIELD = 3.0  # times the place's own size that a picture shows
LEAST_FIELD = 0.35  # of the scene's radius
FOV_Y = 0.6  # radians
SIZE = (320, 240)
SHARE = 0.65  # of the kind's colour over the picture
NOTHING = 0.16  # grey where nothing is known


def words(place: ChangedPlace) -> str:
    """Such as "3 hotter by 17.2 °C, now 58.3"."""
    said = f"{place.number} {place.kind}"
    if place.kind == "moved":
        return f"{said} by {100 * place.amount:.1f} cm"
    if place.kind in HEAT_WORDS:
        return f"{said} by {abs(place.amount):.1f} {place.unit}, now {place.level:.1f}"
    if place.kind in VALUE_WORDS:
        amount = f"{abs(place.amount):.3g} {place.unit}".rstrip()
        return f"{said} by {amount}, now {place.level:.3g}"
    if place.kind == "recoloured":
        return f"{said} by {place.amount:.0f} (Lab)"
    return said


def pictures_of(renderer: "Renderer", found: FoundChange, place: ChangedPlace) -> np.ndarray:
    """(H, 3 W, 3) before, after and the place marked, from the side that shows most of it."""
    view = best_view(found, place)
    from_b = found.change.registration.a_from_b
    pair = draw_pair(renderer, found.before, found.after, view, from_b)
    heat = place.kind in (*HEAT_WORDS, *VALUE_WORDS)
    sides = (pair.before, pair.after)
    pictures = [np.where(s.coverage[..., None] >= 0.5, s.color, NOTHING) for s in sides]
    scale = None
    if heat and found.before.measured is not None:
        values = [side.value for side in sides if side.value is not None]
        low, high = np.nanpercentile(np.concatenate([v.ravel() for v in values]), (1, 99.5))
        least = 1 if place.kind in HEAT_WORDS else found.change.settings.least_value
        stop = found.before.measured.stop
        scale = ColorScale(float(low), float(max(high, low + least)), stop.palette)
        pictures = [heat_colors(value, scale) for value in values]
    last = marked(pair, place, found.change.settings.cell_m)
    pictures = [written(pictures[0], "before"), written(pictures[1], "after")]
    if scale is not None:
        pictures[1] = with_scale_bar(pictures[1], scale, place.unit)
    return np.concatenate([*pictures, written(last, words(place))], axis=1)


def heat_colors(value: np.ndarray, scale: ColorScale) -> np.ndarray:
    """(H, W, 3) of values (H, W)."""
    share = (value - scale.low) / scale.span
    colors = palette_values(np.nan_to_num(share), scale.palette)
    return np.where(np.isfinite(value)[..., None], colors, NOTHING)


def best_view(found: FoundChange, place: ChangedPlace) -> View:
    """A close look at a place from the direction that shows most of it."""
    later = place.kind != "vanished"
    seen = [
        int(sees(pair, later, place.points).sum() + sees(pair, False, place.before).sum())
        for pair in found.pairs
    ]
    best = found.pairs[int(np.argmax(seen))].view
    every = np.concatenate([place.points, place.before])
    low, high = every.min(axis=0), every.max(axis=0)
    radius = found.before.document.bounds()[1]
    field = max(FIELD * float(np.linalg.norm(high - low)) / 2, LEAST_FIELD * radius / 2)
    way = best.world_from_eye.position - (low + high) / 2
    distance = min(field / np.tan(FOV_Y / 2), float(np.linalg.norm(way)))
    eye = (low + high) / 2 + way / np.linalg.norm(way) * distance
    return view_from(eye, (low + high) / 2, radius, SIZE, FOV_Y)


def sees(pair: SeenPair, later: bool, points: np.ndarray) -> np.ndarray:
    """(N,) bool: which points (N, 3) a visit shows in a view."""
    side = pair.after if later else pair.before
    return ValuePicture(pair.view, side.depth_m, side.depth_m, "m").sees(points)


def marked(pair: SeenPair, place: ChangedPlace, cell_m: float) -> np.ndarray:
    """(H, W, 3) the later visit in grey with the place in its kind's colour; where something
    was, that stands in it too.
    """
    from scipy.spatial import cKDTree

    later = pair.after.color @ LUMINANCE
    out = np.where(pair.after.coverage >= 0.5, 0.75 * later, NOTHING)[..., None].repeat(3, axis=2)
    color = np.array(COLORS[place.kind])
    groups = [(pair.before, place.points if place.kind == "vanished" else place.before, 0.5)]
    if place.kind != "vanished":
        groups.append((pair.after, place.points, 1.0))
    for side, points, strength in groups:
        if not len(points):
            continue
        flat = surface_points(pair.view, side)
        known = np.isfinite(flat).all(axis=2)
        inside = np.zeros(known.shape, bool)
        inside[known] = cKDTree(points).query(flat[known])[0] <= 1.2 * cell_m
        below = (side.color @ LUMINANCE)[..., None]
        mixed = SHARE * color * strength + (1 - SHARE) * below
        out = np.where(inside[..., None], mixed, out)
    return out


def surface_points(view: View, side: SeenSide) -> np.ndarray:
    """(H, W, 3) metres, NaN where nothing is."""
    return ValuePicture(view, side.depth_m, side.depth_m, "m").points
