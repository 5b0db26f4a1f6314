"""The tutorials as a person follows them: each command, file and Python block, in their order."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.cli import COMMANDS, OPEN_ENDED, main

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs/tutorials"
ORDER = (
    "photos.md",
    "thermal.md",
    "objects.md",
    "touch.md",
    "python.md",
)  # a later one uses earlier results
BLOCK = re.compile(
    r"^(?:Save this text as `(\S+)`.*?)?\n*```(sh|json|python)\n(.*?)^```", re.M | re.S
)
LEAVES = {
    "photos.md": ["out/first.shift", "out/first/0002_x1.000.png", "out/first_rgb.spz"],
    "thermal.md": [
        "out/thermal/0001_x0.250.png",
        "out/lens/0000_x0.000.png",
        "out/heat.spz",
        "out/alarms.png",
    ],
    "objects.md": [
        "out/cut/tankard.scene.json",
        "out/cut/report/views.png",
        "out/cut/isolated/0000_x0.000.png",
        "out/cut/throw/00060.png",
    ],
    "touch.md": ["out/mug/thermal.ply", "out/room/00090.png", "out/ready/room.scene.json"],
    "python.md": ["out/python/faded.spz", "out/python/touch.png", "out/python/trained.shift"],
}
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where a person types: the folder of launch.py, as far as the tutorials look into it."""
    path = tmp_path_factory.mktemp("checkout")
    for folder in ("assets", "examples"):
        (path / folder).symlink_to(ROOT / folder, target_is_directory=True)
    (path / "out").mkdir()
    return path


def clone_tankard(folder: Path) -> None:
    """What `git clone` of the photos gives, out of a copy with smaller ones."""
    photos = ROOT.parent / "shared/data/maryrose_tankard"
    if not (photos / "cameras.json").is_file():
        pytest.skip("photos of the tankard (github.com/vork/maryRose) are not on this machine")
    table, rows = json.loads((photos / "cameras.json").read_text()), []
    (folder / "maryRose/images").mkdir(parents=True)
    for frame in table["frames"]:
        path = photos / frame["file"]
        (folder / "maryRose/images" / path.with_suffix(".JPG").name).symlink_to(path)
        right, down, forward, eye = np.array(frame["c2w"])[:3].T
        size = np.array([table["h"], table["w"], table["fl_x"]])
        pose = np.stack([down, right, -forward, eye, size], axis=1)  # LLFF's columns
        rows.append(np.append(pose.ravel(), frame["near_far"]))
    np.save(folder / "maryRose/poses_bounds.npy", np.array(rows))


def follow(page: Path, folder: Path) -> None:
    names: dict = {}
    for file, kind, text in BLOCK.findall(page.read_text()):
        if kind == "json" and file:
            (folder / file).write_text(text)
        elif kind == "python":
            exec(compile(text, page.name, "exec"), names)
        elif kind == "sh":
            for line in text.splitlines():
                words = shlex.split(line, comments=True)[2:]
                if words and words[0] in COMMANDS and words[0] not in OPEN_ENDED:  # no window
                    assert main(words) == 0, line


@pytest.mark.parametrize("name", ORDER)
def test_a_tutorial_runs_and_leaves_what_it_says(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    if name == "objects.md":
        clone_tankard(folder)
    follow(FOLDER / name, folder)
    for file in LEAVES[name]:
        assert (folder / file).stat().st_size > 0
        if file.endswith(".png"):  # something is in the picture
            assert np.asarray(Image.open(folder / file)).std() > 5
    if name == "touch.md":
        rows = [json.loads(line) for line in (folder / "out/room/run.jsonl").open()]
        events = [event for row in rows for event in row.get("events", ())]
        assert [(e["object"], e["on"], e["to"]) for e in events] == [
            ("mug", "grab", "Thermal"), ("mug", "collision", "RGB"),
        ]  # fmt: skip


def test_every_tutorial_is_followed():
    assert {path.name for path in FOLDER.glob("*.md")} - {"README.md"} == set(ORDER)
