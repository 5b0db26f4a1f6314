"""RealityScan's metadata: an .xmp beside each photo, with its words in the name space xcr.

Rotation is camera from world, rows, OpenCV axes; Position where the camera stands; principal point
and focal length as in its CSV.
"""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.foreign.foreign_frames import (
    Z_UP,
    Gathered,
    PhotoIndex,
    checked_lens,
    world_from,
)
from shapeshift.scene.captures.foreign.read_blocks import finite, numbers_in, read_xml
from shapeshift.scene.captures.foreign.read_realityscan import lens_of
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

MOST_FILES = 100_000
BROWN = ("brown3", "brown4", "brown3t2", "brown4t2", "perspective", "")
NAMES = ("k1", "k2", "k3", "k4", "t1", "t2")  # of its six coefficients


def xmp_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """All such files in the folder of one, and below it.  Raises BadFile."""
    out = Gathered(path, "RealityScan", photos, Z_UP)
    for file in sorted(path.parent.rglob("*.xmp"))[:MOST_FILES]:
        inside = file.is_relative_to(photos.folder)
        own = file.relative_to(photos.folder) if inside else file
        name = own.with_suffix("").as_posix()
        words = words_of(read_xml(file))
        if "Rotation" not in words or "Position" not in words:
            out.leave(name, "have no pose")
            continue
        rotation = np.reshape(numbers_in(words["Rotation"], 9, str(file)), (3, 3))
        place = np.array(numbers_in(words["Position"], 3, str(file)))
        size = out.size_of(name)
        lens = None if size is None else xmp_lens(words, size, str(file))
        if size is not None and lens is None:
            out.leave(
                name, f"have the lens {words.get('DistortionModel', '')[:20]!r}, not read here"
            )
        else:
            out.add(name, world_from(rotation, place), lens)
    return out.finished()


def words_of(root: Element) -> dict[str, str]:
    """Its words, whether they are attributes or elements."""
    found: dict[str, str] = {}
    for element in root.iter():
        for key, value in element.attrib.items():
            if key.startswith("xcr:"):
                found[key[4:]] = value
        if element.text and element.text.strip():
            found[element.tag] = element.text.strip()
    return found


def xmp_lens(words: dict[str, str], size: tuple[int, int], where: str) -> ColmapCamera | None:
    """None of distortion models that are not read."""
    model = words.get("DistortionModel", "").lower()
    bends = words.get("DistortionCoeficients", words.get("DistortionCoefficients", ""))
    each = numbers_in(bends, len(bends.split()), where)
    if model not in BROWN and any(each):
        return None
    values: dict[str, float] = dict(zip(NAMES, each if model in BROWN else [], strict=False))
    for key, name in (
        ("f", "FocalLength35mm"),
        ("px", "PrincipalPointU"),
        ("py", "PrincipalPointV"),
    ):
        values[key] = number_in(words, name, where, None if key == "f" else 0.0)
    lens = lens_of(values, size, where)
    ratio = number_in(words, "AspectRatio", where, 1.0)
    if ratio == 1:
        return lens
    params = (lens.params[0], lens.params[1] * ratio, *lens.params[2:])
    return checked_lens(lens.model, size, params, where)


def number_in(words: dict[str, str], name: str, where: str, default: float | None) -> float:
    text = words.get(name, "")
    if not text and default is not None:
        return default
    try:
        return finite(float(text))
    except ValueError:
        raise BadFile(f"{where}: {name} is {text[:40]!r}; a number is wanted") from None
