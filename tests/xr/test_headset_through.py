"""The room itself behind the scene: on a runtime that shows it, and on one that does not."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.support.xr.validation import complaints, switched_on

PROGRAM = Path(__file__).resolve().parents[1] / "support" / "xr" / "see_room.py"
OPAQUE, ALPHA_BLEND = 1, 3  # XrEnvironmentBlendMode


@pytest.mark.slow
@pytest.mark.parametrize("offered", [True, False])
def test_the_room_is_behind_the_scene_where_the_runtime_shows_it(stand, start, offered):
    pictures, blends = stand.folder / "pictures", stand.folder / "blends.json"
    asked = ("--passthrough", "--quality", "best", "--no-hints", "--frames", "8")
    settings = {**switched_on(stand.folder), "SHAPESHIFT_TEST_BLENDS": str(blends)}
    more = {"program": PROGRAM} if offered else {}
    program = start(stand, *asked, "--pictures", str(pictures), **more, **settings)
    report = program.end()
    lines = [line for line in program.read() or program.lines if line["drawn"]]
    assert report["code"] == 0 and report["passthrough"] == offered
    last = np.asarray(Image.open(sorted(pictures.glob("left-*.png"))[-1]))[..., :3]
    sky = last[: len(last) // 4].reshape(-1, 3)  # where the scene has nothing
    if offered:
        assert {tuple(line["layers"]) for line in lines} == {("room", "depth", "eyes")}
        modes = json.loads(blends.read_text())
        assert modes.count(ALPHA_BLEND) >= len(lines) > 0
        assert set(modes) <= {ALPHA_BLEND, OPAQUE}, "frames without a picture blend nothing"
        assert not sky.any() and last.max() > 150, "black, with alpha 0, and the table"
    else:
        assert {tuple(line["layers"]) for line in lines} == {("depth", "eyes")}
        assert sky.min() > 10 and "shows no room behind pictures" in program.told()
    assert not complaints(stand.folder)
    assert "Traceback" not in program.told()
