"""Photos of one channel, of any size beside others: counts, and from the file to the legend."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.evaluation.evaluate import evaluate_model
from shapeshift.training.synthetic.balls import make_balls
from tests.support.scene.captures import simple, write_transforms

KELVIN = 273.15
HEAT = {"name": "Heat", "x": 1, "kind": "thermal", "palette": "ironbow",
        "value_range": [15, 95], "unit": "°C", "counts": [28815, 36815]}  # fmt: skip


def capture_of(folder, values, name="000.tif", **heat) -> Capture:
    """Two photos of which the first is of heat."""
    frames, rest = simple(folder, 2)
    Image.fromarray(values).save(folder / name)
    frames[0] |= {"modality": "Heat", "file_path": name}
    frames[1] |= {"modality": "RGB"}
    modalities = [{"name": "RGB", "x": 0}, HEAT | heat]
    write_transforms(folder, frames, **rest, modalities=modalities)
    return read_capture(folder)


def picture(celsius) -> np.ndarray:
    out = np.full((12, 16), 15.0)
    out.flat[: len(celsius)] = celsius
    return out


@pytest.mark.parametrize("kind", ["centikelvin", "float"])
def test_counts_say_what_is_black_and_white(tmp_path, kind):
    celsius = picture([15, 95, 55, 0, 200, 35])
    if kind == "float":
        capture = capture_of(tmp_path, celsius.astype(np.float32), counts=[15, 95])
    else:
        counts = np.rint((celsius + KELVIN) * 100).astype(np.uint16)
        capture = capture_of(tmp_path, counts, "000.png")
    rgb, mask, _ = load_photo(capture.photos[0])
    assert mask is None and rgb.dtype == np.uint8
    np.testing.assert_allclose(rgb[0, :6, 0], [0, 255, 127.5, 0, 255, 63.75], atol=0.5)
    assert (rgb == rgb[..., :1]).all()
    assert capture.photos[1].counts is None
    write_capture(capture)
    assert read_capture(tmp_path).photos[0].counts == capture.photos[0].counts


@pytest.mark.parametrize(
    "values, heat, told",
    [
        (picture([1]).astype(np.float32), {"counts": None, "kind": "layer"}, "counts"),
        (np.zeros((12, 16, 3), np.uint8), {}, "greyscale"),
        (picture([1]).astype(np.float32), {"counts": [5, 5]}, "counts"),
        (picture([1]).astype(np.float32), {"counts": 5}, "counts"),
        (picture([1]).astype(np.float32), {"counts": [1, "a"]}, "counts"),
    ],
)
def test_refused_in_one_sentence(tmp_path, values, heat, told):
    with pytest.raises(BadFile, match=told) as refused:
        load_photo(capture_of(tmp_path, values, **heat).photos[0])
    assert "\n" not in str(refused.value)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory) -> Capture:
    """RGB of 64x64 pixels; heat of 40x40 centikelvin, narrower, from other places."""
    folder = tmp_path_factory.mktemp("mixed")
    capture = make_balls(folder, 64, 10, 2)
    photos, (low, high) = [], (20.0, 100.0)
    for photo in capture.photos:
        if photo.modality == "Thermal":
            grey = load_photo(photo).rgb[..., 0]
            small = np.asarray(Image.fromarray(grey).resize((40, 40), Image.Resampling.BOX))
            counts = np.rint((low + (high - low) * small / 255 + KELVIN) * 100)
            path = photo.path.with_name(f"counts_{photo.path.name}")
            Image.fromarray(counts.astype(np.uint16)).save(path)
            ends = ((low + KELVIN) * 100, (high + KELVIN) * 100)
            photo = replace(photo, view=photo.view.resized((40, 40)), path=path, counts=ends)
        photos.append(photo)
    write_capture(replace(capture, photos=tuple(photos)))
    return read_capture(folder)


def test_from_the_file_to_the_scene_and_its_legend(mixed, tmp_path, capsys):
    """Sixteen bits, one channel and another size train as any photo; range and unit stay."""
    out = tmp_path / "mixed.shift"
    arguments = [mixed.folder, "--out", out, "--iterations", 150, "--max-anchors", 500]
    assert cli.main(["train", *map(str, arguments)]) == 0
    model = read_model(out)
    thermal = Stop("Thermal", 1.0, "thermal", "ironbow", (20.0, 100.0), "°C")
    assert model.stops[1] == thermal == mixed.stops[1]
    scores = evaluate_model(open_device("cpu"), model, mixed)
    assert scores["Thermal"].psnr_db > 24 and scores["RGB"].psnr_db > 18, scores
    capsys.readouterr()
    assert cli.main(["eval", str(out), str(mixed.folder), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["modalities"]["Thermal"]["photos"] == 2
