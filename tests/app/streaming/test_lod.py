"""lod: a folder that this program and others open, refusals in one sentence, nothing lost."""

import json
from types import SimpleNamespace

import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.models import random_package
from tests.support.splats.ply_files import some_splats


@pytest.fixture
def scene(tmp_path):
    write_ply(some_splats(400, 4, opacities=(0.3, 0.9)), tmp_path / "a.ply")
    return tmp_path / "a.ply"


def test_a_folder_is_written_and_read_at_any_budget(scene, tmp_path, capsys):
    assert cli.main(["lod", str(scene), "--out", str(tmp_path / "b"), "--leaf", "100"]) == 0
    said = capsys.readouterr().err
    assert "4 leaves, 2 levels of 400, 200" in said
    written = ss.lod(scene, tmp_path / "library", leaf=100)
    assert [level["splats"] for level in written.levels] == [400, 200] and written.leaves == 4
    files = sorted(path for path in (tmp_path / "b").rglob("*") if path.is_file())
    assert written.bytes == sum(path.stat().st_size for path in files)
    for path in files:
        same = tmp_path / "library" / path.relative_to(tmp_path / "b")
        assert same.read_bytes() == path.read_bytes()
    assert capsys.readouterr() == ("", "")
    assert read_model(tmp_path / "b").splat_count == 400
    counts = read_model(tmp_path / "b").provenance["level_splats"]
    for count in counts:
        assert read_model(tmp_path / "b", Reading(most_splats=count)).splat_count == count
    assert cli.main(["info", str(tmp_path / "b"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["levels"] and facts["sh_degree"] == 1
    flat = ["lod", str(scene), "--out", str(tmp_path / "c"), "--sh-degree", "0"]
    assert cli.main(flat) == 0 and read_model(tmp_path / "c").sh.shape == (400, 1, 3)


def test_a_package_is_written_as_it_is_at_x(tmp_path):
    package = random_package(tmp_path, 40)
    for x in ("0", "1"):
        words = ["lod", str(package), "--x", x, "--out", str(tmp_path / f"at{x}")]
        assert cli.main(words) == 0
    one, other = (read_model(tmp_path / f"at{x}") for x in "01")
    assert one.splat_count != other.splat_count or (one.means != other.means).any()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--out", "b.sog"], "is no folder's name"),
        (["--out", "b", "--leaf", "63"], "--leaf is 63, expected 64 to 524288"),
        (["--out", "b", "--sh-degree", "4"], "--sh-degree is 4, expected 0 to 3"),
        (["--out", "b", "--x", "nowhere"], "is no x of this scene"),
        (["--out", "there"], "--overwrite replaces it"),
    ],
)
def test_refusals_are_one_sentence(scene, tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "own.txt").write_text("kept")
    assert cli.main(["lod", str(scene), *words]) == 2
    text = capsys.readouterr().err
    assert said in text and "Traceback" not in text
    assert (tmp_path / "there" / "own.txt").read_text() == "kept"
    assert not (tmp_path / "b").exists()


def test_no_place_and_no_room_are_said_before_the_work(tmp_path, monkeypatch, capsys):
    """A full disk was said after five minutes of levels, and these were lost."""
    package = random_package(tmp_path, 40)

    def worked(*_):
        raise AssertionError("the work began")

    monkeypatch.setattr("shapeshift.app.streaming.lod.bake_scene", worked)
    monkeypatch.setattr("shapeshift.app.streaming.package_levels.make_levels", worked)
    for name in ("levels", "levels.lod"):
        assert cli.main(["lod", str(package), "--out", str(package / name)]) == 2
        assert "nothing can be written into" in capsys.readouterr().err
    size = package.stat().st_size
    for free, began in ((size - 1, False), (size, True)):
        usage = SimpleNamespace(total=free, used=0, free=free)
        monkeypatch.setattr("shutil.disk_usage", lambda path, usage=usage: usage)
        ended = cli.main(["lod", str(package), "--out", str(tmp_path / "b.lod")])
        assert ended == (cli.FAULT if began else cli.BAD_INPUT)
        said = capsys.readouterr().err
        assert ("the work began" in said) == began
        assert (f"{free:,} bytes are free there, and the package" in said) != began


def test_several_scenes_are_the_folders_of_each(scene, tmp_path, capsys):
    """Each in a process of its own; the same bytes as alone, and nothing left beside them."""
    write_ply(some_splats(300, 4, opacities=(0.3, 0.9)), tmp_path / "other.ply")
    scenes = [str(scene), str(tmp_path / "other.ply")]
    for name in ("a", "other"):
        path = str(tmp_path / f"{name}.ply")
        assert cli.main(["lod", path, "--leaf", "100", "--out", str(tmp_path / f"{name}1")]) == 0
    many = ["lod", *scenes, "--leaf", "100", "--out", str(tmp_path / "many")]
    assert cli.main(many) == 0
    for name in ("a", "other"):
        one, other = tmp_path / f"{name}1", tmp_path / "many" / name
        files = sorted(p.relative_to(one) for p in one.rglob("*") if p.is_file())
        assert files == sorted(p.relative_to(other) for p in other.rglob("*") if p.is_file())
        assert all((one / file).read_bytes() == (other / file).read_bytes() for file in files)
    assert not (tmp_path / "many.tasks").exists()
    capsys.readouterr()
    assert cli.main(many) == 2 and "--overwrite replaces it" in capsys.readouterr().err
    assert cli.main(["lod", scenes[0], scenes[0], "--out", str(tmp_path / "b")]) == 2
    assert "two scenes are called a" in capsys.readouterr().err
    assert cli.main(["lod", scenes[0], "no.ply", "--out", str(tmp_path / "b")]) == 2
    assert "no.ply: there is no such file" in capsys.readouterr().err
