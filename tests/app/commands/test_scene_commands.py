"""Scene files in render, info and lint: every object where and as the file says."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.charts import budget_chart
from shapeshift.app.charts.budget_chart import BudgetRow
from shapeshift.app.commands.info import Options as Info
from shapeshift.app.commands.info import run as info
from shapeshift.app.commands.lint import Options as Lint
from shapeshift.app.commands.lint import run as lint
from shapeshift.app.commands.render import Options, run
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import ReadingOptions, open_model
from shapeshift.app.training.evaluate import Options as Evaluate
from shapeshift.app.training.evaluate import run as evaluate
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import first_view, read_models, scene_of
from tests.support.splats.gltf_files import plain_splats

SCENE = Path(__file__).resolve().parents[3] / "examples" / "touch.scene.json"
SIZE = (96, 54)
ROWS = [BudgetRow("exact", RenderSettings(), 2.0, 200.0)]


def rendered(scene: Path, out: Path, **changes) -> list[np.ndarray]:
    options = Options(scene, out, size="96x54", drawing="tiles", context="none")
    assert run(replace(options, **changes)) == 0
    return [np.asarray(Image.open(path)) for path in sorted(out.glob("*.png"))]


def test_render_draws_what_the_file_says(tmp_path):
    (picture,) = rendered(SCENE, tmp_path)
    file = read_scene_file(SCENE)
    scene = scene_of(*read_models(file))
    with Renderer(None, "tiles") as renderer:
        renderer.update(scene)
        renderer.draw([first_view(file, scene, SIZE)])
        wanted = (np.clip(renderer.resolved(0), 0, 1) * 255 + 0.5).astype(np.uint8)
    np.testing.assert_array_equal(picture, wanted)
    assert (picture.max(axis=2) > 60).mean() > 0.2


def absolute() -> dict:
    """The example for another folder."""
    data = json.loads(SCENE.read_text())
    for item in (data["background"], *data["objects"]):
        for key in ("model", "collider"):
            if item[key] != "hulls":
                item[key] = str(SCENE.parent / item[key])
    return data


def test_a_moved_object_and_another_x_are_seen(tmp_path):
    data, path = absolute(), tmp_path / "a.scene.json"

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
    [({"select": ("sphere:0,0,0:1:1",)}, "--select is for one model"),
     ({"mode": "exclusive"}, "--mode is for one model"), ({"flip": True}, "--flip"),
     ({"camera": "auto"}, "no cameras lie with")],
)  # fmt: skip
def test_what_a_scene_file_does_not_take_is_said(tmp_path, changes, said):
    with pytest.raises(UsageError, match=said):
        rendered(SCENE, tmp_path / "out", **changes)
    assert not (tmp_path / "out").exists()


def test_x_is_of_all_objects(tmp_path):
    own, at_one, at_zero = (
        rendered(SCENE, tmp_path / name, x=x)[0].astype(int)
        for name, x in (("own", ()), ("one", ("1",)), ("zero", ("0",)))
    )
    assert np.abs(own - at_zero).max() > 25, "the ring begins in brass"
    assert np.abs(at_one - at_zero).max() > 25
    assert len(rendered(SCENE, tmp_path / "sweep", x=("sweep:3",))) == 3


def test_a_budget_is_measured_with_all_objects(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    asked = []
    monkeypatch.setattr(budget_chart, "measure", lambda *what: asked.append(what[2]) or ROWS)
    rendered(SCENE, tmp_path / "out", target_ms=5.0)
    assert asked[0].subject.scene.splat_count == 32_000 and asked[0].x is None
    assert "exact" in capsys.readouterr().err


def test_lint_tells_of_every_model_and_mesh(tmp_path, capsys):
    assert lint(Lint(SCENE, json=True)) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["objects"], facts["splats"], facts["findings"]) == (5, 32_000, [])
    assert facts["bytes"] > SCENE.stat().st_size + 200_000
    data = absolute()
    broken = tmp_path / "plain.ply"
    splats = plain_splats(40)
    splats.opacity[3] = np.nan
    write_ply(splats, broken)
    data["objects"][0] = {"name": "broken", "model": "plain.ply"}
    data["objects"][1] |= {"name": "the same", "model": "plain.ply", "reactions": []}
    for key in ("states", "two_axes", "mode", "up"):
        data["objects"][1].pop(key, None)
    path = tmp_path / "a.scene.json"
    path.write_text(json.dumps(data))
    assert lint(Lint(path, json=True)) == 0
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert [found["rows"] for found in findings if found["repaired"]] == [[3]]
    assert lint(Lint(path)) == 0
    assert "5 objects" in capsys.readouterr().out
    (tmp_path / "mesh.obj").write_text("nothing")
    data["objects"][3]["collider"] = str(tmp_path / "mesh.obj")
    path.write_text(json.dumps(data))
    with pytest.raises(BadFile, match="object 'plate': 'collider': mesh"):
        lint(Lint(path, json=True))
    assert json.loads(capsys.readouterr().out)["refused"] is True


def test_info_lists_the_objects(capsys):
    assert info(Info(SCENE, json=True)) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [item["name"] for item in facts["objects"]] == [
        "background", "cube", "ball", "ring", "plate"
    ]  # fmt: skip
    assert facts["splats"] == sum(item["splats"] for item in facts["objects"]) == 32_000
    assert info(Info(SCENE)) == 0
    assert "touch/ring" in capsys.readouterr().out


def test_what_wants_one_model_says_so(tmp_path):
    with pytest.raises(BadFile, match="is a scene file of objects; one model is wanted here"):
        open_model(SCENE, ReadingOptions())
    with pytest.raises(UsageError, match="photos are of one scene as it was trained"):
        evaluate(Evaluate(SCENE, tmp_path))
