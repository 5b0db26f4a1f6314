"""The objects of a scene by number, as a tuple has them, and by name."""

from collections.abc import Sequence
from typing import Any, Generic, Protocol, SupportsIndex, TypeVar, overload

import numpy as np

from shapeshift.api.arguments import X
from shapeshift.runtime_models.model import Model
from shapeshift.runtime_models.shapes import three
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.appearance import WHITE, Appearance
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import SceneObject


class HoldsObjects(Protocol):
    """A scene: what finds an object and makes another scene of it."""

    def object(self, name: str) -> SceneObject: ...
    def with_object(
        self,
        name: str,
        *,
        position: Sequence[float] | None = None,
        wxyz: Sequence[float] | None = None,
        x: X | None = None,
        visible: bool | None = None,
        appearance: Appearance | None = None,
    ) -> Any: ...


S = TypeVar("S", bound=HoldsObjects)


class NamedObject(Generic[S]):
    """One object of a scene.  Nothing in it changes: what moves it gives another scene.

    mug = scene.objects["mug"]
    moved = mug.move(by=(0, 0.2, 0)); moved.render()
    """

    def __init__(self, scene: S, obj: SceneObject) -> None:
        self._scene, self.drawn = scene, obj  # drawn: as the renderer takes it

    def __repr__(self) -> str:
        place = ", ".join(f"{metres:.3g}" for metres in self.pose.position)
        return f"<object '{self.name}' at ({place}) m, {self.model.splat_count:,} splats>"

    @property
    def name(self) -> str:
        """As the scene file has it."""
        return self.drawn.name

    @property
    def model(self) -> Model:
        """Its anchors or splats, in its own frame."""
        return self.drawn.model

    @property
    def pose(self) -> Pose:
        """world_from_object: metres, and a quaternion, w first."""
        return self.drawn.world_from_object

    @property
    def x(self) -> Control:
        """Where its slider stands."""
        return self.drawn.x

    @property
    def visible(self) -> bool:
        return self.drawn.visible

    def _changed(self, **changes: Any) -> S:
        scene: S = self._scene.with_object(self.name, **changes)
        return scene

    def move(
        self,
        position: Sequence[float] | None = None,
        wxyz: Sequence[float] | None = None,
        *,
        by: Sequence[float] | None = None,
    ) -> S:
        """The scene with it elsewhere: at a position, or by so many metres from where it is.

        position, by: (3,) metres, world, one of them.  wxyz: (4,) unit quaternion, w first; None:
        turned as it is.  Raises ValueError for both, and for places that are none.

            lifted = scene.objects["mug"].move(by=(0, 0.1, 0))
        """
        if by is not None:
            if position is not None:
                raise ValueError("move takes a position or by, not both.")
            position = (self.pose.position + np.asarray(by, np.float64)).tolist()
        return self._changed(position=position, wxyz=wxyz)

    def at(self, x: X) -> S:
        """The scene with its slider at x alone, as `Scene.at` takes x.

        opened = scene.objects["motor"].at("Opened")
        """
        return self._changed(x=x)

    def show(self, visible: bool = True) -> S:
        """The scene with it shown or hidden.

        scene.objects["mug"].show(False).render()
        """
        return self._changed(visible=visible)

    def appear(
        self,
        exposure: float = 0.0,
        gamma: float = 1.0,
        tint: Sequence[float] = WHITE,
        opacity: float = 1.0,
    ) -> S:
        """The scene with it brighter, darker, of another colour, or see-through.

        exposure: stops of light.  gamma: above 1 its darker tones are brighter.  tint: (3,) times
        its colours as displayed.  opacity: 0..1 times that of its splats.  Raises ValueError.

            scene.objects["motor"].appear(exposure=1, opacity=0.5).render()
        """
        return self._changed(appearance=Appearance(exposure, gamma, three(tint), opacity))


class SceneObjects(tuple[SceneObject, ...], Generic[S]):
    """All objects, in the order of the file; ["mug"] is the one of that name."""

    _scene: S

    @classmethod
    def of(cls, scene: S, objects: Sequence[SceneObject]) -> "SceneObjects[S]":
        """The objects of a scene, which makes other scenes of them."""
        made = cls(objects)
        made._scene = scene
        return made

    @overload
    def __getitem__(self, key: SupportsIndex, /) -> SceneObject: ...
    @overload
    def __getitem__(self, key: slice, /) -> tuple[SceneObject, ...]: ...
    @overload
    def __getitem__(self, key: str, /) -> NamedObject[S]: ...
    def __getitem__(
        self, key: SupportsIndex | slice | str, /
    ) -> SceneObject | tuple[SceneObject, ...] | NamedObject[S]:
        """By number as of a tuple, or by name.  Raises UsageError that lists the names."""
        if isinstance(key, str):
            return NamedObject(self._scene, self._scene.object(key))
        return super().__getitem__(key)
