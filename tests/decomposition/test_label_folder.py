"""Label maps of photos: found by name, at the photo's size, straight where the photo is bent."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.decomposition.label_folder import find_maps, read_map, stop_of
from shapeshift.decomposition.masks.label_maps import SILENT, write_label_map
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.undistort import pinhole_of
from shapeshift.scene.pose import View, look_at, perspective

FIXTURES = Path(__file__).resolve().parents[1] / "fixtures"
DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SIZE = (64, 48)
STOPS = (Stop("RGB", 0.0), Stop("Thermal", 1.0))


def view(size=SIZE) -> View:
    return View(look_at((0, 0, 3), (0, 0, 0)), perspective(0.8, size), 0.05, 100.0, size)


def photo(path: Path, modality: str = "RGB") -> Photo:
    return Photo(view(), path, modality)


def squares(size=SIZE) -> np.ndarray:
    """(H, W) uint8: patches of 8 pixels of labels that differ by much from their neighbours."""
    y, x = np.mgrid[: size[1], : size[0]] // 8
    return (60 * ((x + 2 * y) % 4)).astype(np.uint8)


def test_maps_are_found_by_the_photos_names(tmp_path):
    names = ["rgb/0.jpg", "rgb/1.png", "thermal/0.png", "thermal/9.png"]
    capture = Capture(tmp_path / "c", STOPS, tuple(photo(tmp_path / "c" / name) for name in names))
    maps = tmp_path / "m"
    for name in ("rgb/0.png", "rgb/1.png.png", "9.png", "0.png"):  # 0 is of two photos: unclear
        (maps / name).parent.mkdir(parents=True, exist_ok=True)
        write_label_map(squares(), maps / name)
    found = [(str(p.path.relative_to(tmp_path / "c")), str(m.relative_to(maps)))
             for p, m in find_maps(maps, capture)]  # fmt: skip
    assert found == [("rgb/0.jpg", "rgb/0.png"), ("rgb/1.png", "rgb/1.png.png"),
                     ("thermal/9.png", "9.png")]  # fmt: skip
    with pytest.raises(BadFile, match=r"called rgb/0[.]png"):
        find_maps(tmp_path, capture)


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_each_pixel_has_the_label_of_its_middle(tmp_path, factor):
    write_label_map(squares(), tmp_path / "0.png")
    small, labels = read_map(tmp_path / "0.png", photo(tmp_path / "0.jpg"), factor)
    assert small.size == labels.shape[::-1] == (SIZE[0] // factor, SIZE[1] // factor)
    for y, x in np.ndindex(labels.shape):
        assert labels[y, x] == squares()[int((y + 0.5) * factor), int((x + 0.5) * factor)]


@pytest.mark.parametrize("k1", [0.2, -0.2])
@pytest.mark.parametrize("factor", [1, 2])
def test_a_bent_photo_and_its_labels_are_straightened_alike(tmp_path, k1, factor):
    lens = ColmapCamera("SIMPLE_RADIAL", SIZE, (50.0, 32.0, 24.0, k1))
    bent = replace(photo(tmp_path / "p.png"), lens=lens, view=view(pinhole_of(lens).size))
    Image.fromarray(squares()).save(tmp_path / "p.png")
    write_label_map(squares(), tmp_path / "m.png")
    small, labels = read_map(tmp_path / "m.png", bent, factor)
    pixels = load_photo(bent, factor)
    grey = pixels.rgb[..., 0]
    assert labels.shape == grey.shape == small.size[::-1]
    assert np.array_equal(labels == SILENT, pixels.lost)
    # The photo is blended where squares meet, labels never are; elsewhere both say the same.
    assert set(np.unique(labels)) <= {0, 60, 120, 180, SILENT}
    pure = np.isin(grey, (0, 60, 120, 180)) & ~pixels.lost
    for axis in (0, 1):
        for step in (-1, 1):
            pure &= np.roll(grey, step, axis) == grey
    assert pure.sum() > 20 and np.array_equal(labels[pure], grey[pure])


def test_a_photo_shows_the_stop_of_its_modality():
    assert stop_of(photo(Path("a"), "thermal"), STOPS) is STOPS[1]
    assert stop_of(photo(Path("a"), "anything"), STOPS[:1]) is STOPS[0]
    with pytest.raises(BadFile, match="'depth' belong to no stop of the scene, which has RGB, T"):
        stop_of(photo(Path("a"), "depth"), STOPS)


@pytest.mark.parametrize("name,capture", [("plush", "plush_snowmiku"), ("fern", "fern_llff")])
def test_drawn_maps_belong_to_the_photos_of_their_captures(name, capture):
    """Ten each, with the thing, the rest, and pixels that are not marked."""
    folder = DATA / capture
    if not folder.is_dir():
        pytest.skip(f"{capture} is not here")
    found = find_maps(FIXTURES / "drawn_labels" / name, read_capture(folder))
    assert len(found) == 10
    for photo, path in found[:2]:
        _, labels = read_map(path, photo, 4)
        assert np.unique(labels).tolist() == [0, 1, 255]
