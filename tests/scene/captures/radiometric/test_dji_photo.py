"""DJI's radiometric JPEG through an installed converter, of which a stand-in has the command line.

The stand-in writes what dji-thermal-cli's manual promises: NAME_temp_c.tiff, Deflate, float32 °C.
"""

import io
import os
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.radiometric import dji_photo
from shapeshift.scene.captures.radiometric.dji_photo import is_dji
from shapeshift.scene.captures.radiometric.number_photos import is_radiometric, radiometric_celsius
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.inspection.emissivity import camera_settings
from tests.support.scene.captures import simple, write_transforms

STAND_IN = """#!{python}
import pathlib, sys
import numpy as np
from PIL import Image
told = dict(zip(sys.argv[2::2], sys.argv[3::2]))
assert sys.argv[1] == "process" and told["-o"] == "temp_c:tiff", sys.argv
photos = sorted(pathlib.Path(told["--input-dir"]).iterdir())
out = pathlib.Path(told["--output-dir"])
out.mkdir(parents=True, exist_ok=True)
for photo in photos:
    data = photo.read_bytes()
    hot = int.from_bytes(data[data.index(b"HOT ") + 4 :][:2], "big")
    if hot == 999:
        sys.exit("damaged thermal data")
    celsius = np.full((12, 16), hot, np.float32)
    celsius[0, 0] = -273.15
    name = out / (photo.stem + "_temp_c.tiff")
    Image.fromarray(celsius).save(name, compression="tiff_adobe_deflate")
"""


def segment(marker: int, body: bytes) -> bytes:
    return bytes([0xFF, marker]) + struct.pack(">H", len(body) + 2) + body


def write_dji(path: Path, hot: int, maker: bytes = b"DJI", markers=(0xE3, 0xE4, 0xE5)) -> None:
    """A JPEG of 16x12 with the segments that ExifTool's documentation of DJI names."""
    held = io.BytesIO()
    Image.new("L", (16, 12), 90).save(held, "JPEG")
    data = held.getvalue()
    extra = segment(0xE1, b"Exif\0\0" + maker + b"\0M3T")
    extra += b"".join(segment(m, b"HOT " + struct.pack(">H", hot) + bytes(60)) for m in markers)
    path.write_bytes(data[:2] + extra + data[2:])


@pytest.fixture
def program(tmp_path, monkeypatch):
    """On the PATH; its folder."""
    if os.name != "posix":
        pytest.skip("the stand-in is a script of a POSIX shell's PATH")
    folder = tmp_path / "bin"
    folder.mkdir()
    file = folder / dji_photo.PROGRAM
    file.write_text(STAND_IN.format(python=sys.executable))
    file.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    return folder


def test_degrees_come_from_the_converter(program, tmp_path, monkeypatch):
    photo = tmp_path / "DJI_0001_T.JPG"
    write_dji(photo, 57)
    assert is_radiometric(photo)
    celsius = radiometric_celsius(photo, (16, 12))
    assert np.isnan(celsius[0, 0]) and (celsius.ravel()[1:] == 57).all()
    larger = radiometric_celsius(photo, (32, 24))  # the picture has more pixels
    assert larger.shape == (24, 32) and (larger[4:] == 57).all()
    with pytest.raises(BadFile, match="not read; say them"):
        camera_settings(photo)
    monkeypatch.chdir(program)  # a program of the folder of now is none
    assert dji_photo.converter() == ""


def test_a_capture_of_them_has_their_range(program, tmp_path):
    folder = tmp_path / "capture"
    folder.mkdir()
    frames, rest = simple(folder, 4)
    for i in range(3):
        write_dji(folder / f"heat{i}.jpg", 20 + 10 * i)
        frames[i] |= {"modality": "Heat", "file_path": f"heat{i}.jpg"}
    frames[3] |= {"modality": "RGB"}
    stops = [{"name": "RGB", "x": 0}, {"name": "Heat", "x": 1, "kind": "thermal"}]
    write_transforms(folder, frames, **rest, modalities=stops)
    heat = read_capture(folder).stops[-1]
    assert heat.unit == "°C" and heat.value_range == pytest.approx((19, 41), abs=0.2)


@pytest.mark.parametrize(
    "maker, markers",
    [(b"Canon", (0xE3, 0xE4)), (b"DJI", (0xE4,)), (b"DJI", (0xE3,)), (b"DJI", ())],
)
def test_other_photos_are_none(tmp_path, maker, markers):
    photo = tmp_path / "a.jpg"
    write_dji(photo, 57, maker, markers)
    assert not is_dji(photo) and not is_radiometric(photo)


@pytest.mark.parametrize("cut", [0, 1, 2, 3, 5, 30, 80])
def test_a_cut_file_is_none_and_hangs_nothing(tmp_path, cut):
    whole = tmp_path / "a.jpg"
    write_dji(whole, 57)
    part = tmp_path / "b.jpg"
    part.write_bytes(whole.read_bytes()[:cut])
    assert not is_dji(part)
    assert not is_dji(tmp_path / "missing.jpg")


def test_without_the_program_one_sentence_says_which(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    photo = tmp_path / "a.jpg"
    write_dji(photo, 57)
    with pytest.raises(BadFile, match="pipx install dji-thermal-cli") as refused:
        radiometric_celsius(photo, (16, 12))
    assert "\n" not in str(refused.value)


def test_what_the_converter_cannot_read_is_one_sentence(program, tmp_path):
    photo = tmp_path / "a.jpg"
    write_dji(photo, 999)
    with pytest.raises(BadFile, match=r"gave no temperatures \(damaged thermal data\)"):
        radiometric_celsius(photo, (16, 12))
