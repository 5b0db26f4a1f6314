"""Levels of detail in the window: finer ones are shown as they come, if the device holds them."""

from collections.abc import Callable

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.refine import Refiner, show_level
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.runtime_models.model import BadFile, SplatLayers
from shapeshift.scene.scene import Scene


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
