"""Folders of gsplat's and nerfstudio's runs, opened whole, and what their settings say."""

import json
import zipfile

import numpy as np
import pytest

from shapeshift.runtime_models.checkpoint.read_checkpoint import settings_beside
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.splats.formats import read_plain, read_raw
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.splats.ply_files import some_splats
from tests.support.splats.run_folders import (
    arrays_of,
    write_gsplat_run,
    write_nerfstudio_run,
    write_png_folder,
)

HUGE = Reading(allow_huge=True)


@pytest.mark.parametrize("said, drawn", [("true", True), ("True", True), ("false", False)])
def test_a_gsplat_run_opens_whole_and_is_drawn_as_it_was_trained(tmp_path, said, drawn):
    """Two cards' checkpoints are one scene; settings are read and nothing in them runs."""
    parts = [arrays_of(40), arrays_of(25, seed=1)]
    run = write_gsplat_run(tmp_path / "results", parts, antialiased=said)
    write_gsplat_run(tmp_path / "results", [arrays_of(9)], step=6999, antialiased=said)
    model = read_model(run, HUGE)
    assert model.splat_count == 65 and model.antialiased is drawn
    assert model.stops[0].name == "results"
    assert any("cfg.yml" in finding.what for finding in model.findings) is drawn
    assert model.findings[-1].what == "its run has splats of step 6999 as well"
    assert model.findings[-1].done == "29999 is read" and describe(model, run)["step"] == "29999"
    assert model.provenance["files"] == [f"ckpts/ckpt_29999_rank{i}.pt" for i in range(2)]
    alone = read_plain(run / "ckpts" / "ckpt_29999_rank0.pt", HUGE)
    assert alone.antialiased is drawn, "the file alone is of the same run"
    assert not list(tmp_path.rglob("owned"))


def test_a_world_that_was_not_turned_is_colmap_s(tmp_path):
    one = write_gsplat_run(tmp_path / "a", [arrays_of(30)], normal="true")
    two = write_gsplat_run(tmp_path / "b", [arrays_of(30)], normal="false")
    file = "ckpts/ckpt_29999_rank0.pt"
    assert read_raw(one / file, Reading()).up == "+Z"
    raw = read_raw(two / file, Reading())
    assert raw.up == "-Y" and "left as COLMAP has it" in raw.findings[0].what
    (one / "ply").mkdir()
    write_ply(some_splats(30, 1), one / "ply" / "point_cloud_30000.ply")
    assert read_raw(one / "ply" / "point_cloud_30000.ply", Reading()).up == "+Z"
    newer = read_model(one, HUGE)  # its cloud is later than its checkpoint
    assert newer.provenance["files"] == ["ply/point_cloud_30000.ply"]


def test_a_last_step_with_fewer_files_than_another_is_said(tmp_path):
    write_gsplat_run(tmp_path / "a", [arrays_of(4), arrays_of(5)], step=10)
    write_gsplat_run(tmp_path / "a", [arrays_of(4)], step=20)
    model = read_model(tmp_path / "a", HUGE)
    assert [f.what for f in model.findings[-2:]] == [
        "its run has splats of step 10 as well", "step 20 has 1 of 2 files of another step",
    ]  # fmt: skip


@pytest.mark.parametrize("mode, drawn", [("antialiased", True), ("classic", False)])
def test_a_nerfstudio_run_opens_from_any_folder_above_it(tmp_path, mode, drawn):
    run = write_nerfstudio_run(tmp_path / "outputs", arrays_of(40), mode)
    for folder in (run, run.parent, run.parent.parent, run.parent.parent.parent):
        model = read_model(folder, HUGE)
        assert model.splat_count == 40 and model.antialiased is drawn, folder
    write_nerfstudio_run(tmp_path / "outputs", arrays_of(4), mode, "0002")
    with pytest.raises(BadFile, match=r"holds 2 runs of nerfstudio .*0001.*0002.*name one"):
        read_model(tmp_path / "outputs", HUGE)


@pytest.mark.parametrize("text", [b"", b"\xff\xfe\0", b"antialiased", b"antialiased: [true]",
                                  b"other_antialiased: true", b"x: antialiased"])  # fmt: skip
def test_settings_that_say_nothing_of_it_change_nothing(tmp_path, text):
    run = write_gsplat_run(tmp_path / "a", [arrays_of(30)])
    (run / "cfg.yml").write_bytes(text)
    assert not read_raw(run / "ckpts" / "ckpt_29999_rank0.pt", Reading()).antialiased


def test_settings_that_contradict_themselves_or_never_end_are_said(tmp_path):
    run = write_gsplat_run(tmp_path / "a", [arrays_of(30)], antialiased="true")
    text = (run / "cfg.yml").read_text()
    for more, told in (
        ("antialiased: True\n", "was trained antialiased"),  # twice the same
        ("antialiased: false\n", "says antialiased 2 times: true, false"),
        ("#" * (1 << 20), "has over 1,048,576 bytes"),
    ):
        (run / "cfg.yml").write_text(text + more)
        raw = read_raw(run / "ckpts" / "ckpt_29999_rank0.pt", Reading())
        assert raw.antialiased is ("was" in told)
        assert told in raw.findings[0].what and len(raw.findings) == 1


TEXT = "# caf\xe9\nantialiased: true\n"


@pytest.mark.parametrize("name", ["cfg.yml", "config.yml", "config.yaml"])
@pytest.mark.parametrize("data", [TEXT.encode(code) for code in (
    "utf-8", "utf-8-sig", "utf-16", "utf-32", "cp1252")] + [
    b"\xfe\xff" + TEXT.encode("utf-16-be")])  # fmt: skip
def test_settings_in_any_encoding_that_says_its_name_are_read(tmp_path, name, data):
    run = write_gsplat_run(tmp_path / "a", [arrays_of(9)])
    (run / "cfg.yml").unlink()
    (run / name).write_bytes(data)
    raw = read_raw(run / "ckpts" / "ckpt_29999_rank0.pt", Reading())
    assert raw.antialiased and len(raw.findings) == 1 and name in raw.findings[0].what


@pytest.mark.parametrize("data, told", [
    (b"\xff\xfe\0", "cfg.yml is no UTF-16, though it begins so"),
    (TEXT.encode("utf-16-le"), "cfg.yml is no text"), (bytes(99), "cfg.yml is no text"),
    (b"\x80\x81caf\xe9", "cfg.yml is no UTF-8"), (None, "cfg.yml is no file"),
    (b"antialiased: maybe", "cfg.yml says antialiased maybe, which is unknown"),
    (b"rasterize_mode: fancy", "cfg.yml says rasterize_mode fancy, which is unknown"),
])  # fmt: skip
def test_settings_that_cannot_be_read_are_said(tmp_path, data, told):
    run = write_gsplat_run(tmp_path / "a", [arrays_of(9)])
    (run / "cfg.yml").unlink()
    (run / "cfg.yml").mkdir() if data is None else (run / "cfg.yml").write_bytes(data)
    raw = read_raw(run / "ckpts" / "ckpt_29999_rank0.pt", Reading())
    assert [finding.what for finding in raw.findings] == [f"its run's {told}"]
    assert not raw.antialiased and not raw.findings[0].repaired


@pytest.mark.parametrize("data, drawn, told", [
    (b"Namespace(sh_degree=3, antialiasing=True, eval=False)", True, "was trained antialiased"),
    (b"Namespace(sh_degree=3, antialiasing=False)", False, ""),
    (b"Namespace(sh_degree=3)", False, ""),
    (bytes(9), False, "cfg_args is no text"),
])  # fmt: skip
def test_arguments_of_a_3dgs_run_are_obeyed(tmp_path, data, drawn, told):
    cloud = tmp_path / "point_cloud" / "iteration_7" / "point_cloud.ply"
    cloud.parent.mkdir(parents=True)
    write_ply(some_splats(9, 1), cloud)
    (tmp_path / "cfg_args").write_bytes(data)
    model = read_model(tmp_path, HUGE)
    assert model.antialiased is drawn
    assert [told in finding.what for finding in model.findings] == [True] * bool(told)


def test_settings_lie_beside_what_a_checkpoint_is_packed_in(tmp_path):
    run = write_gsplat_run(tmp_path / "a", [arrays_of(30)], antialiased="true")
    file = run / "ckpts" / "ckpt_29999_rank0.pt"
    with zipfile.ZipFile(run / "ckpts" / "last.zip", "w") as archive:
        archive.write(file, file.name)
    assert read_raw(run / "ckpts" / "last.zip", Reading()).antialiased


@pytest.mark.parametrize("name", ["means_l.png", "means_u.png", "shN.npz"])
def test_a_png_folder_that_lacks_a_file_names_it(tmp_path, name):
    write_png_folder(tmp_path / "rank0", arrays_of(64, 15))
    (tmp_path / "rank0" / name).unlink()
    with pytest.raises(BadFile, match=f"lacks '{name}'"):
        read_model(tmp_path / "rank0", HUGE)


def test_settings_of_another_folder_are_not_looked_at(tmp_path):
    (tmp_path / "cfg.yml").write_text("antialiased: true")
    (tmp_path / "scans" / "mine").mkdir(parents=True)
    assert settings_beside(tmp_path / "scans" / "mine" / "a.pt") == ("", {}, "")
    assert settings_beside(tmp_path / "a.pt")[1] == {"antialiased": ["true"]}


@pytest.mark.parametrize("rest", [3, 8, 15])
def test_a_png_folder_is_what_gsplat_reads_of_it(tmp_path, rest):
    want = write_png_folder(tmp_path / "rank0", arrays_of(64, rest))
    for path in (tmp_path / "rank0", tmp_path / "rank0" / "meta.json"):
        raw = read_raw(path, Reading())
        assert raw.format == "gsplat's PNG folder" and raw.up == "+Z"
        for name, array in (("means", raw.means), ("scales", raw.scales), ("quats", raw.wxyz),
                            ("opacities", raw.opacity), ("sh0", raw.sh[:, 0]),
                            ("shN", raw.sh[:, 1:])):  # fmt: skip
            np.testing.assert_allclose(
                array.reshape(64, -1), want[name].reshape(64, -1), rtol=2e-5, atol=2e-6
            )
    assert read_model(tmp_path / "rank0", HUGE).splat_count == 64


def test_a_png_folder_of_a_run_follows_its_settings(tmp_path):
    run = write_gsplat_run(tmp_path / "a", [arrays_of(30)], antialiased="true")
    write_png_folder(run / "compression" / "rank0", arrays_of(36))
    assert read_raw(run / "compression" / "rank0", Reading()).antialiased


def spoil(folder, how: str) -> None:
    meta = json.loads((folder / "meta.json").read_text())
    if how == "shape":
        meta["means"]["shape"] = [64, 2]
    elif how == "huge":
        meta["means"]["shape"] = [1 << 40, 3]
    elif how == "mins":
        meta["scales"]["mins"] = [None, 0, 0]
    elif how == "count":
        meta["sh0"]["shape"] = [63, 1, 3]
    elif how == "labels":
        np.savez(folder / "shN.npz", centroids=np.zeros((2, 45), np.uint8),
                 labels=np.full(64, 9, np.uint16))  # fmt: skip
    elif how == "picture":
        (folder / "quats.png").write_bytes((folder / "sh0.png").read_bytes())
    elif how == "cut":
        (folder / "quats.png").write_bytes((folder / "quats.png").read_bytes()[:60])
    elif how == "gone":
        (folder / "quats.png").unlink()
    (folder / "meta.json").write_text(json.dumps(meta))


@pytest.mark.parametrize(
    "how, words",
    [("shape", "no splats of gsplat"), ("huge", "memory"), ("mins", "finite numbers as its mins"),
     ("count", "another count"), ("labels", "labels beyond"), ("picture", "expected a PNG of 64"),
     ("cut", "is no PNG"), ("gone", "lacks 'quats.png'")],
)  # fmt: skip
def test_a_broken_png_folder_is_one_sentence(tmp_path, how, words):
    write_png_folder(tmp_path / "rank0", arrays_of(64))
    spoil(tmp_path / "rank0", how)
    with pytest.raises(BadFile, match=words) as error:
        read_model(tmp_path / "rank0", HUGE)
    assert "\n" not in str(error.value)
