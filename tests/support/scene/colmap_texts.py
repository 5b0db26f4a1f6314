"""COLMAP's text tables as programs and journeys leave them: each way, out of well-formed ones."""

from collections.abc import Callable
from pathlib import Path

import pycolmap

NAMES = ("IMG 0 (1).JPG", "sub folder/a b.png", "20240501", "12.5 7", "nan", "x.y.z.tif")
Change = Callable[[bytes], bytes]


def well_formed(folder: Path, frames: int = 3) -> pycolmap.Reconstruction:
    """Tables as pycolmap writes them, of two cameras of one rig, every image with points."""
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig = 1, 2
    options.num_frames_per_rig, options.num_points3D = frames, 12
    options.num_points2D_without_point3D = 3
    made = pycolmap.synthesize_dataset(options)
    folder.mkdir(parents=True, exist_ok=True)
    made.write_text(folder)
    return made


def lines(data: bytes) -> list[bytes]:
    return data.decode().rstrip("\n").encode().split(b"\n")


def without_points(data: bytes) -> list[bytes]:
    """Comments and the lines of images alone: those that end in a name."""
    return [row for row in lines(data) if row.startswith(b"#") or row.rstrip().endswith(b".png")]


def joined(rows: list[bytes]) -> bytes:
    return b"\n".join(rows) + b"\n"


def between(data: bytes, row: bytes) -> bytes:
    """A further line after every line."""
    return joined([each for line in lines(data) for each in (line, row)])


def with_points(data: bytes, row: bytes) -> bytes:
    """images.txt with one and the same line of points behind every image."""
    images = without_points(data)
    return joined([each for line in images
                   for each in ([line] if line.startswith(b"#") else [line, row])])  # fmt: skip


def longer(data: bytes, by: float) -> bytes:
    """images.txt with quaternions `by` times as long."""
    out = []
    for row in lines(data):
        words = row.split()
        if row.rstrip().endswith(b".png") and not row.startswith(b"#"):
            words[1:5] = [repr(float(word) * by).encode() for word in words[1:5]]
            row = b" ".join(words)
        out.append(row)
    return joined(out)


# Of every table.
EVERY: dict[str, Change] = {
    "as it is": lambda data: data,
    "CR LF": lambda data: data.replace(b"\n", b"\r\n"),
    "lone CR": lambda data: data.replace(b"\n", b"\r"),
    "CR CR LF": lambda data: data.replace(b"\n", b"\r\r\n"),
    "byte order mark": lambda data: b"\xef\xbb\xbf" + data,
    "mark and CR LF": lambda data: b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n"),
    "UTF-16 with mark": lambda data: data.decode().encode("utf-16"),
    "UTF-16, big end first": lambda data: b"\xfe\xff" + data.decode().encode("utf-16-be"),
    "UTF-16 without mark": lambda data: data.decode().encode("utf-16-le"),
    "no last line end": lambda data: data.rstrip(b"\n"),
    "many last line ends": lambda data: data + b"\n\n \n",
    "empty lines between all": lambda data: between(data, b""),
    "comments between all": lambda data: between(data, b"# 1 1 0 0 0 0 0 0 1 comment.png"),
    "no comments": lambda data: joined([r for r in lines(data) if not r.startswith(b"#")]),
    "tabs, spaces at the ends": lambda data: joined(
        [b"\t" + row.replace(b" ", b"\t") + b"  " for row in lines(data) if row]
    ),
}
# Of images.txt alone.
IMAGES: dict[str, Change] = {
    "one line an image": lambda data: joined(without_points(data)),
    "one line an image, CR LF": lambda data: b"\r\n".join(without_points(data)),
    "empty lines for points": lambda data: with_points(data, b""),
    "last line of points missing": lambda data: joined(lines(data)[:-1]),
    "points of every second alone": lambda data: joined([
        row for i, row in enumerate(lines(data))
        if row in without_points(data) or i % 4 == 1
    ]),
    "one image's points lost": lambda data: joined(lines(data)[:5] + lines(data)[6:]),
    "points of nan": lambda data: with_points(data, b"nan 1 -1 2 inf 7 8 9 -1"),
    "one point each": lambda data: with_points(data, b"12 13 7"),
    "three points each": lambda data: with_points(data, b"12 13 7 14 15 8 16 17 9"),
    "four points each": lambda data: with_points(data, b"12 13 7 14 15 8 16 17 9 1 2 -1"),
    "quaternions of length 2": lambda data: longer(data, 2.0),
    "quaternions turned round": lambda data: longer(data, -1.0),
    "quaternions of 1e-6": lambda data: longer(data, 1e-6),
    "quaternions of 1e200": lambda data: longer(data, 1e200),
    "quaternions of 1e-300": lambda data: longer(data, 1e-300),
}  # fmt: skip
# Names with letters beyond ASCII, and the code page of the machine that wrote the table.
PAGES = {
    "cp1252": "Küche (1).png",
    "cp1250": "łazienka.png",
    "cp1251": "комната.png",
    "cp932": "写真_001.png",
    "gbk": "厨房照片.png",
    "cp949": "사진.png",
    "cp437": "Straße.png",
}


def named(folder: Path, names: dict[str, bytes]) -> None:
    """Other names for images, as bytes, in images.txt."""
    path = folder / "images.txt"
    data = path.read_bytes()
    for old, new in names.items():
        data = data.replace(b" " + old.encode() + b"\n", b" " + new + b"\n")
    path.write_bytes(data)
