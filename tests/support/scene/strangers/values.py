"""Bands, indices and other values: how multispectral cameras and rasters lie in folders."""

import json
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.band_files import write_bands
from tests.support.scene.strangers.situations import (
    Shot,
    Situation,
    short,
    write_colmap,
    write_frames,
)

FRAMES = 4
NAMES = ("Red", "NIR")
INDEX = {"name": "NDVI", "x": 1, "kind": "values", "formula": "(nir - red) / (nir + red)",
         "value_range": [-1, 1]}  # fmt: skip


def read_values(path: Path) -> str:
    """Stops with their photos and ranges and those by formula, after a photo of each is read."""
    try:
        capture = read_capture(path)
        for stop in capture.stops:
            load_photo(next(p for p in capture.photos if p.modality == stop.name))
    except BadFile as error:
        return f"refused: {short(str(error), path)}"
    said = []
    for stop in capture.stops:
        count = sum(photo.modality == stop.name for photo in capture.photos)
        ends = "" if stop.value_range is None else " ({:g} to {:g})".format(*stop.value_range)
        said.append(f"{stop.name} {count}{ends}")
    return ", ".join([*said, *(f"{stop.name} by formula" for stop in capture.formulas)])


def said_of(*entries: dict, **each) -> list[dict]:
    """Modalities of values, evenly on the slider, and their index."""
    rows = [
        {"name": name, "x": i / 4, "kind": "values"} | each | entry
        for i, (name, entry) in enumerate(zip(NAMES, entries, strict=False))
    ]
    return [*rows, INDEX]


def beside(folder: Path, modalities: list[dict]) -> Path:
    (folder / "capture.json").write_text(json.dumps({"modalities": modalities}), encoding="utf-8")
    return folder


def shots(*patterns: str) -> list[Shot]:
    return [Shot(p.format(i), "I;16", camera=1) for i in range(FRAMES) for p in patterns]


def band_folders(folder: Path) -> Path:
    write_colmap(folder, shots("red/{}.tif", "nir/{}.tif"))
    return beside(folder, said_of({"folder": "red"}, {"folder": "nir"}, counts=[0, 200]))


def band_suffixes(folder: Path) -> Path:
    write_colmap(folder, shots("DJI_{:04}_MS_R.TIF", "DJI_{:04}_MS_NIR.TIF"))
    chosen = {"photos": "*_MS_R.*"}, {"photos": "*_MS_NIR.*"}
    return beside(folder, said_of(*chosen, value_range=[0, 1], counts=[0, 65535]))


def many_bands(folder: Path, modalities: list[dict], dtype: str = "u2", **form) -> Path:
    """Frames of one TIFF of five bands each, of 16 bits."""
    write_frames(folder, [Shot(f"{i}.png") for i in range(FRAMES)])
    text = (folder / "transforms.json").read_text().replace(".png", ".tif")
    random = np.random.default_rng(0)
    for i in range(FRAMES):
        (folder / f"{i}.png").unlink()
        bands = random.integers(0, 60000, (5, 12, 16), dtype=np.uint16)
        write_bands(folder / f"{i}.tif", bands.astype(dtype), **form)
    said = json.loads(text) | {"modalities": modalities}
    (folder / "transforms.json").write_text(json.dumps(said))
    return folder


def five_bands(folder: Path) -> Path:
    said = said_of({"band": 3}, {"band": 4}, counts=[0, 60000], value_range=[0, 1])
    return many_bands(folder, said, beside=True)


def signed_bytes(folder: Path) -> Path:
    said = said_of({"band": 3}, {"band": 4}, counts=[-100, 100])
    return many_bands(folder, said, "i1", beside=True)


def no_band(folder: Path) -> Path:
    return many_bands(folder, [{"name": "NIR", "x": 0, "kind": "values"}])


def no_such_band(folder: Path) -> Path:
    return many_bands(folder, said_of({"band": 3}, {"band": 6}))


def other_sizes(folder: Path) -> Path:
    """Pages of which the last is of half the size, as a panchromatic band beside others."""
    many_bands(folder, said_of({"band": 1}, {"band": 2}))
    for i in range(FRAMES):
        one, other = (np.zeros((1, h, w), np.uint16) for h, w in ((12, 16), (6, 8)))
        write_bands(folder / f"{i}.tif", one, pages=True)
        first = (folder / f"{i}.tif").read_bytes()
        write_bands(folder / "other.tif", other, pages=True)
        (folder / f"{i}.tif").write_bytes(linked(first, (folder / "other.tif").read_bytes()))
    return folder


def linked(first: bytes, second: bytes) -> bytes:
    """Two classic TIFFs of one page as one of two: the second's places move behind the first."""
    import struct

    at, shift = struct.unpack("<I", second[4:8])[0], len(first)
    count = struct.unpack("<H", second[at : at + 2])[0]
    table = bytearray(second)
    for row in range(count):
        place = at + 2 + 12 * row
        tag, kind, values = struct.unpack("<HHI", second[place : place + 8])
        if tag == 273 or values * {3: 2, 4: 4}.get(kind, 1) > 4:
            (old,) = struct.unpack("<I", second[place + 8 : place + 12])
            table[place + 8 : place + 12] = struct.pack("<I", old + shift)
            if tag == 273 and values > 1:
                places = struct.unpack(f"<{values}I", second[old : old + 4 * values])
                table[old : old + 4 * values] = struct.pack(
                    f"<{values}I", *(p + shift for p in places)
                )
    start = struct.unpack("<I", first[4:8])[0]
    link = start + 2 + 12 * struct.unpack("<H", first[start : start + 2])[0]
    whole = bytearray(first)
    whole[link : link + 4] = struct.pack("<I", at + shift)
    return bytes(whole + table)


def infrared_camera(folder: Path) -> Path:
    """A converted camera: red light in one channel of its pictures, near infrared in another."""
    write_colmap(folder, [Shot(f"rgn/{i}.png") for i in range(FRAMES)])
    return beside(folder, said_of({"band": 1}, {"band": 3}, folder="rgn"))


def colours(folder: Path) -> Path:
    write_colmap(folder, [Shot(f"rgn/{i}.png") for i in range(FRAMES)])
    return beside(folder, [{"name": "NIR", "x": 0, "kind": "values", "folder": "rgn"}])


def with_formula(formula: str):
    def make(folder: Path) -> Path:
        band_folders(folder)
        said = json.loads((folder / "capture.json").read_text())["modalities"]
        said[-1] |= {"formula": formula}
        return beside(folder, said)

    return make


def with_words(**words):
    def make(folder: Path) -> Path:
        band_folders(folder)
        said = json.loads((folder / "capture.json").read_text())["modalities"]
        said[0] |= words
        return beside(folder, said)

    return make


SITUATIONS = [
    Situation(name, met, make, expected, read_values)
    for name, met, make, expected in (
        ("bands in folders", "red/ and nir/ of 16 bits, an index in capture.json", band_folders,
         "Red 4 (0 to 200), NIR 4 (0 to 200), NDVI by formula"),
        ("bands by suffix", "one folder, DJI's _MS_R and _MS_NIR", band_suffixes,
         "Red 4 (0 to 1), NIR 4 (0 to 1), NDVI by formula"),
        ("bands in one TIFF", "five bands of 16 bits side by side, `band` in capture.json",
         five_bands, "Red 4 (0 to 1), NIR 4 (0 to 1), NDVI by formula"),
        ("bands of signed bytes", "five bands of 8 bits with a sign, `band` in capture.json",
         signed_bytes, "Red 4 (-100 to 100), NIR 4 (-100 to 100), NDVI by formula"),
        ("a converted camera", "red and near infrared as channels of one picture",
         infrared_camera, "Red 4 (0 to 255), NIR 4 (0 to 255), NDVI by formula"),
        ("bands without `band`", "a TIFF of five bands, nothing said", no_band,
         "refused: 0.tif: a TIFF of 5 bands"),
        ("a band that is not there", "band 6 of five", no_such_band,
         "refused: 0.tif: 'band' is 6"),
        ("bands of other sizes", "a page of half the size in one TIFF", other_sizes,
         "refused: 0.tif: bands of 16x12 and of 8x6 pixels"),
        ("colours as values", "pictures in colours of kind values", colours,
         'refused: images/rgn/0.png: a photo of colours in "NIR", which is of kind values'),
        ("a formula of what is not there", "an index of a band that no photo has",
         with_formula("(nir - blue) / (nir + blue)"),
         "refused: the formula '(nir - blue) / (nir + blue)': there is no stop 'blue'"),
        ("a formula that is code", "abs(nir) as a formula", with_formula("abs(nir)"),
         "refused: capture.json: modality \"NDVI\": the formula 'abs(nir)': the end, or one of + - "
         "* / is wanted before '('"),
        ("a palette that is not there", "`sunset` as a palette", with_words(palette="sunset"),
         "refused: capture.json: modality \"Red\": there is no palette 'sunset'"),
        ("a unit that is none", "a sentence as a unit",
         with_words(unit="watts per square metre and steradian"),
         "refused: capture.json: modality \"Red\": the unit is 'watts per square metre and "
         "steradian'"),
    )
]  # fmt: skip
