"""Photos of a measured quantity that is no heat: their range, palette and unit, what is refused."""

import json

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.captures import simple, write_transforms
from tests.support.scene.strangers.situations import Shot, write_colmap

HEIGHT, WIDTH = 12, 16


def capture_of(folder, pixels, name="000.tif", **said):
    """Two photos of which the first is of values; pixels: an array, or a picture of its own."""
    frames, rest = simple(folder, 2)
    picture = pixels if isinstance(pixels, Image.Image) else Image.fromarray(pixels)
    picture.save(folder / name)
    frames[0] |= {"modality": "NIR", "file_path": name}
    frames[1] |= {"modality": "RGB"}
    band = {"name": "NIR", "x": 1, "kind": "values"} | said
    write_transforms(folder, frames, **rest, modalities=[{"name": "RGB", "x": 0}, band])
    return read_capture(folder)


def ramp(dtype) -> np.ndarray:
    return np.arange(HEIGHT * WIDTH).reshape(HEIGHT, WIDTH).astype(dtype)


@pytest.mark.parametrize(
    ("said", "ends"),
    [({}, (0, 255)), ({"value_range": [0, 1]}, (0, 1)), ({"counts": [0, 191]}, (0, 191)),
     ({"counts": [0, 191], "value_range": [0, 0.6], "unit": "%", "palette": "gray"}, (0, 0.6))],
)  # fmt: skip
def test_eight_bits_are_counts_where_nothing_is_said(tmp_path, said, ends):
    capture = capture_of(tmp_path, ramp(np.uint8), **said)
    stop = capture.stops[1]
    assert stop.value_range == ends and stop.palette == said.get("palette", "viridis")
    assert stop.unit == said.get("unit", "")
    shown = load_photo(capture.photos[0]).rgb[..., 0]
    most = 191 if "counts" in said else 255
    assert np.abs(shown - ramp(float) * 255 / most).max() <= 0.5


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_sixteen_bits_and_floats_have_their_own_range(tmp_path, dtype):
    stop = capture_of(tmp_path, ramp(dtype)).stops[1]
    low, high = stop.value_range
    # From the 0.1st to the 99.9th percentile of 192 numbers, and a twentieth more at each end.
    assert -12 < low < -8 and 199 < high < 203 and stop.palette == "viridis"


def test_colours_are_no_values(tmp_path):
    grey = np.repeat(ramp(np.uint8)[..., None], 3, axis=2)
    (tmp_path / "grey").mkdir()
    assert capture_of(tmp_path / "grey", grey, "000.png").stops[1].value_range == (0, 255)
    (tmp_path / "jpeg").mkdir()
    assert capture_of(tmp_path / "jpeg", grey, "000.jpg").stops[1].palette == "viridis"
    (tmp_path / "red").mkdir()
    with pytest.raises(BadFile, match=r"a photo of colours in .NIR.*'band'"):
        capture_of(tmp_path / "red", grey * np.array([1, 0, 0], np.uint8), "000.png")


@pytest.mark.parametrize(
    ("said", "words"),
    [({"palette": "sunset"}, "no palette 'sunset'"), ({"unit": "x" * 25}, "24 printable letters"),
     ({"kind": "value"}, "kind"), ({"value_range": [2, 1]}, "value_range")],
)  # fmt: skip
def test_what_a_modality_of_values_cannot_say(tmp_path, said, words):
    with pytest.raises(BadFile, match=words):
        capture_of(tmp_path, ramp(np.uint8), "000.png", **said)


def test_info_lists_an_index_by_formula(tmp_path, capsys):
    shots = [Shot(f"{name}/{i}.png", "I;16") for name in ("red", "nir") for i in range(2)]
    write_colmap(tmp_path, shots)
    said = [{"name": n, "x": x, "kind": "values"} for n, x in (("red", 0), ("nir", 1))]
    said.append({"name": "Index", "x": 0.5, "kind": "values", "value_range": [-1, 1]}
                | {"formula": "nir - red"})  # fmt: skip
    (tmp_path / "capture.json").write_text(json.dumps({"modalities": said}))
    assert cli.main(["info", str(tmp_path)]) == 0
    assert "0.500  Index (values): by formula, nir - red\n" in capsys.readouterr().out
