"""The panel's section "Export": what is shown now, as a file for other programs, in a thread."""

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from shapeshift.app.commands.exported import Look, Part, export
from shapeshift.app.editor.panels.widgets.panel_rows import choice, number, tip
from shapeshift.app.editor.window.hooks import Section
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import file_name
from shapeshift.runtime_models.evaluate import follows_eye
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.write_plain import WRITERS, writer_of

if TYPE_CHECKING:
    from shapeshift.app.editor.window.viewer import Viewer

EVERYTHING, REGIONS = -1, -2  # what is exported, beside one object by its index
DEGREES = ("colours: one from all sides", *(f"colours: SH degree {n}" for n in (1, 2, 3)))
FORMAT_TIPS = {
    ".ply": "What 3DGS writes; every viewer opens it. The largest.",
    ".compressed.ply": "A quarter of the size or less; SuperSplat and PlayCanvas.",
    ".spz": "The smallest; Niantic's viewers, Spark, glTF tools.",
    ".glb": "glTF 2.0 with KHR_gaussian_splatting; not everywhere yet.",
    ".splat": "One colour from all sides; web viewers.",
    ".usdz": "USD with ParticleField3DGaussianSplat; Omniverse, Houdini. Needs usd-core.",
}


def attach_export(viewer: "Viewer") -> "ExportPanel":
    """Adds the section to a viewer's panel."""
    panel = ExportPanel(viewer)
    viewer.hooks.sections.append(Section("Export", panel.draw))
    viewer.hooks.each_frame.append(panel.poll)
    viewer.hooks.opened.append(panel.forget)
    viewer.hooks.status.append(panel.status)
    return panel


class ExportPanel:
    """The choices, and the one export that may be under way."""

    def __init__(self, viewer: "Viewer") -> None:
        self._viewer = viewer
        self.ending = ".ply"
        self.what = EVERYTHING
        self.sh_degree = 3
        self.palette = True
        self._thread = ThreadPoolExecutor(1, "export")
        self._work: Future[PlainSplats] | None = None
        self._path = Path()
        self._told = ("", 0.0)  # what is being done, part done

    @property
    def running(self) -> bool:
        return self._work is not None

    def forget(self) -> None:
        """Another scene: its objects are others."""
        self.what = EVERYTHING

    def status(self) -> str:
        """Words for the status line; "" when nothing is under way."""
        return f"exporting {self._path.name}" if self.running else ""

    def draw(self, ui_scale: float) -> None:
        """Format, what, SH degree, the button, or how far it is."""
        things = self._viewer.state.scene.objects
        if not things:
            imgui.text_disabled("There is nothing to export.")
            return
        imgui.push_item_width(-1)
        endings = [writer.ending for writer in WRITERS]
        names = [f"{w.ending}  {w.name if w.name not in w.ending else ''}" for w in WRITERS]
        self.ending = choice("format", self.ending, endings, names)
        tip(FORMAT_TIPS[self.ending], ui_scale)
        values, labels = self._choices()
        self.what = self.what if self.what in values else EVERYTHING
        self.what = choice("what", self.what, values, labels)
        tip("As it is shown now: at this x, with the regions.", ui_scale)
        most = writer_of(Path(self.ending)).sh_degree
        degree = min(self.sh_degree, most)
        chosen = choice("degree", degree, range(most + 1), DEGREES[: most + 1])
        self.sh_degree = chosen if chosen != degree else self.sh_degree
        tip("How colours may change with the direction; less is smaller.", ui_scale)
        imgui.pop_item_width()
        if self._viewer.state.has_palettes:
            _, self.palette = imgui.checkbox("with the palette", self.palette)
            tip("False colours of the thermal stop, as they are shown; else gray.", ui_scale)
        if self.running:
            imgui.progress_bar(self._told[1], imgui.ImVec2(-1, 0), self._told[0])
        elif imgui.button("Export", imgui.ImVec2(-1, 0)):
            self.start()

    def _choices(self) -> tuple[list[int], list[str]]:
        """What can be exported: values and what they are called."""
        state = self._viewer.state
        values, labels = [EVERYTHING], ["everything"]
        if len(state.scene.objects) > 1:
            values += range(len(state.scene.objects))
            labels += [f"{i + 1}  {thing.name}" for i, thing in enumerate(state.scene.objects)]
        if any(region.enabled for region in state.regions.items):
            values.append(REGIONS)
            labels.append("inside the regions")
        return values, labels

    def parts(self) -> list[Part]:
        """The objects as they are shown now, or what lies in their regions."""
        viewer = self._viewer
        view = viewer.view()
        things = viewer.state.shown(view).objects
        if self.what == EVERYTHING:
            return [Part(thing) for thing in things if thing.visible]
        if self.what == REGIONS:
            return [Part(thing, thing.selectors) for thing in things if thing.selectors]
        return [Part(things[self.what])]

    def start(self) -> None:
        """Begins to write; what is moved meanwhile does not show in the file."""
        parts, viewer = self.parts(), self._viewer
        seen = any(follows_eye(part.thing.model) for part in parts)
        eye = tuple(map(float, viewer.view().world_from_eye.position)) if seen else None
        look = Look(self.sh_degree, self.palette, eye, tuple(viewer.state.origin))
        try:
            self._path = claim_name(viewer.folders.exports, parts, self.ending)
        except (OSError, UsageError) as error:
            viewer.state.problem = str(error)
            return
        self._told = ("", 0.0)
        self._work = self._thread.submit(export, parts, look, self._path, self._tell)

    def _tell(self, what: str, part: float) -> None:
        self._told = (what, part)

    def poll(self) -> bool:
        """Once a frame: says how it ended; True while it is under way."""
        if self._work is None or not self._work.done():
            return self.running
        work, self._work = self._work, None
        try:
            splats = work.result()
        except (BadFile, UsageError, OSError, MemoryError) as error:
            self._path.unlink(missing_ok=True)  # the claim, which is empty
            self._viewer.state.problem = f"Nothing was exported: {error}"
        else:
            size = self._path.stat().st_size / 1e6
            self._viewer.say(f"{self._path}: {number(len(splats.means))} splats, {size:.1f} MB")
        return True  # one frame more, so that it is seen


def claim_name(folder: Path, parts: list[Part], ending: str) -> Path:
    """An empty file named after the scene and x; never one that is there."""
    from shapeshift.app.drawing import make_folder

    make_folder(folder)
    thing = parts[0].thing
    more = f" and {len(parts) - 1} more" * (len(parts) > 1)
    name = f"{file_name(thing.name)}{more}-x{thing.slider_x:.2f}"
    count = 1
    while True:
        path = folder / f"{name}{f'-{count}' * (count > 1)}{ending}"
        try:
            path.touch(exist_ok=False)
        except FileExistsError:
            count += 1
            continue
        return path
