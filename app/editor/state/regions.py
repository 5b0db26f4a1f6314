"""Regions of a scene that have a control value of their own, as a person edits them; no window."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from shapeshift.runtime_models.shapes import four, three
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.pick import anchor_places
from shapeshift.scene.pose import View
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.selectors.selector import Box, HalfSpace, Lens, Painted, Selector, Sphere

KINDS = ("box", "sphere", "half-space", "lens", "painted")
FIRST_SIZE = 0.25  # of the scene's radius: half a box's side, a sphere's radius
FIRST_BORDER = 0.01  # of the scene's radius: on the way x may pass other stops, which shows
LENS = 0.25  # tangent of half the lens' angle at first
BRUSH = 24.0  # logical pixels, radius
WORDS = {"painted": "paint", "x": "x of", "centre": "move", "name": "rename"}  # by what changes
DEEP = 2.0  # brush radii behind the front: what lies deeper is another surface


@dataclass(frozen=True, eq=False)  # the same only where nothing was edited: arrays are large
class Region:
    """One region of one object; which of the sizes count depends on its kind."""

    kind: str  # one of KINDS
    name: str
    index: int = 0  # of its object
    enabled: bool = True
    x: Control = 0.0  # inside
    border: float = 0.0  # metres over which x changes to what is outside
    centre: np.ndarray = field(default_factory=lambda: np.zeros(3))  # (3,) metres, object frame
    half: np.ndarray = field(default_factory=lambda: np.ones(3))  # (3,) metres; a sphere's: [0]
    normal: np.ndarray = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))  # into it
    tangent: float = LENS  # a lens' radius at a metre from the eye
    painted: np.ndarray | None = None  # (A,) bool, one an anchor or a plain splat

    @property
    def is_placed(self) -> bool:
        """Whether it has a place in the scene that a click can set."""
        return self.kind in ("box", "sphere", "half-space")


class Regions:
    """The list of regions, which of them is being edited, and what the mouse does to it.

    `version` goes up with every edit, so that what is made of regions knows when they changed;
    `did` says in words what the last one was, "" where nobody edited: undoing passes over it.
    """

    def __init__(self, radius: float = 1.0) -> None:
        self.radius = radius  # metres, of the scene: what sizes start from
        self.items: tuple[Region, ...] = ()
        self.chosen = -1  # index of the one that is edited; -1: none
        self.placing = False  # the next click into the picture sets the chosen one's place
        self.holding = False  # the mouse is down since such a click and moves the region
        self.brush = BRUSH
        self.version = 0
        self.did, self.together = "", ""  # edits in a row that are `together` are one: a drag

    @property
    def current(self) -> Region | None:
        return self.items[self.chosen] if 0 <= self.chosen < len(self.items) else None

    def choose(self, number: int) -> None:
        self.chosen, self.placing = number, False

    def add(self, kind: str, index: int, obj: SceneObject, point: np.ndarray) -> Region:
        """A new region of the object `obj`, about `point` (3,) in its frame; it is chosen.

        It shows the stop farthest from what the object shows, so that it is seen at once.
        """
        names = {region.name for region in self.items}
        count = next(n for n in range(1, len(names) + 2) if f"{kind} {n}" not in names)
        region = Region(
            kind, f"{kind} {count}", index,
            x=farthest_stop(obj), border=FIRST_BORDER * self.radius,
            centre=np.asarray(point, np.float64),
            half=np.full(3, FIRST_SIZE * self.radius),
            painted=np.zeros(len(anchor_places(obj.model)), bool) if kind == "painted" else None,
        )  # fmt: skip
        self.items = (*self.items, region)
        self.choose(len(self.items) - 1)
        self.placing = region.is_placed
        self._changed(f"add {region.name}" if kind != "lens" else "")
        return region

    def add_selectors(self, selectors: tuple[Selector, ...], index: int) -> None:
        """Adds the regions that selectors of object `index` stand for; none is being edited."""
        for selector in selectors:
            region = region_of(selector, "", index)
            count = sum(other.kind == region.kind for other in self.items) + 1
            self.items = (*self.items, replace(region, name=f"{region.kind} {count}"))
        self._changed()

    def selectors(self, index: int, view: View) -> tuple[Selector, ...]:
        """Of the enabled regions of object `index`, in the list's order: a later one lies above."""
        on = [region for region in self.items if region.enabled and region.index == index]
        return tuple(selector_of(region, view) for region in on)

    @property
    def follow_the_eye(self) -> bool:
        """Whether any enabled region is a lens."""
        return any(region.kind == "lens" and region.enabled for region in self.items)

    @property
    def kept(self) -> tuple[Region, ...]:
        """Those that are edited, saved and undone: a lens is nobody's but the eye's."""
        return tuple(region for region in self.items if region.kind != "lens")

    @property
    def bytes(self) -> int:
        """Of the mask that was painted last, which every stroke makes anew."""
        region = self.current
        return region.painted.nbytes if region is not None and region.painted is not None else 0

    def restore(self, kept: tuple[Region, ...]) -> None:
        """Other regions, as they were before or after some edit; a lens stays as it is."""
        current = self.current
        lenses = tuple(region for region in self.items if region.kind == "lens")
        self.items = (*kept, *lenses)
        names = [region.name for region in self.items]
        self.choose(names.index(current.name) if current and current.name in names else -1)
        self._changed()

    def remove(self, number: int) -> None:
        gone = self.items[number]
        self.items = self.items[:number] + self.items[number + 1 :]
        self.choose(min(number, len(self.items) - 1))
        self._changed(f"remove {gone.name}" if gone.kind != "lens" else "")

    def clear(self) -> None:
        """Forgets all, for another scene."""
        self.items = ()
        self._changed()
        self.choose(-1)

    def _changed(self, did: str = "", together: str = "") -> None:
        """Tells of a change; `did` is "" for one that nobody undoes: a lens, another scene."""
        self.version += 1
        if did:
            self.did, self.together = did, together

    def renumber(self, moved: dict[int, int]) -> None:
        """The objects are others: index before -> index now; regions of one that is gone go."""
        if all(region.index == moved.get(region.index) for region in self.items):
            return
        current = self.current
        kept = [(r, replace(r, index=moved[r.index])) for r in self.items if r.index in moved]
        self.items = tuple(after for _, after in kept)
        stays = [n for n, (before, _) in enumerate(kept) if before is current]
        self.choose(stays[0] if stays else -1)
        self._changed()

    def edit(self, number: int, **changes: Any) -> None:
        """Changes fields of one region; `version` tells only when something is different."""
        before = self.items[number]
        if all(same(getattr(before, name), value) for name, value in changes.items()):
            return
        after = replace(before, **changes)
        self.items = (*self.items[:number], after, *self.items[number + 1 :])
        (word, *_) = [WORDS[name] for name in changes if name in WORDS] or ["edit"]
        did = f"{word} {before.name}" if before.kind != "lens" else ""
        self._changed(did, did)

    def place(self, point: np.ndarray, index: int, objects: tuple[SceneObject, ...]) -> None:
        """Moves the chosen region to a world point (3,), into the object that was met there.

        A painted region stays with its object: its anchors mean nothing in another one.
        """
        world_from_object = objects[index].world_from_object.matrix()
        local = np.linalg.inv(world_from_object) @ np.append(point, 1.0)
        self.edit(self.chosen, index=index, centre=local[:3])

    def fit_painted(self, index: int, obj: SceneObject) -> None:
        """Unpaints the regions of object `index` where it now has another number of splats."""
        count = len(anchor_places(obj.model))
        for number, region in enumerate(self.items):
            painted = region.painted
            if region.index == index and painted is not None and len(painted) != count:
                self.edit(number, painted=np.zeros(count, bool))
                self.did = ""  # by nobody's hand

    def toggle_lens(self, obj: SceneObject) -> bool:
        """Switches the lens on or off, adding one the first time; returns whether it is on."""
        for number, region in enumerate(self.items):
            if region.kind == "lens":
                self.edit(number, enabled=not region.enabled)
                return not region.enabled
        self.add("lens", 0, obj, np.zeros(3))
        return True

    def choose_painted(self, objects: Sequence[SceneObject]) -> SceneObject:
        """The object of the chosen painted region, of the last one or a new one where none is."""
        if self.current is None or self.current.kind != "painted":
            numbers = [n for n, region in enumerate(self.items) if region.kind == "painted"]
            if numbers:
                self.choose(numbers[-1])
            else:
                self.add("painted", 0, objects[0], np.zeros(3))
        return objects[self.items[self.chosen].index]

    def paint(
        self, view: View, cursor: tuple[float, float], radius: float, obj: SceneObject,
        erase: bool,
    ) -> int:  # fmt: skip
        """Paints or erases the chosen region's anchors under a brush; returns how many changed.

        cursor and radius are in pixels of the view, from its top left.
        """
        return self._paint(brushed(view, anchor_places(obj.model), obj, cursor, radius), erase)

    def paint_balls(
        self, centres: np.ndarray, radius_m: float, obj: SceneObject, erase: bool
    ) -> int:
        """The same of the anchors within balls about centres (n, 3); metres of the world."""
        return self._paint(np.flatnonzero(within_balls(obj, centres, radius_m)), erase)

    def _paint(self, under: np.ndarray, erase: bool) -> int:
        """Paints or erases rows of anchors of the chosen region; returns how many changed."""
        before = self.items[self.chosen].painted
        assert before is not None  # a painted region has a mask from `add` on
        painted = before.copy()
        painted[under] = not erase
        changed = int(np.count_nonzero(painted != before))
        if changed:
            self.edit(self.chosen, painted=painted)
        return changed


def selector_of(region: Region, view: View) -> Selector:
    """What the scene knows a region as; a lens looks along `view`."""
    inside: dict[str, Any] = {"x": region.x, "border": region.border}
    if region.kind == "box":
        return Box(centre=three(region.centre), half=three(region.half), **inside)
    if region.kind == "sphere":
        return Sphere(centre=three(region.centre), radius=float(region.half[0]), **inside)
    if region.kind == "half-space":
        normal = three(-region.normal)
        return HalfSpace(point=three(region.centre), normal=normal, **inside)
    if region.kind == "lens":
        eye, angle = view.world_from_eye, float(np.arctan(region.tangent))
        position, wxyz = three(eye.position), four(eye.wxyz)
        return Lens(position=position, wxyz=wxyz, half_angle=angle, **inside)
    assert region.painted is not None  # a painted region has a mask from `add` on
    return Painted(region.painted, region.x)


def region_of(selector: Selector, name: str, index: int) -> Region:
    """The region that a selector of a command line stands for; the inverse of `selector_of`."""
    common: dict[str, Any] = {"name": name, "index": index, "x": selector.x}
    if isinstance(selector, Painted):
        return Region("painted", painted=selector.weight > 0.5, **common)
    common["border"] = selector.border
    if isinstance(selector, Box):
        half = np.array(selector.half)
        return Region("box", centre=np.array(selector.centre), half=half, **common)
    if isinstance(selector, Sphere):
        half = np.full(3, selector.radius)
        return Region("sphere", centre=np.array(selector.centre), half=half, **common)
    if isinstance(selector, HalfSpace):
        centre, normal = np.array(selector.point), -np.array(selector.normal)
        return Region("half-space", centre=centre, normal=normal, **common)
    assert selector.half_angle is not None  # a command line has cones alone
    return Region("lens", tangent=float(np.tan(selector.half_angle)), **common)


def same(one: Any, other: Any) -> bool:
    """Equal numbers, texts or arrays; NaN is never the same."""
    return one is other or bool(np.array_equal(one, other))


def farthest_stop(obj: SceneObject) -> float:
    """x of the stop that differs most from what the object shows."""
    xs = [stop.x for stop in obj.model.stops] or [0.0, 1.0]
    return max(xs, key=lambda x: abs(x - obj.slider_x))


def within_balls(obj: SceneObject, centres: np.ndarray, radius_m: float) -> np.ndarray:
    """(A,) bool: which anchors of an object lie within balls about centres (n, 3), world."""
    matrix = obj.world_from_object.matrix()
    places = anchor_places(obj.model) @ matrix[:3, :3].T + matrix[:3, 3]  # (A, 3) metres
    inside = np.zeros(len(places), bool)
    for centre in centres:
        inside |= ((places - centre) ** 2).sum(axis=1) <= radius_m * radius_m
    return inside


def brushed(
    view: View, places: np.ndarray, obj: SceneObject, cursor: tuple[float, float],
    radius: float,
) -> np.ndarray:  # fmt: skip
    """Indices of the places (A, 3), object frame, within `radius` pixels of the cursor.

    Just those of the nearest surface: at most DEEP brush radii, in metres at its depth, behind its
    front.
    """
    eye_from_object = view.eye_from_world() @ obj.world_from_object.matrix()
    in_eye = places @ eye_from_object[:3, :3].T + eye_from_object[:3, 3]  # (A, 3) metres
    depth = -in_eye[:, 2]
    ahead = np.flatnonzero(depth > view.near)
    left, right, _, up = view.tangents
    per_pixel = (right - left) / view.size[0]  # tangent of one pixel
    across = (in_eye[ahead, 0] / depth[ahead] - left) / per_pixel
    down = (up - in_eye[ahead, 1] / depth[ahead]) / per_pixel
    under = ahead[np.hypot(across - cursor[0], down - cursor[1]) <= radius]
    if not len(under):
        return under
    front = np.percentile(depth[under], 5, method="lower")  # a floater before it is no surface
    return under[depth[under] <= front * (1 + DEEP * radius * per_pixel)]
