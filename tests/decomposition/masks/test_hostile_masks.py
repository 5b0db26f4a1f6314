"""Label maps and object lists made to do harm: one sentence, in time and in little memory."""

import os
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("hypothesis")

from shapeshift.decomposition.masks.label_maps import read_label_map, write_label_map
from shapeshift.decomposition.masks.specs import FORMAT, read_specs
from shapeshift.runtime_models.model import BadFile
from tests.support.hostile.fuzz_run import check_sentence, watched


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def bomb(path: Path, side: int) -> None:
    """A grey PNG of side x side pixels in a few bytes."""
    head = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    data = zlib.compress(bytes(1 << 20))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data))


def refused(read, path: Path) -> str:
    with watched(0), pytest.raises(BadFile) as caught:
        read(path)
    check_sentence(str(caught.value), path.parent)
    return str(caught.value)


@pytest.mark.parametrize("side", [1 << 14, 1 << 20, (1 << 31) - 1])
def test_a_map_of_more_pixels_than_its_photo(tmp_path, side):
    bomb(tmp_path / "a.png", side)
    refused(lambda path: read_label_map(path, (64, 48)), tmp_path / "a.png")


def test_a_map_of_one_colour_as_large_as_a_large_photo_is_read(tmp_path):
    """24 million pixels in 24 kB: more than 8 million out of so few bytes is a bomb elsewhere."""
    size = (6000, 4000)
    write_label_map(np.zeros(size[::-1], np.uint8), tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size < 100_000
    assert not read_label_map(tmp_path / "a.png", size).any()


@pytest.mark.skipif(os.name == "nt", reason="no pipes by name")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.png")
    refused(lambda path: read_label_map(path, (4, 4)), tmp_path / "a.png")
    refused(read_specs, tmp_path / "a.png")


def test_object_lists(tmp_path):
    path = tmp_path / "objects.json"
    rows = ",".join(f'{{"label": {i % 254 + 1}, "name": "{i}"}}' for i in range(300))
    for text in (
        '{"format": "' + FORMAT + '", "objects": ' + "[" * 100_000,
        '{"format": "' + FORMAT + '", "objects": [' + rows + "]}",
        '{"format": "' + FORMAT + '", "objects": [{"label": ' + "9" * 5000 + ', "name": "a"}]}',
        '{"format": "' + FORMAT + '", "objects": [{"label": 1, "name": "a\\n\\u202eb"}]}',
        '{"format": "' + FORMAT + '", "objects": [{"label": NaN, "name": "a"}]}',
        '{"format": "' + FORMAT + '", "objects": [{"label": 1, "name": "' + "a" * 90000 + '"}]}',
    ):
        path.write_text(text)
        refused(read_specs, path)
    path.write_bytes(bytes(1000))
    refused(read_specs, path)
