"""SOG scenes of random codes, as folder or zip, and what one splat of them is, by hand."""

import io
import json
import math
import zipfile
from pathlib import Path

import numpy as np
from PIL import Image

COEFFICIENTS = (0, 3, 8, 15)
NAMES = {
    "means": ["means_l.webp", "means_u.webp"],
    "scales": ["scales.webp"],
    "quats": ["quats.webp"],
    "sh0": ["sh0.webp"],
    "shN": ["shN_centroids.webp", "shN_labels.webp"],
}


def random_sog(count: int, version: int = 2, bands: int = 0, palette: int = 100, seed: int = 0):
    """(meta, {name: (H, W, 4) uint8}) with every code somewhere, the extremes first."""
    rng = np.random.default_rng(seed)
    width = 4 * math.ceil(math.sqrt(count) / 4)
    height = 4 * math.ceil(count / width / 4)
    names = [name for part in ("means", "scales", "quats", "sh0") for name in NAMES[part]]
    pictures = {name: rng.integers(0, 256, (height, width, 4), dtype=np.uint8) for name in names}
    for picture in pictures.values():
        picture.reshape(-1, 4)[:2] = [[0] * 4, [255] * 4][: min(2, height * width)]
    pictures["quats.webp"][..., 3] = rng.integers(252, 256, (height, width))
    ends = {"mins": [-1.5, -2.5, 0.25], "maxs": [1.0, 3.0, 0.5]}
    meta = {
        "means": ends | {"files": NAMES["means"]},
        "scales": {"files": NAMES["scales"]},
        "quats": {"files": NAMES["quats"]},
        "sh0": {"files": NAMES["sh0"]},
    }
    if version == 1:
        meta["means"]["shape"] = [count, 3]
        meta["scales"] |= {"mins": [-9, -8.5, -7], "maxs": [-1, -2, -3.5]}
        meta["sh0"] |= {"mins": [-2, -1, -3, -4.5], "maxs": [3, 2, 1, 6.5]}
    else:
        meta |= {"version": 2, "count": count}
        for part in ("scales", "sh0"):
            meta[part]["codebook"] = sorted(rng.normal(size=256) - 3 * (part == "scales"))
    if bands:
        row = 64 * COEFFICIENTS[bands]
        codes = rng.integers(0, 256, (math.ceil(palette / 64), row, 4), dtype=np.uint8)
        pictures["shN_centroids.webp"] = codes
        labels = rng.integers(0, palette, (height, width))
        pictures["shN_labels.webp"] = np.stack(
            [labels & 255, labels >> 8, labels * 0, labels * 0 + 255], -1
        ).astype(np.uint8)
        meta["shN"] = {"files": NAMES["shN"]}
        if version == 1:
            meta["shN"] |= {"mins": -0.75, "maxs": 1.25}
        else:
            meta["shN"] |= {
                "count": palette,
                "bands": bands,
                "codebook": list(rng.normal(size=256)),
            }
    return meta, pictures


def webp(picture: np.ndarray, **options) -> bytes:
    out = io.BytesIO()
    options = {"lossless": True, "exact": True, "method": 0} | options
    Image.fromarray(picture).save(out, "WEBP", **options)
    return out.getvalue()


def write_folder(folder: Path, meta: dict, pictures: dict) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "meta.json").write_text(json.dumps(meta))
    for name, picture in pictures.items():
        (folder / name).write_bytes(webp(picture))
    return folder


def write_zip(file: Path, meta: dict, pictures: dict, top: str = "", **options) -> Path:
    with zipfile.ZipFile(file, "w", **options) as archive:
        for name, picture in pictures.items():
            archive.writestr(top + name, webp(picture))
        archive.writestr(top + "meta.json", json.dumps(meta))
    return file


def splat_by_hand(meta: dict, pictures: dict, number: int) -> dict:
    """One splat's numbers, one after the other, in the file's coding."""
    rows = {name: [int(c) for c in p.reshape(-1, 4)[number]] for name, p in pictures.items()
            if name != "shN_centroids.webp"}  # fmt: skip
    first = meta.get("version") != 2
    mean = []
    for axis in range(3):
        code = rows["means_l.webp"][axis] + 256 * rows["means_u.webp"][axis]
        low, high = meta["means"]["mins"][axis], meta["means"]["maxs"][axis]
        bent = low + (high - low) * code / 65535
        mean.append(math.copysign(math.exp(abs(bent)) - 1, bent))

    def decoded(part: str, channel: int, code: int) -> float:
        if not first:
            return meta[part]["codebook"][code]
        low, high = meta[part]["mins"], meta[part]["maxs"]
        if part != "shN":
            low, high = low[channel], high[channel]
        return low + (high - low) * code / 255

    a, b, c = ((code / 255 - 0.5) * math.sqrt(2) for code in rows["quats.webp"][:3])
    d = math.sqrt(max(0.0, 1 - a * a - b * b - c * c))
    mode = rows["quats.webp"][3] - 252
    wxyz = [(d, a, b, c), (a, d, b, c), (a, b, d, c), (a, b, c, d)][mode]
    alpha = rows["sh0.webp"][3]
    sh = [[decoded("sh0", i, rows["sh0.webp"][i]) for i in range(3)]]
    if "shN" in meta:
        label = rows["shN_labels.webp"][0] + 256 * rows["shN_labels.webp"][1]
        picture = pictures["shN_centroids.webp"]
        each = picture.shape[1] // 64
        for k in range(each):
            pixel = picture[label // 64, (label % 64) * each + k]
            sh.append([decoded("shN", i, int(pixel[i])) for i in range(3)])
    return {
        "means": mean,
        "scales": [decoded("scales", i, rows["scales.webp"][i]) for i in range(3)],
        "wxyz": wxyz,
        "opacity": decoded("sh0", 3, alpha) if first else alpha / 255,
        "sh": sh,
    }


COUNTS = (400, 150, 60, 20)  # splats of each level, finest first


def write_streamed(folder: Path, counts=COUNTS, **changes) -> Path:
    """Two nodes below the root; level i in file i, the second node's splats first in it."""
    folder.mkdir()
    first, second = {}, {}
    for level, count in enumerate(counts):
        write_folder(folder / f"{level}_0", *random_sog(count, bands=1, seed=level))
        part = count // 3
        second[str(level)] = {"file": level, "offset": 0, "count": part}
        first[str(level)] = {"file": level, "offset": part, "count": count - part}
    meta = {
        "lodLevels": len(counts),
        "environment": None,
        "filenames": [f"{level}_0/meta.json" for level in range(len(counts))],
        "tree": {"bound": {}, "children": [{"lods": first}, {"lods": second}]},
    }
    (folder / "lod-meta.json").write_text(json.dumps(meta | changes))
    return folder


def rewrite(folder: Path, change) -> Path:
    """Lets `change` alter the lod-meta.json in place."""
    file = folder / "lod-meta.json"
    meta = json.loads(file.read_text())
    change(meta)
    file.write_text(json.dumps(meta))
    return folder
