"""Files that are packed once more: gzip, and zips with one file of splats in them."""

import gzip
import zipfile
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.files.memory import FREE
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.splats.formats import format_of
from shapeshift.runtime_models.splats.gltf.write_gltf import write_gltf
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.write_compressed_ply import write_compressed_ply
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.splats.spz.write_spz import write_spz
from shapeshift.runtime_models.splats.write_splat import write_splat
from tests.support.hostile.fuzz_seeds import some_splats

WRITERS = {
    "a.ply": write_ply, "a.splat": write_splat, "a.spz": write_spz, "a.glb": write_gltf,
    "a.compressed.ply": write_compressed_ply,
}  # fmt: skip
HUGE = Reading(allow_huge=True)


def zipped(path: Path, files: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("how", ["gzip", "gzip without a name", "zip", "zip with others"])
def test_what_is_packed_is_the_file_itself(tmp_path, name, how):
    plain = tmp_path / name
    WRITERS[name](some_splats(50, 4), plain)
    data, other = plain.read_bytes(), {"readme.txt": b"hello", "__MACOSX/._a.ply": b"x"}
    if how == "zip":
        path = zipped(tmp_path / "b.zip", {name: data})
    elif how == "zip with others":
        path = zipped(tmp_path / "b.zip", {"in/the/" + name: data, **other})
    elif how == "gzip":
        (path := tmp_path / f"{name}.gz").write_bytes(gzip.compress(data))
    else:
        if name == "a.splat":
            pytest.skip("only the ending tells a .splat")
        (path := tmp_path / "b").write_bytes(gzip.compress(data))
    wanted, found = read_model(plain, HUGE), read_model(path, HUGE)
    for part in ("means", "scales", "wxyz", "opacity", "sh"):
        np.testing.assert_array_equal(getattr(found, part), getattr(wanted, part))
    inside = wanted.provenance["format"]
    assert found.provenance["format"] in (f"{inside}, packed", inside)
    assert describe(found, path)["bytes"] == path.stat().st_size
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted({name, path.name})


def test_nothing_is_left_in_the_temporary_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temp"))
    (tmp_path / "temp").mkdir()
    write_ply(some_splats(5, 1), tmp_path / "a.ply")
    path = tmp_path / "a.ply.gz"
    whole = gzip.compress((tmp_path / "a.ply").read_bytes())
    for data in (whole, whole[:-20], gzip.compress(b"ply\nnothing")):
        path.write_bytes(data)
        try:
            read_model(path, HUGE)
        except BadFile:
            pass
        assert not list((tmp_path / "temp").iterdir())


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({}, "is a zip with 0 files"),
        ({"a.txt": b"x"}, r"is a zip with 1 file \('a.txt'\): neither a package"),
        ({"a.ply": b"x", "b.splat": b"y"}, r"2 files \('a.ply', 'b.splat'\).*unpack it"),
        ({"a.ply": b"nothing"}, "holds 'a.ply', which is no file of splats"),
        ({"a.zip": b"PK"}, "1 file"),
        ({"a.obj": b"v 0 0 0", "a.mtl": b"", "a.png": b"", "b.png": b""}, r"4 files .*, \.\.\.\)"),
    ],
)
def test_other_zips_say_what_is_in_them(tmp_path, files, words):
    with pytest.raises(BadFile, match=words):
        read_model(zipped(tmp_path / "a.zip", files))


def test_a_zip_in_a_zip_and_gzip_in_gzip_are_not_opened(tmp_path):
    write_ply(some_splats(5, 1), tmp_path / "a.ply")
    data = (tmp_path / "a.ply").read_bytes()
    inner = zipped(tmp_path / "in.zip", {"a.ply": data}).read_bytes()
    with pytest.raises(BadFile, match="1 file"):
        read_model(zipped(tmp_path / "out.zip", {"in.zip": inner}))
    (tmp_path / "b.ply.gz").write_bytes(gzip.compress(gzip.compress(data)))
    with pytest.raises(BadFile, match="no file of splats"):
        read_model(tmp_path / "b.ply.gz")


def test_what_it_unpacks_to_counts_for_the_outer_file(tmp_path):
    """Zeros behind a header: refused before as much is written as the outer file may become."""
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\nend_header\n"
    (path := tmp_path / "a.ply.gz").write_bytes(gzip.compress(head + bytes(2 * FREE), 9))
    with pytest.raises(BadFile, match=r"with what it unpacks to it would take .*--memory 1 "):
        read_model(path)
    with pytest.raises(BadFile, match="a point cloud or another format"):
        read_model(path, Reading(memory_gb=1))  # who wants it has it read


def test_names_in_a_zip_never_leave_the_folder(tmp_path):
    write_ply(some_splats(5, 1), tmp_path / "a.ply")
    data = (tmp_path / "a.ply").read_bytes()
    for name in (
        "../../b.ply",
        "/etc/b.ply",
        "..\\b.ply",
        "C:\\b.ply",
        ".ply.ply",
        "é" * 90 + ".ply",
    ):
        path = zipped(tmp_path / "c.zip", {name: data})
        if format_of(path) is not None:
            assert read_model(path, HUGE).splat_count == 5
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.ply", "c.zip"]
