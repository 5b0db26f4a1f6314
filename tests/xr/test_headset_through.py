"""The room itself behind the scene: on a runtime that shows it, and on one that does not."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.support.xr.person import Person
from tests.support.xr.validation import complaints, switched_on

SUPPORT = Path(__file__).resolve().parents[1] / "support" / "xr"
PROGRAM, VENDOR = SUPPORT / "see_room.py", SUPPORT / "vendor_room.py"
OPAQUE, ALPHA_BLEND = 1, 3  # XrEnvironmentBlendMode
PROJECTION, ROOM = 35, 1000118003  # XrStructureType of layers
OPENED = ["asked for XR_FB_passthrough", "xrCreatePassthroughFB", "xrCreatePassthroughLayerFB"]
SHOWN = ["xrPassthroughStartFB", "xrPassthroughLayerResumeFB"]
CLOSED = ["xrDestroyPassthroughLayerFB", "xrDestroyPassthroughFB"]
REINIT, FAILED = 1, 2  # of XrPassthroughStateChangedFlagsFB


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


@pytest.mark.slow
@pytest.mark.parametrize("case", ["shown", "refused", "not asked for", "made anew", "failed"])
def test_the_vendors_room_lies_below_the_pictures(stand, start, case):
    """By its own functions, as a runtime without a blend mode for it has them."""
    told = stand.folder / "room.json"
    settings = {**switched_on(stand.folder), "SHAPESHIFT_TEST_ROOM": str(told)}
    settings |= {"SHAPESHIFT_TEST_REFUSES": OPENED[2]} if case == "refused" else {}
    events = {"made anew": [REINIT], "failed": [FAILED]}.get(case, [])
    settings |= {"SHAPESHIFT_TEST_EVENTS": json.dumps(events)}
    words = [] if case == "not asked for" else ["--passthrough"]
    asked = ("--quality", "best", "--no-hints", "--no-depth", "--frames", "8")
    program = start(stand, *asked, *words, program=VENDOR, **settings)
    report = program.end()
    room = json.loads(told.read_text())
    drawn = [frame["kinds"] for frame in room["frames"] if frame["kinds"]]
    assert report["code"] == 0 and {frame["blend"] for frame in room["frames"]} == {OPAQUE}
    assert "Traceback" not in program.told() and not complaints(stand.folder)
    assert ("shows no room behind pictures" in program.told()) == (case == "refused")
    assert report["passthrough"] == (case not in ("refused", "failed"))
    if case == "shown":
        assert room["calls"] == [*OPENED, *SHOWN, *CLOSED]
        assert set(map(tuple, drawn)) == {(ROOM, PROJECTION)}
    elif case == "refused":
        assert room["calls"] == [*OPENED, CLOSED[1]], "what was made before is given back"
        assert set(map(tuple, drawn)) == {(PROJECTION,)}
    elif case == "not asked for":
        assert room["calls"] == [*OPENED, *CLOSED], "the cameras rest"
        assert set(map(tuple, drawn)) == {(PROJECTION,)}
    elif case == "made anew":
        assert room["calls"] == [*OPENED, *SHOWN, *CLOSED, *OPENED[1:], *SHOWN, *CLOSED]
        assert set(map(tuple, drawn)) == {(ROOM, PROJECTION)}
    else:
        assert room["calls"] == [*OPENED, *SHOWN, *CLOSED]
        assert drawn[0] == [ROOM, PROJECTION] and drawn[-1] == [PROJECTION]


@pytest.mark.slow
def test_objects_alone_have_shadows_on_ones_own_table(stand, start):
    """And none where the room is not seen."""
    settings = {"SHAPESHIFT_TEST_ROOM": str(stand.folder / "room.json")}
    words = ("--quality", "best", "--no-hints", "--no-depth")
    program = start(stand, *words, "--passthrough", program=VENDOR, **settings)
    with program.headset(stand.port) as remote:
        seen = Person(program, remote).until(lambda line: len(line["shadows"]) == 4, "shadows")
        program.interrupt()
    report = json.loads((stand.folder / "report.json").read_text())
    assert sorted(seen["shadows"]) == ["ball", "cube", "plate", "ring"]
    assert report["passthrough"] and "Traceback" not in program.told()
    (stand.folder / "lines.jsonl").unlink()
    program = start(stand, *words, "--frames", "12", program=VENDOR, **settings)
    program.end()
    assert not any(line["shadows"] for line in program.read() or program.lines)
