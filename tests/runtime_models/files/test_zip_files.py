"""What ends as a zip: asked of Python's own zipfile, which also raises where it should say no."""

import io
import struct
import zipfile

import pytest

from shapeshift.runtime_models.files.zip_files import is_zip
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model

END_OF_DIRECTORY = 22  # bytes, at the end of a zip without a comment


def zip_of_disks(disks: int, disk: int = 0) -> bytes:
    """A zip whose 64-bit locator says so many disks."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("data.pkl", b"x")
    data = out.getvalue()
    locator = struct.pack("<4sLQL", b"PK\6\7", disk, 0, disks)
    return data[:-END_OF_DIRECTORY] + locator + data[-END_OF_DIRECTORY:]


@pytest.mark.parametrize("disks,disk", [(2, 0), (1, 1), (0xFFFFFFFF, 0)])
@pytest.mark.parametrize("name", ["a.pt", "a.ckpt", "a.shift", "a.npz", "a.zip"])
def test_a_zip_of_several_disks_is_refused_in_a_sentence(tmp_path, name, disks, disk):
    path = tmp_path / name
    path.write_bytes(zip_of_disks(disks, disk))
    assert not is_zip(path)
    with pytest.raises(BadFile) as refused:
        read_model(path)
    assert str(refused.value).endswith(".") and name in str(refused.value)


@pytest.mark.parametrize(
    "data,zipped", [(b"", False), (b"PK", False), (b"PK\5\6" + bytes(18), True)]
)
def test_what_ends_as_a_zip_is_one(tmp_path, data, zipped):
    """As Python says it; a directory that ends at once is an empty zip."""
    path = tmp_path / "a.zip"
    path.write_bytes(data)
    assert is_zip(path) is zipped is zipfile.is_zipfile(path)
