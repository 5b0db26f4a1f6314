"""Kept colliders: found again, bounded, and made anew where a file is damaged."""

import os

import numpy as np
import pytest
from collider_shapes import shapes, splatted

from scene import collider_cache
from scene.collider import Making, collider_of_splats
from scene.collider_cache import content_key, find_kept, keep, pack, unpack
from scene.triangle_mesh import TriangleMesh


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(name, str(tmp_path / "own"))


def some_made(seed: int = 0):
    rng = np.random.default_rng(seed)
    vertices = rng.random((7, 3), np.float32)
    faces = rng.integers(0, 7, (9, 3)).astype(np.int32)
    return (rng.random((4, 3), np.float32), rng.random((5, 3), np.float32)), TriangleMesh(
        vertices, faces
    )


def same(one, two) -> bool:
    parts = [(*hulls, mesh.vertices, mesh.faces) for hulls, mesh in (one, two)]
    return len(parts[0]) == len(parts[1]) and all(map(np.array_equal, *parts))


def test_what_is_kept_is_found_beside_the_scene(tmp_path):
    made = some_made()
    path = keep("key", made, tmp_path)
    assert path.parent == tmp_path / collider_cache.FOLDER
    assert same(find_kept("key", tmp_path), made)
    assert find_kept("other", tmp_path) is None and find_kept("key", None) is None


def test_a_folder_that_cannot_be_written_leaves_the_users(tmp_path):
    wall = tmp_path / "scene"
    wall.write_text("a file where the scene's folder should be")
    path = keep("key", some_made(), wall)
    assert (tmp_path / "own") in path.parents
    assert same(find_kept("key", wall), some_made())


def test_nowhere_to_keep_is_no_harm(tmp_path, monkeypatch):
    wall = tmp_path / "wall"
    wall.write_text("")
    monkeypatch.setattr(collider_cache, "folders", lambda beside: [wall / "a"])
    assert keep("key", some_made(), wall) is None and find_kept("key", wall) is None


def test_every_damage_is_seen():
    made = some_made()
    data = pack(made)
    assert same(unpack(data), made)
    for end in range(len(data)):
        assert unpack(data[:end]) is None
    for place in range(len(data)):
        assert unpack(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]) is None
    assert unpack(data + b"\0") is None and unpack(b"") is None


def test_a_digest_over_nonsense_is_no_collider():
    """A file that was made to fit its digest is no way in either."""
    rng = np.random.default_rng(0)
    mark, seal = collider_cache.MARK, collider_cache.hashlib.sha256
    for size in (0, 4, 12, 16, 40, 400):
        for counts in ((0, 0, 0), (1, 4, 4), (2**32 - 1,) * 3, (2, 1, 1), (1, 2**31, 0)):
            body = np.array(counts, "<u4").tobytes() + rng.bytes(size)
            assert unpack(mark + seal(body).digest() + body) is None


def test_a_damaged_file_is_made_again(tmp_path):
    cloud = splatted(shapes()["sphere"], 500)
    heard = []
    making = Making(beside=tmp_path, told=lambda what, part: heard.append(what))
    first = collider_of_splats(*cloud.columns, making)
    (path,) = (tmp_path / collider_cache.FOLDER).iterdir()
    whole = path.read_bytes()
    heard.clear()
    again = collider_of_splats(*cloud.columns, making)
    assert heard == ["making a collider"]  # nothing was made
    assert same((again.hulls, again.mesh), (first.hulls, first.mesh))
    path.write_bytes(whole[:-5])
    collider_of_splats(*cloud.columns, making)
    assert "wrapping the splats" in heard and path.read_bytes() == whole
    assert [p.name for p in path.parent.iterdir()] == [path.name]  # nothing half-written


def test_another_content_or_wish_is_another_key():
    one = np.arange(6, dtype=np.float32).reshape(2, 3)
    keys = {
        content_key("a", one),
        content_key("b", one),
        content_key("a", one.reshape(3, 2)),
        content_key("a", one.view(np.int32)),
        content_key("a", one + 1),
        content_key("a", one[::-1]),
        content_key("a", one, one),
    }
    assert len(keys) == 7
    assert content_key("a", one) == content_key("a", np.asfortranarray(one))


def test_the_oldest_files_go_first(tmp_path, monkeypatch):
    monkeypatch.setattr(collider_cache, "MOST_FILES", 3)
    for number in range(5):
        path = keep(f"key{number}", some_made(number), tmp_path)
        os.utime(path, (number + 1, number + 1))
        if number == 2:
            assert find_kept("key0", tmp_path) is not None  # used: young again
    left = {path.stem for path in path.parent.iterdir()}
    assert left == {"key0", "key3", "key4"}


def test_a_huge_file_is_not_read(tmp_path, monkeypatch):
    path = keep("key", some_made(), tmp_path)
    monkeypatch.setattr(collider_cache, "MOST_BYTES", path.stat().st_size - 1)
    assert find_kept("key", tmp_path) is None
