"""What the window shows: scene, control values over time, settings, messages; no GL, no imgui."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.document import DARK, Document
from shapeshift.app.editor.state.bodies import Bodies
from shapeshift.app.editor.state.camera.framed import FirstLook
from shapeshift.app.editor.state.files.edited_file import EditedFile, edited_from_scene
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.messages import Messages
from shapeshift.app.editor.state.regions import Regions
from shapeshift.app.editor.state.scene_objects import (
    origin_of,
    scene_of,
    stood_as,
    with_background,
    with_palette,
)
from shapeshift.app.editor.state.shown_scene import Chain, ShownScene, SplitState
from shapeshift.app.editor.state.track import Grip
from shapeshift.app.film.window.timeline import Timeline
from shapeshift.renderer.settings import DEBUG_VIEWS, RenderSettings
from shapeshift.runtime_models.model import Finding, Model, Stop
from shapeshift.runtime_models.stop_weights import Control
from shapeshift.scene.cameras.framing import fit_points, frame_points
from shapeshift.scene.control import SHIFT_S, Shift, Sweep
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import SceneItem, named_stops
from shapeshift.scene.film.style_path import AutoSlide
from shapeshift.scene.pick import Hit, Picker
from shapeshift.scene.pose import Pose, View, perspective
from shapeshift.scene.scene import Scene, SceneObject

if TYPE_CHECKING:
    from shapeshift.scene.world.world import World

HANDLES = ("", "move", "turn")  # that an object can have; "": none
AS_FILED = ""  # the palette that the scene's own stops name


class EditorState:
    """The scene with what a person may change about it while it is shown."""

    def __init__(self, read_model: Callable[[Path], Model]) -> None:
        self.read_model = read_model
        self.scene = Scene(())
        # Of each of the scene's objects:
        self.filed: tuple[Model, ...] = ()  # its model as read, before a palette was chosen
        self.sources: tuple[Source, ...] = ()  # where the scene's objects come from
        self.edited = edited_from_scene(self.scene, ())  # the same as a scene file, to be edited
        self.bodies = Bodies()
        self._followed: Scene | None = None  # the world's, as it was taken over last
        self.chosen = ""  # name of the object that is edited; "": none
        self.steered = ""  # name of the object whose x a hand has moved last
        self.renamed: list[Callable[[Mapping[str, str]], None]] = []  # hear: before -> after
        self.grip = Grip()  # of the track that the mouse holds
        self.most_sliders = 2  # that there is room for
        self.split = SplitState()
        self.first_look = FirstLook()
        self.sweeps: list[Sweep] = []
        # Of objects on their way to a stop, or there and back by themselves, by their index:
        self.shifts: dict[int, Shift | AutoSlide] = {}
        self.timeline = Timeline()  # of the film that is made here
        self.settings = RenderSettings(background=DARK)
        self.palette = AS_FILED
        self.regions = Regions()
        self.measure_now = False  # compare the picture with the exact one in the next frame
        self.overlay = True  # the panel and all else over the picture is shown
        self.handles = HANDLES[0]  # on the chosen object
        self.save_picture = False  # into a file, of the next frame
        self.seconds = 0.0  # that the frame which is under way lets pass
        self.messages = Messages()
        self.centre, self.radius = np.zeros(3), 1.0
        self._points = (np.zeros((0, 3)), np.zeros(0))
        self._picker, self.shown_scene = Picker(), ShownScene()
        self._movable: tuple[Scene | None, list[int]] = (None, [])
        self.chain = Chain()
        self._legend: tuple[Scene | None, bool] = (None, False)

    def open(self, paths: Sequence[Path], x: float | None = None) -> None:
        """Shows the files or folders instead of what is there; BadFile leaves all as it was."""
        sources = [Source(path, self.read_model(path)) for path in paths]
        self.open_sources(sources, scene_of(sources, x))

    def open_sources(
        self,
        sources: Sequence[Source],
        scene: Scene,
        first_look: FirstLook | None = None,
        edited: EditedFile | None = None,
    ) -> None:
        """Shows what has been opened; `scene` is `scene_of(sources)` or of the document's file."""
        self.sources, self.first_look = tuple(sources), first_look or FirstLook()
        self.show(scene, edited)

    def show(self, scene: Scene, edited: EditedFile | None = None) -> None:
        """Takes a scene over and frames it."""
        self.scene, self.chosen, self.shifts = scene, "", {}
        self.chain.loose.clear()
        self.timeline.forget()
        self.split.on, self.split.name = False, ""
        self.edited = edited or edited_from_scene(scene, self.sources)
        self.bodies.forget()
        self.shown_scene.forget()
        self.settings = with_background(self.settings, self.edited.file.sky, scene)
        self.filed = tuple(obj.model for obj in scene.objects)
        self.palette = AS_FILED
        self.sweeps = [Sweep.over(obj.model.blend) for obj in scene.objects]
        for sweep, obj in zip(self.sweeps, scene.objects, strict=True):
            sweep.resume_at(obj.x)
        self.reframe()
        self.regions.clear()
        self.regions.radius = self.radius
        self.keep_regions()

    def keep_regions(self) -> None:
        """The regions as they are belong to what was opened: nothing to undo, nothing unsaved."""
        self.edited.amend_regions(self.regions)
        self.edited.record_film(self.timeline)
        self.edited.saved_regions, self.edited.saved_film = self.regions.kept, self.timeline.keys

    def record_regions(self) -> None:
        """What was done to the regions and the film since the last call is a step of history."""
        self.edited.record_regions(self.regions)
        self.edited.record_film(self.timeline)

    def reframe(self) -> None:
        """Where the middle of all is now, and how far it reaches."""
        self._points = self.document.points()
        self.centre, self.radius = frame_points(*self._points)

    def replace_model(self, index: int, model: Model) -> None:
        """Another model of the same object: x, sweep, regions, camera and settings stay.

        For finer levels of detail.  What was painted on another number of splats is unpainted.
        """
        objects, filed = list(self.scene.objects), list(self.filed)
        filed[index] = model
        self.edited.refine(index, model)
        objects[index] = replace(objects[index], model=self.in_palette(model))
        self.scene, self.filed = Scene(tuple(objects)), tuple(filed)
        self._points = self.document.points()
        self.regions.fit_painted(index, self.scene.objects[index])

    def first_view(self, size: tuple[int, int]) -> View:
        """The view of a single package if it gives one, else everything framed."""
        return self.first_look.view(self.edited.file, self.scene, self._points, size)

    @property
    def first_target(self) -> np.ndarray:
        """(3,) metres: what the first view looks at and turns about."""
        return self.centre if (view := self.edited.file.view) is None else np.array(view.target)

    @property
    def origin(self) -> np.ndarray:
        """(3,) metres of the file where the scene has its zero: not 0 for one re-centred."""
        return origin_of(self.scene.objects[0].model) if self.scene.objects else np.zeros(3)

    @property
    def document(self) -> Document:
        """What is open, as it is now, as commands and the headset have it."""
        return Document(self.scene, self.edited.file)

    @property
    def title(self) -> str:
        """What is open: the scene file, else the names of the objects."""
        path = self.edited.path
        return path.name if path else ", ".join(obj.name for obj in self.scene.objects)

    @property
    def findings(self) -> list[Finding]:
        """What was wrong in the files that are shown."""
        return [finding for obj in self.scene.objects for finding in obj.model.findings]

    def fit(self, view: View, fov_y: float, size: tuple[int, int]) -> float:
        """Metres from the centre at which all fits size (W, H), looking as the view does."""
        axes = view.world_from_eye.matrix()
        return fit_points(*self._points, self.centre, axes, perspective(fov_y, size))

    def shown(self, view: View) -> Scene:
        """What is drawn, as `view` sees it; the same object until something of it changes."""
        return self.shown_scene.of(self.scene, self.regions, self.chosen, view)

    def pick(self, view: View, direction: np.ndarray, spread: float) -> Hit | None:
        """What a ray from the eye meets, of splats as they are now; `spread` is the hand's."""
        origin = view.world_from_eye.position
        return self._picker.under(self.shown(view), origin, direction, spread)

    def add_region(self, kind: str) -> None:
        """A region of the first object, in the middle of the scene until it is placed."""
        obj = self.scene.objects[0]
        object_from_world = np.linalg.inv(obj.world_from_object.matrix())
        centre = object_from_world @ np.append(self.centre, 1.0)
        self.regions.add(kind, 0, obj, centre[:3])

    def toggle_lens(self) -> bool:
        """Switches the lens on or off; returns whether it is on."""
        return bool(self.scene.objects) and self.regions.toggle_lens(self.scene.objects[0])

    def paint(self, view: View, cursor: tuple[float, float], radius: float, erase: bool) -> None:
        """Paints anchors of the chosen painted region, of a new one where none is chosen."""
        obj = self.regions.choose_painted(self.scene.objects)
        self.regions.paint(view, cursor, radius, obj, erase)

    @property
    def world(self) -> "World | None":
        """What moves and answers to touch; None: nothing can be touched, or not yet."""
        return self.bodies.world

    @property
    def running(self) -> bool:
        """Whether the world goes on by itself: what moves then is no edit."""
        return self.world is not None and not self.world.paused

    def follow_world(self) -> None:
        """Takes over where the world's objects are and what their x is."""
        drawn = self.world.drawn() if self.world is not None else None
        if drawn is not None and drawn is not self._followed:
            stood = {obj.name: obj for obj in drawn.objects}
            objects = [stood_as(obj, stood.get(obj.name)) for obj in self.scene.objects]
            self.scene, self._followed = Scene(tuple(objects)), drawn

    def rest(self) -> None:
        """The hand has let go: the next edit is a step of its own."""
        self.edited.history = self.edited.history.rest()

    def move(self, index: int, pose: Pose) -> None:
        """Puts an object elsewhere, at rest; what the file says stays."""
        obj = self.scene.objects[index]
        self._replace_object(index, replace(obj, world_from_object=pose))
        if self.world is not None and obj.name in self.world.objects:
            self.world.move_object(obj.name, pose)

    def reorder_rows(self, rows: Sequence[tuple], moved: dict[int, int]) -> None:
        """Other objects, each with model as read, sweep and source; camera and settings stay.

        `moved` tells where those that stay have gone: index before -> index now.
        """
        columns = list(zip(*rows, strict=True)) or [(), (), (), ()]
        self.scene = Scene(columns[0])
        self.filed, self.sweeps, self.sources = columns[1], list(columns[2]), columns[3]
        self.regions.renumber(moved)
        self._followed = None

    def next_debug_view(self, step: int) -> None:
        """The next debug view in their order, the picture itself among them."""
        number = (DEBUG_VIEWS.index(self.settings.debug) + step) % len(DEBUG_VIEWS)
        self.settings = replace(self.settings, debug=DEBUG_VIEWS[number])

    def set_x(self, index: int, x: Control) -> None:
        """Moves an object's x; what the file says stays."""
        obj = self.scene.objects[index]
        self._replace_object(index, replace(obj, x=x))
        if self.world is not None and obj.name in self.world.objects:
            self.world.control(obj.name, x)

    def set_chain_x(self, index: int, x: Control) -> None:
        """The same of all that go along with this one."""
        for each in self.chain.of(self.scene, index):
            self.set_x(each, x)

    def _replace_object(self, index: int, obj: SceneObject) -> None:
        objects = list(self.scene.objects)
        objects[index] = obj
        self.scene = Scene(tuple(objects))

    def stops(self, index: int) -> tuple[Stop, ...]:
        """The stops of an object's slider, by x, under the names that the scene gives them."""
        obj = self.scene.objects[index]
        item = edits.find(self.edited.file, obj.name)
        return named_stops(item or SceneItem(name=obj.name, model=""), obj.model)

    def finish_shifts(self) -> None:
        """Objects on their way to a stop are there."""
        self._advance_shifts(SHIFT_S)

    def _advance_shifts(self, seconds: float) -> None:
        """A hand that has moved x meanwhile has the last word."""
        for index, shift in list(self.shifts.items()):
            taken = self.scene.objects[index].x != shift.control
            shift.seconds += seconds
            if not taken:
                self.set_chain_x(index, shift.control)
            if taken or shift.over:
                del self.shifts[index]

    def toggle_play(self, index: int | None = None) -> None:
        """Starts or stops one sweep, or all together: all stop if any was playing."""
        indices = range(len(self.sweeps)) if index is None else [index]
        chosen = {self.chain.of(self.scene, i)[0] for i in indices}
        start = not any(self.sweeps[i].playing for i in chosen)
        for i in chosen:
            self.shifts.pop(i, None)
            if start:
                self.set_chain_x(i, self.sweeps[i].play(self.scene.objects[i].x))
            else:
                self.sweeps[i].playing = False

    def visit(self, index: int, x: float, on: bool) -> None:
        """Adds a stop to those that a sweep visits or takes it away; two are left."""
        sweep = self.sweeps[index]
        xs = {*sweep.xs, x} if on else {*sweep.xs} - {x}
        if len(xs) >= 2:
            sweep.xs = tuple(sorted(xs))
            sweep.resume_at(self.scene.objects[index].x)

    @property
    def movable(self) -> list[int]:
        """Indices of the objects that have somewhere to go: two stops or more."""
        if self._movable[0] is not self.scene:  # asked several times a frame, of many objects
            objects = enumerate(self.scene.objects)
            found = [index for index, obj in objects if len({s.x for s in obj.model.stops}) > 1]
            self._movable = (self.scene, found)
        return self._movable[1]

    @property
    def tracks(self) -> list[int]:
        """Of those, the ones that do not follow their scene."""
        return [i for i in self.movable if i not in self.chain.followers(self.scene)]

    @property
    def sliders(self) -> list[int]:
        """Of tracks, those that there is room for: all of a few, else the chosen one's."""
        movable, index = self.tracks, self.chosen_index
        chosen = None if index is None else self.chain.of(self.scene, index)[0]
        if len(movable) <= self.most_sliders:
            return movable
        seen = [index for index in movable if self.scene.objects[index].visible]
        return [index for index in movable if index == chosen] or (seen or movable)[:1]

    @property
    def chosen_index(self) -> int | None:
        """Where the chosen object is in the scene; None: none is."""
        names = [obj.name for obj in self.scene.objects]
        return names.index(self.chosen) if self.chosen in names else None

    @property
    def problem(self) -> str:
        """The newest problem that nobody has taken away; "": nothing is wrong."""
        return (self.messages.problems or [""])[-1]

    @problem.setter
    def problem(self, sentence: str) -> None:
        """Tells another one; "" takes all away."""
        if sentence:
            self.messages.fail(sentence)
        else:
            self.messages.problems = []

    def say(self, text: str, seconds: float | None = None) -> None:
        """Shows a note for a few seconds, longer for more lines; "" takes it away."""
        self.messages.say(text, time.perf_counter(), seconds)

    @property
    def playing(self) -> bool:
        sweeping = any(sweep.playing for sweep in self.sweeps)
        return bool(self.shifts) or sweeping or self.timeline.playing

    def advance(self, seconds: float) -> None:
        """Lets sweeps and shifts go on, each from where a hand has left its slider meanwhile."""
        self.seconds = seconds
        self._advance_shifts(seconds)
        for index, sweep in enumerate(self.sweeps):
            if sweep.playing:
                sweep.resume_at(self.scene.objects[index].x)
                self.set_chain_x(index, sweep.advance(seconds))

    def choose_palette(self, name: str) -> None:
        """Shows every value stop in that palette; AS_FILED: in the scene's own."""
        self.palette = name
        objects = [
            replace(obj, model=self.in_palette(model))
            for obj, model in zip(self.scene.objects, self.filed, strict=True)
        ]
        self.scene = Scene(tuple(objects))

    def in_palette(self, model: Model) -> Model:
        """A model as it was read, as it is shown."""
        return model if self.palette == AS_FILED else with_palette(model, self.palette)

    @property
    def has_palettes(self) -> bool:
        """Whether any value stop is drawn through a palette at all."""
        return any(stop.palette for obj in self.scene.objects for stop in obj.model.stops)

    @property
    def has_legend(self) -> bool:
        """Whether any value stop that may be seen has values to tell."""
        if self._legend[0] is not self.scene:  # asked several times a frame, of many objects
            seen = [obj for obj in self.scene.objects if obj.visible]
            stops = [stop for obj in seen for stop in obj.model.stops]
            found = any(stop.palette and stop.value_range is not None for stop in stops)
            self._legend = (self.scene, found)
        return self._legend[1]
