"""What other parts of the program add to the viewer: a section of the panel, work every frame."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.viewer.shown import Wish
    from app.viewer.window import Event


@dataclass(frozen=True)
class Section:
    """A heading of the panel that folds, with what lies under it."""

    name: str
    draw: Callable[[float], None]  # called with ui_scale between imgui.begin and end
    open_first: bool = False
    above: bool = False  # under the title, before what is about frames
    opens: Callable[[], bool] | None = None  # True: unfold it now
    shown: Callable[[], bool] | None = None  # False: leave it out, there is nothing in it


@dataclass
class Hooks:
    """Lists that whoever adds to the viewer appends to, before or while it runs."""

    sections: list[Section] = field(default_factory=list)  # after Regions, in this order
    top: list[Callable[[float], None]] = field(default_factory=list)  # under the title, ui_scale
    each_frame: list[Callable[[], bool]] = field(default_factory=list)
    # each_frame: called in every frame, in the window's thread, before the splats are drawn;
    # True = something is under way, call again in 30 ms even if nobody touches anything
    opened: list[Callable[[], None]] = field(default_factory=list)  # after every change of scene
    status: list[Callable[[], str]] = field(default_factory=list)  # short words for the status
    #                                                                line; "" = nothing to say
    keys: list[tuple[str, str]] = field(default_factory=list)  # (key, what it does), under Keys
    # over: called once the splats are on the screen, before the overlay, in every frame
    over: list[Callable[["Wish"], None]] = field(default_factory=list)
    # marks: called with ui_scale; over the picture, under the panel, not in saved pictures
    marks: list[Callable[[float], None]] = field(default_factory=list)
    # closing: asked when the window is to be closed; False = not yet
    closing: list[Callable[[], bool]] = field(default_factory=list)
    # takes: sees every event first; True = it was for this
    takes: list[Callable[["Event"], bool]] = field(default_factory=list)
