"""Outlines of regions in the picture: line segments in the world, cut at the eye, as pixels."""

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.regions import Region, Regions
from shapeshift.app.editor.texts.table import said
from shapeshift.scene.cameras.upright import ASSUMED, PHOTOS, PLANES, STATED, Upright, disagree
from shapeshift.scene.document.scene_file import SceneFile
from shapeshift.scene.pick import anchor_places
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject

Vec = imgui.ImVec2
ROUND = 48  # segments of a circle
GRID = 4  # lines of a half-space's plane to either side
BOUNDS = (1, 99)  # percent of an object's anchors along an axis, that its frame holds
MOST_DOTS = 3000  # of painted anchors that are marked


def segments(region: Region, reach: float) -> np.ndarray:
    """(S, 2, 3) metres in the object's frame: the edges of a region; none for what has no edge.

    `reach` is how far the plane of a half-space is drawn.
    """
    if region.kind == "box":
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        pairs = [
            (i, j) for i in range(8) for j in range(i) if (corners[i] != corners[j]).sum() == 1
        ]
        return region.centre + corners[np.array(pairs)] * region.half
    if region.kind == "sphere":
        return region.centre + np.concatenate(circles(region.half[0]))
    if region.kind == "half-space":
        return region.centre + plane(region.normal, reach)
    return np.zeros((0, 2, 3))


def circles(radius: float) -> list[np.ndarray]:
    """Three (ROUND, 2, 3) great circles."""
    turn = np.linspace(0, 2 * np.pi, ROUND + 1)
    out = []
    for axis in range(3):
        points = np.zeros((ROUND + 1, 3))
        points[:, (axis + 1) % 3] = radius * np.cos(turn)
        points[:, (axis + 2) % 3] = radius * np.sin(turn)
        out.append(np.stack([points[:-1], points[1:]], axis=1))
    return out


def plane(normal: np.ndarray, reach: float) -> np.ndarray:
    """(S, 2, 3): a grid across the origin and an arrow along the normal (3,)."""
    unit = normal / np.linalg.norm(normal)
    first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
    first /= np.linalg.norm(first)
    second = np.cross(unit, first)
    steps = np.linspace(-reach, reach, 2 * GRID + 1)[:, None]
    lines = [
        np.stack([steps * one - reach * other, steps * one + reach * other], axis=1)
        for one, other in ((first, second), (second, first))
    ]
    return np.concatenate([*lines, np.array([[0 * unit, 0.3 * reach * unit]])])


def on_screen(view: View, points: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """(S, 2, 2) places on a picture of `size` of the parts of (S, 2, 3) segments before the eye."""
    matrix = view.eye_from_world()
    in_eye = points @ matrix[:3, :3].T + matrix[:3, 3]  # (S, 2, 3) metres
    depth = -in_eye[..., 2]
    in_eye = in_eye[(depth > view.near).any(axis=1)]
    depth = -in_eye[..., 2]
    gap = depth[:, 1] - depth[:, 0]
    part = (view.near - depth[:, 0]) / np.where(
        gap == 0, 1.0, gap
    )  # where it crosses the near plane
    crossing = in_eye[:, 0] + part[:, None] * (in_eye[:, 1] - in_eye[:, 0])
    in_eye = np.where((depth < view.near)[..., None], crossing[:, None], in_eye)
    return pixels(view, in_eye, size)


def pixels(view: View, in_eye: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """(..., 2) places from the top left of points (..., 3) before the eye."""
    left, right, down, up = view.tangents
    x = (in_eye[..., 0] / -in_eye[..., 2] - left) / (right - left) * size[0]
    y = (up - in_eye[..., 1] / -in_eye[..., 2]) / (up - down) * size[1]
    return np.stack([x, y], axis=-1)


def draw_outlines(regions: Regions, scene: Scene, view: View, ui_scale: float) -> None:
    """Draws every enabled region behind the overlay's windows, the chosen one in the accent."""
    screen = imgui.get_io().display_size
    size = (screen.x, screen.y)
    for number, region in enumerate(regions.items):
        chosen = number == regions.chosen
        if not (region.enabled or chosen) or region.index >= len(scene.objects):
            continue
        world_from_object = scene.objects[region.index].world_from_object.matrix()
        ink = theme.color(theme.ACCENT if chosen else theme.TEXT, 0.9 if chosen else 0.4)
        if region.kind == "lens":
            _lens(region, view, size, ink, ui_scale)
        elif region.kind == "painted":
            if chosen:
                places = anchor_places(scene.objects[region.index].model)[region.painted]
                _dots(view, moved(places, world_from_object), size, ui_scale)
        else:
            lines = moved(segments(region, regions.radius), world_from_object)
            _lines(on_screen(view, lines, size), ink, (1.8 if chosen else 1.2) * ui_scale)


def draw_doubts(file: SceneFile, scene: Scene, view: View, ui_scale: float) -> None:
    """A frame around each object that may be cut wrong, in the colour of a warning."""
    doubted = {item.name for item in file.items if item.doubt}
    screen = imgui.get_io().display_size
    size = (screen.x, screen.y)
    for obj in scene.objects:
        if obj.name in doubted and obj.visible:
            lines = moved(frame_of(anchor_places(obj.model)), obj.world_from_object.matrix())
            ink = theme.color(theme.WARNING, 0.8)
            _lines(on_screen(view, lines, size), ink, 1.4 * ui_scale)


def frame_of(places: np.ndarray) -> np.ndarray:
    """(12, 2, 3): the edges of the box that holds nearly all places (A, 3); none of no place."""
    places = places[np.isfinite(places).all(axis=1)]
    if not len(places):
        return np.zeros((0, 2, 3))
    low, high = np.percentile(places, BOUNDS, axis=0)
    return segments(Region("box", "", centre=(low + high) / 2, half=(high - low) / 2), 0.0)


def draw_segments(
    lines: np.ndarray, obj: SceneObject, view: View, size: tuple[float, float], ui_scale: float
) -> None:
    """Segments (S, 2, 3) of an object's frame, in the accent."""
    placed = moved(lines, obj.world_from_object.matrix())
    _lines(on_screen(view, placed, size), theme.color(theme.ACCENT, 0.9), 1.8 * ui_scale)


NAMES = {STATED: "up: capture", ASSUMED: "up: usual axis", PHOTOS: "up: photos",
         PLANES: "up: planes"}  # fmt: skip


def draw_ups(upright: Upright, centre: np.ndarray, view: View, ui_scale: float) -> None:
    """An arrow a way that says what is up, from the middle of the scene, where two disagree; the
    one that is believed in the accent, and how far each is from it.
    """
    if not any(disagree(way, upright.used) for way in upright.ways):
        return
    screen, draw = imgui.get_io().display_size, imgui.get_background_draw_list()
    arrows = zip(*up_arrows(upright, centre, view), upright.ways, strict=True)
    for row, (one, other, way) in enumerate(arrows):  # texts of arrows that are one stand apart
        ink = theme.color(theme.ACCENT if way == upright.used else theme.TEXT, 0.9)
        ends = on_screen(view, np.array([[one, other]]), (screen.x, screen.y))
        _lines(ends, ink, 2.5 * ui_scale)
        for x, y in np.clip(ends[:, 1], -1e5, 1e5):
            draw.add_circle_filled(Vec(x, y), 4 * ui_scale, ink)
            text = f"{said(NAMES[way.source])}, {way.off(upright.used):.0f}\u00b0"
            draw.add_text(Vec(x + 8 * ui_scale, y + (16 * row - 24) * ui_scale), ink, text)


def up_arrows(upright: Upright, centre: np.ndarray, view: View) -> tuple[np.ndarray, np.ndarray]:
    """(W, 3) each, metres in the world: where each way's arrow begins and ends, a third of the
    picture long, from the middle of the picture as far away as `centre` (3,) is."""
    eye, ahead = view.world_from_eye.position, -view.world_from_eye.matrix()[:3, 2]
    away = np.linalg.norm(centre - eye)
    length = away * (view.tangents[3] - view.tangents[2]) / 3
    ways = np.array([way.direction for way in upright.ways]) @ upright.turn.T
    begin = eye + away * ahead
    return np.broadcast_to(begin, ways.shape), begin + length * ways


def draw_brush(cursor: tuple[float, float], radius: float, erase: bool, ui_scale: float) -> None:
    """The brush as a circle at the mouse."""
    ink = theme.color(theme.TEXT if erase else theme.ACCENT, 0.9)
    draw = imgui.get_background_draw_list()
    draw.add_circle(Vec(*cursor), radius, ink, ROUND, 1.5 * ui_scale)


def moved(points: np.ndarray, world_from_object: np.ndarray) -> np.ndarray:
    """Points (..., 3) of the object's frame in the world."""
    return points @ world_from_object[:3, :3].T + world_from_object[:3, 3]


def _lines(lines: np.ndarray, ink: int, width: float) -> None:
    draw = imgui.get_background_draw_list()
    for (x0, y0), (x1, y1) in np.clip(lines, -1e5, 1e5):
        draw.add_line(Vec(x0, y0), Vec(x1, y1), ink, width)


def _lens(region: Region, view: View, size: tuple, ink: int, ui_scale: float) -> None:
    """The lens lies around the line of sight: a circle in the picture's own middle."""
    left, right, _, up = view.tangents
    per_unit = size[0] / (right - left)
    middle = Vec(-left * per_unit, up * per_unit)
    draw = imgui.get_background_draw_list()
    draw.add_circle(middle, region.tangent * per_unit, ink, 2 * ROUND, 1.5 * ui_scale)


def _dots(view: View, points: np.ndarray, size: tuple, ui_scale: float) -> None:
    """Small marks on points (P, 3) in the world; a sample of them when there are many."""
    points = points[:: max(1, len(points) // MOST_DOTS)]
    matrix = view.eye_from_world()
    in_eye = points @ matrix[:3, :3].T + matrix[:3, 3]
    places = pixels(view, in_eye[-in_eye[:, 2] > view.near], size)
    draw, ink, half = imgui.get_background_draw_list(), theme.color(theme.ACCENT, 0.6), ui_scale
    inside = ((places >= 0) & (places < size)).all(axis=1)
    for x, y in places[inside]:
        draw.add_rect_filled(Vec(x - half, y - half), Vec(x + half, y + half), ink)
