"""What is not read is refused by its own name, in one sentence that says what to do."""

import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model

PNG = b"\x89PNG\r\n\x1a\n" + bytes(40)
FILES: dict[str, tuple[str, bytes, str]] = {
    "empty PLY": ("a.ply", b"", "is empty: it has 0 bytes"),
    "empty file": ("a", b"", "is empty"),
    "PLY without a beginning": ("a.ply", b"perty float x\n" * 40, "does not begin with 'ply'"),
    "spz without a beginning": ("a.spz", b"\0" * 40, "does not begin with gzip's mark or 'NGSP'"),
    "glb without a beginning": ("a.glb", b"\0" * 40, "does not begin with 'glTF'"),
    "cut package": ("a.shift", b"PK\3\4" + bytes(40), "is not a package: it is no zip"),
    "no package": ("a.shift", b"nothing", "does not begin with a zip's mark"),
    "no checkpoint": ("a.ckpt", b"nothing", "does not begin with a zip's mark"),
    "pickle": ("a.pt", b"\x80\x02}q\x00.", "is a bare pickle of Python.*torch.save"),
    "rad": ("a.rad", b"RAD0" + bytes(99), "a tree of levels for Spark .*open the PLY"),
    "splatv": ("a.splatv", bytes(99), r"\(.splatv\).*SpacetimeGaussians"),
    "safetensors": ("a.safetensors", struct.pack("<Q", 2) + b"{}", "file of tensors.*as a PLY"),
    "tile set": ("tileset.json", json.dumps({"asset": {"version": "1.1"}, "geometricError": 1,
                 "root": {}}).encode(), "a tile set of 3D Tiles.*open one of its .glb"),
    "b3dm": ("a.b3dm", b"b3dm" + bytes(40), "a tile of 3D Tiles"),
    "SuperSplat page": ("a.html", b"<!DOCTYPE html><title>SuperSplat Viewer</title>",
                        "a SuperSplat page.*as .ply or .sog"),
    "web page": ("a.ply", b"<!DOCTYPE html><title>404 Not Found</title>", "is a web page"),
    "ssproj": ("a.ssproj", b"PK\3\4" + bytes(40), "a project of SuperSplat"),
    "Postshot": ("a.psht", bytes(40), "a project of Postshot"),
    "OBJ": ("a.obj", b"v 0 0 0\n", "is a mesh.*collider in a scene file"),
    "STL": ("a.stl", bytes(84), "is a mesh"),
    "FBX": ("a.fbx", b"Kaydara FBX Binary  \0", "is a mesh"),
    "LAS": ("a.las", b"LASF" + bytes(400), "a laser scan.*--points"),
    "E57": ("a.e57", b"ASTM-E57" + bytes(40), "a laser scan"),
    "picture": ("a.png", PNG, "is a picture.*the command train"),
    "photo": ("a.jpg", b"\xff\xd8\xff\xe0" + bytes(40), "is a picture"),
    "film": ("a.mp4", b"\0\0\0\x20ftypisom", "is a film"),
    "npy": ("a.npy", b"\x93NUMPY\1\0", "single array of numpy"),
    "rar": ("a.rar", b"Rar!\x1a\7", "is an archive; unpack|is an archive, which"),
    "tar": ("a.tar", bytes(600), r"an archive \(tar\)"),
    "PDF": ("a.pdf", b"%PDF-1.7", "a document"),
    "HDF5": ("a.h5", b"\x89HDF\r\n", "a file of HDF5"),
    "text": ("a.txt", b"hello", "is of no known format; wanted is a package"),
    "JSON": ("a.json", b"{}", "is of no known format"),
    "Luma": ("a.zip", b"", "is a zip with 2 files"),
    "empty zip": ("b.zip", b"PK\5\6" + bytes(18), "is a zip with 0 files|no known format"),
}  # fmt: skip


@pytest.mark.parametrize("how", FILES)
def test_a_foreign_file_is_told_by_its_name(tmp_path, how):
    name, data, words = FILES[how]
    path = tmp_path / name
    path.write_bytes(data)
    if how == "Luma":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("field.luma", b"x")
            archive.writestr("preview.mp4", b"x")
    with pytest.raises(BadFile, match=words) as refusal:
        read_model(path)
    said = str(refusal.value)
    assert "\n" not in said and len(said) - len(str(path)) < 330 and said.endswith("."), said


@pytest.mark.parametrize(
    "address", ["https://example.org/a.ply", "http:/example.org/a.ply", "HTTPS://example.org"]
)
def test_an_address_is_told_by_its_name(address):
    with pytest.raises(BadFile, match="is an address of the web; download the file"):
        read_model(Path(address))


def test_brush_s_own_test_scene_is_refused_by_name(data):
    path = data / "splats_misc" / "brush_tiny_case.safetensors"
    with pytest.raises(BadFile, match=r"a file of tensors \(.safetensors\)"):
        read_model(path)


def test_ply_of_splats_with_plain_colours(tmp_path):
    """red, green, blue in place of f_dc, as some converters write: no point cloud."""
    from tests.support.splats.ply_files import names_of, random_rows, write_rows

    names = [n for n in names_of(1) if not n.startswith(("f_dc", "n"))]
    rows = random_rows(5, names)
    shades = np.random.default_rng(0).integers(0, 256, (5, 3))
    for row, shade in zip(rows, shades, strict=True):
        row.update(zip(("red", "green", "blue"), map(int, shade), strict=True))
    for kind, divisor in (("uchar", 255), ("float", 1)):
        kinds = dict.fromkeys(("red", "green", "blue"), kind)
        for row, shade in zip(rows, shades, strict=True):
            values = shade if kind == "uchar" else shade / 255
            row.update(zip(("red", "green", "blue"), values.tolist(), strict=True))
        model = read_model(write_rows(tmp_path / f"{kind}.ply", rows, kinds))
        found = 0.5 + 0.28209479177387814 * model.sh[:, 0]
        np.testing.assert_allclose(found, shades / 255, atol=1e-6)
        assert model.sh.shape[1] == 1 and not model.extra and divisor
