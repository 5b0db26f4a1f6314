"""A person at the window: twelve jobs with a real mouse and real keys, each press watched.

    python3 tools/app/person.py --out docs/bench/person.csv

Starts the program on the demo under Xvfb, in folders of its own, and presses by XTEST what a person
would: server, GLFW, our callbacks, ImGui.  Buttons are found by their words among what is drawn.
Actions are keys, clicks, drags and words that are typed.  A press is silent where not one pixel of
the window differs within a second after it, the mouse at rest (longer on a busy machine: until the
window has drawn what the press has asked for).  Style and film are begun and then cancelled.
All keys and all items over all states: tests/app/editor/window/look/test_desktop_answers.py.
"""

import argparse
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.editor import desktop  # noqa: E402
from shapeshift.app.editor.texts.table import language_in_use  # noqa: E402
from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.runtime_models.files.whole_file import write_whole  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.splats.plain_splats import PlainSplats  # noqa: E402
from shapeshift.runtime_models.splats.ply.write_ply import write_ply  # noqa: E402
from tests.support.desktop.desktop_stand import ball  # noqa: E402
from tests.support.desktop.objects_stand import place_of  # noqa: E402
from tests.support.desktop.sitting import PATIENCE_S, SIZE, Items, Job, Person, screen  # noqa: E402
from tools.synthetic.labels import LABELS, labels_of_places  # noqa: E402


class Jobs:
    """The twelve, one a method; each ends with whether what was wanted is there."""

    def __init__(self, person: Person, folder: Path) -> None:
        self.person, self.viewer, self.folder = person, person.viewer, folder

    def _section(self, name: str, item: str) -> None:
        """Where an item is not in sight its section, or tool, is opened: that is an action."""
        if not self._is_in_sight(item):
            self.person.press(name)

    def _is_in_sight(self, item: str) -> bool:
        items = self.person.items
        found = items.places.get(item)
        return found is not None and found[2] >= items.newest - 1

    def _mug(self) -> tuple[float, float]:
        model = read_model(DEMO)
        assert isinstance(model, AnchorModel)
        anchors = model.anchors.astype(np.float64)
        mine = labels_of_places(anchors)[0] == LABELS["mug"]
        return place_of(self.viewer, np.median(anchors[mine], axis=0))

    def heat(self) -> bool:
        self.person.key("2")
        return self.viewer.state.scene.objects[0].slider_x > 0.3

    def split(self) -> bool:
        self.person.key("c")
        return self.viewer.state.split.on

    def mark(self) -> bool:
        if self.viewer.state.split.on:
            self.person.strike("c")
        place = self._mug()
        self.person.key("y")
        self.person.click(*place, "click the mug")
        return len(self.viewer.inspecting.file.marks) == 1

    def length(self) -> bool:
        x, y = self._mug()
        self.person.key("y", "Shift_L")
        self.person.click(x, y, "click the mug")
        self.person.click(x + 90, y + 60, "click the bench")
        return len(self.viewer.inspecting.file.lengths) == 1

    def section(self) -> bool:
        self.person.strike("y", "Shift_L")
        self.person.key("o", "Shift_L")
        done = self.viewer.sections.on and bool(self.viewer.sections.sections)
        self.person.strike("z", "Control_L")
        self.person.rest()
        if self.viewer.sections.on:
            self.person.strike("Escape")
        return done

    def cut_out(self) -> bool:
        self.person.rest()
        place = self._mug()
        self.person.key("o")
        self.person.until(lambda: not self.viewer.parts.finder.busy)
        self.person.click(*place, "click the mug")
        self.person.until(lambda: not self.viewer.parts.finder.busy)
        self.person.key("Return")
        return len(self.viewer.state.scene.objects) == 2

    def throw(self) -> bool:
        state = self.viewer.state
        self.person.strike("Escape")  # what a job before has left in the hand
        if self.viewer.parts.on:
            self.person.strike("o")
        self.person.key("t")
        self.person.until(lambda: state.running)
        self.person.rest()
        x, y = place_of(self.viewer, state.scene.objects[1].world_from_object.position)
        before = state.scene.objects[1].world_from_object.position.copy()
        self.person.drag((x, y), (x + 60, y - 120))
        moved = abs(state.scene.objects[1].world_from_object.position - before).max() > 0.01
        self.person.strike("t")
        return bool(moved)

    def style(self) -> bool:
        self._section("Style", "Add style")
        self.person.press("Add style")
        begun = self.viewer.films.styles.running
        if begun:
            self._cancel()
        return begun

    def film(self) -> bool:
        self._section("Film", "Around")
        self.person.press("Around")
        self.person.press("Render")
        begun = self.person.until(lambda: self.viewer.films.rendering.running, 20)
        if begun:
            self._cancel()
        return begun

    def _cancel(self) -> None:
        counted = self.person.job.actions
        self.person.press("Cancel")
        self.person.job.actions = counted

    def language(self) -> bool:
        self.person.press("globe")
        self.person.press("de")
        return language_in_use().code == "de"

    def save(self) -> bool:
        self.person.key("s", "Control_L")
        self.person.key("Return")
        return self.viewer.state.edited.path is not None and not self.viewer.objects.unsaved

    def open(self) -> bool:
        self.person.key("o", "Control_L")
        self.person.type(str(self.folder / "ball.ply"))
        self.person.key("Return")
        self.person.rest()
        if self._is_in_sight("Do not save"):  # the film's keys
            self.person.press("Do not save")
        return self.person.until(lambda: self.viewer.state.title == "ball", 60)


# A film is of what lies in files: it comes after what was cut out is saved.
JOBS = ("heat", "split", "mark", "length", "section", "cut_out", "throw", "save", "style", "film",
        "language", "open")  # fmt: skip


def work(person: Person, folder: Path, names: list[str]) -> list[Job]:
    """All of them in one sitting, as a person does them."""
    jobs, found = Jobs(person, folder), []
    person.move(SIZE[0] / 2, SIZE[1] / 3)  # keys go to the window under the pointer
    person.rest(1.0)
    for name in names:
        person.begin(job := Job(name.replace("_", " ")))
        began = time.process_time()
        try:
            job.done = getattr(jobs, name)()
        except (SystemExit, AttributeError, IndexError) as error:
            sys.stderr.write(f"{name}: {error}\n")
        job.cpu_s = time.process_time() - began
        sys.stderr.write(f"{job}\n")
        found.append(job)
    return found


def start(display: str, act: Callable[[Person], list[Job]]) -> list[Job]:
    """The program as it is started, with a person at it; returns when it is closed."""
    found: list[Job] = []
    failed: list[BaseException] = []
    items, loop = Items(), desktop.Viewer.loop

    def looped(self: desktop.Viewer) -> None:
        viewer = self

        def sit() -> None:
            try:
                found.extend(act(person))
            except BaseException as error:
                failed.append(error)
            finally:
                viewer.hooks.closing.clear()
                viewer.window.close()

        person = Person(viewer, display, items)
        thread = threading.Thread(target=sit, daemon=True)
        thread.start()
        loop(viewer)
        thread.join(PATIENCE_S)

    desktop.Viewer.loop = looped
    desktop.run(desktop.Options(scenes=(Path(DEMO),), size="{}x{}".format(*SIZE)))
    if failed:
        raise failed[0]
    return found


def own_folders(folder: Path) -> None:
    """Nothing of the person whose computer it is: settings, documents, journals; caches stay."""
    os.environ.setdefault("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    for name in ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_DOCUMENTS_DIR"):
        os.environ[name] = str(folder)
    os.environ.pop("WAYLAND_DISPLAY", None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=list(JOBS), choices=JOBS)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, screen() as display:
        folder = Path(name)
        own_folders(folder)
        os.environ["DISPLAY"] = display
        b = ball(50)
        write_ply(PlainSplats(b.means, b.scales, b.wxyz, b.opacity, b.sh), folder / "ball.ply")
        found = start(display, lambda person: work(person, folder, options.only))
    rows = ["# python3 tools/app/person.py --out docs/bench/person.csv",
            "job,actions,silent_presses,done,cpu_s"]  # fmt: skip
    for job in found:
        rows.append(f"{job.name},{job.actions},{len(job.silent)},{job.done},{job.cpu_s:.1f}")
    text = "\n".join(rows) + "\n"
    sys.stdout.write(text)
    if options.out:
        write_whole(options.out, text.encode())


if __name__ == "__main__":
    main()
