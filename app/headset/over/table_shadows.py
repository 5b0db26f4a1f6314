"""The shadows of a scene's objects on one's own table or floor, while the room itself is seen."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import moderngl
import numpy as np

from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.control import control_key
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.vr.shadow.cast import Cast, Shadows
from shapeshift.vr.shadow.occlusion import STRAY, Blocks, Shadow, blocks_of, shadow_on

RESTS_S = 0.3  # an object that has not moved so long stands on something
HEIGHT_STEP_M = 0.004  # of the way up: another one is another shadow
TURN_STEP = 0.04  # of a rotation matrix
MEASURED = 16  # every so many of its points say where an object ends below
LOWER_M = 0.002  # what sinks so far below its plane has none there any more


@dataclass
class Standing:
    """What is known of one object."""

    model: object
    key: object = None  # of its shape
    blocks: Blocks | None = None
    matrix: np.ndarray = field(default_factory=lambda: np.zeros((4, 4)))  # world_from_object
    still_s: float = 0.0
    bottom_y: float = 0.0  # metres of the world
    plane_y: float | None = None
    made_for: tuple | None = None  # of the shadow in use or under way
    shadow: Shadow | None = None
    work: "Future[Shadow | None] | None" = None


class TableShadows:
    """Follows the objects; shadows are worked out beside the session, one after the other.

    An object's plane is level, where it stood when it was last at rest; what falls below takes its
    plane along.  Close at the end.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._shadows: Shadows | None = None
        self.standing: dict[str, Standing] = {}
        self._worker: ThreadPoolExecutor | None = None
        self.casts: list[Cast] = []  # of this frame

    def follow(self, renderer: Renderer, scene: Scene, seconds: float) -> None:
        """After the renderer has taken the scene over; `seconds` since the frame before."""
        names = {obj.name for obj in scene.objects if obj.seen}
        self.standing = {n: each for n, each in self.standing.items() if n in names}
        busy = any(each.work is not None for each in self.standing.values())
        self.casts = []
        for i, obj in enumerate(scene.objects):
            if not obj.seen:
                continue
            standing = self._of(renderer, i, obj)
            self._move(standing, obj.world_from_object.matrix(), seconds)
            self._collect(standing)
            busy |= self._ask(standing, busy)
            if standing.shadow is not None and standing.plane_y is not None:
                x, _, z = standing.matrix[:3, 3]
                place = np.array([x, standing.plane_y, z])
                self.casts.append(Cast(obj.name, standing.shadow, place))

    def draw(self, framebuffer: moderngl.Framebuffer, view: View) -> None:
        """Below an eye's picture over the room; `view` in the world."""
        if not self.casts:
            return
        if self._shadows is None:
            self._shadows = Shadows(self._ctx)
        self._shadows.draw(framebuffer, view, self.casts)

    def _of(self, renderer: Renderer, i: int, obj: SceneObject) -> Standing:
        standing = self.standing.get(obj.name)
        if standing is None or standing.model is not obj.model:
            standing = self.standing[obj.name] = Standing(obj.model)
        key = (control_key(obj), obj.sections, obj.appearance.opacity)
        if standing.blocks is None or standing.key != key:
            standing.key, standing.blocks = key, blocks_of(*renderer.drawing.read_splats(i))
            standing.made_for, standing.matrix = None, np.zeros((4, 4))
        return standing

    def _move(self, standing: Standing, matrix: np.ndarray, seconds: float) -> None:
        """Where it is now, and what it stands on."""
        assert standing.blocks is not None
        moved = not np.allclose(matrix, standing.matrix, atol=1e-4)
        standing.still_s = 0.0 if moved else standing.still_s + seconds
        if moved:
            standing.matrix = matrix
            points = standing.blocks.points[::MEASURED]
            if len(points):
                heights = points @ matrix[1, :3] + matrix[1, 3]
                standing.bottom_y = float(np.quantile(heights, STRAY))
        plane = standing.plane_y
        sinks = plane is None or standing.bottom_y < plane - LOWER_M
        if sinks or standing.still_s >= RESTS_S:
            standing.plane_y = standing.bottom_y

    def _ask(self, standing: Standing, busy: bool) -> bool:
        """Has its shadow worked out where it would be another one; whether it does."""
        plane, blocks = standing.plane_y, standing.blocks
        if plane is None or blocks is None or not len(blocks.points):
            return False
        height = round((standing.matrix[1, 3] - plane) / HEIGHT_STEP_M)
        turn = np.round(standing.matrix[:3, :3] / TURN_STEP).astype(int).tobytes()
        wanted = (standing.key, height, turn)
        if busy or wanted == standing.made_for:
            return False
        standing.made_for = wanted
        self._worker = self._worker or ThreadPoolExecutor(1, "shadows")
        standing.work = self._worker.submit(shadow_on, blocks, standing.matrix.copy(), plane)
        return True

    def _collect(self, standing: Standing) -> None:
        if standing.work is not None and standing.work.done():
            standing.shadow, standing.work = standing.work.result(), None

    def close(self) -> None:
        """Ends what is under way and gives all back; the context stays."""
        if self._worker is not None:
            self._worker.shutdown(cancel_futures=True)
        if self._shadows is not None:
            self._shadows.release()
