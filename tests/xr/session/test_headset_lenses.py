"""Lenses that hide much of a picture, in a real session: it is left out, all else is the same."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.renderer.foveation import hidden_pixels
from shapeshift.scene.pose import HiddenMesh, View
from tests.support.xr.masked_eyes import PART, frame_mesh
from tests.support.xr.person import SIZE, Person, pose_of
from tests.support.xr.validation import complaints, switched_on

PROGRAM = Path(__file__).resolve().parents[2] / "support" / "xr" / "masked_eyes.py"
SCENE = Path(__file__).resolve().parents[3] / "assets" / "workshop.shift"
STILL = (
    "--quality", "best", "--no-hints", "--no-floor", "--drawing", "tiles",
    "--frames", "40", "--every", "40",
)  # fmt: skip


@pytest.mark.slow
def test_what_lenses_hide_is_not_drawn_and_the_rest_is_the_same(stand, start):
    """Of a scene in which nothing moves."""
    pictures, hidden = {}, None
    for name, words in (("masked", []), ("whole", ["--no-visibility"])):
        folder = stand.folder / name
        asked = (
            str(SCENE),
            *STILL,
            "--pictures",
            str(folder),
            "--frames",
            "40",
            "--every",
            "40",
            *words,
        )
        for file in ("lines.jsonl", "validation.txt"):
            (stand.folder / file).unlink(missing_ok=True)
        program = start(stand, *asked, program=PROGRAM, **switched_on(stand.folder))
        with program.headset(stand.port) as remote:
            remote.left.there = remote.right.there = False
            remote.send()
            line = Person(program, remote).until(lambda line: line["focused"], "focused")
            report = program.end()
        hidden = report["hidden"]
        pictures[name] = [
            np.asarray(Image.open(folder / f"{side}-00040.png")) for side in ("left", "right")
        ]
        assert "Traceback" not in program.told() and not complaints(stand.folder)
    assert all(abs(part - (1 - PART**2)) < 0.02 for part in hidden), hidden
    for row, masked, whole in zip(line["views"], *pictures.values(), strict=True):
        tangents = tuple(row["tangents"])
        corners, order = frame_mesh(tangents)
        mesh = HiddenMesh(np.array(corners)[order].reshape(-1, 3, 2))
        view = View(pose_of(row), tangents, 0.05, 1000.0, SIZE, hidden=mesh)
        seen = ~hidden_pixels(view)
        np.testing.assert_array_equal(masked[seen], whole[seen])
        assert np.ptp(whole[seen]) > 100
        assert (masked != whole).any(-1)[~seen].mean() > 0.02, "it reaches the edge"
