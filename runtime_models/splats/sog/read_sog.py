"""PlayCanvas's SOG, versions 1 and 2: splats as pixels of WebP pictures beside a meta.json."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.checkpoint.read_png_folder import is_png_folder
from shapeshift.runtime_models.files.blocks import each_block
from shapeshift.runtime_models.files.json_fields import Fields, shown
from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.files.zip_files import member_names
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.package.package_files import MANIFEST
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading
from shapeshift.runtime_models.splats.ply.read_compressed_ply import from_smallest_three
from shapeshift.runtime_models.splats.sog.sog_files import META, SogFiles, is_meta

PICTURES = {"means": 2, "scales": 1, "quats": 1, "sh0": 1, "shN": 2}  # of each part
COEFFICIENTS = (0, 3, 8, 15)  # beyond degree 0, by bands
PALETTE_ROW = 64  # sets of harmonics in a row of their picture
LARGEST_PALETTE = 1 << 16  # sets; labels have 16 bits
GEOMETRY, DECODING = 44, 72  # bytes a splat of the arrays but for harmonics, and on the way there
ROOM = 1 << 16  # pixels that a picture may have beyond four times its splats
FIRST_MODE = 252  # the alpha of a quaternion says which entry is the largest: 252 is w
LARGEST_NUMBER = 1e38  # of float32
CODES = 1 << 16  # of a coordinate
HEAD = 1 << 16  # bytes of a meta.json that tell what it is


def is_sog(head: bytes, path: Path) -> bool:
    """Whether it is a SOG: a zip or a folder with meta.json, or that file, naming its parts."""
    if path.is_dir():
        meta = path / META
        if not meta.is_file():
            return False
        with meta.open("rb") as file:
            return is_sog(file.read(HEAD), meta)
    if path.name == META:
        return b'"means"' in head[:HEAD] and not is_png_folder(path)
    names = member_names(path) if head[:2] == b"PK" else []
    packaged = any(name.rpartition("/")[2] == MANIFEST for name in names)
    return any(is_meta(name) for name in names) and not packaged


def read_raw_sog(path: Path, reading: Reading) -> RawSplats:
    """Splats of SH degree 0 to 3 of a .sog, of its unpacked folder or its meta.json.

    Raises BadFile.
    """
    memory = reading.within(path).account
    sog = open_sog(path, memory)
    raw = raw_splats(sog, lambda part: reading.report(f"reading {path.name}", part))
    memory.release(sog.files.held)
    return raw


def raw_splats(sog: "Sog", report: Callable[[float], None] = lambda part: None) -> RawSplats:
    """All splats of a SOG that is open.  Raises BadFile."""
    memory, what = sog.files.memory, f"{sog.count:,} splats"
    memory.charge(GEOMETRY * sog.count, what)
    with memory.lend(DECODING * sog.count, what):
        report(0.0)
        means = read_means(sog)
        report(0.3)
        scales = decode(sog, "scales", sog.pixels("scales")[:, :3])
        wxyz = read_quaternions(sog)
        report(0.5)
        sh, opacity = read_colors(sog)
    return RawSplats(
        means=means,
        scales=scales,
        wxyz=wxyz,
        opacity=opacity,
        sh=sh,
        file=sog.files.name,
        format=f"SOG v{sog.version}",
        logits=sog.version == 1,
        antialiased=sog.meta.data.get("model") == "antialiased"
        or sog.meta.data.get("antialias") is True,
        findings=tuple(sog.findings),
        memory=memory,
    )


@dataclass
class Sog:
    """What a meta.json says; what is odd in its pictures gathers as findings."""

    files: SogFiles
    meta: Fields
    version: int
    count: int
    findings: list[Finding] = field(default_factory=list)
    known: dict[tuple[str, str], np.ndarray] = field(default_factory=dict)  # numbers, checked once
    named: dict[str, list[str]] = field(default_factory=dict)  # files of parts, checked once

    def names(self, part: str) -> list[str]:
        """The files of a part; [] where there is none, which only harmonics may be."""
        if part in self.named:
            return self.named[part]
        names: list[str] = []
        if part != "shN" or part in self.meta.data:
            names = self.meta.object(part).texts("files")
            if len(names) != PICTURES[part]:
                raise self.bad(f"{part} needs the names of {PICTURES[part]} files")
        self.named[part] = names
        return names

    def file_names(self) -> list[str]:
        """All pictures."""
        return [name for part in PICTURES for name in self.names(part)]

    def numbers(self, part: str, key: str, least: int, most: int) -> np.ndarray:
        """(n,) float32, `least` to `most` of them; read only.  Raises BadFile."""
        if (kept := self.known.get((part, key))) is not None and least <= len(kept) <= most:
            return kept
        found = self.meta.object(part).data.get(key)
        found = found if isinstance(found, list) else [found]
        if key == "codebook" and len(found) == 256 and found[0] is None:
            found = [extrapolated(found), *found[1:]]
        if key in ("mins", "maxs") and len(found) == most and None in found:
            raise self.bad(
                f"the {key} of {part} has a null: its writer met an infinite number (null is what "
                "JSON makes of that), and the whole axis is lost; leave such splats out before it"
            )
        if not least <= len(found) <= most or not set(map(type, found)) <= {int, float}:
            wanted = f"{least}" if least == most else f"{least} to {most}"
            raise self.bad(f"{part} needs {wanted} numbers as its {key}")
        try:
            numbers = np.array(found, np.float64)
        except OverflowError:  # a whole number beyond 1e308
            numbers = np.array([np.inf])
        if not (np.abs(numbers) < LARGEST_NUMBER).all():  # False for NaN
            raise self.bad(f"the {key} of {part} is not finite")
        self.known[part, key] = numbers.astype(np.float32)
        self.known[part, key].flags.writeable = False
        return self.known[part, key]

    def pixels(self, part: str, number: int = 0) -> np.ndarray:
        """(N, 4) uint8: of each splat the pixel of one of a part's pictures."""
        most = 4 * self.count + ROOM
        picture = self.files.image(self.names(part)[number], self.count, most)
        return picture.reshape(-1, picture.shape[2])[: self.count]

    def palette(self) -> np.ndarray:
        """(P, M - 1, 3) sets of harmonics; of one colour from all sides (1, 0, 3)."""
        return read_palette(self) if self.names("shN") else np.zeros((1, 0, 3), np.float32)

    def bad(self, what: str) -> BadFile:
        return BadFile(f"{self.files.name}: in its {META}, {what}; export it again.")


def extrapolated(codebook: list) -> float | None:
    """What stands for a null at the beginning, which older writers left, as PlayCanvas takes it."""
    first, last = codebook[1], codebook[-1]
    if type(first) not in (int, float) or type(last) not in (int, float):
        return None
    return first + (first - last) / 255


def open_sog(path: Path, memory: Account) -> Sog:
    """The meta.json of a SOG; no picture is read yet.  Raises BadFile."""
    files = SogFiles(path, memory)
    meta = files.meta()
    version = meta.value("version", 1)
    if type(version) is not int or version not in (1, 2):
        raise BadFile(f"{files.name} is a SOG of version {shown(version)}, known are 1 and 2.")
    count = meta.value("count", None)
    if version == 1:
        shape = meta.object("means").data.get("shape")
        count = shape[0] if isinstance(shape, list) and shape else None
    if type(count) is not int or count < 1:
        raise BadFile(f"{files.name} does not say how many splats there are; export it again.")
    sog = Sog(files, meta, version, count)
    sog.file_names()  # all named as they should be
    return sog


def decode(sog: Sog, part: str, codes: np.ndarray) -> np.ndarray:
    """float32 of bytes (..., c): by a codebook (version 2) or between two ends (version 1)."""
    if sog.version == 2:
        codebook = sog.numbers(part, "codebook", 1, 256)
        if len(codebook) < 256 and codes.size and codes.max() >= len(codebook):
            raise sog.bad(f"the codebook of {part} has {len(codebook)} numbers, some codes more")
        values = np.empty(codes.shape, np.float32)
        for channel in range(codes.shape[-1]):
            values[..., channel] = codebook.take(codes[..., channel].astype(np.intp))
        return values
    width = 1 if part == "shN" else codes.shape[-1]
    low, high = (sog.numbers(part, end, width, max(width, 3))[:width] for end in ("mins", "maxs"))
    share = codes.astype(np.float32) / 255
    return low * (1 - share) + high * share


def read_means(sog: Sog) -> np.ndarray:
    """(N, 3) float32: 16 bits between two ends of sign(x) log(1 + |x|), in two pictures."""
    low, high = (sog.numbers("means", end, 3, 3).astype(float) for end in ("mins", "maxs"))
    fine, coarse = sog.pixels("means", 0)[:, :3], sog.pixels("means", 1)[:, :3]
    means = np.empty((sog.count, 3), np.float32)

    def unbent(axis: int, codes: np.ndarray) -> np.ndarray:
        share = codes / 65535
        bent = low[axis] * (1 - share) + high[axis] * share
        return (np.sign(bent) * np.expm1(np.abs(bent))).astype(np.float32)

    with np.errstate(over="ignore"):  # what is beyond float32 is for the judge
        many = sog.count > CODES  # then each code's place is reckoned once
        places = [unbent(axis, np.arange(CODES)) for axis in range(3)] if many else []

        def fill(rows: slice, _: object) -> None:
            for axis in range(3):
                codes = coarse[rows, axis].astype(np.intp) << 8
                codes |= fine[rows, axis]
                means[rows, axis] = places[axis].take(codes) if many else unbent(axis, codes)

        each_block(sog.count, fill)
    return means


def read_quaternions(sog: Sog) -> np.ndarray:
    """(N, 4) wxyz: three entries of 8 bits, and in alpha which one is left out."""
    pixels = sog.pixels("quats")
    wxyz = np.empty((sog.count, 4), np.float32)
    unknown = pixels[:, 3] < FIRST_MODE

    entries = (np.arange(256, dtype=np.float32) / 255 - 0.5) * np.float32(2**0.5)

    def fill(rows: slice, _: object) -> None:
        small = [entries.take(pixels[rows, entry].astype(np.intp)) for entry in range(3)]
        mode = np.maximum(pixels[rows, 3], FIRST_MODE) - np.uint8(FIRST_MODE)
        from_smallest_three(small, mode, wxyz[rows])

    each_block(sog.count, fill)
    if unknown.any():
        wxyz[unknown] = 1, 0, 0, 0
        sog.findings.append(
            finding_of_pixels("quaternions are of no known code", unknown, "not turned", sog)
        )
    return wxyz


def read_colors(sog: Sog) -> tuple[np.ndarray, np.ndarray]:
    """(N, M, 3) harmonics and (N,) opacity: 0..1, of version 1 logits."""
    pixels = sog.pixels("sh0")
    palette = sog.palette()
    sog.files.memory.charge(12 * sog.count * (1 + palette.shape[1]), f"{sog.count:,} splats")
    sh = np.empty((sog.count, 1 + palette.shape[1], 3), np.float32)
    if sog.version == 1:
        decoded = decode(sog, "sh0", pixels)
        sh[:, 0], opacity = decoded[:, :3], decoded[:, 3].copy()
    else:
        sh[:, 0] = decode(sog, "sh0", pixels[:, :3])
        opacity = pixels[:, 3].astype(np.float32) / 255
    if palette.shape[1]:
        labels = sog.pixels("shN", 1)
        labels = labels[:, 0] | labels[:, 1].astype(np.uint16) << 8
        beyond = labels >= len(palette)
        each_block(sog.count, lambda rows, _: look_up(palette, labels[rows], sh[rows, 1:]))
        if beyond.any():
            sh[beyond, 1:] = 0
            found = finding_of_pixels(
                "splats name harmonics that are not there", beyond, "one colour", sog
            )
            sog.findings.append(found)
    return sh, opacity


def look_up(palette: np.ndarray, labels: np.ndarray, into: np.ndarray) -> None:
    """Puts the sets of harmonics that labels (n,) name into (n, M - 1, 3)."""
    sets = palette.reshape(
        len(palette), -1
    )  # take() copies a row at once, an index number by number
    into[:] = sets.take(labels, axis=0, mode="clip").reshape(into.shape)


def read_palette(sog: Sog) -> np.ndarray:
    """(P, 3, 8 or 15, 3) float32: sets of harmonics, 64 in each row of the picture."""
    most = PALETTE_ROW * COEFFICIENTS[3] * (LARGEST_PALETTE // PALETTE_ROW)
    picture = sog.files.image(sog.names("shN")[0], PALETTE_ROW * COEFFICIENTS[1], most)
    height, width = picture.shape[:2]
    count = height * PALETTE_ROW
    coefficients = width // PALETTE_ROW
    if sog.version == 2:
        bands, stated = (sog.meta.object("shN").data.get(key) for key in ("bands", "count"))
        if type(bands) is not int or bands not in (1, 2, 3):
            raise sog.bad("shN needs 1, 2 or 3 bands")
        if type(stated) is not int or not 1 <= stated <= count:
            raise sog.bad(f"shN needs a count of 1 to {count}, what its picture holds")
        count = stated
        if coefficients != COEFFICIENTS[bands]:
            raise sog.bad(f"{bands} bands need a picture {64 * COEFFICIENTS[bands]} pixels wide")
    if coefficients not in COEFFICIENTS[1:] or width % PALETTE_ROW:
        raise sog.bad(f"the harmonics' picture is {width} pixels wide, expected 192, 512 or 960")
    codes = picture[:, :, :3].reshape(-1, coefficients, 3)[:count]
    with sog.files.memory.lend(16 * codes.size, f"{count:,} sets of harmonics"):
        return decode(sog, "shN", codes)


def finding_of_pixels(what: str, rows: np.ndarray, done: str, sog: Sog) -> Finding:
    """A finding about the rows (N,) bool."""
    numbers = np.flatnonzero(rows)
    few = tuple(int(number) for number in numbers[:10])
    return Finding(f"{len(numbers):,} {what}", len(numbers), done, few, sog.files.name)
