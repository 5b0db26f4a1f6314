"""launch.py colliders: made once, beside a new scene file, nothing replaced."""

import json
from pathlib import Path

import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.app.commands.colliders import Options, run
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.colliders.collider_pieces import read_pieces
from shapeshift.scene.document.read_scene_file import read_scene_file
from tests.support.scene.collider_shapes import shapes, splatted


@pytest.fixture
def scene(tmp_path) -> Path:
    import numpy as np

    cloud = splatted(shapes()["sphere"], 500)
    sh = np.zeros((len(cloud.means), 1, 3), np.float32)
    write_ply(PlainSplats(*(np.float32(c) for c in cloud.columns), sh), tmp_path / "ball.ply")
    body = {"model": "ball.ply", "collider": "hulls"}
    objects = [{"name": name, **body} for name in ("one", "two", "a/b", "a:b")]
    objects[1]["x"] = 0.5
    objects.append({"name": "seen", "model": "ball.ply"})
    (tmp_path / "room.scene.json").write_text(json.dumps({"objects": objects}))
    return tmp_path / "room.scene.json"


def test_the_new_scene_names_what_was_made(scene, tmp_path, capsys):
    before = scene.read_bytes()
    out = tmp_path / "out" / "room.scene.json"
    assert run(Options(scene, out)) == 0
    assert scene.read_bytes() == before
    file = read_scene_file(out)
    named = {item.name: item.collider for item in file.items}
    assert named == {"one": "colliders/one.glb", "two": "colliders/two.glb", "seen": None,
                     "a/b": "colliders/one.glb", "a:b": "colliders/one.glb"}  # fmt: skip
    for name in ("one", "two"):
        assert len(read_pieces(file.path(named[name])).points) == 1
    assert {p.name for p in (out.parent / "colliders").iterdir()} == {"one.glb", "two.glb"}
    assert capsys.readouterr().err.count("1 convex piece,") == 2
    made = ss.colliders(scene, tmp_path / "library" / "room.scene.json")
    assert {name: path.name for name, path in made.items()} == {
        name: Path(path).name for name, path in named.items() if path
    }
    for path in made.values():
        assert path.read_bytes() == (out.parent / "colliders" / path.name).read_bytes()
    assert capsys.readouterr() == ("", "")
    with pytest.raises(UsageError, match="exists; choose another --out"):
        run(Options(scene, out))
    assert run(Options(scene, out, overwrite=True)) == 0
    with pytest.raises(UsageError, match='has "hulls" as its collider'):
        run(Options(out, tmp_path / "again.scene.json"))


def test_shapes_of_objects_by_name_and_of_all(scene, tmp_path, capsys):
    """A ball of radius r: each shape holds nearly all of it, and is as large as its formula."""
    import numpy as np

    out = tmp_path / "out" / "room.scene.json"
    asked = ["colliders", str(scene), "--out", str(out), "--shape", "cylinder", "two=box"]
    assert cli.main(asked) == 0
    file = read_scene_file(out)
    named = {item.name: item.collider for item in file.items}
    assert named["one"] == named["a/b"] != named["two"] and named["seen"] is None
    (cylinder,) = read_pieces(file.path(named["one"])).points
    (box,) = read_pieces(file.path(named["two"])).points
    assert len(box) == 8 and len(cylinder) == 48
    height = np.ptp(box[:, 1])  # the same skin, the same axis
    np.testing.assert_allclose(np.ptp(cylinder[:, 1]), height, rtol=1e-5)
    across = cylinder[:, [0, 2]] - cylinder[:, [0, 2]].mean(axis=0)
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), height / 2, rtol=0.06)
    assert capsys.readouterr().err.count("1 convex piece,") == 2


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("ring", "--shape is 'ring'; one of hull, box, cylinder, sphere, capsule is wanted."),
        ("one=", "--shape is 'one='; one of hull"),
        ("three=box", "--shape three=box: its object is none of one, two, a/b, a:b."),
        ("seen=box", "its object is none of one, two"),
    ],
)
def test_shapes_that_are_none_are_one_sentence(scene, tmp_path, capsys, asked, said):
    out = tmp_path / "out" / "room.scene.json"
    assert cli.main(["colliders", str(scene), "--out", str(out), "--shape", asked]) == 2
    assert said in capsys.readouterr().err and not out.parent.exists()


def test_an_upright_cylinder_stays_upright_of_a_turned_object(scene, tmp_path):
    """Its frame is turned by a quarter about x: what is up in the world is its own z."""
    import numpy as np

    read = json.loads(scene.read_text())
    read["objects"] = [read["objects"][0] | {"pose": {"wxyz": [0.5**0.5, 0.5**0.5, 0, 0]}}]
    scene.write_text(json.dumps(read))
    out = tmp_path / "out" / "room.scene.json"
    assert cli.main(["colliders", str(scene), "--out", str(out), "--shape", "cylinder"]) == 0
    file = read_scene_file(out)
    (points,) = read_pieces(file.path(file.items[0].collider)).points
    world = points @ file.items[0].pose.matrix()[:3, :3].T
    assert len(np.unique(world[:, 1].round(4))) == 2


def test_what_is_read_is_not_written(scene, tmp_path):
    with pytest.raises(UsageError, match="is read in this run"):
        run(Options(scene, scene, overwrite=True))
    with pytest.raises(UsageError, match=r"ends in \.scene\.json"):
        run(Options(scene, tmp_path / "ball.ply", overwrite=True))


def test_a_link_in_place_of_the_folder_is_not_followed(scene, tmp_path, capsys):
    (tmp_path / "victim").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "colliders").symlink_to(tmp_path / "victim")
    asked = ["colliders", str(scene), "--out", str(tmp_path / "out" / "room.scene.json")]
    assert cli.main(asked) == 2
    assert "through which nothing is written" in capsys.readouterr().err
    assert not any((tmp_path / "victim").iterdir())


def test_what_is_no_scene_file_is_told_what_is(tmp_path):
    (tmp_path / "room.shift").write_bytes(b"PK\x03\x04")
    with pytest.raises(UsageError, match=r"room.shift is no scene file: colliders makes .* NAME\."):
        run(Options(tmp_path / "room.shift", tmp_path / "out.scene.json"))
