"""PNG files of 16 bits a number: depth, normals, coverage.  Pillow writes no such colours."""

import struct
import zlib
from pathlib import Path

import numpy as np

from shapeshift.app.drawing import SOFTWARE
from shapeshift.runtime_models.files.whole_file import write_whole

MARK = b"\x89PNG\r\n\x1a\n"
MOST = 65535
GREY, COLOR = 0, 2  # colour types
UP = 2  # filter: each row is the difference to the one above, which packs better


def write_png16(pixels: np.ndarray, path: Path, texts: dict[str, str] | None = None) -> None:
    """(H, W) or (H, W, 3) uint16 to a grey or colour PNG, whole or not at all.

    texts: Latin-1, one tEXt entry each, after the name of this program.
    """
    height, width = pixels.shape[:2]
    bytes_ = np.ascontiguousarray(pixels, ">u2").reshape(height, -1).view(np.uint8)
    rows = np.full((height, 1 + bytes_.shape[1]), UP, np.uint8)
    rows[:, 1:] = np.diff(bytes_, axis=0, prepend=np.zeros_like(bytes_[:1]))  # modulo 256
    kind = COLOR if pixels.ndim == 3 else GREY
    data = MARK + _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, kind, 0, 0, 0))
    for key, text in ({"Software": SOFTWARE} | (texts or {})).items():
        data += _chunk(b"tEXt", key.encode("latin-1") + b"\0" + text.encode("latin-1"))
    data += _chunk(b"IDAT", zlib.compress(rows.tobytes(), 6)) + _chunk(b"IEND", b"")
    write_whole(path, data)


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
