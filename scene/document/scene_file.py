"""What a scene file says (docs/scene.md): objects with a place, a body and reactions, a background.

This is the file's own content, models still being paths; `read_models` opens them and `scene_of`
gives what the renderer draws.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile, Model, SplatLayers, Stop
from shapeshift.runtime_models.parts import find_label, part_of
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.stop_weights import Control, StopWeights
from shapeshift.scene.appearance import NEUTRAL, Appearance, Sky
from shapeshift.scene.cameras.framing import frame_points, framing_view, scene_points, view_from
from shapeshift.scene.cameras.upright import Upright
from shapeshift.scene.pose import Pose, View, orthographic
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.sections.section import SceneSection
from shapeshift.scene.selectors.selector import UPRIGHT, Painted, Selector
from shapeshift.scene.world.reactions import Machine, Reaction, State, TwoAxes

FORMAT = "shapeshift-scene 1"
UP_OPTION = re.compile(r"--up=([+-][XYZ])")
ENDING = ".scene.json"
HULLS = "hulls"  # as a collider: made from the splats
BACKGROUND = "background"  # the name of the background's object
FAR_M = 1e4  # metres: farther from the origin the physics is coarser than a millimetre
MARK_WITHIN = 4096  # bytes from the start in which a file without the ending says its format


@dataclass(frozen=True, kw_only=True)
class SceneItem:
    """One object of the file."""

    name: str
    model: str  # path, forward slashes, from the file's folder unless absolute
    mode: str = ""  # how its layers add up, which axis is up: as of Reading
    up: str = ""
    flip: bool = False
    part: int | str | None = None  # of the model: a label or an object's name; None: all of it
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)  # metres in the world
    wxyz: tuple[float, float, float, float] = UPRIGHT
    placed: bool = True  # False: a part without a pose, until `read_models` puts it in its place
    x: Control = 0.0
    visible: bool = True
    appearance: Appearance = NEUTRAL
    selectors: tuple[Selector, ...] = ()
    sections: tuple[SceneSection, ...] = ()
    collider: str | None = None  # a mesh's path, HULLS, or None: nothing can touch it
    static: bool = False  # touched, but never moved
    floats: bool = False  # stays in the air until something touches it
    doubt: str = ""  # why it may be cut wrong, as `segment` says
    mass_kg: float = 1.0
    friction: float = 0.6
    restitution: float = 0.0
    states: tuple[State, ...] = ()  # of its reactions; none: the model's stops
    ring: bool = False
    reactions: tuple[Reaction, ...] = ()
    two_axes: TwoAxes | None = None

    @property
    def pose(self) -> Pose:
        wxyz = np.array(self.wxyz)
        return Pose(np.array(self.position), wxyz / np.linalg.norm(wxyz))


@dataclass(frozen=True)
class FirstView:
    """From where a scene is looked at first."""

    eye: tuple[float, float, float]  # metres
    target: tuple[float, float, float]
    fov_y: float = 0.8  # radians
    orthographic: bool = False  # parallel rays, to the scale that the target is seen in
    near_m: float = 0.0  # metres from the eye before which nothing is drawn; 0: as usual


@dataclass(frozen=True)
class NamedView:
    """A view of the scene to come back to."""

    name: str
    view: FirstView


@dataclass(frozen=True, kw_only=True)
class SceneFile:
    folder: Path  # where relative paths begin
    items: tuple[SceneItem, ...] = ()
    background: SceneItem | None = None  # static, called BACKGROUND
    floor_y: float | None = None  # metres; None: no floor
    gravity_m_s2: float = 9.81
    view: FirstView | None = None
    views: tuple[NamedView, ...] = ()  # to go to by their names
    appearance: Appearance = NEUTRAL  # of all objects, after their own
    sections: tuple[SceneSection, ...] = ()  # of all objects, in the world
    sky: Sky | None = None  # behind everything; None: what the model or the program has there
    upright: Upright | None = None  # how its up was found; None: +Y is up, and nobody asked

    @property
    def all_items(self) -> tuple[SceneItem, ...]:
        """The background, where there is one, and the objects."""
        return ((self.background,) if self.background else ()) + self.items

    def path(self, text: str) -> Path:
        """A path of the file on this machine."""
        return self.folder / text  # an absolute one stays


def is_scene_file(path: Path) -> bool:
    """By its ending, else a .json that says so itself."""
    if path.name.lower().endswith(ENDING):
        return True
    if path.suffix.lower() != ".json" or not path.is_file():
        return False
    with path.open("rb") as file:
        return b'"shapeshift-scene ' in file.read(MARK_WITHIN)


def read_models(
    file: SceneFile, reading: Reading | None = None
) -> tuple[SceneFile, dict[str, Model]]:
    """The file, in which every part has its place now, and each object's model by its name.

    A model that several have, or parts of it, is read once.  A part that the file gives no pose
    stands where it stands in its model.  Raises BadFile.
    """
    reading, models = (reading or Reading()).begun(), {}
    opened: dict[tuple, Model] = {}
    parts: dict[tuple, tuple[Model, tuple[float, float, float]]] = {}
    items = []
    for item in file.all_items:
        key = (item.model, item.mode, item.up, item.flip)
        if key not in opened:
            own = replace(reading, mode=item.mode, up=item.up, flip=item.flip)
            try:
                opened[key] = advised_in_file(read_model(file.path(item.model), own))
            except BadFile as error:
                raise BadFile(f"object '{item.name}': 'model': {error}") from None
        if item.part is None:
            models[item.name], position = opened[key], item.position
        else:
            try:
                label = find_label(opened[key], item.part, Path(item.model).name)
                if (*key, label) not in parts:
                    parts[*key, label] = part_of(opened[key], label)
            except BadFile as error:
                raise BadFile(f"object '{item.name}': 'part': {error}") from None
            models[item.name], position = parts[*key, label]
        items.append(item if item.placed else replace(item, position=position, placed=True))
    background = items.pop(0) if file.background else None
    return replace(file, items=tuple(items), background=background), models


def advised_in_file(model: Model) -> Model:
    """The model, its findings with keys of the file for options that a scene does not take."""
    told = (
        replace(found, done=UP_OPTION.sub(r'"up": "\1" of its object', found.done))
        for found in model.findings
    )
    return replace(model, findings=tuple(told)) if model.findings else model


def scene_of(file: SceneFile, models: Mapping[str, Model]) -> Scene:
    """What is drawn: every object with its model, where and how the file says.  Raises BadFile."""
    return Scene(tuple(object_of(item, models[item.name], i, file) for i, item in labelled(file)))


def labelled(file: SceneFile) -> list[tuple[int, SceneItem]]:
    """Each object with its label; 0 is the background's."""
    first = 0 if file.background else 1
    return list(enumerate(file.all_items, first))


def with_own_appearance(file: SceneFile) -> SceneFile:
    """The same scene, in which each object has what the file says of all of them, too."""
    if file.appearance == NEUTRAL and not file.sections:
        return file

    def own(item: SceneItem) -> SceneItem:
        sections = (*item.sections, *file.sections)
        return replace(item, appearance=item.appearance.under(file.appearance), sections=sections)

    background = own(file.background) if file.background is not None else None
    items = tuple(map(own, file.items))
    return replace(file, items=items, background=background, appearance=NEUTRAL, sections=())


def object_of(
    item: SceneItem, model: Model, label: int, file: SceneFile | None = None
) -> SceneObject:
    """The object as it is drawn, with what the file says of all.  Raises BadFile."""
    of_scene = file.appearance if file is not None else NEUTRAL
    cuts = file.sections if file is not None else ()
    count = len(model.means if isinstance(model, SplatLayers) else model.anchors)
    for selector in item.selectors:
        if isinstance(selector, Painted) and len(selector.weight) != count:
            raise BadFile(
                f"object '{item.name}': 'selectors': painted are {len(selector.weight):,} weights, "
                f"its model has {count:,} anchors; paint it anew."
            )
    try:
        return SceneObject(
            item.name, model, item.pose, item.x, label, item.visible, item.selectors,
            appearance=item.appearance.under(of_scene),
            sections=sections_of(item, model, cuts),
        )  # fmt: skip
    except ValueError as error:  # a blend of stops that its model has not
        raise BadFile(f"object '{item.name}': 'x': {error}") from None


def sections_of(
    item: SceneItem, model: Model, of_scene: tuple[SceneSection, ...]
) -> tuple[SceneSection, ...]:
    """An object's own, then those of the scene; what shows stops beyond that the model has not is
    for other objects.
    """
    names = {stop.name for stop in model.stops}

    def known(one: SceneSection) -> bool:
        blend = one.beyond
        return not isinstance(blend, StopWeights) or {n for n, w in blend.parts if w} <= names

    return (*item.sections, *filter(known, of_scene))


def machine_of(item: SceneItem, model: Model) -> Machine:
    """What moves the object's x; its states are the model's stops where the file names none.

    Raises BadFile for a state that is neither.
    """
    if not item.reactions:
        return Machine(item.states, blend=model.blend)
    try:
        states = item.states or tuple(State(stop.name, stop.x) for stop in model.stops)
        return Machine(states, item.reactions, item.ring, model.blend)
    except ValueError as error:
        raise BadFile(f"object '{item.name}': 'reactions': {error}") from None


def named_stops(item: SceneItem, model: Model) -> tuple[Stop, ...]:
    """The stops of an object's slider, by x: the model's, named as the states that the scene has
    there, and those states themselves; a state in a blend of stops has no place on it; the end of a
    ring is its beginning.
    """
    stops = {stop.x: stop for stop in model.stops}
    named = [(state.x, state.name) for state in item.states if not isinstance(state.x, StopWeights)]
    if item.ring and named:
        named.append((1.0, min(named)[1]))
    for x, name in named:
        stops[x] = replace(stops.get(x, Stop("", x)), name=name)
    return tuple(stops[x] for x in sorted(stops))


def first_view(file: SceneFile, scene: Scene, size: tuple[int, int]) -> View:
    """From where the file wants to be seen, else all of it in the picture."""
    points, opacity = scene_points(scene)
    if file.view is None:
        return framing_view(points, opacity, size)
    _, radius = frame_points(points, opacity)
    return stated_view(file.view, radius, size)


def stated_view(stated: FirstView, radius: float, size: tuple[int, int]) -> View:
    """The view that a file states, of a scene that reaches so many metres."""
    eye, target = np.array(stated.eye), np.array(stated.target)
    view = view_from(eye, target, radius, size, stated.fov_y)
    if stated.orthographic:
        return orthographic(view, float(np.linalg.norm(target - eye)), radius, stated.near_m)
    return replace(view, near=stated.near_m) if stated.near_m > 0 else view
