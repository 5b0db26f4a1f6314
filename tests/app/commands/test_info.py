"""info: the keys that scripts rely on, for every kind of scene, and a table for people."""

import json

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.runtime_models.package.refit_encoding import encoding_for
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.models import STOPS, make_random_model
from tests.support.splat_scenes import shell
from tests.support.splats.ply_files import some_splats
from tests.support.splats.spz_files import spz_of

KEYS = {"format", "anchors", "splats", "sh_degree", "stops", "bytes"}


def info(*arguments):
    return cli.main(["info", *map(str, arguments)])


def facts_of(capsys, *arguments):
    assert info(*arguments, "--json") == 0
    told = capsys.readouterr()
    assert told.err == ""
    return json.loads(told.out)


@pytest.mark.parametrize("name", ["scene.shift", "scene"])
def test_a_package_as_file_and_as_folder(tmp_path, capsys, name):
    path, encoding = tmp_path / name, encoding_for([0, 1])
    model = make_random_model(30, k=4, features=8, hidden=(24, 20), encoding=encoding)
    write_package(model, path)
    facts = facts_of(capsys, path)
    assert facts.keys() >= KEYS
    assert (facts["format"], facts["anchors"], facts["splats"]) == ("shapeshift 1", 30, 120)
    assert facts["sh_degree"] is None
    assert facts["stops"] == [{"name": s.name, "x": s.x, "kind": s.kind} for s in STOPS]
    files = [f for f in path.rglob("*") if f.is_file()] if path.is_dir() else [path]
    assert facts["bytes"] == sum(f.stat().st_size for f in files)
    assert facts["heads"]["offset"]["layers"] == [8 + encoding.d, 24, 20, 12]


def test_layers_of_plain_splats(data, capsys):
    facts = facts_of(capsys, data / "anatomy_leg_ml3dgs")
    assert (facts["format"], facts["anchors"], facts["splats"]) == ("ply", 0, 136_605)
    assert facts["sh_degree"] == 3 and facts["mode"] == "cumulative"
    assert facts["made_of"] == "plain splats in 3 layers"
    assert [s["x"] for s in facts["stops"]] == [0.0, 0.5, 1.0]
    exclusive = facts_of(capsys, data / "anatomy_leg_ml3dgs", "--mode", "exclusive")
    assert exclusive == facts | {"mode": "exclusive"}


def test_a_phone_capture(data, capsys):
    path = sorted(data.glob("splats_marcelpadilla/*/*.splat"))[0]
    facts = facts_of(capsys, path)
    assert facts["splats"] == path.stat().st_size // 32 and facts["sh_degree"] == 0


@pytest.mark.parametrize(("layers", "said"), [(1, "plain splats"), (2, "plain splats in 2 layers")])
def test_plain_splats_are_said_to_be_that_and_not_no_anchors(tmp_path, capsys, layers, said):
    for n in range(layers):
        write_ply(shell(20, seed=n), tmp_path / f"layer{n}.ply")
    path = tmp_path if layers > 1 else tmp_path / "layer0.ply"
    facts = facts_of(capsys, path)
    assert (facts["anchors"], facts["splats"], facts["made_of"]) == (0, 20 * layers, said)
    assert info(path) == 0
    rows = [[word.strip() for word in row.split("│")[1:3]]
            for row in capsys.readouterr().out.splitlines() if "│" in row]  # fmt: skip
    assert ["made of", said] in rows and "anchors" not in dict(rows)


def test_the_table_says_the_same(tmp_path, capsys):
    write_package(make_random_model(1000, k=3), tmp_path / "scene.shift")
    assert info(tmp_path / "scene.shift") == 0
    table = capsys.readouterr().out
    for words in ("anchors", "3,000", "0.000  RGB (rgb)", "1.000  Thermal (thermal)", "color:"):
        assert words in table


def test_a_scene_file_says_axes_and_its_own_key_for_another_one(tmp_path, capsys):
    (tmp_path / "a.spz").write_bytes(spz_of(some_splats(300, 4), "RUB", 3))
    path = tmp_path / "a.scene.json"
    objects = [{"name": "a", "model": "a.spz"}, {"name": "b", "model": "a.spz", "up": "-Y"}]
    path.write_text(json.dumps({"format": "shapeshift-scene 1", "objects": objects}))
    assert info(path, "--json") == 0
    told = capsys.readouterr()
    first, second = json.loads(told.out)["objects"]
    assert first["axes"].startswith("right, up, back; a guess") and "axes" not in second
    assert 'text of version 3 has it; "up": "-Y" of its object turns it over' in told.err
    assert info(path) == 0 and "axes right, up," in capsys.readouterr().out


def test_names_with_brackets_are_no_markup(capsys):
    from shapeshift.app.commands.info import print_table

    print_table({"stops": [{"name": "[red]a[/b]", "x": 0.5, "kind": "rgb"}], "bytes": 1234567})
    table = capsys.readouterr().out
    assert "0.500  [red]a[/b] (rgb)" in table and "1,234,567" in table


def test_what_is_no_scene_is_one_sentence(tmp_path, capsys):
    (tmp_path / "text.shift").write_text("hello")
    (tmp_path / "short.ply").write_bytes(b"ply\nformat binary_little_endian 1.0\n")
    (tmp_path / "empty").mkdir()
    (tmp_path / "capture" / "images").mkdir(parents=True)
    (tmp_path / "capture" / "images" / "one.JPG").touch()
    np.save(tmp_path / "array.npy", np.zeros(3))
    cases = {
        "none.shift": "does not exist",
        "text.shift": "does not begin with a zip's mark",
        "short.ply": "short.ply",
        "empty": "holds nothing to show",
        "capture": "holds photos and no scene; make one of them with `python3 launch.py train ",
        "array.npy": "is a single array of numpy",
    }
    for name, words in cases.items():
        assert info(tmp_path / name, "--json") == 2, name
        told = capsys.readouterr()
        assert words in told.err and told.out == "" and told.err.count("\n") == 1
