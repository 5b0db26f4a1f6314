"""The viewer's files: those it opens while the window goes on, and those it opened before."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.camera_files import camera_reading, in_scene
from shapeshift.app.editor.panels.empty_panel import DEMO_LABEL, OPEN, TOUCH_LABEL, draw_empty
from shapeshift.app.editor.panels.open_row import OpenRow
from shapeshift.app.editor.panels.widgets.path_box import PathBox
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.state.camera.camera import Camera
from shapeshift.app.editor.state.camera.first_look import FirstLook
from shapeshift.app.editor.state.files.document import Document, document_from, document_of
from shapeshift.app.editor.state.files.opened import OpenedFiles, Opener, ReadModel, read_files
from shapeshift.app.editor.state.scene_objects import scene_of
from shapeshift.app.editor.state.user.recent import RecentFiles
from shapeshift.app.editor.window.window import Drop, Event, KeyDown
from shapeshift.app.opening import sentence
from shapeshift.app.paths import DEMO, TOUCH, config_folder
from shapeshift.app.subject import file_at, placed
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.framing import common_side
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import scene_of as scene_of_file
from shapeshift.scene.scene import Scene

if TYPE_CHECKING:
    from shapeshift.app.editor.desktop import Options
    from shapeshift.app.editor.window.viewer import Viewer

MOST_TOLD = 2  # findings that the note at opening spells out; the status line has them all


class Files:
    """Opens what is dropped or chosen; the scene changes when all of it has been read."""

    def __init__(self, viewer: "Viewer", recent: RecentFiles | None = None) -> None:
        self._viewer = viewer
        self._opener = Opener()
        self.recent = recent  # None: nothing is kept
        self._at_demo = False  # the bundled demo is what is seen: what else there is, is offered
        # Reads one scene, in the thread that opens; replaced where progress can be told.
        self.read: ReadModel = lambda path, told: viewer.state.read_model(path)
        self._row = OpenRow()
        self._box = PathBox("Open a scene", "Open")
        hooks = viewer.hooks
        hooks.each_frame.append(self.poll)
        hooks.top.append(self.draw_row)
        hooks.marks.append(self.draw_box)
        hooks.cards.append(self.draw_empty)
        hooks.takes.append(self.take_event)

    @property
    def busy(self) -> bool:
        return self._opener.busy

    def open_soon(self, paths: tuple[Path, ...]) -> None:
        """Begins to read files; the window stays alive meanwhile."""
        viewer = self._viewer
        reading, plain = camera_reading(viewer.options), viewer.options.reading()
        self._opener.start(
            paths, lambda paths, told: read_files(paths, self.read, reading, told, plain)
        )
        viewer.say(self._opener.note)

    def started(self, found: OpenedFiles, options: "Options") -> None:
        """The scene and cameras with which the window opens."""
        viewer = self._viewer
        viewer.set_title()
        self._at_demo = not (options.scenes or options.touch)
        if options.screenshot is None:
            self.recent = RecentFiles.read(config_folder())
            if options.scenes:
                self.remember_all(found)
        self.take_cameras(found, stand=options.camera is not None)
        viewer.say(told_of(found))

    def ask(self) -> None:
        """Opens the box that takes a path; what is dropped meanwhile is opened as well."""
        self._box.ask()

    def take_event(self, event: Event) -> bool:
        """True for Ctrl+O, for keys while the box is open, and for what is dropped on it."""
        match event:
            case KeyDown(shortcut="o") if not self._box.asking:
                self.ask()
            case KeyDown() if self._box.asking:
                pass
            case Drop() if self._box.asking:
                self._box.close()
                return False
            case _:
                return False
        return True

    def poll(self) -> bool:
        """Takes over what has been read; True while something is being read or looked for."""
        busy = take_over(self._viewer, self._opener, self._ask_and_take)
        return busy or self._box.browsing

    def _ask_and_take(self, found: OpenedFiles) -> None:
        if found.sources:
            self._viewer.objects.saving.before_losing(lambda: self.take(found))
        else:
            self.take(found)

    def take(self, found: OpenedFiles) -> None:
        """Shows what has been read; a scene that the device cannot hold leaves the old one."""
        viewer = self._viewer
        state = viewer.state
        if found.sources:
            try:
                scene, document = opened_scene(found)
                viewer.renderer.update(scene)
            except BadFile as error:
                state.problem = str(error)
                viewer.shown.forget()
                return
            state.take(found.sources, scene, first_look(found), document)
            self._at_demo = [source.path for source in found.sources] == [DEMO]
            viewer.messages.problems = []
            viewer.show_scene()
        self.take_cameras(found, stand=not found.sources)
        self.remember_all(found)
        viewer.say(told_of(found))

    def take_cameras(self, found: OpenedFiles, stand: bool) -> None:
        """The cameras of a file for n and p; of a scene without any there are none."""
        viewer = self._viewer
        cameras = found.cameras
        if cameras is None and found.floor is not None and not found.sources:
            cameras = found.floor
        if cameras is None and not found.sources:
            return
        if cameras is not None and viewer.state.scene.objects:
            cameras = in_scene(cameras, viewer.state.scene.objects[0].model)
        now = viewer.view()
        viewer.steps.take(cameras)
        if stand and cameras is not None:
            viewer.steps.go_to(0, now if viewer.frames else None)
            viewer.steps.untold = ()  # said with the file's other notes

    def draw_row(self, ui_scale: float) -> None:
        """The buttons under the panel's title."""
        here = self._viewer.state.document.path
        others = {TOUCH_LABEL: TOUCH} if self._at_demo else {DEMO_LABEL: DEMO}
        others = others if self._at_demo or here == TOUCH else {}
        wants, chosen = self._row.draw(self.recent, others, ui_scale)
        if wants:
            self.ask()
        elif chosen is not None:
            self.open_soon((chosen,))

    def draw_box(self, ui_scale: float) -> None:
        """The box for a path, while it is open."""
        if chosen := self._box.draw(self.recent.paths if self.recent else (), ui_scale):
            self.open_soon(chosen)

    def draw_empty(self, free: Box, ui_scale: float) -> Box | None:
        """What can be opened, while nothing is."""
        if self._viewer.state.scene.objects or self.busy:
            return None
        box, clicked = draw_empty(free, ui_scale)
        if clicked == OPEN:
            self.ask()
        elif clicked:
            self.open_soon((TOUCH if clicked == TOUCH_LABEL else DEMO,))
        return box

    def remember_all(self, found: OpenedFiles) -> None:
        """What was opened by name: the scene file, not what is in it."""
        inside = len(found.file.all_items) if found.file else 0
        for path in [found.path] * (inside > 0) + [s.path for s in found.sources[inside:]]:
            self.remember(path)

    def remember(self, path: Path) -> None:
        """Puts a file first in the list of recent ones."""
        if self.recent is None:
            return
        try:
            self.recent.add(path)
        except OSError as error:
            sentence = f"The list of recent files cannot be kept: {error.strerror}."
            self._viewer.messages.fail(sentence)
            self.recent = None


def take_over(viewer: "Viewer", opener: Opener, take: Callable[[OpenedFiles], None]) -> bool:
    """Gives what a thread has read to `take`, its failure to the viewer; True while it reads."""
    if not opener.busy:
        return False
    name = opener.paths[0].name
    try:
        found = opener.poll()
    except (BadFile, OSError) as error:
        viewer.state.problem = str(error)
        viewer.say("")
    except MemoryError:
        viewer.state.problem = f"{name} needs more memory than there is."
        viewer.say("")
    else:
        if found is not None:
            viewer.say("")
            take(found)
    if opener.busy:
        viewer.say(opener.note)
    return opener.busy


def opened_scene(found: OpenedFiles, x: str = "") -> tuple[Scene, Document]:
    """What is drawn of what was opened, and its file: each at its own x, or where the text x says.

    Raises BadFile for a scene file whose objects cannot be as it says, UsageError for x.
    """
    if found.file is None:
        scene = scene_of(found.sources)
        scene = Scene(placed(scene.objects, x)) if x else scene
        return scene, document_from(scene, found.sources)
    file, inside = found.file, len(found.file.all_items)
    document = document_of(found.path, file, found.sources[:inside])
    for source in found.sources[inside:]:
        file = edits.add(file, document.item(source))
        document.history = document.history.take(file, f"add {file.items[-1].name}")
    models = document.models_by_name()
    if x:
        file = file_at(file, models, x)
        document.history = edits.History.of(file)
    return scene_of_file(file, models), document


def told_of(found: OpenedFiles) -> str:
    """What was repaired in the files and assumed about the cameras, a line each; "" = nothing."""
    findings = [finding for source in found.sources for finding in source.model.findings]
    lines = [sentence(finding) for finding in findings if finding.repaired]
    more = [f"and {len(lines) - MOST_TOLD} more."] if len(lines) > MOST_TOLD else []
    return "\n".join([*lines[:MOST_TOLD], *more, *found.notes])


def first_look(found: OpenedFiles) -> FirstLook:
    """What lies beside the first scene and tells from where to look: a floor, cameras of a side."""
    if not found.sources:
        return FirstLook()
    model, home, front = found.sources[0].model, None, None
    if found.floor is not None:
        home = in_scene(found.floor, model).views[0]
    if found.cameras is not None:
        front = common_side(in_scene(found.cameras, model).views)
    return FirstLook(home, front)


def first_camera(viewer: "Viewer") -> Camera:
    """The camera of a new scene: on its floor where one is given, else the whole in view."""
    state = viewer.state
    camera = Camera(state.first_view(viewer.free_size()), state.first_target, state.radius)
    if state.first_look.home is not None:
        camera.toggle_flying()
        camera.stand(state.first_look.home.world_from_eye, state.first_look.fov_y)
    return camera


def named_cameras(options: "Options", found: OpenedFiles) -> OpenedFiles:
    """With the cameras of --camera instead of those beside the scene.  Raises BadFile."""
    if options.camera is None:
        return found
    cameras = read_camera_list(options.camera, camera_reading(options))
    return replace(found, cameras=cameras, notes=cameras.notes)
