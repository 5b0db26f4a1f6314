"""Scene files in bench, chart, stability, compare and export, as models in each of them."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.app.charts.chart_scene import side_by_side
from shapeshift.app.commands.compared import open_side
from shapeshift.app.document import Document, open_document
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import ReadingOptions
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene
from tests.support.scene.object_scenes import ODD, turned_view
from tests.support.splats.gltf_files import plain_splats

SIZE = (120, 90)
WORLD_PART = {"kind": "sphere", "centre": [0.4, 0, 0], "radius": 0.6, "x": 1, "space": "world"}
OWN_PART = {"kind": "half", "point": [0, 0, 0], "normal": [1, 1, 0], "x": 0.5, "border": 0.2}


@pytest.fixture
def scene(tmp_path) -> Path:
    """A cloud of degree 3 twice, turned and moved into itself; two layers; one that is hidden."""
    folder = tmp_path / "files"
    (folder / "layers").mkdir(parents=True)
    write_ply(plain_splats(300, 3), folder / "cloud.ply")
    for i, name in enumerate(("cold", "hot")):
        write_ply(plain_splats(200, 1, seed=5 + i), folder / "layers" / f"{name}.ply")
    turned = {"position": [0.3, 0.1, -0.2], "wxyz": ODD.tolist()}
    layered = {"model": "layers", "mode": "exclusive"}
    objects = [
        {"name": "turned", "model": "cloud.ply", "pose": turned},
        {"name": "still", "model": "cloud.ply"},
        layered | {"name": "2", "x": 1, "pose": {"position": [0.5, 0, 0]}},
        layered | {"name": "parts", "pose": turned, "selectors": [WORLD_PART, OWN_PART],
                   "states": [{"name": "half way", "x": 0.5}]},
        {"name": "ghost", "model": "cloud.ply", "visible": False},
    ]  # fmt: skip
    path = folder / "several.scene.json"
    path.write_text(json.dumps({"objects": objects}))
    return path


def drawn(renderer, scene: Scene, view) -> np.ndarray:
    renderer.update(scene)
    renderer.draw([view])
    return renderer.image(0).copy()


def opened(path: Path) -> Document:
    return open_document(path, ReadingOptions())


def run(command: str, *words) -> int:
    return cli.main([command, *map(str, words)])


def refused(capsys, said: str, *words) -> None:
    assert run(*words) == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith(f"shapeshift {words[0]}: ") and said in last, last


def test_a_subject_tells_what_its_objects_have(scene):
    subject = opened(scene)
    assert [obj.label for obj in subject.scene.objects] == [1, 2, 3, 4, 5]
    assert len(subject.models) == 2 and subject.stops == (0.0, 0.5, 1.0)
    assert subject.x is None and not subject.origin.any() and subject.background == (0, 0, 0)
    assert {obj.x for obj in subject.at(0.25).objects} == {0.25}
    assert subject.at(None) == subject.scene
    one = replace(read_model(scene.parent / "cloud.ply"), origin=(3.0, 0.0, -2.0))
    assert Document.of(one).x == 0 and Document.of(one).origin.tolist() == [3, 0, -2]
    empty = scene.with_name("empty.scene.json")
    empty.write_text("{}")
    with pytest.raises(BadFile, match="has no object"):
        opened(empty)


def test_a_moved_world_looks_as_from_a_moved_eye(renderer, scene):
    """Parts that stand in the world go with it, too."""
    subject, pose = opened(scene), Pose(np.array([3.0, -1.0, 2.0]), ODD)
    view = subject.view(SIZE)
    here = drawn(renderer, subject.scene, view)
    there = replace(view, world_from_eye=Pose.from_matrix(pose.matrix() @ matrix_of(view)))
    assert psnr(drawn(renderer, subject.at(None, pose), there)[..., :3], here[..., :3]) > 70
    back = turned_view(there, pose)
    np.testing.assert_allclose(matrix_of(back), matrix_of(view), atol=1e-12)


def matrix_of(view) -> np.ndarray:
    return view.world_from_eye.matrix()


def test_bench(scene, tmp_path, capsys):
    small = ("--frames", 3, "--sweep", 3, "--size", "64x48", "--quality-size", "32x24")
    assert run("bench", scene, *small, "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["objects"], result["splats"], result["x"]) == (5, 1700, None)
    assert result["psnr_db"] > 60 and result["quality_images"] == 3 + 5  # x 0 to 1 by quarters
    assert run("bench", scene, *small, "--x", 1, "--json") == 0
    assert json.loads(capsys.readouterr().out)["x"] == 1
    assert run("bench", scene, *small, "--settings", "nope") == 2
    capsys.readouterr()
    refused(capsys, "--up is for one model", "bench", scene, *small, "--up=+Z")


def test_chart(scene, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    words = ("--quick", "--size", "48x36", "--frames", 2, "--out", tmp_path / "out")
    assert run("chart", scene, *words) == 0
    lines = (tmp_path / "out" / "rows.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert {row["splats"] for row in rows} == {"1700"} and rows[0]["name"] == "exact"
    assert "several.scene.json (1,700 splats)" in "".join(lines)
    assert list((tmp_path / "cache" / "shapeshift" / "charts").glob("*")) == []  # quick


def test_scene_files_stand_side_by_side(renderer, scene):
    """The second one looks as it does alone, with its parts."""
    alone = opened(scene)
    both = side_by_side([alone, alone], None)
    first, second = both.objects[:5], both.objects[5:]
    assert first == alone.scene.objects
    shift = second[0].world_from_object.position - first[0].world_from_object.position
    assert shift[0] > alone.bounds()[1] and not shift[1:].any()
    view = alone.view(SIZE)
    moved = replace(view, world_from_eye=replace(view.world_from_eye,
                    position=view.world_from_eye.position + shift))  # fmt: skip
    wanted = drawn(renderer, alone.scene, view)
    assert psnr(drawn(renderer, Scene(second), moved)[..., :3], wanted[..., :3]) > 70


def test_stability(scene, tmp_path, capsys):
    cases = ("sweep", "far-origin", "inside", "extrapolated-x", "broken-heads", "stale-orbit")
    words = ("--out", tmp_path / "out", "--size", "96x64", "--steps", 6, "--context", "none")
    assert run("stability", scene, *words, "--cases", *cases) == 0
    text = (tmp_path / "out" / "stability.csv").read_text()
    assert "FAILS" not in text and all(case in text for case in cases)


def baked(path: Path) -> Document:
    return Document.of(read_model(path))


def test_export_bakes_all_objects_in_place(renderer, scene, tmp_path, capsys):
    assert run("export", scene, "--out", tmp_path / "all.ply") == 0
    assert "4 objects, each at its own x" in capsys.readouterr().err
    subject = opened(scene)
    for view in (subject.view(SIZE), turned_view(subject.view(SIZE), Pose(np.zeros(3), ODD))):
        wanted = drawn(renderer, subject.scene, view)
        found = drawn(renderer, baked(tmp_path / "all.ply").scene, view)
        assert psnr(found[..., :3], wanted[..., :3]) > 70


def test_export_of_one_object(renderer, scene, tmp_path, capsys):
    subject, view = opened(scene), opened(scene).view(SIZE)
    for chosen, at in (("parts", 3), ("4", 3), ("ghost", 4), ("2", 2)):  # "2" is a name here
        out = tmp_path / f"{chosen}.ply"
        assert run("export", scene, "--object", chosen, "--out", out) == 0
        obj = replace(subject.scene.objects[at], visible=True)
        found = drawn(renderer, baked(out).scene, view)
        assert psnr(found[..., :3], drawn(renderer, Scene((obj,)), view)[..., :3]) > 70
    capsys.readouterr()
    refused(capsys, "1 turned, 2 still, 3 2, 4 parts, 5 ghost",
            "export", scene, "--object", "nobody", "--out", tmp_path / "x.ply")  # fmt: skip


def test_export_at_an_x_and_beside_a_model(scene, tmp_path, capsys):
    """A name is for the objects that have such a stop, and hidden ones stay out."""
    for x in ("1", "HOT"):
        assert run("export", scene, "--x", x, "--out", tmp_path / f"{x}.ply") == 0
    counts = [len(read_plain(tmp_path / f"{x}.ply").means) for x in ("1", "HOT")]
    assert counts[0] == counts[1] and 300 + 300 + 200 < counts[0] < 300 + 300 + 200 + 400
    refused(capsys, "'lukewarm' is no x of this scene; expected a number",
            "export", scene, "--x", "lukewarm", "--out", tmp_path / "x.ply")  # fmt: skip
    refused(capsys, "expected a number from 0 to 1",
            "export", scene, "--x", "2", "--out", tmp_path / "x.ply")  # fmt: skip
    cloud = scene.parent / "cloud.ply"
    assert run("export", scene, cloud, "--out", tmp_path / "more.ply") == 0
    assert len(read_plain(tmp_path / "more.ply").means) > 300 * 3 + 200
    one = ("export", scene, cloud, "--object", "cloud.ply", "--out", tmp_path / "one.ply")
    assert run(*one) == 0 and len(read_plain(tmp_path / "one.ply").means) == 300


def test_export_never_replaces_what_the_scene_reads(scene, tmp_path, capsys):
    cloud = scene.parent / "cloud.ply"
    before = cloud.read_bytes()
    refused(capsys, "is the scene that is read", "export", scene, "--out", cloud, "--overwrite")
    refused(capsys, "which have places, cannot become a package",
            "export", scene, "--out", tmp_path / "a.shift")  # fmt: skip
    assert cloud.read_bytes() == before


def test_compare(scene, tmp_path, capsys):
    assert run("export", scene, "--out", tmp_path / "all.ply") == 0
    capsys.readouterr()
    both = ("--size", "64x48", "--json")
    assert run("compare", scene, tmp_path / "all.ply", *both) == 0
    assert json.loads(capsys.readouterr().out)["mean"]["psnr_db"] > 60
    assert run("compare", scene, f"{scene}@0.5", *both) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["b"] == "several.scene.json @ 0.5" and result["mean"]["psnr_db"] < 40


def test_a_stop_of_a_scene_file_is_of_the_objects_that_have_it(scene):
    def xs(at: str) -> list[float]:
        side = open_side(f"{scene}@{at}", ReadingOptions())
        return [obj.x for obj in side.subject.scene.objects]

    assert xs("hot") == [0, 0, 1, 1, 0] and xs("Half Way") == [0, 0, 1, 0.5, 0]
    assert xs("0.75") == [0.75] * 5
    with pytest.raises(UsageError, match=r"'ice' is no x of this scene; .* a stop \(.*half way"):
        xs("ice")
    with pytest.raises(UsageError, match=r"'1\.5' is no x of this scene; .* from 0 to 1"):
        xs("1.5")
    assert open_side(str(scene), ReadingOptions()).stated
