"""A scene's stop of values as numbers: which one it is, its range, and a ValuePicture of a view."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.renderer.colors.palette import LUMINANCE, PALETTES, STEPS, palette_colors
from shapeshift.renderer.surface import SOLID
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stops.stop_formula import read_formula, sources_of
from shapeshift.scene.appearance import NEUTRAL
from shapeshift.scene.cameras.framing import default_background
from shapeshift.scene.inspection.emissivity import KELVINS
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import View, look_at
from shapeshift.scene.scene import Scene, Tint

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer

UNKNOWN = (-1.0, -1.0, -1.0)  # a background that no scene can have


@dataclass(frozen=True)
class MeasuredScene:
    """What is drawn to be measured."""

    scene: Scene  # at the value stop, neither tinted nor graded
    stop: Stop  # with a value_range
    behind: float | None  # luminance of what the scene was trained before; None: not known
    colors: str = ""  # the palette that the scene's own colours are of; "": they are values
    # Of a stop by formula: what is measured of the stops in it, by the formula's names.
    parts: "tuple[tuple[str, MeasuredScene], ...]" = ()


@dataclass(frozen=True)
class ValueChoice:
    """What a person says about the stop that is measured; empty: as the scene does."""

    stop: str = ""
    value_range: tuple[float, float] | None = None
    unit: str = ""
    colors: str = ""  # a palette: the colours are its, values are looked up in it


def measured_scene(document: Document, choice: ValueChoice = ValueChoice()) -> MeasuredScene:
    """The scene at the stop to be measured.  Raises UsageError, one sentence."""
    stop = _choose_stop(document, choice)
    value_range = choice.value_range or stop.value_range
    if value_range is None:
        raise UsageError(
            f"the stop '{stop.name}' does not say which values black and white stand for; say it: "
            "--range LOW HIGH (in Python value_range=(low, high))."
        )
    low, high = value_range
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise UsageError(
            f"the range goes from {low:g} to {high:g}; two numbers are wanted, the lower one first."
        )
    if choice.colors and choice.colors not in PALETTES:
        raise UsageError(f"there is no palette '{choice.colors}'; known are {', '.join(PALETTES)}.")
    if not choice.colors and not stop.has_false_colors:
        raise UsageError(
            f"the stop '{stop.name}' holds colours and no values; name the palette that they are "
            "of: --colors NAME (gray, where they are values)."
        )
    placed = document.placed(stop.name, "the stop")
    objects = tuple(
        replace(obj, tint=None, appearance=NEUTRAL, selectors=()) for obj in placed.scene.objects
    )
    _refuse_other_ranges(objects, stop)
    behind = None
    if len(objects) == 1 and document.file is None:
        color = default_background(objects[0].model, UNKNOWN)
        behind = None if color == UNKNOWN else float(np.array(color) @ LUMINANCE)
    measured = replace(stop, value_range=(float(low), float(high)), unit=choice.unit or stop.unit)
    parts: tuple[tuple[str, MeasuredScene], ...] = ()
    if stop.formula and not choice.colors:
        stops = next(model.stops for model in document.models if stop in model.stops)
        parts = tuple(
            (name, measured_scene(document, ValueChoice(source.name)))
            for name, source in sources_of(read_formula(stop.formula), stops, stop.name).items()
        )
    return MeasuredScene(Scene(objects), measured, behind, choice.colors, parts)


def _choose_stop(document: Document, choice: ValueChoice) -> Stop:
    stops = [stop for model in document.models for stop in model.stops]
    names = ", ".join(dict.fromkeys(stop.name for stop in stops))
    if choice.stop:
        for stop in stops:
            if stop.name.casefold() == choice.stop.casefold():
                return stop
        raise UsageError(f"there is no stop '{choice.stop}'; the scene has {names or 'none'}.")
    for stop in stops:
        if stop.is_heat:
            return stop
    for stop in stops:
        if stop.is_measured:
            return stop
    raise UsageError(
        f"the scene has no thermal stop (it has {names or 'none'}) nor one of other values; where "
        "the colours of one are of a palette, name both: --stop NAME --colors PALETTE --range LOW "
        "HIGH."
    )


def _refuse_other_ranges(objects: tuple, stop: Stop) -> None:
    """Objects with a stop of the same name have to mean the same by it."""
    for obj in objects:
        for other in obj.model.stops:
            known = (other.palette, other.value_range, other.unit)
            if other.name == stop.name and known != (stop.palette, stop.value_range, stop.unit):
                raise UsageError(
                    f"objects of this scene have a stop '{stop.name}' with different palettes, "
                    "ranges or units; measure one of them alone."
                )


def draw_values(renderer: "Renderer", measured: MeasuredScene, view: View) -> ValuePicture:
    """Values and depths of a view, from the scene's values before the palette.

    The network gives values 0..1 (as luminance), which splats blend as they blend colours.  What a
    pixel lacks to full coverage showed, in training, what stood behind: that is put back where it
    is known, else the value is divided by the coverage (docs/thermal.md has both errors).  Of a
    stop by formula it is the formula of the values of its stops, where all of them are known.
    """
    if measured.parts:
        return _by_formula(renderer, measured, view)
    with renderer.levels.all_whole():
        renderer.update(measured.scene)
        renderer.draw([view])
        depth = renderer.surface(view).depth(SOLID).astype(np.float64)
    behind, away = measured.behind, None
    if measured.colors:
        rgba = renderer.image(0).astype(np.float64)
        alpha = rgba[..., 3]
        colors = rgba[..., :3] / np.maximum(alpha, 1e-6)[..., None]
        share, away = value_of_colors(colors, measured.colors)
    elif renderer.drawing.draws_heat:  # beside objects that have no such stop
        heat = renderer.drawing.heat(0).astype(np.float64)
        alpha = heat[..., 1]
        share = heat[..., 0] / np.maximum(alpha, 1e-6)
    else:
        rgba = renderer.image(0).astype(np.float64)
        alpha, share = rgba[..., 3], rgba[..., :3] @ LUMINANCE
        share = share / np.maximum(alpha, 1e-6) if behind is None else share + (1 - alpha) * behind
    owners = draw_owners(renderer, measured.scene, view) if measured.stop.unit in KELVINS else None
    assert measured.stop.value_range is not None  # measured_scene has seen to it
    low, high = measured.stop.value_range
    values = low + (high - low) * np.clip(share, 0, 1)
    known = (alpha >= SOLID) & np.isfinite(depth)
    return ValuePicture(
        view,
        np.where(known, values, np.nan),
        np.where(known, depth, np.nan),
        measured.stop.unit,
        (low, high),
        float(np.percentile(away[known], 95)) if away is not None and known.any() else None,
        is_heat=measured.stop.kind != "values",
        digits=measured.stop.digits,
        stop=measured.stop.name,
        owner_names=tuple(obj.name for obj in measured.scene.objects),
        owners=owners,
    )


def _by_formula(renderer: "Renderer", measured: MeasuredScene, view: View) -> ValuePicture:
    """Pixel by pixel of what the stops in it show; depths are of the first, whose shapes it has."""
    seen = {name: draw_values(renderer, part, view) for name, part in measured.parts}
    values = read_formula(measured.stop.formula).value({n: s.values for n, s in seen.items()})
    depth = next(iter(seen.values())).depth_m
    assert measured.stop.value_range is not None  # measured_scene has seen to it
    return ValuePicture(
        view, values, np.where(np.isfinite(values), depth, np.nan), measured.stop.unit,
        measured.stop.value_range, is_heat=False, digits=measured.stop.digits, may_exceed=True,
        stop=measured.stop.name,
    )  # fmt: skip


BITS = 3  # of an object's number that one picture holds: red, green, blue


def draw_owners(renderer: "Renderer", scene: Scene, view: View) -> np.ndarray:
    """(H, W) int: the object that has most of a pixel, counted from 0; -1: less than half is
    covered.  Objects are drawn in colours that are the digits of their numbers.
    """
    width, height = view.size
    count = len(scene.objects)
    if count == 1:
        return np.zeros((height, width), int)
    owners, alpha = np.zeros((height, width), int), np.zeros((height, width))
    for shift in range(0, (count - 1).bit_length(), BITS):
        tinted = []
        for number, obj in enumerate(scene.objects):
            color = np.array([number >> (shift + bit) & 1 for bit in range(BITS)], np.float32)
            tinted.append(replace(obj, tint=Tint(color, 1.0)))
        with renderer.levels.all_whole():
            renderer.update(Scene(tuple(tinted)))
            renderer.draw([view])
            rgba = renderer.image(0).astype(np.float64)
        alpha = rgba[..., 3]
        bits = rgba[..., :BITS] > alpha[..., None] / 2
        owners += (bits << (shift + np.arange(BITS))).sum(axis=2)
    return np.where((alpha >= SOLID) & (owners < count), owners, -1)


def depth_picture(renderer: "Renderer", scene: Scene, view: View) -> ValuePicture:
    """The depths of a view of any scene, at its own x; they are its values, too."""
    with renderer.levels.all_whole():
        renderer.update(scene)
        depth = renderer.surface(view).depth(SOLID).astype(np.float64)
    return ValuePicture(view, depth, depth, "m", (0.0, float("inf")))


def value_of_colors(colors: np.ndarray, palette: str) -> tuple[np.ndarray, np.ndarray]:
    """(...) values 0..1 whose colour of the palette is nearest to colours (..., 3) display sRGB,
    and (...) how far from it, as a distance in sRGB: 0 is a colour of the palette.

    The nearest point of the palette's curve, between its 256 colours.
    """
    from scipy.spatial import cKDTree

    table = palette_colors(palette).astype(np.float64)
    fine = np.linspace(0, 1, 16 * (STEPS - 1) + 1)
    curve = np.stack([np.interp(fine * (STEPS - 1), np.arange(STEPS), c) for c in table.T], axis=1)
    away, nearest = cKDTree(curve).query(np.nan_to_num(colors.reshape(-1, 3)))
    return fine[nearest].reshape(colors.shape[:-1]), away.reshape(colors.shape[:-1])


# The value of a place in the world, without a view: read from where its surface faces the eye.

EYES = 32  # directions, spread evenly over the sphere
AWAY = 0.8  # of the scene's radius, from the place to each eye
PIXELS = 33  # a side
FOOTPRINT = 0.002  # of the scene's radius: what a pixel is wide at the place
REACH = 2  # pixels to each side, for the surface's direction
STEEPEST = 0.2  # cosine: more grazing views tell nothing of a surface
GOLDEN_ANGLE = np.pi * (3 - 5**0.5)  # radians


def value_facing(
    values_of: Callable[[View], ValuePicture], point: np.ndarray, radius: float
) -> float:
    """The value at a point (3,) metres, world, in the view of EYES that sees it most from the
    front: emission falls off at grazing angles.  NaN where none sees it.

    radius: of the scene, metres.
    """
    best, found = STEEPEST, float("nan")
    for view in eyes_around(point, radius):
        picture = values_of(view)
        value = float(picture.values_at(point[None])[0])
        if not np.isfinite(value):
            continue
        cosine = facing(picture)
        if cosine > best:
            best, found = cosine, value
    return found


def eyes_around(point: np.ndarray, radius: float) -> list[View]:
    """Small views on a point from all sides: a spiral by the golden angle."""
    distance = AWAY * radius
    side = PIXELS / 2 * FOOTPRINT * radius / distance  # tangent
    heights = 1 - 2 * (np.arange(EYES) + 0.5) / EYES
    turns = GOLDEN_ANGLE * np.arange(EYES)
    level = np.sqrt(1 - heights**2)
    directions = np.stack([level * np.sin(turns), heights, level * np.cos(turns)], axis=1)
    tangents = (-side, side, -side, side)
    return [
        View(look_at(point + distance * d, point), tangents, 0.01 * distance, 100 * distance,
             (PIXELS, PIXELS))
        for d in directions
    ]  # fmt: skip


def facing(picture: ValuePicture) -> float:
    """Cosine between the surface in the middle of a picture and the ray to it; 0: not known."""
    row, column = (side // 2 for side in picture.depth_m.shape)
    points = picture.points
    across = points[row, column + REACH] - points[row, column - REACH]
    down = points[row + REACH, column] - points[row - REACH, column]
    normal = np.cross(across, down)
    ray = points[row, column] - picture.view.world_from_eye.position
    size = float(np.linalg.norm(normal) * np.linalg.norm(ray))
    cosine = abs(float(normal @ ray)) / size if size > 0 else 0.0
    return cosine if np.isfinite(cosine) else 0.0
