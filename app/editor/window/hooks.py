"""What other parts of the program add to the viewer: a section of the panel, work every frame."""

from collections.abc import Callable
from dataclasses import dataclass, field

from shapeshift.app.editor.panels.panel import Section
from shapeshift.app.editor.state.layout import Box
from shapeshift.app.editor.window.shown import FrameRequest, RightSide
from shapeshift.app.editor.window.window import Event
from shapeshift.scene.scene import Scene


@dataclass
class Hooks:
    """Lists that parts of the viewer append to, before or while it runs."""

    sections: list[Section] = field(default_factory=list)  # the panel knows their order by name
    top: list[Callable[[float], None]] = field(default_factory=list)  # under the title, ui_scale
    each_frame: list[Callable[[], bool]] = field(default_factory=list)
    # each_frame: called in every frame, in the window's thread, before the splats are drawn;
    # True = something is under way, call again in 30 ms even if nobody touches anything
    opened: list[Callable[[], None]] = field(default_factory=list)  # after every change of scene
    status: list[Callable[[], str]] = field(default_factory=list)  # short words for the status
    #                                                                line; "" = nothing to say
    # keys: name of a group -> (key, what it does), on the sheet of keys
    keys: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    # cards: called with the free part of the window and ui_scale; draws over it and returns where,
    # None for nothing
    cards: list[Callable[[Box, float], Box | None]] = field(default_factory=list)
    # over: called once the splats are on the screen, before the overlay, in every frame
    over: list[Callable[[FrameRequest], None]] = field(default_factory=list)
    # beside: asked with the scene and the window's width for what is right of a line instead
    beside: Callable[[Scene, int], RightSide | None] = lambda scene, width: None
    # film: whether its timeline lies over the whole lower edge
    film: Callable[[], bool] = lambda: False
    # marks: called with ui_scale; over the picture, under the panel, not in saved pictures
    marks: list[Callable[[float], None]] = field(default_factory=list)
    # closing: asked when the window is to be closed; False = not yet
    closing: list[Callable[[], bool]] = field(default_factory=list)
    # asked: what a box asks or a part says by itself; another value is drawn at once, though nobody
    # has touched anything
    asked: list[Callable[[], object]] = field(default_factory=list)
    # event_handlers: each sees every event first; True = it was for this
    event_handlers: list[Callable[[Event], bool]] = field(default_factory=list)
