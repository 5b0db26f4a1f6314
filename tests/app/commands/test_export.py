"""launch.py export: formats, what is chosen, what is refused; nothing read is ever written over."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.runtime_models.model import ObjectLabel
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.gltf.read_gltf import read_raw_gltf
from shapeshift.runtime_models.splats.operations.rotate_splats import HALF_TURN_Y
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.models import make_random_model
from tests.support.splats.gltf_files import plain_splats
from tests.support.splats.writers import EACH_WRITER


@pytest.fixture(scope="module")
def scenes(tmp_path_factory) -> Path:
    """A package, a .ply, and a folder of two layers."""
    folder = tmp_path_factory.mktemp("scenes")
    write_package(make_random_model(50, k=4), folder / "random.shift")
    write_ply(plain_splats(40), folder / "plain.ply")
    (folder / "layers").mkdir()
    for i in range(2):
        write_ply(plain_splats(30 + i, 1, seed=i), folder / "layers" / f"layer{i}.ply")
    return folder


def export(*arguments) -> int:
    return cli.main(["export", *map(str, arguments)])


def refused(capsys, words: str, *arguments) -> None:
    assert export(*arguments) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("shapeshift export: ") and words in said, said


@EACH_WRITER
def test_every_format(scenes, tmp_path, capsys, writer):
    out = tmp_path / "new folder" / f"größe{writer.ending}"
    assert export(scenes / "random.shift", "--out", out, "--x", "thermal") == 0
    said = capsys.readouterr()
    assert not said.out and "x = 1 (Thermal)" in said.err and "left out" in said.err
    splats = read_plain(out)
    assert f"{len(splats.means):,} splats" in said.err
    assert splats.sh.shape[1] == (1 if writer.ending == ".splat" else 16)
    assert [path.name for path in out.parent.iterdir()] == [out.name]


@pytest.mark.parametrize("axes, words", [("ply", "right, down"), ("rub", "right, up")])
def test_spz_in_either_axes_says_which(scenes, tmp_path, capsys, axes, words):
    out, wanted = tmp_path / "a.spz", read_plain(scenes / "plain.ply")
    for version in "234":
        given = (scenes / "plain.ply", "--out", out, "--overwrite", "--spz-axes", axes)
        assert export(*given, "--spz-version", version) == 0
        found = read_plain(out)
        assert np.abs(found.means - wanted.means).max() < 1e-4 and found.axes.startswith(words)
        capsys.readouterr()
        assert cli.main(["info", str(out)]) == 0
        assert words in capsys.readouterr().out
    refused(capsys, "are of .spz", scenes / "plain.ply", "--out", tmp_path / "a.ply",
            "--spz-axes", "rub")  # fmt: skip


def test_x_by_number_by_name_and_by_default(scenes, tmp_path):
    for i, words in enumerate([(), ("--x", "0"), ("--x", "RGB"), ("--x", "rgb")]):
        assert export(scenes / "random.shift", "--out", tmp_path / f"{i}.ply", *words) == 0
    files = [(tmp_path / f"{i}.ply").read_bytes() for i in range(4)]
    assert len(set(files)) == 1
    assert export(scenes / "random.shift", "--out", tmp_path / "half.ply", "--x", ".5") == 0
    assert (tmp_path / "half.ply").read_bytes() != files[0]


def test_degree_palette_and_regions(scenes, tmp_path):
    scene, thermal = scenes / "random.shift", ("--x", "Thermal")
    assert export(scene, "--out", tmp_path / "a.ply", *thermal, "--sh-degree", 1) == 0
    assert read_plain(tmp_path / "a.ply").sh.shape[1] == 4
    assert (
        export(scene, "--out", tmp_path / "b.ply", *thermal, "--sh-degree", 1, "--no-palette") == 0
    )
    assert np.abs(read_plain(tmp_path / "a.ply").sh - read_plain(tmp_path / "b.ply").sh).max() > 0.1
    everywhere = ("--select", "sphere:0,0,0:99:Thermal")
    assert export(scene, "--out", tmp_path / "c.ply", *everywhere, "--sh-degree", 1) == 0
    assert (tmp_path / "c.ply").read_bytes() == (tmp_path / "a.ply").read_bytes()


def test_only_what_lies_inside(scenes, tmp_path):
    whole = read_plain(scenes / "plain.ply").means
    near = whole[np.linalg.norm(whole - [0.2, 0, 0], axis=1) <= 0.9]
    for i, words in enumerate(["sphere:0.2,0,0:0.9", "box:0,0,0:0.5,9,9", "half:0,0.1,0:0,1,0"]):
        assert export(scenes / "plain.ply", "--out", tmp_path / f"{i}.ply", "--only", words) == 0
    found = [read_plain(tmp_path / f"{i}.ply").means for i in range(3)]
    np.testing.assert_allclose(found[0], near, atol=1e-6)
    np.testing.assert_allclose(found[1], whole[np.abs(whole[:, 0]) <= 0.5], atol=1e-6)
    np.testing.assert_allclose(found[2], whole[whole[:, 1] <= 0.1], atol=1e-6)
    both = ("--only", "half:0,0.1,0:0,1,0", "half:0,0.1,0:0,-1,0")
    assert export(scenes / "plain.ply", "--out", tmp_path / "all.ply", *both) == 0
    assert len(read_plain(tmp_path / "all.ply").means) == len(whole)


def test_several_scenes_and_one_of_them(scenes, tmp_path):
    both = (scenes / "plain.ply", scenes / "layers")
    assert export(*both, "--out", tmp_path / "both.ply") == 0
    assert export(*both, "--out", tmp_path / "two.ply", "--object", 2) == 0
    assert export(*both, "--out", tmp_path / "end.ply", "--object", 2, "--x", "layer1") == 0
    counts = [len(read_plain(tmp_path / f"{name}.ply").means) for name in ("both", "two", "end")]
    assert counts == [70, 30, 61]
    merged = read_plain(tmp_path / "both.ply")
    assert merged.sh.shape[1] == 16 and not merged.sh[40:, 4:].any()


def test_far_places_come_back(scenes, tmp_path, monkeypatch):
    """Two files millions of metres from zero, three metres apart, stand so in one file."""
    near = read_model(scenes / "plain.ply")
    places = {"one.ply": (4e6, 1e6, -3e6), "two.ply": (4e6 + 3, 1e6, -3e6)}
    monkeypatch.setattr(
        "shapeshift.app.commands.export.open_model",
        lambda path, options: replace(near, origin=places[path.name]),
    )
    both = (tmp_path / "one.ply", tmp_path / "two.ply")
    for path in both:
        path.touch()
    assert export(*both, "--out", tmp_path / "both.glb") == 0
    assert export(*both, "--object", 2, "--out", tmp_path / "two.glb") == 0
    raw = [read_raw_gltf(tmp_path / name, Reading()) for name in ("both.glb", "two.glb")]
    found = [each.means @ HALF_TURN_Y for each in raw]  # its axes: left, up, forward
    wanted = [near.means + np.array(place) for place in places.values()]
    np.testing.assert_allclose(found[0], np.concatenate(wanted), rtol=0, atol=1e-6)
    np.testing.assert_allclose(found[1], wanted[1], rtol=0, atol=1e-6)


@pytest.mark.parametrize("label", ["cup", 2])
def test_an_object_of_a_package_by_name_or_label(tmp_path, label):
    whole = make_random_model(50, k=4)
    objects = (ObjectLabel(1, "mug"), ObjectLabel(2, "cup"))
    whole = replace(whole, labels=np.resize(np.array([0, 1, 2], np.uint8), 50), objects=objects)
    write_package(whole, tmp_path / "room.shift", "float32")
    for out in ("cup.ply", "cup.shift", "all.ply"):
        words = () if out == "all.ply" else ("--label", label)
        assert export(tmp_path / "room.shift", "--out", tmp_path / out, "--no-pace", *words) == 0
    part, cup = read_plain(tmp_path / "cup.ply"), read_plain(tmp_path / "all.ply")
    assert len(part.means) == (cup.labels == 2).sum() and set(part.labels) == {2}
    # Where it stands in the whole, to the last bit of what the PLY holds.
    assert np.array_equal(part.means + part.origin, (cup.means + cup.origin)[cup.labels == 2])
    package = read_model(tmp_path / "cup.shift")
    assert np.array_equal(package.anchors, whole.anchors[whole.labels == 2])
    assert package.objects == objects[1:] and package.stops == whole.stops


def test_a_label(scenes, tmp_path, capsys, monkeypatch):
    model = read_model(scenes / "plain.ply")
    labelled = replace(model, labels=np.arange(40, dtype=np.int32) % 3)
    monkeypatch.setattr("shapeshift.app.commands.export.open_model", lambda path, options: labelled)
    assert export(scenes / "plain.ply", "--out", tmp_path / "a.ply", "--label", 2) == 0
    np.testing.assert_allclose(read_plain(tmp_path / "a.ply").means, model.means[2::3], atol=1e-6)
    refused(
        capsys, "it has 0, 1, 2", scenes / "plain.ply", "--out", tmp_path / "b.ply", "--label", 7
    )


@EACH_WRITER
def test_what_a_format_has_no_place_for_is_said(scenes, tmp_path, capsys, monkeypatch, writer):
    model = read_model(scenes / "plain.ply")
    more = {"labels": np.arange(40, dtype=np.int32) % 3, "extra": {"error": np.ones(40, "f4")}}
    rich = replace(model, antialiased=True, **more)
    monkeypatch.setattr("shapeshift.app.commands.export.open_model", lambda path, options: rich)
    out = tmp_path / f"a{writer.ending}"
    assert export(scenes / "plain.ply", "--out", out) == 0
    said, back = capsys.readouterr().err, read_plain(out)
    assert ("cannot say so" in said) == (not back.antialiased) == (not writer.antialiased)
    assert ("(labels, error)" in said) == (back.labels is None) == (not writer.columns)


# Packages


def test_a_package_is_written_as_it_is(scenes, tmp_path):
    for name in ("copy.shift", "folder"):
        assert export(scenes / "random.shift", "--out", tmp_path / name, "--no-pace") == 0
        copy, model = read_model(tmp_path / name), read_model(scenes / "random.shift")
        np.testing.assert_array_equal(copy.features, model.features)
        for head, mlp in model.networks.items():
            for one, other in zip(copy.networks[head].weights, mlp.weights, strict=True):
                np.testing.assert_array_equal(one, other)
    assert (tmp_path / "copy.shift").read_bytes() == (scenes / "random.shift").read_bytes()


@pytest.mark.parametrize("words", [("--x", "1"), ("--only", "sphere:0,0,0:1")])
def test_a_package_has_no_part(scenes, tmp_path, capsys, words):
    out = ("--out", tmp_path / "part.shift")
    refused(capsys, f"leave {words[0]} out", scenes / "random.shift", *out, *words)


def test_plain_splats_become_no_package(scenes, tmp_path, capsys):
    for name in ("p.shift", "folder"):
        refused(
            capsys,
            "plain splats cannot become a package",
            scenes / "plain.ply",
            "--out",
            tmp_path / name,
        )
    two = (scenes / "random.shift", scenes / "random.shift")
    refused(capsys, "several scenes cannot", *two, "--out", tmp_path / "p.shift")
    assert not list(tmp_path.iterdir())


# Refused


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--x", "1.5"),
            "'1.5' is no x of this scene; expected a number from 0 to 1",
        ),
        (("--x", "nan"), "'nan' is no x of this scene"),
        (("--x", "layer9"), "a stop (RGB, Thermal) or a way such as RGB..Thermal:0.5"),
        (("--sh-degree", "4"), "--sh-degree is 4"),
        (("--sh-degree", "-1"), "--sh-degree is -1"),
        (("--object", "2"), "there are 1 random.shift"),
        (("--object", "0"), "--object is 0"),
        (("--label", "1"), "has no labels"),
        (("--eye", "1,2"), "expected x,y,z in metres"),
        (("--eye", "1,2,inf"), "expected x,y,z in metres"),
        (("--only", "sphere:9,9,9:0.1"), "nothing of random lies inside"),
        (("--only", "sphere:0,0,0:1:0.5"), "write sphere:x,y,z:radius"),
        (("--only", "cone:1"), "begins with 'cone'"),
        (("--only", "sphere:0,0:1"), "--only"),
        (("--select", "sphere:0,0,0:1:9"), "--select"),
    ],
)
def test_options_that_cannot_be(scenes, tmp_path, capsys, words, said):
    refused(capsys, said, scenes / "random.shift", "--out", tmp_path / "a.ply", *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("scene", ["random.shift", "plain.ply", "layers"])
def test_an_eye_that_changes_nothing_is_said_and_changes_nothing(scenes, tmp_path, capsys, scene):
    assert export(scenes / scene, "--out", tmp_path / "without.ply") == 0
    assert "--eye" not in capsys.readouterr().err
    assert export(scenes / scene, "--out", tmp_path / "with.ply", "--eye", "9,2,-3") == 0
    assert capsys.readouterr().err.count("--eye changes nothing: the shapes") == 1
    assert (tmp_path / "with.ply").read_bytes() == (tmp_path / "without.ply").read_bytes()


@pytest.mark.parametrize("name", ["a.png", "a.ksplat", "a.sog", "a.gltf", "a.txt"])
def test_endings_that_are_not_written(scenes, tmp_path, capsys, name):
    refused(capsys, "no ending that can be written", scenes / "plain.ply", "--out", tmp_path / name)


def test_what_exists_is_kept_unless_asked(scenes, tmp_path, capsys):
    out = tmp_path / "a.ply"
    out.write_text("mine")
    refused(capsys, "--overwrite replaces it", scenes / "plain.ply", "--out", out)
    assert out.read_text() == "mine"
    assert export(scenes / "plain.ply", "--out", out, "--overwrite") == 0
    assert len(read_plain(out).means) == 40
    (tmp_path / "folder.ply").mkdir()
    refused(
        capsys,
        "another kind",
        scenes / "plain.ply",
        "--out",
        tmp_path / "folder.ply",
        "--overwrite",
    )


@pytest.mark.parametrize("way", ["same", "relative", "symlink", "hard link", "through a link"])
def test_nothing_that_is_read_is_written_over(scenes, tmp_path, capsys, way, monkeypatch):
    scene = tmp_path / "in.ply"
    shutil.copy(scenes / "plain.ply", scene)
    before, out = scene.read_bytes(), scene
    if way == "relative":
        monkeypatch.chdir(tmp_path)
        out = Path("./../" + tmp_path.name + "/in.ply")
    if way == "symlink":
        out = tmp_path / "link.ply"
        os.symlink(scene, out)
    if way == "hard link":
        out = tmp_path / "link.ply"
        os.link(scene, out)
    if way == "through a link":
        os.symlink(tmp_path, tmp_path / "again")
        out = tmp_path / "again" / "in.ply"
    refused(capsys, "is the scene that is read", scene, "--out", out, "--overwrite")
    assert scene.read_bytes() == before


def test_nor_into_a_folder_that_is_read(scenes, tmp_path, capsys):
    shutil.copytree(scenes / "layers", tmp_path / "layers")
    for name in ("layer0.ply", "layer2.ply", "below/a.ply"):
        out = tmp_path / "layers" / name
        refused(capsys, "which is read", tmp_path / "layers", "--out", out, "--overwrite")
    assert sorted(path.name for path in (tmp_path / "layers").iterdir()) == [
        "layer0.ply",
        "layer1.ply",
    ]
    shutil.copy(scenes / "random.shift", tmp_path / "r.shift")
    other = (tmp_path / "r.shift", scenes / "plain.ply")
    refused(
        capsys,
        "is the scene that is read",
        *other,
        "--object",
        2,
        "--out",
        tmp_path / "r.shift",
        "--overwrite",
    )


def test_nor_over_a_package_that_is_named_by_its_manifest(scenes, tmp_path, capsys):
    assert export(scenes / "random.shift", "--out", tmp_path / "package") == 0
    manifest = tmp_path / "package" / "scene.json"
    refused(capsys, "which is read", manifest, "--out", manifest.parent, "--overwrite")
    assert export(manifest, "--out", tmp_path / "beside.ply") == 0


def test_a_failure_leaves_no_part(scenes, tmp_path, capsys, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device", "a.ply")

    monkeypatch.setattr("os.replace", full)
    refused(capsys, "No space left on device", scenes / "plain.ply", "--out", tmp_path / "a.ply")
    assert not list(tmp_path.iterdir())
