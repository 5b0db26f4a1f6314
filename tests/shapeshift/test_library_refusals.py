"""Arguments of the library that cannot be: each is refused in one sentence, and nothing is made."""

import numpy as np
import pytest

import shapeshift as ss
from tests.support.touch_scene import TOUCH


@pytest.fixture(scope="module")
def demo():
    return ss.load(ss.DEMO)


@pytest.mark.parametrize(
    "call",
    [
        lambda demo, wrong: ss.load(wrong),
        lambda demo, wrong: demo.export(wrong),
        lambda demo, wrong: demo.save(wrong),
        lambda demo, wrong: demo.compare(wrong),
        lambda demo, wrong: demo.film(wrong),
        lambda demo, wrong: ss.train(wrong),
        lambda demo, wrong: ss.evaluate(demo, wrong),
        lambda demo, wrong: ss.cameras(wrong),
        lambda demo, wrong: ss.poses(wrong, "capture"),
        lambda demo, wrong: ss.lint(wrong),
        lambda demo, wrong: ss.lod(demo, wrong),
        lambda demo, wrong: ss.fit(wrong),
        lambda demo, wrong: ss.colliders(wrong, "a.scene.json"),
        lambda demo, wrong: ss.stability(demo, wrong),
        lambda demo, wrong: demo.thermal(report=[wrong]),
    ],
)
@pytest.mark.parametrize("wrong", [None, 3, b"scene.shift", ["a.ply", "b.ply"]])
def test_what_is_no_path_is_refused(demo, call, wrong, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ss.UsageError, match="is no path; a text or a pathlib"):
        call(demo, wrong)
    assert not list(tmp_path.iterdir())  # export(None) wrote a file "None"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda demo: ss.lint(TOUCH, up="+Z"), "up is for one model; in touch"),
        (lambda demo: ss.lint(ss.DEMO, memory_gb=-1), "memory is -1, expected GB"),
        (lambda demo: ss.lod(demo, "a", leaf=63), "leaf is 63, expected 64"),
        (lambda demo: ss.lod(demo, "a", sh_degree=4), "sh_degree is 4, expected 0"),
        (lambda demo: ss.lod(demo, "a.lod", x=0.5), "x is of streamed SOG"),
        (lambda demo: ss.lod(demo, "a.lod", distill=float("nan")), "distill is nan, expected"),
        (lambda demo: ss.lod(demo.with_model(demo.model), "a.lod"), "save the scene first"),
        (lambda demo: ss.fit("capture", seeds=0), "seeds is 0; it has to be"),
        (lambda demo: ss.fit("capture", tolerance_db=float("nan")), "tolerance_db is nan; it"),
        (lambda demo: ss.fit("capture", anchor=3), "did you mean"),
        (lambda demo: ss.colliders(TOUCH, "a.scene.json"), 'has "hulls" as its collider'),
        (lambda demo: ss.stability(demo, "a", cases=["no"]), "cases: there is no case 'no'"),
        (lambda demo: demo.thermal(out="a.jpg"), r"out is a\.jpg; a file \.png is wanted"),
        (lambda demo: demo.thermal(spott="a"), "there is no option 'spott'; there are above"),
        (lambda demo: demo.thermal(view=1), "view is 1; the file has cameras 0 to 0"),
        (lambda demo: demo.with_model(demo.model).thermal(save=True), "lies in no file"),
        (lambda demo: demo.measure("distance", report=["a.txt"]), r"report is a\.txt; a file"),
        (lambda demo: demo.export("a.html", object="cup"), "a page shows a scene whole"),
    ],
)
def test_a_refusal_of_a_commands_work_speaks_python(demo, call, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ss.UsageError, match=said) as refused:
        call(demo)
    assert "--" not in str(refused.value) and not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "size",
    [
        (0, 0),
        (0, 24),
        (-3, 4),
        (32.5, 24),
        (65537, 24),
        (32,),
        (32, 24, 3),
        64,
        "640x480",
        {32, 24},
    ],
)
def test_what_is_no_size_is_refused(demo, size):
    for draw in (demo.render, demo.views, lambda size: demo.frames(count=2, size=size)):
        with pytest.raises(ss.UsageError, match=r"^size is .*whole pixels, 1 to 65536, is wanted"):
            draw(size=size)


def test_ends_of_sizes_and_other_containers_are_taken(demo):
    assert demo.render(size=(1, 1)).shape == (1, 1, 3)
    assert demo.views(size=(65536, 1))[0].size == (65536, 1)
    assert demo.render(size=np.array([32, 24])).shape == demo.render(size=[32, 24]).shape


def test_a_camera_is_a_4x4_of_transforms_json(demo):
    orbit = demo.views("orbit", 5)
    poses = np.array([view.world_from_eye.matrix() for view in orbit])
    for given, views in ((poses, orbit), (poses.tolist(), orbit), (poses[2], orbit[2:3]),
                         (poses[2].astype(np.float32), orbit[2:3])):  # fmt: skip
        seen = demo.views(given)
        assert len(seen) == len(views) and seen[0].tangents == demo.views("front")[0].tangents
        for a, b in zip(seen, views, strict=True):
            np.testing.assert_allclose(
                a.world_from_eye.matrix(), b.world_from_eye.matrix(), atol=1e-6
            )
    assert demo.views(poses[0], size=(8, 8))[0].size == (8, 8)
    mirror, moved = np.diag([1.0, 1, -1, 1]), np.eye(4)
    moved[3, 0] = 1
    for wrong in (2 * np.eye(4), mirror, moved, np.full((4, 4), np.nan), np.zeros((4, 4))):
        with pytest.raises(ss.UsageError, match="a 4x4 of camera= is no rigid pose"):
            demo.views(wrong)
    for wrong in (np.eye(3), np.zeros((0, 4, 4)), [orbit[0], np.eye(4)], [[1, 2], [3]]):
        with pytest.raises(ss.UsageError, match="a camera is 'orbit'"):
            demo.views(wrong)


def test_a_camera_that_is_no_sequence_is_refused(demo):
    for wrong in (3, 1.5, None):
        with pytest.raises(ss.UsageError, match="a camera is 'orbit'"):
            demo.views(wrong)


@pytest.mark.parametrize(
    ("eye", "target", "up"),
    [
        ((0, 0, 0), (0, 0, 0), (0, 1, 0)),
        ((0, 2, 0), (0, 0, 0), (0, 1, 0)),  # straight down, up the way it looks
        ((0, 0, 1), (0, 0, 0), (0, 0, 0)),
        ((float("nan"), 0, 1), (0, 0, 0), (0, 1, 0)),
    ],
)
def test_an_eye_without_a_direction_is_refused(eye, target, up):
    with pytest.raises(ValueError, match="has no direction"):
        ss.look_at(eye, target, up)


def test_an_eye_beside_straight_down_looks_there():
    pose = ss.look_at((0, 2, 1e-6), (0, 0, 0))  # -Z of the eye, by its matrix
    np.testing.assert_allclose(-pose.matrix()[:3, 2], (0, -1, 0), atol=1e-6)
