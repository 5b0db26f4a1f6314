"""Files of .spz made by hand for the tests, and a reader that takes one splat at a time."""

import gzip
import math
import struct

import numpy as np

REST = (0, 3, 8, 15, 24)


def random_streams(count: int, version: int, degree: int, seed: int = 0) -> list[bytes]:
    """Places, alphas, colours, scales, rotations, harmonics with every code in them."""
    rng = np.random.default_rng(seed)
    sizes = (9, 1, 3, 3, 4 if version >= 3 else 3, 3 * REST[degree])
    streams = [rng.integers(0, 256, count * size, np.uint8).tobytes() for size in sizes]
    if version == 1:
        streams[0] = rng.normal(size=3 * count).astype("<f2").tobytes()
    if version >= 3:  # what a writer makes: the largest really is
        q = rng.normal(size=(count, 4))
        words = [pack_quaternion(row / np.linalg.norm(row)) for row in q]
        streams[4] = struct.pack(f"<{count}I", *words)
    return streams


def pack_quaternion(xyzw: np.ndarray) -> int:
    """The smallest three of one quaternion."""
    largest = max(range(4), key=lambda i: abs(xyzw[i]))
    word = largest
    for i in range(4):
        if i != largest:
            negative = (xyzw[i] < 0) != (xyzw[largest] < 0)
            word = word << 10 | negative << 9 | round(511 * abs(xyzw[i]) * math.sqrt(2))
    return word


def legacy(
    count: int, version: int, degree: int, streams: list[bytes], bits: int = 12, flags: int = 0,
    extensions: bytes = b"", raw: bool = False,
) -> bytes:  # fmt: skip
    """A file of version 1 to 3."""
    head = struct.pack("<4sIIBBBB", b"NGSP", version, count, degree, bits, flags, 0)
    data = head + b"".join(streams) + extensions
    return data if raw else gzip.compress(data)


def modern(
    count: int, degree: int, streams: list[bytes], bits: int = 12, flags: int = 0,
    extensions: bytes = b"", version: int = 4,
) -> bytes:  # fmt: skip
    """A file of version 4."""
    import zstandard

    streams = [s for s in streams if s]
    packed = [zstandard.ZstdCompressor().compress(s) for s in streams]
    table = 32 + len(extensions)
    head = struct.pack(
        "<4sIIBBBBI12x", b"NGSP", version, count, degree, bits, flags, len(streams), table
    )
    rows = b"".join(
        struct.pack("<QQ", len(p), len(s)) for p, s in zip(packed, streams, strict=True)
    )
    return head + extensions + rows + b"".join(packed)


def splat_by_hand(streams: list[bytes], i: int, version: int, degree: int, bits: int) -> dict:
    """Splat i in plain Python numbers."""
    places, alphas, colors, scales, rotations, rest = streams
    if version == 1:
        mean = struct.unpack_from("<3e", places, 6 * i)
    else:
        at = [9 * i + 3 * k for k in range(3)]
        codes = [int.from_bytes(places[a : a + 3], "little", signed=True) for a in at]
        mean = [code / 2**bits for code in codes]
    if version >= 3:
        (word,) = struct.unpack_from("<I", rotations, 4 * i)
        largest, xyzw = word >> 30, [0.0] * 4
        for k in (3, 2, 1, 0):
            if k != largest:
                xyzw[k] = (word & 511) / 511 / math.sqrt(2) * (-1 if word & 512 else 1)
                word >>= 10
        xyzw[largest] = math.sqrt(max(0, 1 - sum(v * v for v in xyzw)))
    else:
        xyz = [code / 127.5 - 1 for code in rotations[3 * i : 3 * i + 3]]
        xyzw = [*xyz, math.sqrt(max(0, 1 - sum(v * v for v in xyz)))]
    size = 3 * REST[degree]
    return {
        "means": mean,
        "scales": [code / 16 - 10 for code in scales[3 * i : 3 * i + 3]],
        "wxyz": [xyzw[3], *xyzw[:3]],
        "opacity": alphas[i] / 255,
        "sh": [(code / 255 - 0.5) / 0.15 for code in colors[3 * i : 3 * i + 3]]
        + [(code - 128) / 128 for code in rest[size * i : size * (i + 1)]][:45],
    }


def spz_of(splats, axes: str, version: int, named: int | None = None, bits: int = 12) -> bytes:
    """A file of splats of SH degree 0 or 1 as another writer stores it, in axes such as RDF.

    splats: in ours, right up back.  named: the number that the extension gives; None: without one.
    Places, rotations and harmonics are taken to those axes by a matrix, a mirrored one, too.
    """
    columns = {"R": (0, 1), "L": (0, -1), "U": (1, 1), "D": (1, -1), "B": (2, 1), "F": (2, -1)}
    turn = np.zeros((3, 3))
    for row, letter in enumerate(axes):
        column, sign = columns[letter]
        turn[row, column] = sign  # file from ours
    count = len(splats.means)
    codes = np.rint((splats.means @ turn.T) * 2.0**bits).astype("<i4")
    places = codes.view(np.uint8).reshape(-1, 3, 4)[:, :, :3].tobytes()
    words = []
    for wxyz in splats.wxyz:
        matrix = turn @ matrix_of(wxyz)
        matrix[:, 0] *= np.linalg.det(turn)  # an axis of a splat and its minus are the same
        xyzw = xyzw_of(matrix)
        if version < 3:  # x y z of the one whose w is positive
            codes = np.rint((xyzw[:3] * np.copysign(1, xyzw[3]) + 1) * 127.5)
            words.append(codes.astype(np.uint8).tobytes())
        else:
            words.append(struct.pack("<I", pack_quaternion(xyzw)))
    rest = b""
    if splats.sh.shape[1] == 4:  # degree 1 is -y, z, -x, times the same number
        vectors = splats.sh[:, [3, 1, 2]] * [[-1], [-1], [1]]
        turned = np.einsum("ij,njc->nic", turn, vectors)
        harmonics = turned[:, [1, 2, 0]] * [[-1], [1], [-1]]
        rest = np.rint(harmonics * 128 + 128).clip(0, 255).astype(np.uint8).tobytes()
    streams = [
        places,
        np.rint(splats.opacity * 255).astype(np.uint8).tobytes(),
        np.rint((splats.sh[:, 0] * 0.15 + 0.5) * 255).clip(0, 255).astype(np.uint8).tobytes(),
        np.rint((np.log(splats.scales) + 10) * 16).clip(0, 255).astype(np.uint8).tobytes(),
        b"".join(words),
        rest,
    ]
    said = b"" if named is None else struct.pack("<III", 0xADBE0003, 4, named)
    kind = {"flags": 2 if said else 0, "extensions": said, "bits": bits}
    degree = 1 if rest else 0
    if version == 4:
        return modern(count, degree, streams, **kind)
    return legacy(count, version, degree, streams, **kind)


def matrix_of(wxyz: np.ndarray) -> np.ndarray:
    """(3, 3) of a unit quaternion."""
    w, x, y, z = (float(v) for v in wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def xyzw_of(matrix: np.ndarray) -> np.ndarray:
    """(4,) x y z w of a rotation, by the largest of the four."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    rows = np.array(
        [
            [1 + a - e - i, b + d, c + g, h - f],
            [b + d, 1 - a + e - i, f + h, c - g],
            [c + g, f + h, 1 - a - e + i, d - b],
            [h - f, c - g, d - b, 1 + a + e + i],
        ]
    )
    row = rows[np.argmax(rows.diagonal())]
    return row / np.linalg.norm(row)
