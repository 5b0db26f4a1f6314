"""Files of .ksplat made by hand for the tests, as GaussianSplats3D lays them out."""

import struct
from dataclasses import dataclass, field

import numpy as np

BANDS = ((), (3,), (3, 5), (15,))  # harmonics that lie together, by degree


@dataclass
class HandSection:
    """Rows by bucket; level 0 has one bucket that nothing is relative to."""

    buckets: list[np.ndarray]  # each (n, 3) places: codes, or metres at level 0
    centers: list[tuple[float, float, float]] = field(default_factory=list)
    degree: int = 0
    bucket_size: int = 4  # of full ones, which come first
    block: float = 5.0
    steps: int = 0  # 0: not said, 32767
    spare: int = 0  # rows that nothing was put in
    seed: int = 0


def ksplat(level: int, sections: list[HandSection], least: float = 0, most: float = 0, **said):
    """(the file, what each splat is by hand: a list of dicts)."""
    heads, bodies, splats = [], [], []
    for section in sections:
        head, body, mine = write_section(level, section, least or -1.5, most or 1.5)
        heads.append(head.ljust(1024, b"\0"))
        bodies.append(body)
        splats += mine
    said = {"major": 0, "minor": 1, "sections": len(heads), "count": len(splats)} | said
    main = struct.pack("<BBxxIIIIH", said["major"], said["minor"], said["sections"], len(heads),
                       said["count"], said["count"], said.get("level", level))  # fmt: skip
    main += bytes(14) + struct.pack("<ff", least, most)
    return main.ljust(4096, b"\0") + b"".join(heads) + b"".join(bodies), splats


def write_section(level: int, section: HandSection, least: float, most: float) -> tuple:
    rng = np.random.default_rng(section.seed)
    lengths = [len(bucket) for bucket in section.buckets]
    full = sum(1 for n in lengths if n == section.bucket_size)
    assert all(n == section.bucket_size for n in lengths[:full])
    partly = lengths[full:]
    rows, mine = b"", []
    for i, bucket in enumerate(section.buckets):
        for place in bucket:
            row, splat = write_row(level, section, i, place, rng, (least, most))
            rows += row
            mine.append(splat)
    size = len(rows) // max(1, len(mine))
    body = rows + bytes(size * section.spare)
    if level:
        centers = b"".join(struct.pack("<3f", *c) for c in section.centers)
        body = struct.pack(f"<{len(partly)}I", *partly) + centers + body
    buckets = (section.bucket_size, len(section.buckets), section.block, 12) if level else (0,) * 4
    head = struct.pack("<IIIIfHxxIIIIH", len(mine), len(mine) + section.spare, *buckets,
                       section.steps, len(body), full if level else 0,
                       len(partly) if level else 0, section.degree)  # fmt: skip
    return head, body, mine


def write_row(level, section, bucket, place, rng, ends) -> tuple[bytes, dict]:
    """One splat: its bytes, and what they stand for."""
    scale, wxyz = rng.uniform(0.001, 2, 3), rng.normal(size=4)
    rgba = rng.integers(0, 256, 4)
    number = {0: "f4", 1: "f2", 2: "f2"}[level]
    if level:
        steps = section.steps or 32767
        mean = [
            (int(code) - steps) * (section.block / 2 / steps) + center
            for code, center in zip(place, section.centers[bucket], strict=True)
        ]
        row = np.asarray(place, "<u2").tobytes()
    else:
        mean, row = place, np.asarray(place, "<f4").tobytes()
    stored = [np.asarray(a, "<" + number) for a in (scale, wxyz)]
    row += stored[0].tobytes() + stored[1].tobytes() + bytes(rgba.tolist())
    sh = [[(c / 255 - 0.5) / 0.28209479177387814 for c in rgba[:3]]]
    for band in BANDS[section.degree]:
        if level == 2:
            codes = rng.integers(0, 256, (3, band), np.uint8)
            values = ends[0] + codes / 255 * (ends[1] - ends[0])
        else:
            codes = rng.normal(size=(3, band)).astype("<" + number)
            values = codes.astype(np.float64)
        row += codes.tobytes()  # all of red, then green, then blue
        sh += [[values[channel, k] for channel in range(3)] for k in range(band)]
    return row, {
        "means": mean, "scales": stored[0], "wxyz": stored[1], "opacity": rgba[3] / 255, "sh": sh,
    }  # fmt: skip
