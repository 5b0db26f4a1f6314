"""The film of the timeline in the window, while it plays or its playhead is dragged."""

from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.film.timeline import Timeline
from shapeshift.app.film.film_plan import FilmPlan
from shapeshift.runtime_models.stop_weights import StopWeights, control_text


class Preview:
    """Shows the frame under the playhead; whoever moves the camera or a slider leaves it."""

    def __init__(self, state: EditorState, viewpoint: Viewpoint) -> None:
        self._state, self._viewpoint = state, viewpoint
        self._shown: tuple | None = None  # the keys and the playhead that are on the screen

    @property
    def timeline(self) -> Timeline:
        return self._state.timeline

    @property
    def plan(self) -> FilmPlan | None:
        return self.timeline.plan(self._state.document)

    def toggle(self) -> None:
        """Plays from the playhead on, or stops there."""
        timeline = self.timeline
        timeline.playing = not timeline.playing and self.plan is not None
        if timeline.playing and timeline.at_s >= timeline.keys.seconds:
            timeline.at_s = 0.0

    def show(self) -> None:
        """Puts the frame under the playhead on the screen."""
        plan, state = self.plan, self._state
        if plan is None:
            return
        number = self.timeline.frame(plan)
        self._viewpoint.fly(plan.view(number))
        for index, (path, control) in enumerate(
            zip(plan.paths, plan.controls(number), strict=True)
        ):
            if path is not None and index < len(state.scene.objects):
                state.sweeps[index].playing = False
                state.set_x(index, control)

    def each_frame(self) -> bool:
        """Goes on with what plays; a hand on the camera ends it."""
        timeline = self.timeline
        if not timeline.playing:
            return False
        if self._shown is not None and self._viewpoint.flown is None:
            timeline.playing, self._shown = False, None
            return False
        timeline.advance(self._state.seconds)
        self.show()
        self._shown = (timeline.keys, timeline.at_s)
        return True

    def key_camera(self) -> None:
        """The view of now at the playhead."""
        self.timeline.add_camera(self._viewpoint.plain_view())

    def key_stop(self) -> None:
        """What the first slider's object shows now, at the playhead."""
        state = self._state
        if state.sliders:
            index = state.sliders[0]
            self.timeline.add_stop(self.word(index))

    def word(self, index: int) -> str:
        """What an object shows now, as a style path says it."""
        control = self._state.scene.objects[index].x
        if not isinstance(control, StopWeights):
            for stop in self._state.stops(index):
                if abs(stop.x - control) < 1e-6:
                    return stop.name
        return control_text(control)
