"""What commands make beside the window: the sections Film, Gallery and Web page; dropped paths."""

from collections.abc import Callable
from pathlib import Path

from shapeshift.app.editor.panels.panel import TOOLS, PanelActions, Section
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.window import Drop, Event, Window
from shapeshift.app.errors import UsageError
from shapeshift.app.film.window.film_panel import FilmPanel, Preview, draw_film_edge, draw_page
from shapeshift.app.film.window.gallery import Gallery
from shapeshift.app.film.window.gallery_panel import draw_gallery
from shapeshift.app.film.window.rendering import PageShare, Rendering, origin_on_disk
from shapeshift.app.film.window.style_work import StyleWork
from shapeshift.app.paths import WorkFolders
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.film.film_path import is_film_file, read_film_file


class Films:
    """The parts of films that a viewer has."""

    def __init__(
        self, window: Window, state: EditorState, viewpoint: Viewpoint, folders: WorkFolders,
        open_soon: Callable[[tuple[Path, ...]], None],
    ) -> None:  # fmt: skip
        self._state = state
        folder = folders.pictures.parent / "films"
        self.styles = StyleWork(state, folders.scenes, lambda path: open_soon((path,)))
        self.preview = Preview(state, viewpoint)
        self.rendering = Rendering(state, folder)
        self.page = PageShare(state, folders.exports)
        self.gallery = Gallery(state)
        self.panel = FilmPanel(state, viewpoint, self.preview, self.rendering)
        self._textures = window.textures

    def draw_gallery(self, ui_scale: float) -> None:
        draw_gallery(self.gallery, self.styles, self._textures, ui_scale)

    def each_frame(self) -> bool:
        """What plays, is drawn or is waited for; True while there is such."""
        playing = self.preview.each_frame()
        children = [self.rendering.poll(), self.rendering.pyav.poll(), self.styles.poll()]
        children.append(self.page.poll())
        return any([playing, *children, self.gallery.each_frame()])

    def handle_event(self, event: Event) -> bool:
        """True for a film that is dropped."""
        if not isinstance(event, Drop) or len(event.paths) != 1:
            return False
        if not is_film_file(event.paths[0]):
            return False
        self.open(event.paths[0])
        return True

    def open(self, path: Path) -> None:
        """Takes the keys of a film file over; it can be undone."""
        state = self._state
        try:
            film = read_film_file(path)
            state.timeline.take_over(film, origin_on_disk(state))
        except (BadFile, UsageError, OSError) as error:
            state.problem = str(error)
        else:
            state.say(said("The keys of {name} are in the section Film.", name=path.name))


def attach_films(
    window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks, folders: WorkFolders,
    open_soon: Callable[[tuple[Path, ...]], None], actions: PanelActions,
) -> Films:  # fmt: skip
    """Adds the sections and the timeline to a viewer; `open_soon` opens what was made."""
    films = Films(window, state, viewpoint, folders, open_soon)
    films.panel.close = lambda: actions.choose(TOOLS[0].name)
    hooks.film = lambda: actions.tool() == "Film" and bool(state.scene.objects)
    hooks.sections += [
        Section("Gallery", films.draw_gallery, shown=lambda: bool(state.scene.objects)),
        Section("Film", films.panel.draw),
        Section("Web page", lambda scale: draw_page(films.page, state, scale)),
    ]
    hooks.each_frame.append(films.each_frame)
    hooks.event_handlers.append(films.handle_event)
    hooks.marks.append(lambda scale: draw_film_edge(state, viewpoint, scale))
    hooks.opened.append(films.gallery.forget)
    hooks.status += [films.rendering.status, films.styles.status, films.page.status]
    return films
