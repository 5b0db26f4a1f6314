"""Kept colliders: in the user's cache alone, found again, bounded, made anew where damaged."""

import os
from pathlib import Path

import numpy as np
import pytest

from shapeshift.scene.colliders import collider_cache
from shapeshift.scene.colliders.collider import Making, collider_of_splats
from shapeshift.scene.colliders.collider_cache import (
    MARK,
    content_key,
    pack,
    read_cached,
    unpack,
    write_cached,
)
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from tests.support.scene.collider_shapes import shapes, splatted

KEY = "0123456789abcdef" * 4
posix = pytest.mark.skipif(os.name == "nt", reason="links need rights on Windows")


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch) -> Path:
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.setenv(name, str(tmp_path / "own"))
    return tmp_path / "own" / "shapeshift" / "colliders"


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


def test_what_is_kept_is_found_in_the_users_cache(own_folder):
    made = some_made()
    assert write_cached(KEY, made) == own_folder / f"{KEY}.collider"
    assert same(read_cached(KEY), made)
    assert read_cached(KEY[::-1]) is None
    if os.name != "nt":
        assert own_folder.stat().st_mode & 0o077 == 0


def test_nothing_is_written_beside_a_scene(tmp_path):
    cloud = splatted(shapes()["sphere"], 500)
    before = set(tmp_path.iterdir())
    made = collider_of_splats(*cloud.columns)
    assert {path.name for path in set(tmp_path.iterdir()) - before} == {"own"}
    assert same((made.parts, made.mesh), read_cached(next(kept(tmp_path)).stem))


def kept(tmp_path: Path):
    return (tmp_path / "own").rglob("*.collider")


def test_nowhere_to_keep_is_no_harm(tmp_path):
    (tmp_path / "own").write_text("a file where the user's cache should be")
    assert write_cached(KEY, some_made()) is None and read_cached(KEY) is None


@posix
@pytest.mark.parametrize("where", ["shapeshift", "shapeshift/colliders"])
def test_a_link_in_the_way_is_not_followed(tmp_path, where):
    victim = tmp_path / "victim"
    victim.mkdir()
    for number in range(3):
        (victim / f"{number:064x}.collider").write_bytes(b"mine")
    link = tmp_path / "own" / where
    link.parent.mkdir(parents=True)
    link.symlink_to(victim)
    assert write_cached(KEY, some_made()) is None and read_cached(f"{0:064x}") is None
    assert len(list(victim.iterdir())) == 3


@posix
def test_a_link_in_place_of_a_file_is_replaced(tmp_path, own_folder):
    mine = tmp_path / "mine"
    write_cached(KEY, some_made(1))
    (own_folder / f"{KEY}.collider").rename(mine)
    (own_folder / f"{KEY}.collider").symlink_to(mine)
    before = mine.read_bytes()
    assert read_cached(KEY) is None
    path = write_cached(KEY, some_made(2))
    assert not path.is_symlink() and same(read_cached(KEY), some_made(2))
    assert mine.read_bytes() == before


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes in folders")
def test_a_pipe_in_place_of_a_file_is_not_waited_for(own_folder):
    write_cached(KEY, some_made()).unlink()
    (own_folder / f"{KEY}.collider").mkdir()
    assert read_cached(KEY) is None and write_cached(KEY, some_made()) is None


def test_every_damage_is_seen():
    made = some_made()
    data = pack(made)
    assert same(unpack(data), made)
    for end in range(len(data)):
        assert unpack(data[:end]) is None
    for place in range(len(data)):
        assert unpack(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]) is None
    assert unpack(data + b"\0") is None and unpack(b"") is None


def sealed(body: bytes) -> bytes:
    return MARK + collider_cache.hashlib.sha256(body).digest() + body


def test_a_digest_over_nonsense_is_no_collider():
    """A file that was made to fit its digest is no way in either."""
    rng = np.random.default_rng(0)
    for size in (0, 4, 12, 16, 40, 400):
        for counts in ((0, 0, 0), (1, 4, 4), (2**32 - 1,) * 3, (2, 1, 1), (1, 2**31, 0)):
            assert unpack(sealed(np.array(counts, "<u4").tobytes() + rng.bytes(size))) is None


@pytest.mark.parametrize("hulls", [64, 65, 6000])
def test_more_hulls_than_an_engine_can_hold_are_none(hulls):
    corners = np.eye(4, 3, dtype=np.float32)
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]], np.int32)
    found = unpack(pack(((corners,) * hulls, TriangleMesh(corners, faces))))
    assert (found is not None) == (hulls <= 64)


@pytest.mark.parametrize("number", [np.nan, np.inf])
@pytest.mark.parametrize("place", ["hull", "mesh"])
def test_numbers_that_are_none_are_no_collider(number, place):
    hulls, mesh = some_made()
    (hulls[1] if place == "hull" else mesh.vertices)[2, 1] = number
    assert unpack(pack((hulls, mesh))) is None


def test_a_damaged_file_is_made_again(tmp_path):
    cloud = splatted(shapes()["sphere"], 500)
    heard = []
    making = Making(progress=lambda what, part: heard.append(what))
    first = collider_of_splats(*cloud.columns, making)
    (path,) = kept(tmp_path)
    whole = path.read_bytes()
    heard.clear()
    again = collider_of_splats(*cloud.columns, making)
    assert heard == ["making a collider"]  # nothing was made
    assert same((again.parts, again.mesh), (first.parts, first.mesh))
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
    assert len(keys) == 7 and {len(key) for key in keys} == {64}  # all of a SHA-256
    assert content_key("a", one) == content_key("a", np.asfortranarray(one))


@posix
def test_the_oldest_files_go_first_and_only_ours(own_folder, monkeypatch, tmp_path):
    size = len(pack(some_made()))
    monkeypatch.setattr(collider_cache, "MOST_ALL", 3 * size)
    own_folder.mkdir(parents=True)
    others = ("notes.collider", f"{KEY}.txt", f"{KEY[:40]}.collider")
    for name in others:
        (own_folder / name).write_bytes(b"x" * size)
        os.utime(own_folder / name, (0, 0))
    (own_folder / f"{'f' * 64}.collider").symlink_to(own_folder / others[0])
    keys = [f"{number:064x}" for number in range(5)]
    for number, key in enumerate(keys):
        os.utime(write_cached(key, some_made()), (number + 1, number + 1))
        if number == 2:
            assert read_cached(keys[0]) is not None  # used: young again
    left = {path.stem for path in own_folder.iterdir() if path.name not in others}
    assert left == {keys[0], keys[3], keys[4], "f" * 64}
    assert all((own_folder / name).exists() for name in others)


def test_a_huge_file_is_not_read(monkeypatch):
    path = write_cached(KEY, some_made())
    monkeypatch.setattr(collider_cache, "MOST_BYTES", path.stat().st_size - 1)
    assert read_cached(KEY) is None
