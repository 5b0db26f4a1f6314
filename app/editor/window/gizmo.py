"""Handles on the chosen object that move and turn it: ImGuizmo, drawn over the picture."""

from typing import TypeAlias

import glfw
import numpy as np
from imgui_bundle import imgui, imguizmo

from shapeshift.app.editor.panels.outlines import moved, on_screen
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.arrange import place
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import HANDLES, EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.window import (
    DoubleClick,
    Drag,
    Event,
    KeyDown,
    Press,
    Release,
    Window,
)
from shapeshift.runtime_models.parts import MIN_OPACITY, PERCENTILES
from shapeshift.scene.cameras.framing import model_points
from shapeshift.scene.document.scene_file import FAR_M
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import SceneObject

Matrix16: TypeAlias = imguizmo.im_guizmo.Matrix16
Vec = imgui.ImVec2
CORNER = 0.2  # of an edge of the box that shows what is chosen
NONE, MOVE, TURN = HANDLES
HANDLE_WORDS = {MOVE: "Drag an arrow to move it.", TURN: "Drag a ring to turn it.",
                NONE: "No handles."}  # fmt: skip
OPERATIONS = {
    MOVE: imguizmo.im_guizmo.OPERATION.translate,
    TURN: imguizmo.im_guizmo.OPERATION.rotate,
}


class Gizmo:
    """Which handles are shown, and whether the mouse holds one."""

    def __init__(self, state: EditorState, viewpoint: Viewpoint, window: Window) -> None:
        self._state, self._viewpoint, self._window = state, viewpoint, window
        self.holding = False
        self._shown = False  # in the last frame: only then can a handle be under the mouse
        self._box: tuple = (None, np.zeros((2, 3)))  # a model, and its corners, object frame

    def handle_event(self, event: Event) -> bool:
        """True for what is meant for a handle, and for the key that goes through them."""
        match event:
            case KeyDown(key=glfw.KEY_M):
                self.next_mode()
            case Press(button="left") if self.under_mouse:
                self.holding = True
            case DoubleClick() if self.holding:
                pass
            case Drag(button="left") if self.holding:
                pass  # ImGuizmo has seen it itself
            case Release(button="left") if self.holding:
                self.holding = False
                self._state.rest()
            case _:
                return False
        return True

    def release(self) -> None:
        """Another scene: nothing of the old one is held."""
        self.holding = False

    def next_mode(self) -> None:
        """Moving, turning, none; of the only object where none is chosen."""
        state = self._state
        state.handles = HANDLES[(HANDLES.index(state.handles) + 1) % len(HANDLES)]
        if state.handles and not state.chosen:
            if len(state.scene.objects) == 1:
                state.chosen = state.scene.objects[0].name
            else:
                state.say(said("Click an object, or its name, to choose what to move."))
                return
        state.say(said(HANDLE_WORDS[state.handles]))

    @property
    def under_mouse(self) -> bool:
        return self._shown and imguizmo.im_guizmo.is_over()

    def draw(self, ui_scale: float) -> None:
        """Shows the handles and does what the mouse does with them."""
        state = self._state
        index = state.chosen_index
        self._shown = bool(state.handles) and index is not None and not state.regions.placing
        if not self._shown:
            self.holding = False
        if index is None:
            return
        obj, view = state.scene.objects[index], self._viewpoint.view()
        if state.overlay and not self.holding:
            self._outline(obj, view, ui_scale)
        if self._shown:
            self._handles(index, obj, view, ui_scale)

    def _handles(self, index: int, obj: SceneObject, view: View, ui_scale: float) -> None:
        gizmo, mode = imguizmo.im_guizmo, self._state.handles
        gizmo.begin_frame()
        gizmo.set_drawlist(imgui.get_background_draw_list())
        gizmo.set_rect(0, 0, *self._window.logical_size)
        gizmo.set_gizmo_size_clip_space(0.12 * ui_scale)
        world_from_pivot, pivot = self._frame(obj)
        matrix = flat(world_from_pivot)
        before = unflat(matrix)
        gizmo.push_id(obj.name)
        changed = gizmo.manipulate(
            flat(view.eye_from_world()),
            flat(view.clip_from_eye()),
            OPERATIONS[mode],
            gizmo.MODE.world if mode == MOVE else gizmo.MODE.local,
            matrix,
        )
        gizmo.pop_id()
        if changed and self.holding:
            place(self._state, index, pose_after(obj, before, unflat(matrix), pivot))

    def _frame(self, obj: SceneObject) -> tuple[np.ndarray, np.ndarray]:
        """(4, 4) world_from_pivot, and the pivot (3,) in the object: where its splats are."""
        pivot, world_from_object = (
            self._corners(obj).mean(axis=0),
            obj.world_from_object.matrix(),
        )
        world_from_pivot = world_from_object.copy()
        world_from_pivot[:3, 3] += world_from_object[:3, :3] @ pivot
        return world_from_pivot, pivot

    def _corners(self, obj: SceneObject) -> np.ndarray:
        """(2, 3) metres, object frame: from where to where its splats are, a few floaters aside."""
        if self._box[0] is not obj.model:
            points, opacity = model_points(obj.model)
            seen = points[opacity > MIN_OPACITY]
            points = seen if len(seen) else points
            corners = (
                np.percentile(points, PERCENTILES, axis=0) if len(points) else np.zeros((2, 3))
            )
            self._box = (obj.model, corners)
        return self._box[1]

    def _outline(self, obj: SceneObject, view: View, ui_scale: float) -> None:
        """The corners of the chosen object's box."""
        low, high = self._corners(obj)
        lines = moved(corner_lines(low, high), obj.world_from_object.matrix())
        ink = theme.color(theme.ACCENT, 0.8)
        draw = imgui.get_background_draw_list()
        for (x0, y0), (x1, y1) in on_screen(view, lines, self._window.logical_size):
            draw.add_line(Vec(x0, y0), Vec(x1, y1), ink, 1.5 * ui_scale)


def corner_lines(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(24, 2, 3): three short edges from each corner of the box between low and high (3,)."""
    lines = []
    for bits in np.ndindex(2, 2, 2):
        corner = np.where(bits, high, low)
        for axis in range(3):
            end = corner.copy()
            end[axis] += CORNER * (low + high - 2 * corner)[axis]
            lines.append((corner, end))
    return np.array(lines)


def pose_after(obj: SceneObject, before: np.ndarray, after: np.ndarray, pivot: np.ndarray) -> Pose:
    """Where the object is once its pivot has gone from one (4, 4) to another, both float32.

    Only the difference counts, so that rounding moves and turns nothing by itself.  Never farther
    away than the physics reaches.
    """
    pose = obj.world_from_object
    middle = pose.position + pose.matrix()[:3, :3] @ pivot + (after - before)[:3, 3]
    turn = np.eye(4)
    turn[:3, :3] = after[:3, :3] @ before[:3, :3].T @ pose.matrix()[:3, :3]
    same = np.array_equal(after[:3, :3], before[:3, :3])
    wxyz = pose.wxyz if same else Pose.from_matrix(turn).wxyz
    position = middle - Pose(np.zeros(3), wxyz).matrix()[:3, :3] @ pivot
    return Pose(np.clip(position, -FAR_M, FAR_M), wxyz)


def flat(matrix: np.ndarray) -> Matrix16:
    """A (4, 4) as ImGuizmo has it: column by column, float32."""
    columns = np.asarray(matrix, np.float32).T.ravel().copy()
    return Matrix16(columns)  # pyright: ignore[reportArgumentType]  # takes arrays, too


def unflat(matrix: Matrix16) -> np.ndarray:
    return np.array(matrix.values, np.float64).reshape(4, 4).T
