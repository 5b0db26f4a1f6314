"""launch.py lint: what it prints, its exit codes, and that it never touches what it reads."""

import hashlib
import json
import math

import pytest

import shapeshift as ss
from shapeshift.app.commands.lint import Options, run, summary
from shapeshift.runtime_models.model import BadFile
from tests.support.program import assert_refused, launch
from tests.support.splats.ply_files import names_of, random_rows, write_rows

KEYS = {"file", "refused", "format", "splats", "sh_degree", "bytes", "extent_m", "origin_m",
        "splats_over_a_pixel", "findings"}  # fmt: skip


def broken_file(path):
    """40 splats: 12 without a place, one without a rotation, one opaque for ever."""
    rows = random_rows(40, names_of(4))
    for i in range(12):
        rows[2 * i]["z"] = math.nan
    rows[1].update({f"rot_{i}": 0.0 for i in range(4)})
    rows[3]["opacity"] = math.inf
    return write_rows(path, rows)


def state_of(path):
    return hashlib.sha256(path.read_bytes()).hexdigest(), path.stat().st_mtime_ns


def test_a_table_for_people(tmp_path, capsys):
    path = broken_file(tmp_path / "a b [bold].ply")
    before = state_of(path)
    assert run(Options(path)) == 0
    printed = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for words in ("27 splats, SH degree 1", f"{path.stat().st_size:,} bytes", "12 splats",
                  "0, 2, 4, 6,", "kept, opaque", "splats over a pixel", "a b [bold]",
                  "4 findings: 2 repaired on opening, 2 only worth knowing."):  # fmt: skip
        assert words in printed, words
    assert state_of(path) == before and list(tmp_path.iterdir()) == [path]


def test_json_for_programs(tmp_path, capsys):
    path = broken_file(tmp_path / "a.ply")
    assert run(Options(path, json=True)) == 0
    facts = json.loads(capsys.readouterr().out)
    assert set(facts) == KEYS and facts["refused"] is False and facts["splats"] == 27
    nan = facts["findings"][0]
    assert nan["count"] == 12 and nan["rows"] == [0, 2, 4, 6, 8, 10, 12, 14, 16, 18]
    assert nan["done"] == "dropped" and nan["repaired"] and nan["file"] == "a.ply"
    assert json.loads(json.dumps(ss.lint(path))) == facts
    assert capsys.readouterr() == ("", "")


def test_a_good_file_is_good(tmp_path, capsys):
    path = write_rows(tmp_path / "a.ply", random_rows(40, names_of(1)))
    assert run(Options(path)) == 0
    assert "Nothing is wrong." in capsys.readouterr().out


def test_what_is_refused_is_exit_code_2_and_a_sentence(tmp_path):
    path = write_rows(tmp_path / "a.ply", random_rows(40, names_of(1)))
    path.write_bytes(path.read_bytes()[:-100])
    before = state_of(path)
    assert_refused(launch("lint", path), "promises 40 splats", "the file holds 38", "cut off")
    done = launch("lint", path, "--json")
    told = json.loads(done.stdout)
    assert done.returncode == 2 and told["refused"] and told["findings"] == []
    assert told["why"] in done.stderr and state_of(path) == before


def test_a_header_that_lies_is_refused_before_memory_is_taken(tmp_path):
    path = write_rows(tmp_path / "a.ply", random_rows(4, names_of(1)))
    path.write_bytes(path.read_bytes().replace(b"vertex 4\n", b"vertex 999999999999\n"))
    with pytest.raises(BadFile, match=r"promises 999999999999 splats of 68 bytes, .* holds 4"):
        run(Options(path))


def test_strict_refuses(tmp_path):
    path = broken_file(tmp_path / "a.ply")
    with pytest.raises(BadFile, match=r"12 splats with a NaN or Inf position \(1 more finding\)"):
        run(Options(path, strict=True))


def test_the_gate_and_its_key(tmp_path, capsys):
    rows = random_rows(4000, names_of(1))
    for row in rows:
        row.update({"scale_0": 3.0, "scale_1": 3.0, "scale_2": -1.0, "opacity": 2.0})
    path = write_rows(tmp_path / "a.ply", rows)
    with pytest.raises(BadFile, match="splats would lie over every pixel"):
        run(Options(path))
    assert run(Options(path, allow_huge=True, json=True)) == 0
    assert json.loads(capsys.readouterr().out)["splats_over_a_pixel"] > 2000


def test_a_point_cloud_names_what_it_lacks(tmp_path, capsys):
    path = write_rows(tmp_path / "a.ply", [{"x": i, "y": i * i, "z": 0.5} for i in range(30)])
    assert run(Options(path, json=True)) == 0
    (found,) = json.loads(capsys.readouterr().out)["findings"]
    assert "scale_0" in found["what"] and "rot_0" in found["what"] and "points" in found["done"]
    with pytest.raises(BadFile, match="point cloud"):
        run(Options(path, strict=True))


def test_packages_folders_and_anchors(data, capsys):
    from shapeshift.app.commands.headless import DEMO

    for scene in (DEMO, data / "anatomy_leg_ml3dgs"):
        files = [scene] if scene.is_file() else sorted(scene.glob("*.ply"))
        before = [state_of(file) for file in files]
        assert run(Options(scene, json=True)) == 0
        facts = json.loads(capsys.readouterr().out)
        # Two of the leg's splats are thinner than viewers with half floats can draw.
        assert [row["count"] for row in facts["findings"]] == [2] * scene.is_dir()
        assert 1 < facts["splats_over_a_pixel"] < 20  # 17 of the demo
        assert [state_of(file) for file in files] == before


def test_scaffold_folders(tmp_path, capsys):
    from tests.support.splats.scaffold_scenes import random_raw, write_run

    assert run(Options(write_run(random_raw(), tmp_path), json=True)) == 0
    assert json.loads(capsys.readouterr().out)["format"].startswith("Scaffold")


def test_every_folder_of_layers_names_the_file(tmp_path, capsys):
    broken_file(tmp_path / "layer0.ply")
    write_rows(tmp_path / "layer1.ply", random_rows(40, names_of(4)))
    broken_file(tmp_path / "layer2.ply")
    assert run(Options(tmp_path, json=True)) == 0
    files = [f["file"] for f in json.loads(capsys.readouterr().out)["findings"]]
    # The last one is about the whole: what other viewers' half floats lose.
    assert files == ["layer0.ply"] * 3 + ["layer2.ply"] * 3 + [tmp_path.name]


def test_the_last_line():
    assert summary(1, 1) == "1 finding, all repaired on opening."
    assert summary(2, 0) == "2 findings, only worth knowing."
    assert summary(3, 1) == "3 findings: 1 repaired on opening, 2 only worth knowing."


def test_missing_is_one_sentence(tmp_path):
    assert_refused(launch("lint", tmp_path / "nothing.ply"), "nothing.ply does not exist")
