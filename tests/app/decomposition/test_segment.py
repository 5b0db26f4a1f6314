"""segment: as a person starts it, on three balls whose label maps are drawn; what it refuses."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.decomposition.label_pictures import LabelPictures
from shapeshift.decomposition.masks.label_maps import write_label_map
from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import ObjectLabel, SplatLayers, Stop
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import read_models
from shapeshift.scene.pose import View, look_at, perspective
from tests.support.models import make_random_model

SIZE, VIEWS = (96, 72), 4


def balls():
    """An anchor model of three balls beside each other, and their labels."""
    plain = make_random_model(anchors=90)
    of = np.resize(np.array([0, 1, 2], np.uint8), 90)
    apart = 0.25 * plain.anchors + np.outer(
        of.astype(np.float32) - 1, np.array([1, 0, 0], np.float32)
    )
    return replace(plain, anchors=apart), of


@pytest.fixture(scope="module")
def given(tmp_path_factory) -> Path:
    """room.shift, room.ply, capture/ with photos of two stops, masks/ and truth/."""
    folder = tmp_path_factory.mktemp("segment")
    model, of = balls()
    write_package(model, folder / "room.shift", "float32")
    pictures = LabelPictures(open_device(), model, np.repeat(of, model.splats_per_anchor))
    photos = []
    for number, stop in enumerate(model.stops):
        for i in range(VIEWS):
            turn = 2 * np.pi * (i + number / 2) / VIEWS
            pose = look_at((3 * np.sin(turn), 0.8, 3 * np.cos(turn)), (0, 0, 0))
            view = View(pose, perspective(0.8, SIZE), 0.05, 100.0, SIZE)
            path = folder / "capture" / stop.name.lower() / f"{i}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            Image.new("RGB", SIZE, (i, i, i)).save(path)
            photos.append(Photo(view, path, stop.name, None, "test" if i == 0 else "train"))
            kind = "truth" if i == 0 else "masks"
            out = folder / kind / stop.name.lower() / f"{i}.png"
            out.parent.mkdir(parents=True, exist_ok=True)
            write_label_map(pictures.label_map(view, stop.x), out)
    write_capture(Capture(folder / "capture", model.stops, tuple(photos)))
    return folder


def segment(folder: Path, *arguments) -> int:
    words = [folder / "room.shift", folder / "capture", "--masks", folder / "masks"]
    return cli.main(["segment", "--no-complete", *map(str, (*words, *arguments))])


def refused(capsys, words: str, arguments) -> None:
    assert cli.main(["segment", *map(str, arguments)]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("shapeshift segment: ") and words in said, said


@pytest.mark.parametrize("name", ["cut.shift", "cut.scene.json"])
def test_what_a_killed_run_left_is_replaced_and_nothing_else(given, tmp_path, capsys, name):
    """Its note stands from before the first file to after the last (tools/program/kills.py)."""
    words, whole = ("--out", tmp_path / "cut.scene.json"), given / "whole"
    if not whole.exists():
        assert segment(given, "--out", whole / "cut.scene.json") == 0
    shutil.copyfile(whole / name, tmp_path / name)
    refused = segment(given, *words)
    assert refused == 2 and "exists; choose another --out" in capsys.readouterr().err
    (tmp_path / "cut.unfinished").touch()
    assert segment(given, *words) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.scene.json", "cut.shift"]
    for path in tmp_path.iterdir():
        assert path.read_bytes() == (whole / path.name).read_bytes()


def test_label_maps_become_objects_that_can_be_opened(given, tmp_path, capsys):
    out = tmp_path / "new" / "cut.scene.json"
    words = ("--out", out, "--score", given / "truth", "--report", tmp_path / "report")
    assert segment(given, *words) == 0
    told = capsys.readouterr()
    assert "object 1" in told.out and "mean" in told.out
    assert "agrees" in told.out and "doubt" in told.out
    assert "2 photos have no label maps and say nothing." in told.err
    assert f"view {out}" in told.err
    _, of = balls()
    file, models = read_models(read_scene_file(out))
    assert [item.name for item in file.all_items] == ["background", "object 1", "object 2"]
    assert file.background.part == 0 and file.items[0].collider == "hulls"
    cut = read_model(out.with_name("cut.shift"))
    # Where balls meet, splats are as large as a third of them: some anchors are of both.
    assert (cut.labels == of).mean() > 0.9
    for item in file.items:
        label = int(item.name[-1])
        there = models[item.name].anchors + np.array(item.position, np.float64)
        assert np.abs(there - cut.anchors[cut.labels == label]).max() < 1e-6
    names = sorted(path.name for path in (tmp_path / "report").iterdir())
    assert names == ["001_object 1.png", "002_object 2.png", "labels.png", "views.png"]
    sheet = np.asarray(Image.open(tmp_path / "report" / "labels.png"))
    assert sheet.shape == (4 * SIZE[1], 3 * SIZE[0], 3)
    assert np.asarray(Image.open(tmp_path / "report" / "views.png")).shape[1] == 4 * SIZE[0]


def test_objects_json_gives_names_masses_and_colliders(given, tmp_path, capsys):
    rows = [
        {"label": 2, "name": "cup", "mass_kg": 0.3, "collider": None},
        {"label": 1, "name": "mug", "static": True},
        {"label": 9, "name": "absent"},
    ]
    path = tmp_path / "objects.json"
    path.write_text(json.dumps({"format": "shapeshift-objects 1", "objects": rows}))
    out = tmp_path / "cut.scene.json"
    assert segment(given, "--out", out, "--objects", path, "--json") == 0
    told = capsys.readouterr()
    facts = json.loads(told.out)["objects"]
    assert facts["cup"]["label"] == 2 and facts["cup"]["photos"] == 6
    assert facts["absent"]["rows"] == 0
    assert facts["absent"]["agreement"] is None and "too little seen" in facts["absent"]["doubt"]
    assert "share" not in facts["mug"] and 0 <= facts["mug"]["agreement"] <= 1
    assert read_scene_file(out).items[0].doubt == facts["cup"]["doubt"]
    assert "Left out, for no label map shows it: absent." in told.err
    items = {item.name: item for item in read_scene_file(out).items}
    assert list(items) == ["cup", "mug"]
    assert (items["cup"].mass_kg, items["cup"].collider, items["mug"].static) == (0.3, None, True)
    assert ObjectLabel(9, "absent") in read_model(tmp_path / "cut.shift").objects
    path.write_text(path.read_text().replace('"label": 2', '"label": 3'))
    refused(
        capsys, "have the label 2, which no object of objects.json has",
        (given / "room.shift", given / "capture", "--masks", given / "masks", "--out",
         tmp_path / "b.scene.json", "--objects", path),
    )  # fmt: skip
    assert not (tmp_path / "b.scene.json").exists() and not (tmp_path / "b.shift").exists()


def test_labels_may_have_any_numbers(given, tmp_path, capsys):
    shutil.copytree(given / "masks", tmp_path / "masks")
    for path in (tmp_path / "masks").rglob("*.png"):
        labels = np.asarray(Image.open(path))
        write_label_map(np.choose(labels, np.array([0, 254, 7], np.uint8)), path)
    base = (given / "room.shift", given / "capture", "--masks", tmp_path / "masks")
    assert (
        cli.main(
            ["segment", "--no-complete", *map(str, (*base, "--out", tmp_path / "far.scene.json"))]
        )
        == 0
    )
    assert segment(given, "--out", tmp_path / "near.scene.json") == 0
    far, near = (read_model(tmp_path / f"{name}.shift") for name in ("far", "near"))
    assert np.array_equal(far.labels, np.choose(near.labels, np.array([0, 254, 7], np.uint8)))
    assert [each.name for each in far.objects] == ["object 7", "object 254"]


def test_plain_splats_are_cut_splat_by_splat(given, tmp_path, capsys):
    model, of = balls()
    count = len(of)
    f = np.float32
    arrays = (np.full((count, 3), 0.05, f), np.tile(f([1, 0, 0, 0]), (count, 1)),
              np.full(count, 0.9, f), np.zeros((count, 1, 3), f))  # fmt: skip
    plain = SplatLayers(model.anchors, *arrays, np.zeros(count, np.int32), (Stop("RGB", 0.0),))
    write_ply(PlainSplats(model.anchors, *arrays), tmp_path / "room.ply")
    shutil.copytree(given / "capture", tmp_path / "capture")
    pictures = LabelPictures(open_device(), plain, of.astype(np.int32))
    from shapeshift.scene.captures.read_capture import read_capture

    for photo in read_capture(tmp_path / "capture").photos:
        if photo.modality == "RGB":
            out = tmp_path / "maps" / "rgb" / f"{photo.path.name}.png"  # 0.png.png: also taken
            out.parent.mkdir(parents=True, exist_ok=True)
            write_label_map(pictures.label_map(photo.view, 0.0), out)
    words = (tmp_path / "room.ply", tmp_path / "capture", "--masks", tmp_path / "maps", "--out",
             tmp_path / "cut.scene.json")  # fmt: skip
    assert cli.main(["segment", "--no-complete", *map(str, words)]) == 0
    assert "splats" in capsys.readouterr().out
    cut = read_model(tmp_path / "cut.ply")
    order, other = np.lexsort(cut.means.T), np.lexsort(model.anchors.T)
    assert np.allclose(cut.means[order], model.anchors[other], atol=1e-5)
    assert (cut.labels[order] == of[other]).mean() > 0.95
    file, models = read_models(read_scene_file(tmp_path / "cut.scene.json"))
    assert [item.part for item in file.all_items] == [0, 1, 2]
    assert sum(models[item.name].splat_count for item in file.all_items) == count


def test_what_is_read_or_there_is_never_replaced(given, tmp_path, capsys):
    before = (given / "room.shift").read_bytes()
    base = (given / "room.shift", given / "capture", "--masks", given / "masks", "--out")
    refused(capsys, "is read in this run", (*base, given / "room.scene.json"))
    refused(capsys, "name a file that ends in .scene.json", (*base, tmp_path / "room.shift"))
    (tmp_path / "a.shift").write_bytes(b"mine")
    refused(capsys, "a.shift exists", (*base, tmp_path / "a.scene.json"))
    assert (tmp_path / "a.shift").read_bytes() == b"mine"
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "mine.txt").write_text("mine")
    refused(
        capsys, "holds files; choose another --report",
        (*base, tmp_path / "b.scene.json", "--report", tmp_path / "pictures"),
    )  # fmt: skip
    assert (given / "room.shift").read_bytes() == before


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: shutil.rmtree(f), "is no folder; label maps lie in one"),
        (lambda f: [p.unlink() for p in f.rglob("*.png")], "called rgb/0.png"),
        (lambda f: paint(f, np.zeros(SIZE[::-1], np.uint8)), "show the background alone"),
        (lambda f: paint(f, np.full(SIZE[::-1], 255, np.uint8)), "show the background alone"),
        (lambda f: paint(f, white_mask()), "look like masks in black and white"),
        (lambda f: paint(f, np.ones((40, 40), np.uint8)), "40x40 pixels, its photo 96x72"),
        (lambda f: (f / "rgb" / "1.png").write_bytes(b"no picture"), "not a PNG"),
        (lambda f: Image.new("RGB", SIZE).save(f / "rgb" / "1.png"), "its colours are RGB"),
    ],
)  # fmt: skip
def test_bad_label_maps_are_one_sentence(given, tmp_path, capsys, change, words):
    shutil.copytree(given / "masks", tmp_path / "masks")
    change(tmp_path / "masks")
    out = tmp_path / "cut.scene.json"
    base = (given / "room.shift", given / "capture", "--masks", tmp_path / "masks", "--out", out)
    refused(capsys, words, base)
    assert not out.exists() and not (tmp_path / "cut.shift").exists()


def white_mask() -> np.ndarray:
    """As a matting program writes it: white inside, one soft row at its edge."""
    mask = np.zeros(SIZE[::-1], np.uint8)
    mask[20:50], mask[19] = 255, 128
    return mask


def paint(folder: Path, labels: np.ndarray) -> None:
    for path in folder.rglob("*.png"):
        write_label_map(labels, path)


def test_another_scenes_capture_is_noticed(given, tmp_path, capsys):
    model, _ = balls()
    words = (given / "capture", "--masks", given / "masks", "--out", tmp_path / "a.scene.json")
    stops = (Stop("skin", 0.0), Stop("bone", 1.0))
    write_package(replace(model, stops=stops), tmp_path / "leg.shift")
    refused(capsys, "belong to no stop of the scene, which has skin, bone",
            (tmp_path / "leg.shift", *words))  # fmt: skip
    away = replace(model, anchors=model.anchors + np.array([0, 500, 0], np.float32))
    write_package(away, tmp_path / "far.shift")
    refused(capsys, "none of the photos shows anything of the scene",
            (tmp_path / "far.shift", *words))  # fmt: skip


def test_the_ground_of_a_completed_scene_travels_with_it(given, tmp_path):
    specs = [
        {"label": n, "name": name, "collider": None} for n, name in ((1, "left"), (2, "right"))
    ]
    objects = tmp_path / "objects.json"
    objects.write_text(json.dumps({"format": "shapeshift-objects 1", "objects": specs}))
    out = tmp_path / "cut.scene.json"
    words = [given / "room.shift", given / "capture", "--masks", given / "masks"]
    words += ["--objects", objects, "--out", out]
    assert cli.main(["segment", *map(str, words)]) == 0
    file = read_scene_file(out)
    assert file.background.collider == "cut.colliders/background.glb"
    assert [item.collider for item in file.items] == [None, None]
    assert (tmp_path / "cut.colliders" / "background.glb").is_file()
    assert cli.main(["segment", *map(str, words)]) == 2  # nothing is overwritten
