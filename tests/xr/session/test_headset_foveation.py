"""Sharp where the eyes look, in a real session: there it is the picture of all pixels."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.renderer.foveation import fovea_of
from shapeshift.scene.pose import View
from shapeshift.vr.openxr.tracked import tangents_along
from tests.support.xr import gazing_eyes
from tests.support.xr.person import SIZE, Person, pose_of
from tests.support.xr.validation import complaints, switched_on

PROGRAM = Path(gazing_eyes.__file__)
SCENE = Path(__file__).resolve().parents[3] / "assets" / "workshop.shift"
STILL = (
    "--quality", "best", "--no-hints", "--no-floor", "--drawing", "tiles", "--no-depth",
    "--frames", "40", "--every", "40",
)  # fmt: skip


@pytest.mark.slow
def test_around_the_gaze_nothing_differs_and_beyond_it_most_does(stand, start):
    pictures = {}
    for level in ("high", "off"):
        folder = stand.folder / level
        for file in ("lines.jsonl", "validation.txt"):
            (stand.folder / file).unlink(missing_ok=True)
        asked = (str(SCENE), *STILL, "--foveation", level, "--pictures", str(folder))
        program = start(stand, *asked, program=PROGRAM, **switched_on(stand.folder))
        with program.headset(stand.port) as remote:
            remote.left.there = remote.right.there = False
            remote.send()
            line = Person(program, remote).until(lambda line: line["focused"], "focused")
            program.end()
        pictures[level] = [
            np.asarray(Image.open(folder / f"{side}-00040.png")) for side in ("left", "right")
        ]
        assert "Traceback" not in program.told() and not complaints(stand.folder)
    way = np.array([
        np.sin(gazing_eyes.ASIDE), -np.tan(gazing_eyes.DOWN), -np.cos(gazing_eyes.ASIDE)
    ])  # fmt: skip
    for row, fovea, whole in zip(line["views"], *pictures.values(), strict=True):
        eye = pose_of(row)
        gaze = tangents_along(way, eye)
        assert gaze is not None and gaze[0] < -0.1 and gaze[1] < -0.05
        view = View(eye, tuple(row["tangents"]), 0.05, 1000.0, SIZE, gaze=gaze)
        place = fovea_of(view, "high")
        x, y = (np.arange(side) + 0.5 for side in SIZE)
        r = np.hypot(
            (x[None] - place.centre[0]) * place.unit[0],
            (y[:, None] - place.centre[1]) * place.unit[1],
        )
        sharp = r < place.inner - max(place.unit)
        np.testing.assert_array_equal(fovea[sharp], whole[sharp])
        assert np.ptp(whole[sharp]) > 100, "there is something to see"
        shown = (r > place.outer) & (np.abs(whole.astype(int) - whole[0, 0]).max(-1) > 8)
        assert (fovea != whole).any(-1)[shown].mean() > 0.2
