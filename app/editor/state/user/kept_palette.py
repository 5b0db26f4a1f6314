"""The palette that a person has chosen for heat, used for every scene that has one."""

from collections.abc import Callable

from shapeshift.app.editor.state.editor_state import AS_FILED, EditorState
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.renderer.colors.palette import PALETTES


class KeptPalette:
    """Follows what is chosen in the section Look."""

    def __init__(
        self, state: EditorState, settings: ProgramSettings, keep: Callable[[], None]
    ) -> None:
        self._state, self._settings, self._keep = state, settings, keep
        self._seen = AS_FILED
        self.use()

    def use(self) -> None:
        """Another scene is open, in its own palette."""
        wanted = self._settings.palette
        if wanted in PALETTES and self._state.has_palettes:
            self._state.choose_palette(wanted)
        self._seen = self._state.palette

    def poll(self) -> bool:
        """Once a frame: a palette that was chosen since is the one to be kept."""
        if self._state.palette != self._seen:
            self._seen = self._settings.palette = self._state.palette
            self._keep()
        return False
