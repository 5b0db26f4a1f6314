"""What is shown now, as a file for other programs, written in a thread."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from shapeshift.app.commands.exported import ExportLook, Part, export
from shapeshift.app.drawing import make_folder
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.state.parts.write_pieces import write_labelled
from shapeshift.app.editor.texts.table import said
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import file_name
from shapeshift.runtime_models.evaluate import follows_eye
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.shapes import three

PACKAGE = ".shift"  # no splats of one x: the model itself, with its slider
EVERYTHING, REGIONS = -1, -2  # what is exported, other than one object by its index


class Exporting:
    """The choices, and the one export that may be under way."""

    def __init__(self, state: EditorState, viewpoint: Viewpoint, folder: Path) -> None:
        self._state, self._viewpoint, self._folder = state, viewpoint, folder
        self.ending = ".ply"
        self.what = EVERYTHING
        self.sh_degree = 3
        self.palette = True
        self._thread = ThreadPoolExecutor(1, "export")
        self._work: Future[int] | None = None  # how many splats were written
        self._path = Path()
        self.progress = ("", 0.0)  # what is being done, part done

    @property
    def running(self) -> bool:
        return self._work is not None

    def forget(self) -> None:
        """Another scene: its objects are others."""
        self.what = EVERYTHING

    def status(self) -> str:
        """Words for the status line; "" when nothing is under way."""
        return said("exporting {name}", name=self._path.name) if self.running else ""

    def choices(self) -> tuple[list[int], list[str]]:
        """What can be exported: values and what they are called."""
        state = self._state
        values, labels = [EVERYTHING], [said("everything")]
        if len(state.scene.objects) > 1:
            values += range(len(state.scene.objects))
            labels += [f"{i + 1}  {obj.name}" for i, obj in enumerate(state.scene.objects)]
        if any(region.enabled for region in state.regions.items):
            values.append(REGIONS)
            labels.append(said("inside the regions"))
        return values, labels

    @property
    def package(self) -> AnchorModel | None:
        """The one model that a package can be written of, as it is now; None: there is none."""
        seen = [i for i, obj in enumerate(self._state.scene.objects) if obj.visible]
        index = seen[0] if self.what == EVERYTHING and len(seen) == 1 else self.what
        model = self._state.filed[index] if 0 <= index < len(self._state.filed) else None
        return model if isinstance(model, AnchorModel) else None

    def parts(self) -> list[Part]:
        """The objects as they are shown now, or what lies in their regions."""
        objects = self._state.shown(self._viewpoint.view()).objects
        if self.what == EVERYTHING:
            return [Part(obj) for obj in objects if obj.visible]
        if self.what == REGIONS:
            return [Part(obj, obj.selectors) for obj in objects if obj.selectors]
        return [Part(objects[self.what])]

    def start(self) -> None:
        """Begins to write; what is moved meanwhile does not show in the file."""
        parts, state = self.parts(), self._state
        seen = any(follows_eye(part.obj.model) for part in parts)
        eye = three(self._viewpoint.view().world_from_eye.position) if seen else None
        look = ExportLook(self.sh_degree, self.palette, eye, three(state.origin))
        try:
            self._path = claim_name(self._folder, parts, self.ending)
        except (OSError, UsageError) as error:
            state.problem = str(error)
            return
        self.progress = ("", 0.0)
        if self.ending == PACKAGE:
            assert self.package is not None, "the panel offers it where there is one"
            self._work = self._thread.submit(write_whole_model, self.package, self._path)
            return
        self._work = self._thread.submit(write_splats, parts, look, self._path, self._show_progress)

    def _show_progress(self, what: str, part: float) -> None:
        self.progress = (what, part)

    def poll(self) -> bool:
        """Once a frame: says how it ended; True while it is under way."""
        if self._work is None or not self._work.done():
            return self.running
        work, self._work = self._work, None
        try:
            splats = work.result()
        except (BadFile, UsageError, OSError, MemoryError) as error:
            self._path.unlink(missing_ok=True)  # the claim, which is empty
            self._state.problem = said("Nothing was exported: {error}", error=error)
        else:
            size = self._path.stat().st_size / 1e6
            facts = {"path": self._path, "count": number(splats), "size": size}
            self._state.say(said("{path}: {count} splats, {size:.1f} MB", **facts))
        return True  # one frame more, so that it is seen


def write_splats(
    parts: list[Part], look: ExportLook, path: Path, progress: Callable[[str, float], None]
) -> int:
    """Plain splats at one x; how many."""
    return len(export(parts, look, path, progress).means)


def write_whole_model(model: AnchorModel, path: Path) -> int:
    """A package of what is left of a model, at every x; how many splats it draws."""
    path.unlink()  # the claim: no package, so nothing that one may be written over
    write_labelled(model, path)
    return model.splat_count


def claim_name(folder: Path, parts: list[Part], ending: str) -> Path:
    """An empty file named after the scene and x; never one that is there."""
    make_folder(folder)
    obj = parts[0].obj
    more = f" and {len(parts) - 1} more" * (len(parts) > 1)
    name = f"{file_name(obj.name)}{more}"
    name += f"-x{obj.slider_x:.2f}" * (ending != PACKAGE)
    count = 1
    while True:
        path = folder / f"{name}{f'-{count}' * (count > 1)}{ending}"
        try:
            path.touch(exist_ok=False)
        except FileExistsError:
            count += 1
            continue
        return path
