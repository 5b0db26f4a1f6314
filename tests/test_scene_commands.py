"""Scene files in render and info: every object where and as the file says."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.errors import UsageError
from app.info import Options as Info
from app.info import run as info
from app.opening import ReadingOptions, open_model
from app.render import Options, run
from renderer.renderer import Renderer
from runtime_models.model import BadFile
from scene.read_scene_file import read_scene_file
from scene.scene_file import first_view, read_models, scene_of

SCENE = Path(__file__).resolve().parents[1] / "assets" / "touch.scene.json"
SIZE = (96, 54)


def rendered(scene: Path, out: Path, **changes) -> list[np.ndarray]:
    options = Options(scene, out, size="96x54", drawing="tiles", context="none")
    assert run(replace(options, **changes)) == 0
    return [np.asarray(Image.open(path)) for path in sorted(out.glob("*.png"))]


def test_render_draws_what_the_file_says(tmp_path):
    (picture,) = rendered(SCENE, tmp_path)
    file = read_scene_file(SCENE)
    scene = scene_of(file, read_models(file))
    with Renderer(None, "tiles") as renderer:
        renderer.update(scene)
        renderer.draw([first_view(file, scene, SIZE)])
        wanted = (np.clip(renderer.resolved(0), 0, 1) * 255 + 0.5).astype(np.uint8)
    np.testing.assert_array_equal(picture, wanted)
    assert (picture.max(axis=2) > 60).mean() > 0.2


def test_a_moved_object_and_another_x_are_seen(tmp_path):
    data = json.loads(SCENE.read_text())
    for item in (data["background"], *data["objects"]):
        item["model"] = str(SCENE.parent / item["model"])
    path = tmp_path / "a.scene.json"

    def picture(name: str) -> np.ndarray:
        path.write_text(json.dumps(data))
        return rendered(path, tmp_path / name)[0].astype(int)

    before = picture("before")
    data["objects"][0]["x"] = 0.25
    icy = picture("icy")
    data["objects"][0]["pose"]["position"][1] += 0.2
    moved = picture("moved")
    data["objects"][0]["visible"] = False
    gone = picture("gone")
    for first, second in ((before, icy), (icy, moved), (moved, gone)):
        assert 5 < (np.abs(first - second).max(axis=2) > 25).sum() < before.size / 3 / 10


def test_orbits_and_stereo(tmp_path):
    assert len(rendered(SCENE, tmp_path / "orbit", frames=3)) == 3
    assert rendered(SCENE, tmp_path / "stereo", stereo=0.06)[0].shape == (54, 192, 3)


@pytest.mark.parametrize(
    "changes,said",
    [({"x": ("1",)}, "--x is for one model"), ({"select": ("sphere:0,0,0:1:1",)}, "--select"),
     ({"target_ms": 5.0}, "--target-ms"), ({"mode": "exclusive"}, "--mode is for one model"),
     ({"flip": True}, "--flip"), ({"camera": "auto"}, "no cameras lie with")],
)  # fmt: skip
def test_what_a_scene_file_does_not_take_is_said(tmp_path, changes, said):
    with pytest.raises(UsageError, match=said):
        rendered(SCENE, tmp_path / "out", **changes)
    assert not (tmp_path / "out").exists()


def test_info_lists_the_objects(capsys):
    assert info(Info(SCENE, json=True)) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [item["name"] for item in facts["objects"]] == [
        "background", "cube", "ball", "ring", "plate"
    ]  # fmt: skip
    assert facts["splats"] == sum(item["splats"] for item in facts["objects"]) == 32_000
    assert info(Info(SCENE)) == 0
    assert "touch/ring" in capsys.readouterr().out


def test_other_commands_say_which_ones_open_it():
    with pytest.raises(BadFile, match="is a scene file of objects; render, info and simulate"):
        open_model(SCENE, ReadingOptions())
