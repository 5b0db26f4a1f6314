"""segment --objects: boxes in one photo each, with a segmenter, without, interrupted, refused."""

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyopencl")

from shapeshift.app import cli
from shapeshift.app.paths import DEMO
from shapeshift.decomposition.masks import sam_files
from shapeshift.decomposition.masks.label_maps import SILENT, read_label_map, write_label_map
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.document.read_scene_file import read_scene_file
from tests.support.decomposition.demo_photos import (
    COUNT,
    SIZE,
    TrueSegmenter,
    box_of_object,
    demo,
    true_maps,
    write_demo_capture,
)
from tests.support.decomposition.sam_stand_ins import write_sam
from tools.synthetic.labels import LABELS

NAMES = ("cabinet", "mug")


@pytest.fixture(scope="module")
def given(tmp_path_factory) -> Path:
    """capture/, objects.json, truth/ and a stand-in segmenter in sam/."""
    folder = tmp_path_factory.mktemp("prompts")
    write_demo_capture(folder / "capture")
    rows = []
    for name in NAMES:
        label = LABELS[name]
        view = int(np.argmax([(labels == label).sum() for labels in true_maps()[1]]))
        said = {"photo": f"rgb/{view:03}.png", "box": box_of_object(view, label)}
        rows.append({"label": label, "name": name, "prompts": [said], "mass_kg": 0.4})
    write_objects(folder / "objects.json", rows)
    for i, labels in enumerate(true_maps()[1]):
        (folder / "truth/rgb").mkdir(parents=True, exist_ok=True)
        known = np.isin(labels, [LABELS[name] for name in NAMES])
        write_label_map(
            np.where(known, labels, 0).astype(np.uint8), folder / f"truth/rgb/{i:03}.png"
        )
    (folder / "sam").mkdir()
    write_sam(folder / "sam", "sam", 256)
    return folder


def write_objects(path: Path, rows: list[dict]) -> None:
    path.write_text(json.dumps({"format": "shapeshift-objects 1", "objects": rows}))


def segment(given: Path, *words) -> int:
    return cli.main(
        ["segment", str(DEMO), str(given / "capture"), "--no-complete", *map(str, words)]
    )


def refused(capsys, words: str, given: Path, *arguments) -> None:
    assert segment(given, *arguments) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("shapeshift segment: ") and words in said, said


def test_without_a_network_a_box_each_cuts_compact_things_out(given, tmp_path, capsys):
    out = tmp_path / "cut.scene.json"
    words = (
        "--objects",
        given / "objects.json",
        "--out",
        out,
        "--score",
        given / "truth",
        "--json",
    )
    assert segment(given, *words) == 0
    told = capsys.readouterr()
    facts = json.loads(told.out)
    assert set(facts["objects"]) == set(NAMES) and facts["miou"] > 0.55  # .63; true maps: .77
    assert "No --segmenter" in told.err
    scene = read_scene_file(out)
    assert [item.name for item in scene.items] == list(NAMES) and scene.items[0].mass_kg == 0.4
    model = read_model(tmp_path / "cut.shift")
    assert set(np.unique(model.labels)) == {0, *(LABELS[name] for name in NAMES)}
    assert not (tmp_path / "cut.masks").exists()


def test_with_a_segmenter_label_maps_are_kept_and_counts_are_told(
    given, tmp_path, capsys, monkeypatch
):
    """The truth answers instead of SAM; what it gave can be handed in again as --masks."""
    answering(monkeypatch, given)
    out = tmp_path / "cut.scene.json"
    words = ("--objects", given / "objects.json", "--score", given / "truth", "--json")
    assert segment(given, *words, "--out", out, "--segmenter", given / "sam") == 0
    told = capsys.readouterr()
    first = json.loads(told.out)
    assert first["miou"] > 0.65  # .72; true maps of all photos: .77
    assert first["objects"]["cabinet"]["accepted"] >= 3
    maps = sorted((tmp_path / "cut.masks").rglob("*.png"))
    assert [path.name for path in maps] == [f"{i:03}.png" for i in range(COUNT)]
    labels = {LABELS[name] for name in NAMES} | {0, SILENT}
    assert all(set(np.unique(read_label_map(path, SIZE))) <= labels for path in maps)
    assert not list(tmp_path.glob("*.unfinished"))
    again = tmp_path / "again.scene.json"
    assert segment(given, *words, "--out", again, "--masks", tmp_path / "cut.masks") == 0
    second = json.loads(capsys.readouterr().out)
    assert second["miou"] == pytest.approx(first["miou"], abs=0.02)


def answering(monkeypatch, given: Path, stops_after: int = 10**6) -> TrueSegmenter:
    """Opens the truth in place of the networks; it is interrupted after so many questions."""
    pixels = [np.rint(255 * np.clip(demo().look(v, 0.0), 0, 1)).astype(np.uint8)
              for v in true_maps()[0]]  # fmt: skip
    segmenter = TrueSegmenter(pixels)
    ask = segmenter.candidates

    def asked(encoded: int, prompt) -> list:
        if segmenter.asked >= stops_after:
            raise KeyboardInterrupt
        return ask(encoded, prompt)

    segmenter.candidates = asked
    monkeypatch.setattr(sam_files, "open_segmenter", lambda folder: segmenter)
    return segmenter


def test_who_is_interrupted_goes_on_with_the_same_command(given, tmp_path, capsys, monkeypatch):
    out = tmp_path / "cut.scene.json"
    words = ("--objects", given / "objects.json", "--out", out, "--segmenter", given / "sam")
    whole = answering(monkeypatch, given)
    assert segment(given, *words[:2], "--out", tmp_path / "whole.scene.json", *words[4:]) == 0
    answering(monkeypatch, given, stops_after=20)
    assert segment(given, *words) not in (0, 2)
    told = capsys.readouterr().err
    assert "keeps the masks so far; the same command goes on there" in told
    assert "Traceback" not in told and not out.exists()
    assert (tmp_path / "cut.masks.unfinished").is_dir()
    rest = answering(monkeypatch, given)
    assert segment(given, *words) == 0
    assert rest.asked <= whole.asked - 15 and not (tmp_path / "cut.masks.unfinished").exists()
    for path in sorted((tmp_path / "whole.masks").rglob("*.png")):
        other = tmp_path / "cut.masks" / path.relative_to(tmp_path / "whole.masks")
        assert path.read_bytes() == other.read_bytes()


def test_what_cannot_be_meant(given, tmp_path, capsys):
    out = ("--out", tmp_path / "cut.scene.json")
    objects = ("--objects", given / "objects.json")
    refused(capsys, "give --objects objects.json with a prompt", given, *out)
    refused(capsys, "leave out --segmenter", given, *out, *objects, "--masks", given / "truth",
            "--segmenter", given / "sam")  # fmt: skip
    refused(capsys, "--photos is 0", given, *out, *objects, "--photos", 0)
    refused(capsys, "is no folder", given, *out, *objects, "--segmenter", given / "none")
    refused(capsys, "no .onnx file", given, *out, *objects, "--segmenter", given / "truth")
    (tmp_path / "cut.masks").mkdir()
    refused(capsys, "cut.masks exists", given, *out, *objects, "--segmenter", given / "sam")
    row = {"label": 1, "name": "thing"}
    for prompts, words in (
        ([], "object 'thing' has no prompt"),
        ([{"photo": "rgb/99.png", "box": [0, 0, 9, 9]}], "none of the capture's 8 photos"),
        ([{"photo": "000.png", "box": [0, 0, 999, 9]}], "lies outside of rgb/000.png"),
        ([{"photo": "000.png", "mask": "no.png"}], "is missing"),
    ):
        write_objects(tmp_path / "o.json", [row | {"prompts": prompts}])
        refused(capsys, words, given, *out, "--objects", tmp_path / "o.json")
    assert not (tmp_path / "cut.scene.json").exists() and not (tmp_path / "cut.shift").exists()


def test_a_text_that_nobody_reads_is_said(given, tmp_path, capsys, monkeypatch):
    answering(monkeypatch, given)
    data = json.loads((given / "objects.json").read_text())
    rows = [row | {"text": "a grey box"} for row in data["objects"][:1]]
    write_objects(tmp_path / "o.json", rows)
    words = ("--objects", tmp_path / "o.json", "--out", tmp_path / "cut.scene.json")
    assert segment(given, *words, "--segmenter", given / "sam", "--photos", 3) == 0
    told = capsys.readouterr().err
    assert "the truth does not read: 'text' is not used." in told
    assert len(list((tmp_path / "cut.masks").rglob("*.png"))) == 3
