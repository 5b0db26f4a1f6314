"""Scene.segment: a scene and photos to a scene of objects that move."""

import numpy as np
import pytest

pytest.importorskip("pyopencl")

import shapeshift as ss
from tests.support.decomposition.demo_photos import box_of_object, true_maps, write_demo_capture
from tools.synthetic.labels import LABELS

LABEL = LABELS["mug"]


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    return write_demo_capture(tmp_path_factory.mktemp("library") / "capture").folder


@pytest.fixture(scope="module")
def mug() -> ss.ObjectSpec:
    view = int(np.argmax([(labels == LABEL).sum() for labels in true_maps()[1]]))
    said = ss.PhotoPrompt(f"rgb/{view:03}.png", box=box_of_object(view, LABEL))
    return ss.ObjectSpec(LABEL, "mug", (said,), mass_kg=0.3)


def test_a_box_makes_an_object_that_moves(capture, mug, tmp_path, capsys):
    scene = ss.load(ss.DEMO)
    told = []
    out = tmp_path / "room.scene.json"
    parts = scene.segment(
        capture, out, objects=[mug], complete=False, progress=lambda *step: told.append(step)
    )
    assert [obj.name for obj in parts.objects] == ["background", "mug"] or {
        obj.name for obj in parts.objects
    } == {"background", "mug"}
    assert 100 < parts.objects["mug"].model.splat_count < scene.splat_count // 20
    moved = parts.objects["mug"].move(by=(0, 0.2, 0))
    before, after = (s.render(size=(64, 48)) for s in (parts, moved))
    assert np.abs(np.asarray(before) - np.asarray(after)).max() > 0.05
    assert told and told[-1][1] <= told[-1][2]
    assert capsys.readouterr() == ("", "")  # a library says nothing by itself
    assert ss.load(out).splat_count == parts.splat_count == scene.splat_count


def test_what_cannot_be_meant(capture, mug, tmp_path):
    scene, out = ss.load(ss.DEMO), tmp_path / "room.scene.json"
    with pytest.raises(ss.UsageError, match="objects with a prompt each are wanted"):
        scene.segment(capture, out)
    with pytest.raises(ss.UsageError, match="leave out segmenter"):
        scene.segment(capture, out, masks=tmp_path, segmenter=tmp_path)
    with pytest.raises(ss.UsageError, match=r"ends in [.]scene[.]json"):
        scene.segment(capture, tmp_path / "room.json", objects=[mug])
    with pytest.raises(ss.BadFile, match="two objects have the label"):
        scene.segment(capture, out, objects=[mug, mug])
    with pytest.raises(ss.BadFile, match="'label' is 0"):
        scene.segment(capture, out, objects=[ss.ObjectSpec(0, "none")])
    with pytest.raises(ss.BadFile, match="has no prompt"):
        scene.segment(capture, out, objects=[ss.ObjectSpec(3, "thing")])
    assert not list(tmp_path.iterdir())
