"""Four views a frame in a real session: what the runtime recommends is drawn, and handed over."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import View
from shapeshift.vr.frame import view_names
from shapeshift.vr.openxr.view_configuration import with_insets
from shapeshift.vr.play_space import PlaySpace
from tests.support.xr import four_views
from tests.support.xr.person import SIZE, Person, pose_of
from tests.support.xr.validation import complaints, switched_on

PROGRAM = Path(four_views.__file__)
SCENE = Path(__file__).resolve().parents[3] / "assets" / "workshop.shift"
STILL = (
    "--quality", "best", "--no-hints", "--no-floor", "--drawing", "tiles",
    "--foveation", "quad", "--frames", "30", "--every", "30",
)  # fmt: skip
SIZES = [tuple(round(four_views.PART * side) for side in SIZE)] * 2 + [four_views.INSET_PX] * 2


def seen(stand, start, how: str) -> tuple[dict, dict, dict, list[np.ndarray]]:
    """The report, what the runtime was told, the last line and the pictures of a still head."""
    folder, told = stand.folder / "pictures", stand.folder / "views.json"
    settings = {"SHAPESHIFT_TEST_VIEWS": how, "SHAPESHIFT_TEST_TOLD": str(told)}
    words = (str(SCENE), *STILL, "--pictures", str(folder))
    program = start(stand, *words, program=PROGRAM, **settings, **switched_on(stand.folder))
    with program.headset(stand.port) as remote:
        remote.left.there = remote.right.there = False
        remote.send()
        line = Person(program, remote).until(lambda line: line["focused"], "focused")
        report = program.end()
    assert "Traceback" not in program.told() and not complaints(stand.folder)
    assert ("offers no quad views" in program.told()) == (not report["insets"])
    names = view_names(len(report["eyes"]))
    pictures = [np.asarray(Image.open(folder / f"{name}-00030.png")) for name in names]
    assert len(list(folder.iterdir())) == len(names)
    return report, json.loads(told.read_text()), line, pictures


@pytest.mark.slow
@pytest.mark.parametrize("how", ["extension", "core"])
def test_four_views_are_begun_drawn_and_handed_over(stand, start, how):
    """Each picture is what one whole picture of that eye shows there.

    The insets' whole is drawn with their density by this test, from the poses that the lines tell,
    and cut; 45 dB: 8 bits cost 58.9, and poses have six decimals.
    """
    report, told, line, pictures = seen(stand, start, how)
    assert report["code"] == 0 and report["insets"]
    assert [tuple(size) for size in report["eyes"]] == SIZES
    assert told["begun"] == [four_views.FOUR]
    assert told["asked"] == (["1.1"] if how == "core" else ["1.0", four_views.NAME])
    for frame in told["frames"]:
        assert [tuple(view["size"]) for view in frame] == SIZES
        assert len({view["chain"] for view in frame}) == 4, "a swapchain a view"
        assert all(view["deep"] for view in frame), "with depth, each"
        for eye in (0, 1):
            wanted = four_views.inset_angles(tuple(frame[eye]["fov"]), eye)
            np.testing.assert_allclose(frame[2 + eye]["fov"], wanted, atol=1e-6)
    assert len(told["frames"]) >= 20
    play = PlaySpace(pose_of(line["standing"]), line["standing"]["scale"])
    rows = zip(line["views"], SIZES, strict=True)
    views = [View(pose_of(r), tuple(r["tangents"]), 0.05, 1000.0, size) for r, size in rows]
    document, _ = open_xr(SCENE, Options())
    with Renderer(None, "tiles") as renderer:
        renderer.settings = RenderSettings(background=document.background_or((0.08,) * 3))
        renderer.update(document.scene)
        for i, (view, picture) in enumerate(zip(with_insets(views), pictures, strict=True)):
            assert np.ptp(picture[..., :3]) > 100, "there is something to see"
            whole, box = whole_of(play.view(view))
            renderer.draw([whole])
            wanted = renderer.resolved(0)[box]
            assert psnr(picture[..., :3] / 255, wanted) > 45, view_names(4)[i]


def whole_of(view: View) -> tuple[View, tuple[slice, slice]]:
    """The smallest centred view in the same density that holds a view, and where that lies in it:
    begun on the pixels of the view, since a whole number of them need not fit.
    """
    left, right, down, up = view.tangents
    across, along = (right - left) / view.size[0], (up - down) / view.size[1]
    a, b, c, d = view.whole or view.tangents
    before = [math.ceil(max(left - a, 0) / across - 1e-9), math.ceil(max(d - up, 0) / along - 1e-9)]
    after = [
        math.ceil(max(b - right, 0) / across - 1e-9),
        math.ceil(max(down - c, 0) / along - 1e-9),
    ]
    size = tuple(n + x + y for n, x, y in zip(view.size, before, after, strict=True))
    tangents = (
        left - before[0] * across, right + after[0] * across,
        down - after[1] * along, up + before[1] * along,
    )  # fmt: skip
    whole = View(view.world_from_eye, tangents, view.near, view.far, size)
    rows = slice(before[1], before[1] + view.size[1])
    return whole, (rows, slice(before[0], before[0] + view.size[0]))


@pytest.mark.slow
def test_a_runtime_that_lists_them_and_has_none_shows_one_view_an_eye(stand, start):
    """And says what it does instead: the falling scale, which the picture shows."""
    report, told, _, pictures = seen(stand, start, "refused")
    assert report["code"] == 0 and not report["insets"] and told["begun"] == [2]
    assert [tuple(size) for size in report["eyes"]] == [SIZE] * 2 and len(pictures) == 2
    assert "--foveation medium is used instead." in (stand.folder / "told.txt").read_text()
