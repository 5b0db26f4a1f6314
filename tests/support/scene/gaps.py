"""Heat photos in which some pixels hold no value, in each form in which programs write that."""

import json
from pathlib import Path

import numpy as np
from PIL import Image, TiffImagePlugin

GDAL_NODATA = 42113
LOWEST = float(np.finfo(np.float32).min)
SIZE = (32, 24)
# Of a photo's numbers: file ending, what stands where there is no value, the tag's text, and what
# capture.json says beside.
FORMS = {
    "nan": (".tif", np.nan, None, {}),
    "inf": (".tif", np.inf, None, {}),
    "minus inf": (".tif", -np.inf, None, {}),
    "tag": (".tif", -9999, "-9999", {}),
    "tag in words": (".tif", -9999, " -9.999e3 ", {}),
    "tag of two": (".tif", -9999, "-32767 -9999", {}),
    "tag nan": (".tif", np.nan, "nan", {}),
    "tag lowest": (".tif", LOWEST, "-3.4028234663852886e+38", {}),
    "tag short": (".tif", LOWEST, "-3.40282e+38", {}),
    "lowest": (".tif", LOWEST, None, {}),
    "tag of counts": (".u16", 0, "0", {}),
    "tag of full counts": (".u16", 65535, "65535", {}),
    "tag of signed counts": (".i16", -32768, "-32768", {}),
    "transparent grey": (".png", 7, "7", {}),
    "said": (".tif", -32767, None, {"no_data": -32767}),
    "said as a list": (".u16", 65535, None, {"no_data": [0, 65535]}),
    "below the range": (".tif", -60, None, {"valid_range": [-40, 550]}),
    "above the range": (".tif", 550.5, None, {"valid_range": [-40, 550]}),
    "npy": (".npy", np.nan, None, {}),
    "csv": (".csv", np.nan, "nan", {}),
    "csv of blanks": (".csv", np.nan, "", {}),
    "csv of dashes": (".csv", np.nan, "--", {}),
    "csv of errors": (".csv", np.nan, "#VALUE!", {}),
    "csv of C": (".csv", np.nan, "-1.#IND", {}),
}


def warm(number: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    """(H, W) float32 whole degrees 20 to 99, another picture each number."""
    rng = np.random.default_rng(number)
    return rng.integers(20, 100, size[::-1]).astype(np.float32)


def border(size: tuple[int, int] = SIZE, wide: int = 2) -> np.ndarray:
    """(H, W) bool: the pixels along the edges."""
    out = np.ones(size[::-1], bool)
    out[wide:-wide, wide:-wide] = False
    return out


def write_numbers(path: Path, values: np.ndarray, ending: str, tag: str | None) -> Path:
    """Numbers in one of FORMS, as programs write them; path: without an ending."""
    if ending == ".npy":
        np.save(path.with_suffix(ending), values)
        return path.with_suffix(ending)
    if ending == ".csv":
        rows = [[tag if np.isnan(v) else f"{v:g}" for v in row] for row in values]
        path.with_suffix(ending).write_text("\n".join(map(",".join, rows)) + "\n")
        return path.with_suffix(ending)
    kind = {".u16": np.uint16, ".i16": np.int16, ".png": np.uint16}
    values = values.astype(kind.get(ending, np.float32))
    if ending == ".png":
        target, image = path.with_suffix(".png"), Image.fromarray(values)
        image.save(target, transparency=int(tag))  # the chunk tRNS
        return target
    target = path.with_suffix(".tif")
    write_tiff(target, values, tag)
    return target


def write_tiff(path: Path, values: np.ndarray, tag: str | None) -> None:
    """One strip of plain numbers, little endian, by TIFF 6.0; Pillow writes not all of these."""
    ifd = TiffImagePlugin.ImageFileDirectory_v2()
    bands = 1 if values.ndim == 2 else values.shape[2]
    sample = {"f": 3, "i": 2, "u": 1}[values.dtype.kind]
    bits = values.dtype.itemsize * 8
    fields = {
        256: values.shape[1], 257: values.shape[0], 258: (bits,) * bands, 259: 1,
        262: 2 if bands > 2 else 1, 273: 0, 277: bands, 278: values.shape[0],
        279: values.nbytes, 339: (sample,) * bands,
    }  # fmt: skip
    for number, value in fields.items():
        ifd[number] = value
    if tag is not None:
        ifd.tagtype[GDAL_NODATA] = 2
        ifd[GDAL_NODATA] = tag
    head = ifd.tobytes(8)  # which puts the strip right behind it
    path.write_bytes(b"II*\0" + (8).to_bytes(4, "little") + head + values.tobytes())


def write_heat(folder: Path, photos: list[Path], **said) -> Path:
    """A capture of heat photos of SIZE that look at one place from around; `said` of its heat."""
    frames = []
    for i, path in enumerate(photos):
        turn = 2 * np.pi * i / max(len(photos), 1)
        pose = np.eye(4)
        pose[:3, :3] = [
            [np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]
        ]  # fmt: skip
        pose[:3, 3] = 3 * pose[:3, 2]
        frames.append({
            "file_path": path.relative_to(folder).as_posix(), "transform_matrix": pose.tolist(),
        })  # fmt: skip
    width, height = SIZE
    heat = {"name": "Thermal", "x": 1, "kind": "thermal", "unit": "°C"} | said
    data = {
        "w": width, "h": height, "fl_x": 30, "fl_y": 30, "cx": width / 2, "cy": height / 2,
        "up": [0, 1, 0], "modalities": [heat], "frames": frames,
    }  # fmt: skip
    (folder / "transforms.json").write_text(json.dumps(data))
    return folder
