"""gsplat's compressed splats: a folder with meta.json and PNG pictures, a splat a pixel.

gsplat (compression/png_compression.py): means in 16 bits, as sign(x) log(1 + |x|), the upper and
lower byte in pictures of their own; scales (logarithms), quats (w x y z), opacities (logits) and
sh0 in 8 bits; all of them between a least and a most number of each column.  shN.npz has sets of
harmonics and which of them each splat has.
"""

import io
import warnings
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.checkpoint.read_checkpoint import with_settings
from shapeshift.runtime_models.colors.spherical_harmonics import COEFFICIENTS
from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.files.npy import read_array
from shapeshift.runtime_models.files.zip_files import opened_zip
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading, empty_splats
from shapeshift.runtime_models.splats.sog.sog_files import META, SogFiles, file_inside

UP = "+Z"  # as of gsplat's checkpoints
WIDTHS = {"means": 3, "scales": 3, "quats": 4, "opacities": 1, "sh0": 3}
LARGEST_NUMBER = 1e38
MARKS = ("means_l.png", "means_u.png")  # one of them beside meta.json tells it from a SOG
MOST_BYTES = 16  # of a PNG a pixel, with a head
SMALL = 1 << 16


def is_png_folder(path: Path) -> bool:
    """Whether a folder, or the meta.json in it, is one of gsplat's."""
    folder = path.parent if path.name == META else path
    return (folder / META).is_file() and any((folder / name).is_file() for name in MARKS)


def read_raw_png_folder(path: Path, reading: Reading) -> RawSplats:
    """Splats of SH degree 0 to 3.  Raises BadFile."""
    folder = path.parent if path.name == META else path
    reading = reading.within(folder)
    memory, files = reading.account, SogFiles(folder, reading.account)
    reading.report(f"reading {folder.name}", 0.0)
    meta = files.meta()
    count = shape_of(meta, "means")[0]
    rest = shape_of(meta, "shN")[1] if "shN" in meta.data else 0
    if 1 + rest not in COEFFICIENTS:
        raise BadFile(f"{folder.name} has {rest} further harmonics; 0, 3, 8 or 15 are known.")
    raw = RawSplats(
        **empty_splats(count, 1 + rest, memory),
        file=folder.name,
        format="gsplat's PNG folder",
        up=UP,
        memory=memory,
    )
    low, high = (pixels(files, f"means_{end}.png", count, 3).astype(np.float32) for end in "lu")
    logs = spread((low + 256 * high) / np.float32(65535), meta, "means")
    with np.errstate(over="ignore"):
        raw.means[:] = np.sign(logs) * np.expm1(np.abs(logs))
    for name, into in (
        ("scales", raw.scales), ("quats", raw.wxyz), ("opacities", raw.opacity[:, None]),
        ("sh0", raw.sh[:, 0]),
    ):  # fmt: skip
        if shape_of(meta, name)[0] != count:
            raise BadFile(f"{folder.name}: {name} has another count than means; copy it again.")
        shares = pixels(files, f"{name}.png", count, WIDTHS[name]) / np.float32(255)
        into[:] = spread(shares, meta, name)
    if rest:
        raw.sh[:, 1:] = harmonics(folder, meta, count, rest, memory)
    return with_settings(raw, folder)


def shape_of(meta: Fields, part: str) -> list[int]:
    """What meta.json says of a part's array: rows first.  Raises BadFile."""
    found = meta.object(part).data.get("shape")
    if not isinstance(found, list) or not all(type(n) is int and n > 0 for n in found):
        raise BadFile(f"{meta.where}: {part} has no shape of whole numbers above 0.")
    wide = found[1:] if part == "shN" else [int(np.prod(found[1:], dtype=np.float64))]
    if (part == "shN" and (len(found) != 3 or found[2] != 3)) or (
        part in WIDTHS and wide != [WIDTHS[part]]
    ):
        raise BadFile(f"{meta.where}: {part} is of shape {str(found)[:40]}, no splats of gsplat.")
    return found


def spread(shares: np.ndarray, meta: Fields, part: str) -> np.ndarray:
    """(N, C) float32 between the least and the most number of each column; shares 0..1."""
    ends = []
    for key in ("mins", "maxs"):
        said = meta.object(part).data.get(key)
        said = said if isinstance(said, list) else [said]
        usual = all(isinstance(n, int | float) and abs(n) < LARGEST_NUMBER for n in said)
        if not usual or len(said) not in (1, shares.shape[1]):
            raise BadFile(f"{meta.where}: {part} needs finite numbers as its {key}.")
        ends.append(np.array(said, np.float32))
    return ends[0] + shares * (ends[1] - ends[0])


def pixels(files: SogFiles, name: str, count: int, width: int) -> np.ndarray:
    """(count, width) uint8 of a PNG that has as many pixels.  Raises BadFile."""
    from PIL import Image

    data = files.read(name, MOST_BYTES * count + SMALL)
    wanted = f"a PNG of {count:,} pixels with {width} channels"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            picture = Image.open(io.BytesIO(data), formats=("PNG",))
        across, down = picture.size
        if across * down != count or len(picture.getbands()) != width:
            raise BadFile(
                f"{files.name}: {name} has {across} x {down} pixels with "
                f"{len(picture.getbands())} channels, expected {wanted}; copy it again."
            )
        with files.memory.lend(8 * count, f"the picture {name}"):
            return np.asarray(picture, np.uint8).reshape(count, width)
    except BadFile:
        raise
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        raise BadFile(f"{files.name}: {name} is no {wanted[2:]}; copy it again.") from None


def harmonics(folder: Path, meta: Fields, count: int, rest: int, memory: Account) -> np.ndarray:
    """(N, rest, 3) by the sets of shN.npz and each splat's number of one.  Raises BadFile."""
    file = file_inside(folder, "shN.npz", folder.name)
    with opened_zip(file, f"{folder.name}/shN.npz", memory) as archive:
        centroids = read_array(archive, "centroids", file.name, memory)
        labels = read_array(archive, "labels", file.name, memory)
    bits = meta.object("shN").data.get("quantization")
    if not (isinstance(bits, int) and 1 <= bits <= 8):
        bits = 0
    if centroids is None or labels is None or centroids.ndim != 2 or not bits:
        raise BadFile(f"{folder.name}: shN.npz has no centroids, labels and bits; copy it again.")
    shape_fits = centroids.shape[1] == 3 * rest and labels.shape == (count,)
    if not shape_fits or labels.dtype.kind not in "ui" or centroids.dtype != np.uint8:
        raise BadFile(f"{folder.name}: shN.npz is of another scene; copy it again.")
    if len(labels) and not 0 <= int(labels.min()) <= int(labels.max()) < len(centroids):
        raise BadFile(f"{folder.name}: shN.npz has labels beyond its sets; copy it again.")
    shares = centroids.reshape(len(centroids), -1) / np.float32(2**bits - 1)
    return spread(shares.reshape(-1, 1), meta, "shN").reshape(-1, rest, 3)[labels]
