"""Kills the editor in the midst of scripted work, and looks at what the next start has of it.

    python3 tools/app/journal.py --kills 500 --out docs/bench/journal.csv

A child opens a small scene, takes back what the one before has left, and works: objects moved,
copied, cut out, regions, paint, marks, lengths, keys of a film, drags, undo, redo, Ctrl+S.  It is
killed (SIGKILL) at a random instant; what the next start offers is compared with what the child had
noted of itself after every edit.  late: seconds before the kill at which the oldest edit was made
that is missing; the limit is one second.  The child is a fork: no window, the editor's own state.
"""

import argparse
import hashlib
import io
import os
import platform
import shutil
import signal
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.editor.state import arrange  # noqa: E402
from shapeshift.app.editor.state.editor_state import EditorState  # noqa: E402
from shapeshift.app.editor.state.files.beside import open_beside  # noqa: E402
from shapeshift.app.editor.state.files.journal import Journal  # noqa: E402
from shapeshift.app.editor.state.files.left_work import Restoring, left_work  # noqa: E402
from shapeshift.app.editor.state.files.open_scene import opened_scene  # noqa: E402
from shapeshift.app.editor.state.files.opened import read_files  # noqa: E402
from shapeshift.app.editor.state.files.saving import Saving  # noqa: E402
from shapeshift.app.editor.state.parts.cutting import make_object  # noqa: E402
from shapeshift.app.editor.state.user.own_files import OwnFiles  # noqa: E402
from shapeshift.app.inspection.window.inspecting import Inspecting  # noqa: E402
from shapeshift.runtime_models.files.whole_file import write_whole  # noqa: E402
from shapeshift.runtime_models.model import BadFile  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.splats.plain_splats import PlainSplats  # noqa: E402
from shapeshift.runtime_models.splats.ply.write_ply import write_ply  # noqa: E402
from shapeshift.scene.cameras.camera_list import CameraReading  # noqa: E402
from shapeshift.scene.document import edits  # noqa: E402
from shapeshift.scene.inspection.length_marks import LengthMark  # noqa: E402
from shapeshift.scene.inspection.marks import Mark  # noqa: E402
from shapeshift.scene.pose import Pose  # noqa: E402
from shapeshift.scene.selectors.selector import Painted  # noqa: E402

SPLATS = 240
LIMIT_S = 1.0
EACH_FOLDER = 12  # kills; then a scene is begun anew
MOST_OBJECTS = 12
UPRIGHT = np.array([1.0, 0, 0, 0])


def write_scene(folder: Path) -> Path:
    """A scene file of this person's own, of one cloud."""
    rng = np.random.default_rng(0)
    means = rng.normal(size=(SPLATS, 3)).astype(np.float32)
    wxyz = np.tile(UPRIGHT.astype(np.float32), (SPLATS, 1))
    scales, opacity = np.full((SPLATS, 3), 0.05, np.float32), np.full(SPLATS, 0.9, np.float32)
    sh = np.zeros((SPLATS, 1, 3), np.float32)
    folder.mkdir(parents=True, exist_ok=True)
    write_ply(PlainSplats(means, scales, wxyz, opacity, sh), folder / "cloud.ply")
    state = open_state(folder / "cloud.ply")
    path = folder / "work.scene.json"
    assert saving_of(state, folder).named(str(path)), state.problem
    return path


def open_state(path: Path) -> EditorState:
    found = read_files([path], lambda path, told: read_model(path), CameraReading(), None)
    state = EditorState(read_model)
    scene, edited = opened_scene(found)
    state.open_sources(found.sources, scene, None, edited)
    state.bodies.follow = lambda edited: None  # colliders are another matter
    open_beside(state)
    return state


def saving_of(state: EditorState, folder: Path) -> Saving:
    return Saving(state, OwnFiles(folder / "own"), folder, lambda path: None)


def take_back(state: EditorState, journals: Path) -> bool:
    """What the child before has left; whether there was anything.  It stays where it is."""
    problems: list[str] = []
    work = left_work(state, journals, problems)
    assert not problems, problems
    if work is None:
        return False
    restoring = Restoring(state, work)
    restoring.take_back(restoring.read(restoring.wanted(), lambda *_: None))
    work.file.close()
    return True


def described(state: EditorState) -> str:
    """All that was edited, in a short text; told apart from the journal's own rows on purpose."""
    selectors = []
    rows = [f"{state.edited.file.floor_y} {[view.name for view in state.edited.file.views]}"]
    for obj, item in zip(state.scene.objects, state.edited.file.all_items, strict=True):
        count = obj.model.splat_count
        rows.append(f"{item.name} {count} {np.round(item.position, 5)} {item.visible}")
        selectors += [*item.selectors]
    selectors += [s for i in range(len(state.scene.objects)) for s in selectors_of(state, i)]
    texts = []
    for one in selectors:
        where = one.weight.sum() if isinstance(one, Painted) else np.round(one.centre, 4)
        texts.append(f"{type(one).__name__} {one.x:.4f} {where}")
    rows += sorted(texts)
    marks, keys = state.edited.marks, state.timeline.keys
    rows += [f"{m.name} {m.note} {np.round(m.points, 4)}" for m in (*marks.marks, *marks.lengths)]
    rows += [f"{k.at_s:.3f} {np.round(k.view.world_from_eye.position, 4)}" for k in keys.cameras]
    rows += [f"{key.word} {key.at:.3f}" for key in keys.stops]
    return hashlib.sha256("\n".join(rows).encode()).hexdigest()[:16]


def selectors_of(state: EditorState, index: int) -> tuple:
    return state.regions.selectors(index, state.first_view((64, 36)))


class Work:
    """Random edits of every kind, one a call."""

    def __init__(self, state: EditorState, folder: Path, rng: np.random.Generator) -> None:
        self.state, self.rng, self.tool = state, rng, Inspecting(state)
        self.saving = saving_of(state, folder)
        self.dragged = 0  # frames that a drag goes on

    def step(self) -> None:
        if self.dragged:
            self.dragged -= 1
            self.place()
            if not self.dragged:
                self.state.rest()
            return
        kinds = (
            self.place, self._drag, self._copy, self._delete, self.cut, self._region, self._paint,
            self._mark, self._length, self._note, self._film, self._stop, self._view, self._undo,
            self._redo, self.save, self._floor,
        )  # fmt: skip
        weights = np.array([3, 1, 1, 1, 0.5, 1, 2, 3, 2, 1, 0.5, 1, 1, 3, 1, 0.3, 1])
        kinds[self.rng.choice(len(kinds), p=weights / weights.sum())]()
        if not self.dragged:
            self.state.rest()

    def _any(self) -> int:
        return int(self.rng.integers(len(self.state.scene.objects)))

    def _number(self) -> float:
        return round(float(self.rng.uniform(-1, 1)), 3)

    def _name(self, prefix: str, taken: set[str]) -> str:
        return next(f"{prefix}{n}" for n in range(1, 1000) if f"{prefix}{n}" not in taken)

    def place(self) -> None:
        where = np.array([self._number() for _ in range(3)])
        arrange.place(self.state, 0, Pose(where, UPRIGHT))

    def _drag(self) -> None:
        self.dragged = int(self.rng.integers(3, 400))

    def _edit(self, change, what: str) -> None:
        try:
            arrange.edit(self.state, change(self.state.edited.file), what)
        except (BadFile, ValueError):
            pass

    def _copy(self) -> None:
        if len(self.state.scene.objects) < MOST_OBJECTS:
            name = self.state.scene.objects[self._any()].name
            self._edit(lambda file: edits.duplicate(file, name, (0.5, 0, 0)), f"copy {name}")

    def _delete(self) -> None:
        if len(self.state.scene.objects) > 2:
            name = self.state.scene.objects[self._any()].name
            self._edit(lambda file: edits.remove(file, name), f"delete {name}")

    def cut(self) -> None:
        index = self._any()
        rows = np.zeros(self.state.scene.objects[index].model.splat_count, bool)
        rows[: len(rows) // 4] = True
        if len(rows) > 20 and len(self.state.scene.objects) < MOST_OBJECTS:
            make_object(self.state, index, rows)

    def _region(self) -> None:
        if len(self.state.regions.items) < 6:
            self.state.add_region("sphere" if self.rng.random() < 0.5 else "box")

    def _paint(self) -> None:
        regions = self.state.regions
        if regions.current is None or regions.current.kind != "painted":
            self._region_painted()
        region = regions.current
        if region is not None and region.painted is not None:
            rows = self.rng.random(len(region.painted)) < 0.5
            regions.edit(regions.chosen, painted=rows)

    def _region_painted(self) -> None:
        regions = self.state.regions
        found = [n for n, region in enumerate(regions.items) if region.kind == "painted"]
        if found:
            regions.choose(found[0])
        else:
            regions.add("painted", 0, self.state.scene.objects[0], np.zeros(3))

    def _mark(self) -> None:
        file = self.tool.file
        name = self._name("Sp", {mark.name for mark in file.marks})
        mark = Mark(name, "spot", np.array([[self._number() for _ in range(3)]]))
        self.tool.edit(replace(file, marks=(*file.marks, mark)[-20:]), what=f"add {name}")

    def _length(self) -> None:
        file = self.tool.file
        name = self._name("L", {each.name for each in file.lengths})
        points = np.array([[self._number() for _ in range(3)] for _ in range(2)])
        made = LengthMark(name, "distance", points)
        self.tool.edit(replace(file, lengths=(*file.lengths, made)[-20:]), what=f"add {name}")

    def _note(self) -> None:
        if self.tool.file.marks:
            self.tool.write_note(self.tool.file.marks[-1].name, f"note {self._number()}")

    def _film(self) -> None:
        self.state.timeline.fill(self.state.document, None)

    def _stop(self) -> None:
        self.state.timeline.at_s = round(float(self.rng.uniform(0, 9)), 2)
        self.state.timeline.add_stop("0.5")

    def _view(self) -> None:
        view = edits.FirstView((self._number(), 1.0, 3.0), (0.0, 0.0, 0.0))
        if len(self.state.edited.file.views) < 20:
            self._edit(lambda file: edits.keep_view(file, view), "add a view")

    def _floor(self) -> None:
        self._edit(lambda file: edits.ground(file, self._number()), "floor")

    def _undo(self) -> None:
        arrange.undo(self.state)

    def _redo(self) -> None:
        arrange.redo(self.state)

    def save(self) -> None:
        if not self.saving.save():
            self.saving.named(self.saving.name, replace=True)
        assert not self.saving.asking, self.state.problem


def child(path: Path, journals: Path, notes: int, seed: int) -> None:
    """Works until it is killed.  Notes: a line of what is there, and when, before it is kept."""
    rng = np.random.default_rng(seed)
    state = open_state(path)
    journal = Journal(state, journals)
    journal.opened()
    left = left_work(state, journals, [])
    if left is not None:
        restoring = Restoring(state, left)
        restoring.take_back(restoring.read(restoring.wanted(), lambda *_: None))
        journal.follow(time.perf_counter())
        left.file.remove()
    work = Work(state, path.parent, rng)
    os.write(notes, f"{time.monotonic()} {described(state)}\n".encode())
    while True:
        work.step()
        state.record_regions()
        os.write(notes, f"{time.monotonic()} {described(state)}\n".encode())
        journal.follow(time.perf_counter())
        assert not journal.words, journal.words
        time.sleep(float(rng.uniform(0, 0.006)))


def one_kill(path: Path, journals: Path, rng: np.random.Generator) -> tuple[float, int]:
    """Seconds that are missing, and edits that were done."""
    noted = path.parent / "noted"
    notes = os.open(noted, os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    process = os.fork()
    if process == 0:
        try:
            child(path, journals, notes, int(rng.integers(1 << 31)))
        except BaseException:
            import traceback

            traceback.print_exc()
        finally:
            os._exit(3)
    while not os.fstat(notes).st_size and os.waitpid(process, os.WNOHANG) == (0, 0):
        time.sleep(0.001)
    longest = 2.5 if rng.random() < 0.2 else 0.4
    time.sleep(float(rng.uniform(0, longest)))
    killed = time.monotonic()
    os.kill(process, signal.SIGKILL)
    _, status = os.waitpid(process, 0)
    os.close(notes)
    if not os.WIFSIGNALED(status):
        raise SystemExit("the work ended by itself")
    lines = [line.split() for line in noted.read_text().splitlines() if len(line.split()) == 2]
    state = open_state(path)
    take_back(state, journals)
    found = described(state)
    same = [number for number, (_, text) in enumerate(lines) if text == found]
    if not same:
        raise SystemExit(f"what came back was never there: {found}, {len(lines)} states")
    last = same[-1]
    late = killed - float(lines[last + 1][0]) if last + 1 < len(lines) else 0.0
    return max(late, 0.0), len(lines) - 1


def kills(count: int, seed: int, folder: Path) -> list[tuple[float, int]]:
    """So many, each with what is missing after it."""
    rng, found = np.random.default_rng(seed), []
    path = journals = folder
    for number in range(count):
        if number % EACH_FOLDER == 0:
            shutil.rmtree(folder / str(number - EACH_FOLDER), ignore_errors=True)
            journals = folder / str(number) / "data" / "journals"
            path = write_scene(folder / str(number) / "scene")
        found.append(one_kill(path, journals, rng))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = kills(options.kills, options.seed, Path(folder))
    late, done = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    out = io.StringIO()
    print(f"# python3 tools/app/journal.py --kills {options.kills} --seed {options.seed}", file=out)
    print(f"# Python {platform.python_version()}, {platform.machine()}", file=out)
    print("figure,value,unit,limit", file=out)
    for figure, value, unit, limit in (
        ("kills", len(found), "", ""), ("edits done", done.sum(), "", ""),
        ("most missing", f"{late.max():.3f}", "s", LIMIT_S),
        ("kills after which something is missing", int((late > 0).sum()), "", ""),
        ("kills after which more than a second is missing", int((late > LIMIT_S).sum()), "", 0),
    ):  # fmt: skip
        print(f"{figure},{value},{unit},{limit}", file=out)
    sys.stdout.write(out.getvalue())
    if options.out:
        write_whole(options.out, out.getvalue().encode())


if __name__ == "__main__":
    main()
