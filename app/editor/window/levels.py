"""Levels of detail in the window: finer ones are shown as they come, if the device holds them."""

from collections.abc import Callable

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.refine import Refiner, show_level
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import BadFile, SplatLayers
from shapeshift.scene.scene import Scene


def attach_budget(renderer: Renderer, state: EditorState, hooks: Hooks) -> None:
    """Draws leaves as they come, and says how many of the splats in sight are there."""
    renderer.streaming.converges = False
    told: list[str] = []

    def go_on() -> bool:
        stats = renderer.streaming.stats
        if stats is not None and stats.problem and stats.problem not in told:
            told.append(stats.problem)
            state.problem = stats.problem
        return stats is not None and stats.pending

    def words() -> str:
        stats = renderer.streaming.stats
        if stats is None or not stats.whole:
            return ""
        counts = {"shown": short_count(stats.shown), "all": short_count(stats.in_sight)}
        text = said("{shown} of {all} in sight", **counts)
        return f"{text} …" if stats.pending else text

    hooks.each_frame.append(go_on)
    hooks.status.append(words)


def short_count(count: int) -> str:
    """ "2.0 M": millions from a million on."""
    return f"{count / 1e6:.1f} M" if count >= 999_950 else number(count)


def attach_refiner(
    refiner: Refiner, state: EditorState, hooks: Hooks, upload: Callable[[Scene], None],
    scene_changed: Callable[[], None],
) -> None:  # fmt: skip
    """Shows finer levels as they come; camera, x and settings stay.

    `upload` gives a scene to the device and raises BadFile where it does not fit; `scene_changed`
    hears that another number of splats is drawn.
    """

    def swap() -> bool:
        if (pair := refiner.next_level()) is not None:
            before, after = pair
            places = [i for i, obj in enumerate(state.scene.objects) if obj.model is before]
            for index in places:
                show(index, before, after)
        if refiner.problem:
            state.problem, refiner.problem = refiner.problem, ""
        return refiner.running

    def show(index: int, before: SplatLayers, after: SplatLayers) -> None:
        show_level(state, index, after)
        try:
            upload(state.scene)
        except BadFile as error:  # more than the driver holds: the level before stays
            show_level(state, index, before)
            refiner.stop_at(before)
            state.problem = said("no finer level can be shown: {error}", error=error)
        scene_changed()

    def follow() -> None:
        refiner.follow([obj.model for obj in state.scene.objects])

    hooks.each_frame.append(swap)
    hooks.opened.append(follow)
    hooks.status.append(lambda: refiner.status)
    follow()
