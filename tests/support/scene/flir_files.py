"""Radiometric JPEG files as FLIR cameras write them, made from temperatures by Planck's law.

The layout is the one that ExifTool's documentation of FLIR tags publishes: APP1 segments "FLIR\\0",
together a file "FFF\\0" with a directory of records at 0x40; record 1 holds raw numbers, record 32
what makes temperatures of them.
"""

import io
import struct
from pathlib import Path

import numpy as np
from PIL import Image

R1, R2, B, F, O = 14911.1846, 0.0108, 1396.6, 1.0, -6303  # of a camera of the E series
KELVIN = 273.15
RAW, CAMERA = 1, 32  # types of records
SEGMENT = 60_000  # bytes of numbers a segment


def raw_counts(celsius: np.ndarray) -> np.ndarray:
    """What the camera's detector counts: Planck's law, a black body without air before it."""
    return np.rint(radiation(celsius)).astype(np.uint16)


def radiation(celsius: np.ndarray | float) -> np.ndarray:
    """The same before it is counted."""
    kelvin = np.asarray(celsius, np.float64) + KELVIN
    return R1 / (R2 * (np.exp(B / kelvin) - F)) - O


def camera_record(saturated: tuple[float, float] | None = None, emissivity: float = 1) -> bytes:
    """At no distance; of emissivity 1 temperatures are those of the surface.  saturated: °C, where
    the camera's numbers end.
    """
    out = bytearray(1000)
    if saturated is not None:
        struct.pack_into("<ff", out, 168, saturated[1] + KELVIN, saturated[0] + KELVIN)
    for offset, value in (
        (32, emissivity), (36, 0.0), (40, 293.15), (44, 293.15), (48, 293.15), (52, 1.0), (60, 0.5),
        (88, R1), (92, B), (96, F), (112, 0.006569), (116, 0.01262), (120, -0.002276),
        (124, -0.00667), (128, 1.9), (780, R2),
    ):  # fmt: skip
        struct.pack_into("<f", out, offset, value)
    struct.pack_into("<i", out, 776, O)
    return bytes(out)


def raw_record(counts: np.ndarray, png: bool) -> bytes:
    height, width = counts.shape
    head = struct.pack("<HHH", 2, width, height).ljust(32, b"\0")
    if not png:
        return head + counts.astype("<u2").tobytes()
    held = io.BytesIO()
    Image.fromarray(counts.byteswap()).save(held, format="PNG")  # as cameras do: bytes swapped
    return head + held.getvalue()


def write_flir(
    path: Path, celsius: np.ndarray, size: tuple[int, int], png: bool = False,
    camera: bytes | None = None,
) -> Path:  # fmt: skip
    """A picture of `size` (W, H) in false colours with the numbers (H, W) in it."""
    records = {RAW: raw_record(raw_counts(celsius), png), CAMERA: camera or camera_record()}
    directory, body, start = b"", b"", 0x40 + 32 * 6
    for kind, record in records.items():
        entry = struct.pack(">HHIIII", kind, 1, 100, 1, start + len(body), len(record))
        directory += entry.ljust(32, b"\0")
        body += record
    head = b"FFF\0" + b"test".ljust(16, b"\0") + struct.pack(">III", 100, 0x40, 6)
    flir = head.ljust(0x40, b"\0") + directory.ljust(32 * 6, b"\0") + body
    parts = [flir[i : i + SEGMENT] for i in range(0, len(flir), SEGMENT)]
    segments = b""
    for number, part in enumerate(parts):
        inner = b"FLIR\0\x01" + bytes([number, len(parts) - 1]) + part
        segments += b"\xff\xe1" + struct.pack(">H", len(inner) + 2) + inner
    shown = np.clip((celsius - celsius.min()) / max(np.ptp(celsius), 1e-9) * 255, 0, 255)
    red = Image.fromarray(np.uint8(shown)).resize(size)
    held = io.BytesIO()
    Image.merge("RGB", (red, red.point(lambda v: 255 - v), red)).save(held, format="JPEG")
    jpeg = held.getvalue()
    path.write_bytes(jpeg[:2] + segments + jpeg[2:])
    return path
