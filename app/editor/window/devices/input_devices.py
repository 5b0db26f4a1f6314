"""What a hand may hold beside keys and mouse: gamepads and 3D mice, as the window's loop asks."""

from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.window.devices.gamepads import attach_pads
from shapeshift.app.editor.window.devices.space_mice import attach_space_mice
from shapeshift.app.editor.window.hands import InputActions
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.window import Window


class InputDevices:
    """All of them; they are read, and have no events that would wake a window."""

    def __init__(
        self, window: Window, state: EditorState, viewpoint: Viewpoint, hands: InputActions,
        hooks: Hooks,
    ) -> None:  # fmt: skip
        attached = (window, state, viewpoint, hands, hooks)
        self.pads = attach_pads(*attached)
        self.mice = attach_space_mice(*attached)

    @property
    def connected(self) -> bool:
        """Whether any is there, so that it is to be read often."""
        return self.pads.connected or self.mice.connected

    @property
    def moving(self) -> bool:
        """Whether a stick, a trigger or a cap is out of its middle."""
        return self.pads.input.moving or self.mice.input.moving

    def poll(self) -> bool:
        """Reads all; whether any asks for a frame."""
        return any([self.pads.poll(), self.mice.poll()])
