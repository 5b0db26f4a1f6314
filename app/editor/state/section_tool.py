"""The tool "Sections": which one is edited, and its handles as places in the world.

Sections are of the chosen object, where one is chosen, else of the whole scene; they are in the
scene file, undone and saved with it.
"""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.app.editor.state.arrange import edit
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.document import edits
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import IDENTITY
from shapeshift.scene.sections.section import (
    CAPPED,
    SOFT,
    BoxShape,
    PlaneShape,
    SceneSection,
    moved_shape,
    plane_through,
)

ARROW = 0.35  # of the scene's radius: how far the handle that turns a plane stands off it
LEAST_SIDE = 0.01  # of the scene's radius: half a box's side
SOFT_PART = 0.1  # of the scene's radius: the width that a soft edge begins with
DECIMALS = 6  # of metres and of normals, as a file has them
TURNS = "turn"  # the handle at the tip of a plane's arrow


@dataclass(frozen=True)
class SectionHandle:
    """What is dragged: a face, which moves along its normal, or a plane's arrow, which turns it."""

    key: int | str  # number of the half space, or TURNS
    place: np.ndarray  # (3,) metres, world
    normal: np.ndarray  # (3,) unit, world: out of what is kept


class SectionTool:
    """What a person does to sections."""

    def __init__(self, state: EditorState) -> None:
        self._state = state
        self.on = False  # its handles are shown
        self.number = 0  # of the section that is edited

    # ---- which

    @property
    def owner(self) -> str:
        """Name of the object whose sections these are; "": of the whole scene."""
        return self._state.chosen if self._state.chosen_index is not None else ""

    @property
    def sections(self) -> tuple[SceneSection, ...]:
        file = self._state.edited.file
        item = edits.find(file, self.owner) if self.owner else None
        return item.sections if item is not None else file.sections

    @property
    def current(self) -> SceneSection | None:
        """The one that is edited."""
        return self.sections[self.number] if self.number < len(self.sections) else None

    def forget(self) -> None:
        """Another scene."""
        self.on, self.number = False, 0

    def toggle(self) -> None:
        """Shows the handles or takes them away; a first plane is made where there is no section."""
        self.on = not self.on and bool(self._state.scene.objects)
        if self.on and not self.sections:
            self.add(plane=True)

    def choose(self, number: int) -> None:
        self.number, self.on = number, True

    # ---- edits

    def add(self, plane: bool) -> None:
        """A plane across the middle of the scene, or a box about its inner half."""
        if not self._state.scene.objects:
            return
        centre, half = self._state.centre, (0.5 * self._state.radius,) * 3
        shape: PlaneShape | BoxShape = (
            plane_through(np.round(centre, DECIMALS), np.array([1.0, 0.0, 0.0]))
            if plane
            else BoxShape(three(np.round(centre, DECIMALS)), three(np.round(half, DECIMALS)))
        )
        space = "object" if self.owner else "world"
        made = SceneSection(
            shape=moved_shape(shape, self._frame_from_world), edge=CAPPED, space=space
        )
        if self._record((*self.sections, made), "add a section"):
            self.number, self.on = len(self.sections) - 1, True

    def remove(self, number: int) -> None:
        kept = tuple(one for n, one in enumerate(self.sections) if n != number)
        self._record(kept, "remove a section")
        self.number = max(min(self.number, len(kept) - 1), 0)
        self.on = self.on and bool(kept)

    def change(self, number: int, what: str, together: str = "", **values: object) -> None:
        """Another edge, width, shape or control of one of them."""
        if values.get("edge") == SOFT:
            values["width_m"] = round(SOFT_PART * self._state.radius, DECIMALS)
        elif "edge" in values:
            values["width_m"] = 0.0
        sections = list(self.sections)
        sections[number] = replace(sections[number], **values)  # type: ignore[arg-type]
        self._record(tuple(sections), what, together)

    def _record(self, sections: tuple[SceneSection, ...], what: str, together: str = "") -> bool:
        state = self._state
        try:
            edit(state, edits.set_sections(state.edited.file, self.owner, sections), what, together)
        except ValueError as error:
            state.messages.fail(str(error))
            return False
        return True

    # ---- places in the world

    @property
    def _world_from_frame(self) -> Pose:
        """Of the current section's frame, or of the one that is about to be made."""
        index, current = self._state.chosen_index, self.current
        fixed = bool(self.owner) if current is None else current.space == "object"
        if index is None or not fixed:
            return IDENTITY
        return self._state.scene.objects[index].world_from_object

    @property
    def _frame_from_world(self) -> Pose:
        index = self._state.chosen_index
        if index is None:
            return IDENTITY
        matrix = self._state.scene.objects[index].world_from_object.matrix()
        return Pose.from_matrix(np.linalg.inv(matrix))

    @property
    def shape(self) -> PlaneShape | BoxShape | None:
        """Of the current section, in the world."""
        current = self.current
        return None if current is None else moved_shape(current.shape, self._world_from_frame)

    @property
    def pivot(self) -> np.ndarray:
        """(3,) metres, world: the scene's middle, on the plane or in the box."""
        shape, centre = self.shape, self._state.centre
        if isinstance(shape, PlaneShape):
            normal = np.array(shape.normal)
            return centre + (shape.offset_m - normal @ centre) * normal
        return np.array(shape.centre) if shape is not None else centre

    def handles(self) -> list[SectionHandle]:
        """Of the current section."""
        shape = self.shape
        if shape is None:
            return []
        if isinstance(shape, PlaneShape):
            normal, arrow = np.array(shape.normal), ARROW * self._state.radius
            face = SectionHandle(0, self.pivot, normal)
            return [face, SectionHandle(TURNS, self.pivot + arrow * normal, normal)]
        out = []
        for number, sign in ((n, s) for s in (1.0, -1.0) for n in range(3)):
            normal = sign * shape.axes[:, number]
            face_number = number if sign > 0 else number + 3
            place = np.array(shape.centre) + shape.half[number] * normal
            out.append(SectionHandle(face_number, place, normal))
        return out

    def drag(self, handle: SectionHandle, origin: np.ndarray, ray: np.ndarray) -> None:
        """The handle as it was when the drag began goes to where a ray of the world is nearest."""
        shape, current = self.shape, self.current
        if shape is None or current is None:
            return
        moved: PlaneShape | BoxShape
        if handle.key == TURNS:
            assert isinstance(shape, PlaneShape), "a plane is turned"
            pivot = handle.place - ARROW * self._state.radius * handle.normal
            moved = plane_through(pivot, towards(origin, ray, pivot, ARROW * self._state.radius))
        else:
            by = along(origin, ray, handle.place, handle.normal)
            place = handle.place + by * handle.normal
            moved = self._with_face(shape, handle, place)
        self.put_shape(moved, f"section {self.number}")

    def put_face(self, handle: SectionHandle, place: np.ndarray, together: str = "") -> None:
        """A face as it was when it was taken hold of goes through a place (3,) of the world."""
        if self.shape is not None:
            self.put_shape(self._with_face(self.shape, handle, place), together)

    def put_shape(self, shape: PlaneShape | BoxShape, together: str = "") -> None:
        """Another shape of the current section, of the world."""
        frame_from_world = Pose.from_matrix(np.linalg.inv(self._world_from_frame.matrix()))
        own = rounded(moved_shape(shape, frame_from_world))
        self.change(self.number, "move a section", together, shape=own)

    def _with_face(
        self, shape: PlaneShape | BoxShape, handle: SectionHandle, place: np.ndarray
    ) -> PlaneShape | BoxShape:
        """With one of its faces through a place, the opposite one as it is."""
        if isinstance(shape, PlaneShape):
            return plane_through(place, handle.normal)
        axis = int(handle.key) % 3
        opposite = np.array(shape.centre) - shape.half[axis] * handle.normal
        side = (place - opposite) @ handle.normal
        side = float(max(side, 2 * LEAST_SIDE * self._state.radius))
        half = list(shape.half)
        half[axis] = side / 2
        # The two other axes stay in the middle of what they were.
        centre = np.array(shape.centre) + (side / 2 - shape.half[axis]) * handle.normal
        return BoxShape(three(centre), three(half), shape.wxyz)


def along(origin: np.ndarray, ray: np.ndarray, place: np.ndarray, line: np.ndarray) -> float:
    """Metres from a place (3,) along a line (3,), unit, to where it is nearest to a ray (3,), unit;
    0 where both are parallel.
    """
    cosine, between = float(ray @ line), place - origin
    across = 1 - cosine * cosine
    return float((cosine * (ray @ between) - line @ between) / across) if across > 1e-6 else 0.0


def towards(origin: np.ndarray, ray: np.ndarray, pivot: np.ndarray, radius: float) -> np.ndarray:
    """(3,) unit, from a pivot to where a ray meets the sphere about it, on the side of the eye;
    beside it to where it passes.
    """
    to_pivot = pivot - origin
    depth = float(ray @ to_pivot)
    miss = origin + depth * ray - pivot  # (3,) of the ray's nearest place
    off = np.linalg.norm(miss)
    if off < radius:
        miss = miss - np.sqrt(radius * radius - off * off) * ray
    return miss / np.linalg.norm(miss)


def rounded(shape: PlaneShape | BoxShape) -> PlaneShape | BoxShape:
    """With numbers as a file has them."""
    if isinstance(shape, PlaneShape):
        normal = three(np.round(shape.normal, DECIMALS))
        length = float(np.linalg.norm(normal))
        return PlaneShape(normal, round(shape.offset_m, DECIMALS) * length)
    centre, half = (three(np.round(v, DECIMALS)) for v in (shape.centre, shape.half))
    return BoxShape(centre, half, shape.wxyz)
