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
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

SIZE = (1280, 720)
PANEL, MOST_TURNS = (150.0, 400.0), 12  # where the wheel is turned; so often for one item
SECOND = 1.0
PATIENCE_S = 60.0  # for a window on a busy machine to draw what it has to
KINDS = ("button", "checkbox", "selectable", "combo", "invisible_button", "tree_node_ex",
         "arrow_button", "input_text", "slider_float", "slider_int")  # fmt: skip


@contextmanager
def screen() -> Iterator[str]:
    """The name of an X display in memory."""
    read_end, write_end = os.pipe()
    words = ["Xvfb", "-displayfd", str(write_end), "-screen", "0", "{}x{}x24".format(*SIZE)]
    server = subprocess.Popen(words, pass_fds=[write_end], stderr=subprocess.DEVNULL)
    os.close(write_end)
    with os.fdopen(read_end) as pipe:
        number = pipe.readline().strip()
    try:
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


class Items:
    """Where what can be pressed was drawn last, by its words in English."""

    def __init__(self) -> None:
        from imgui_bundle import imgui

        self.places: dict[str, tuple[float, float, int]] = {}  # x, y, number of the frame
        self.newest = 0
        for kind in KINDS:
            setattr(imgui, kind, self._watched(getattr(imgui, kind)))

    def _watched(self, function: Callable) -> Callable:
        from imgui_bundle import imgui

        def call(label: str, *values, **named):
            done = function(label, *values, **named)
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            if imgui.is_rect_visible(low, high):
                word = label.rpartition("###")[2] if "###" in label else label
                middle = (low.x + high.x) / 2, (low.y + high.y) / 2
                self.newest = imgui.get_frame_count()
                self.places[word] = (*middle, self.newest)
            return done

        return call


@dataclass
class Job:
    """What was counted of one."""

    name: str
    actions: int = 0
    silent: list[str] = field(default_factory=list)
    done: bool = False
    cpu_s: float = 0.0  # of the program, from the first press to the result


class Person:
    """Hands and eyes, in a thread beside the program's own."""

    def __init__(self, viewer, display: str, items: Items) -> None:
        from Xlib.display import Display

        self.viewer, self.items = viewer, items
        self._x = Display(display)
        self.job = Job("")
        import glfw

        self.rounds, self._scrolled = 0, False
        viewer.window.wait = self._count_rounds(viewer.window.wait)
        self._corner = glfw.get_window_pos(viewer.window.handle)  # of the window on the screen

    def begin(self, job: Job) -> None:
        """What is pressed from now on is of that."""
        self.job, self._scrolled = job, False

    # ---- eyes

    def look(self) -> bytes:
        """All pixels of the screen, which the window fills."""
        from Xlib import X

        image = self._x.screen().root.get_image(0, 0, *SIZE, X.ZPixmap, 0xFFFFFFFF)
        return image.data

    def rest(self, least_s: float = 0.5) -> None:
        """Until the window has drawn all that it has been asked for, and explanations are up."""
        began, rounds = time.monotonic(), self.rounds
        while time.monotonic() - began < PATIENCE_S:
            time.sleep(0.03)
            if self.rounds >= rounds + 3 and time.monotonic() - began >= least_s:
                return

    def _count_rounds(self, wait: Callable[[float], bool]) -> Callable[[float], bool]:
        """The window's wait: each time that it has nothing more to draw is a round."""

        def counted(seconds: float) -> bool:
            redraw = wait(seconds)
            self.rounds += not redraw
            return redraw

        return counted

    def until(self, holds: Callable[[], bool], what: str, seconds: float = 300.0) -> bool:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if holds():
                return True
            time.sleep(0.05)
        sys.stderr.write(f"{self.job.name}: {what} did not come\n")
        return False

    # ---- hands

    def move(self, x: float, y: float) -> None:
        from Xlib import X
        from Xlib.ext import xtest

        left, top = self._corner
        xtest.fake_input(self._x, X.MotionNotify, x=left + round(x), y=top + round(y))
        self._x.sync()
        self.rest()

    def _watched(self, what: str, act: Callable[[], None]) -> None:
        """A press, and whether anything differs after it."""
        self.job.actions += 1
        before = self.look()
        act()
        pressed = time.monotonic()
        while time.monotonic() - pressed < SECOND:
            time.sleep(0.05)
            if self.look() != before and time.monotonic() - pressed > 0.3:
                return
        self.rest()
        if self.look() == before:
            self.job.silent.append(what)
            sys.stderr.write(f"{self.job.name}: silent: {what}\n")

    def _button(self, down: bool) -> None:
        from Xlib import X
        from Xlib.ext import xtest

        xtest.fake_input(self._x, X.ButtonPress if down else X.ButtonRelease, 1)
        self._x.sync()

    def click(self, x: float, y: float, what: str) -> None:
        self.move(x, y)

        def act() -> None:
            self._button(True)
            time.sleep(0.08)
            self._button(False)

        self._watched(what, act)
        self.rest()

    def press(self, word: str) -> None:
        """An item by its words."""
        for _ in range(MOST_TURNS):
            found = self.items.places.get(word)
            if found is not None and found[2] >= self.items.newest - 1:
                self.click(found[0], found[1], f"click {word}")
                return
            self._scroll()
        raise SystemExit(f"{self.job.name}: nothing is called '{word}' among what is drawn")

    def _scroll(self) -> None:
        """The wheel over the panel, down; all of it is one action."""
        from Xlib import X
        from Xlib.ext import xtest

        self.job.actions += not self._scrolled
        self._scrolled = True
        self.move(*PANEL)
        for _ in range(3):
            for kind in (X.ButtonPress, X.ButtonRelease):
                xtest.fake_input(self._x, kind, 5)
        self._x.sync()
        self.rest()

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.move(*start)

        def act() -> None:
            self._button(True)
            for step in range(1, 9):
                part = step / 8
                x, y = (a + (b - a) * part for a, b in zip(start, end, strict=True))
                self._move_at_once(x, y)
                time.sleep(0.06)
            self._button(False)

        self._watched("drag", act)
        self.rest()

    def _move_at_once(self, x: float, y: float) -> None:
        from Xlib import X
        from Xlib.ext import xtest

        left, top = self._corner
        xtest.fake_input(self._x, X.MotionNotify, x=left + round(x), y=top + round(y))
        self._x.sync()

    def _strike(self, name: str, *held: str) -> None:
        from Xlib import XK, X
        from Xlib.ext import xtest

        codes = [self._x.keysym_to_keycode(XK.string_to_keysym(each)) for each in (*held, name)]
        for code in codes:
            xtest.fake_input(self._x, X.KeyPress, code)
        self._x.sync()
        time.sleep(0.08)
        for code in reversed(codes):
            xtest.fake_input(self._x, X.KeyRelease, code)
        self._x.sync()

    def key(self, name: str, *held: str) -> None:
        self._watched("+".join((*held, name)), lambda: self._strike(name, *held))
        self.rest()

    def type(self, text: str) -> None:
        """A word: one action."""
        names = {"/": "slash", ".": "period", "-": "minus", "_": "underscore"}

        def act() -> None:
            for letter in text:
                shifted = letter.isupper() or letter == "_"
                self._strike(names.get(letter, letter), *["Shift_L"] * shifted)

        self._watched(f"type {text}", act)
        self.rest()


def place_of(viewer, point) -> tuple[float, float]:
    """Logical pixels of a point (3,) of the world."""
    import numpy as np

    from shapeshift.app.editor.panels.outlines import pixels

    view = viewer.viewpoint.view()
    in_eye = (view.eye_from_world() @ np.append(point, 1.0))[:3]
    x, y = pixels(view, in_eye, viewer.window.logical_size)
    return float(x), float(y)


class Jobs:
    """The twelve, one a method; each ends with whether what was wanted is there."""

    def __init__(self, person: Person, folder: Path) -> None:
        self.person, self.viewer, self.folder = person, person.viewer, folder

    def _section(self, name: str, item: str) -> None:
        """Where an item is not in sight its section, or tool, is opened: that is an action."""
        items = self.person.items
        found = items.places.get(item)
        if found is None or found[2] < items.newest - 1:
            self.person.press(name)

    def _mug(self) -> tuple[float, float]:
        import numpy as np

        from shapeshift.app.paths import DEMO
        from shapeshift.runtime_models.read_scene import read_model
        from tools.synthetic.labels import LABELS, labels_of_places

        anchors = read_model(DEMO).anchors.astype(np.float64)
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
            self.person._strike("c")
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
        self.person._strike("y", "Shift_L")
        self.person.key("o", "Shift_L")
        done = self.viewer.sections.on and bool(self.viewer.sections.sections)
        self.person._strike("z", "Control_L")
        self.person.rest()
        if self.viewer.sections.on:
            self.person._strike("Escape")
        return done

    def cut_out(self) -> bool:
        self.person.rest()
        place = self._mug()
        self.person.key("o")
        self.person.until(lambda: not self.viewer.parts.finder.busy, "what may be taken")
        self.person.click(*place, "click the mug")
        self.person.until(lambda: not self.viewer.parts.finder.busy, "what may be taken")
        self.person.key("Return")
        return len(self.viewer.state.scene.objects) == 2

    def throw(self) -> bool:
        state = self.viewer.state
        if self.viewer.parts.on:
            self.person._strike("o")
        self.person.key("t")
        self.person.until(lambda: state.running, "the bodies")
        self.person.rest()
        x, y = place_of(self.viewer, state.scene.objects[1].world_from_object.position)
        before = state.scene.objects[1].world_from_object.position.copy()
        self.person.drag((x, y), (x + 60, y - 120))
        moved = abs(state.scene.objects[1].world_from_object.position - before).max() > 0.01
        self.person._strike("t")
        return bool(moved)

    def style(self) -> bool:
        self._section("Gallery", "Add style")
        self.person.press("Add style")
        begun = self.viewer.films.styles.running
        if begun:
            self._cancel()
        return begun

    def film(self) -> bool:
        self._section("Film", "Around")
        self.person.press("Around")
        self.person.press("Render")
        begun = self.viewer.films.rendering.running
        if begun:
            self._cancel()
        return begun

    def _cancel(self) -> None:
        counted = self.person.job.actions
        self.person.press("Cancel")
        self.person.job.actions = counted

    def language(self) -> bool:
        from shapeshift.app.editor.texts.table import language_in_use

        self._section("Settings", "##language")
        self.person.press("##language")
        x, y, _ = self.person.items.places["##language"]
        self.person.click(x, y + 50, "click Deutsch")
        return language_in_use().code == "de"

    def save(self) -> bool:
        self.person.key("s", "Control_L")
        self.person.key("Return")
        return self.viewer.state.edited.path is not None and not self.viewer.objects.unsaved

    def open(self) -> bool:
        self.person.key("o", "Control_L")
        self.person.type(str(self.folder / "ball.ply"))
        self.person.key("Return")
        return self.person.until(lambda: self.viewer.state.title == "ball", "the file")


JOBS = ("heat", "split", "mark", "length", "section", "cut_out", "throw", "style", "film",
        "language", "save", "open")  # fmt: skip


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
    from shapeshift.app.editor import desktop

    found: list[Job] = []
    failed: list[BaseException] = []
    items, loop = Items(), desktop.Viewer.loop

    def looped(viewer) -> None:
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
    desktop.run(desktop.Options(size="{}x{}".format(*SIZE)))
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
        from shapeshift.runtime_models.files.whole_file import write_whole
        from shapeshift.runtime_models.splats.plain_splats import PlainSplats
        from shapeshift.runtime_models.splats.ply.write_ply import write_ply
        from tests.support.desktop.desktop_stand import ball

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
