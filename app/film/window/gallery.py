"""The stops of an object as pictures: two are picked, and the slider goes from one to the other."""

import threading
from collections.abc import Callable

import numpy as np

from shapeshift.app.editor.state.arrange import steer_chain
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import AnchorModel, BadFile, Model, SplatLayers, Stop
from shapeshift.scene.cameras.framing import default_background, default_view
from shapeshift.scene.film.style_path import AutoSlide
from shapeshift.scene.scene import Scene, SceneObject

SIZE = (96, 72)  # pixels of a thumbnail
MOST_SPLATS = 300_000  # of a thumbnail: more cost seconds and change no such small picture
DARK = (0.075, 0.078, 0.085)  # display sRGB behind it
SLIDE_S = 4.0  # from one stop to the other


class Gallery:
    """Which two stops of the first slider's object are picked, and how far the way has led."""

    def __init__(self, state: EditorState) -> None:
        self._state = state
        self.thumbnails = Thumbnails()
        self.seen = False  # whether anybody has looked: pictures are drawn from then on
        self.picked: tuple[str, ...] = ()  # names of at most two stops
        self.part = 0.0  # of the way between them
        self.leg_s = SLIDE_S

    @property
    def shown(self) -> tuple:
        """What its section tells; equal as long as its picture is right."""
        return self.picked, self.part, self.sliding, len(self.thumbnails.pictures)

    def forget(self) -> None:
        """Another scene: other stops."""
        self.picked, self.part = (), 0.0

    @property
    def index(self) -> int | None:
        """The object whose stops are shown; None: nothing is open."""
        if self._state.sliders:
            return self._state.sliders[0]
        return 0 if self._state.scene.objects else None

    @property
    def stops(self) -> tuple[Stop, ...]:
        return () if self.index is None else self._state.stops(self.index)

    def pick(self, name: str) -> None:
        """Picks a stop and goes there; of three the first is left; a picked one is let go."""
        if name in self.picked:
            self.picked = tuple(other for other in self.picked if other != name)
        else:
            self.picked = (*self.picked, name)[-2:]
        if self.index is None or not self.picked:
            return
        self.stop_sliding()
        self.part = float(len(self.picked) - 1)
        steer_chain(self._state, self.index, self._control(self.picked[-1]))

    def slide(self, part: float) -> None:
        """A hand goes to a part of the way between the two, at its even pace."""
        if self.index is None or len(self.picked) < 2:
            return
        self.stop_sliding()
        self.part = part
        blend = self._state.scene.objects[self.index].model.blend
        start, end = map(self._control, self.picked)
        steer_chain(self._state, self.index, blend.between(start, end, part))

    @property
    def sliding(self) -> bool:
        """Whether it goes there and back by itself."""
        return self.index is not None and isinstance(self._shift, AutoSlide)

    @property
    def _shift(self) -> object:
        return None if self.index is None else self._state.shifts.get(self.index)

    def toggle_sliding(self) -> None:
        """There and back between the two by itself, as a film goes; or it stays where it is."""
        if self.sliding:
            self.stop_sliding()
        elif self.index is not None and len(self.picked) == 2:
            blend = self._state.scene.objects[self.index].model.blend
            start, end = map(self._control, self.picked)
            steer_chain(self._state, self.index, start)
            self._state.sweeps[self.index].playing = False
            self._state.shifts[self.index] = AutoSlide.between(start, end, blend, self.leg_s)

    def stop_sliding(self) -> None:
        """A hand takes over."""
        if self.index is not None:
            self._state.shifts.pop(self.index, None)
            self._state.sweeps[self.index].playing = False

    def _control(self, name: str) -> float:
        return next(stop.x for stop in self.stops if stop.name == name)

    def each_frame(self) -> bool:
        """Has pictures drawn where there are none; True while they are."""
        if self.index is None or not self.seen:
            return False
        stops = {stop.name for stop in self.stops}
        if not stops.issuperset(self.picked):
            self.forget()
        return self.thumbnails.want(self._state.scene.objects[self.index].model, self.stops)


class Thumbnails:
    """Small pictures of a model at its stops, drawn once in a thread of its own, without GL."""

    def __init__(self) -> None:
        self.pictures: dict[float, np.ndarray] = {}  # by x: (72, 96, 3) uint8
        self.version = 0  # of the pictures: another scene's are others
        self._of: tuple = ()  # the model and the places that they are of
        self._thread: threading.Thread | None = None
        self._stopped = threading.Event()

    def want(self, model: Model, stops: tuple[Stop, ...]) -> bool:
        """Begins to draw what is not there; True while that goes on."""
        made_of = (id(model), tuple(stop.x for stop in stops))
        if made_of != self._of:
            self.close()
            self._of, self.pictures, self._stopped = made_of, {}, threading.Event()
            self.version += 1
            given = (model, made_of[1], self.pictures, self._stopped)
            self._thread = threading.Thread(target=draw, args=given, name="gallery", daemon=True)
            self._thread.start()
        return self._thread is not None and self._thread.is_alive()

    def close(self) -> None:
        """Ends the drawing after the picture that is under way."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None


def draw(
    model: Model, xs: tuple[float, ...], pictures: dict[float, np.ndarray],
    stopped: threading.Event, open_renderer: Callable[..., Renderer] = Renderer,
) -> None:  # fmt: skip
    """Puts a picture of a model at each x into `pictures`; a model that fits no device has none."""
    few = thinned(model)
    view = default_view(few, SIZE)
    try:
        with open_renderer(None) as renderer:
            renderer.settings = RenderSettings(background=default_background(few, DARK))
            for x in xs:
                if stopped.is_set():
                    return
                renderer.update(Scene((SceneObject("stop", few, x=x),)))
                renderer.draw([view])
                shown = np.clip(renderer.resolved(), 0, 1)
                pictures[x] = (shown * 255 + 0.5).astype(np.uint8)
    except (BadFile, RuntimeError, MemoryError):
        return  # the gallery has names alone then


def thinned(model: Model) -> Model:
    """The same with at most MOST_SPLATS splats, evenly left out."""
    step = -(-model.splat_count // MOST_SPLATS)
    if step <= 1:
        return model
    rows = slice(None, None, step)
    if isinstance(model, SplatLayers):
        return model.with_rows(rows)
    return model.with_anchors(rows) if isinstance(model, AnchorModel) else model
