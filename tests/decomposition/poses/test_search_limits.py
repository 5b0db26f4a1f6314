"""What a search for poses may take: pycolmap reads the photos of strangers itself."""

from pathlib import Path

import pytest

pytest.importorskip("pycolmap", reason="pycolmap is not installed")

from shapeshift.decomposition.poses.find_poses import PoseSettings, allowed_s, find_poses
from shapeshift.decomposition.poses.photo_list import list_photos
from shapeshift.runtime_models.model import BadFile
from tests.support.scene.textured_room import write_photos

MODULE = "shapeshift.decomposition.poses.find_poses"
SETTINGS = PoseSettings(threads=2)


def quiet(*_: object) -> None:
    pass


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("room") / "photos"
    write_photos(folder, 5)
    return folder


def test_one_that_takes_too_long_is_ended_and_the_same_call_goes_on(room, tmp_path, monkeypatch):
    out = tmp_path / "capture"
    with monkeypatch.context() as patch:
        patch.setattr(f"{MODULE}.allowed_s", lambda job: 0.2)
        with pytest.raises(BadFile, match="took longer than these photos should take"):
            find_poses(list_photos(room), out, SETTINGS, quiet)
    assert not (out / "sparse").exists()
    assert find_poses(list_photos(room), out, SETTINGS, quiet).placed == 5


def test_one_without_memory_is_one_sentence(room, tmp_path, monkeypatch):
    monkeypatch.setattr(f"{MODULE}.machine_memory", lambda: 1 << 27)
    with pytest.raises(BadFile, match="perhaps for want of memory"):
        find_poses(list_photos(room), tmp_path / "capture", SETTINGS, quiet)


def test_the_time_grows_with_photos_and_pairs():
    """A real capture of 20 photos and 190 pairs takes 21 s of the 2,750 that it may take."""
    assert allowed_s({"groups": [["a", "b"], ["c"]], "pairs": 3}) == 600 + 3 * 60 + 3 * 5
