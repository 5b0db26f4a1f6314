"""Photos of heat and of visible light that were taken together: by name, by number, by time."""

import datetime
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_names import sort_of_name
from shapeshift.scene.captures.modalities.photo_modality import LETTER, stem_of
from shapeshift.scene.captures.modalities.two_sorts import HEAT, LIGHT, SERIES, role_in
from shapeshift.scene.captures.photo import open_image

# A pair's two photos are exposed within so many seconds, where their files say when: drones and
# rigs trigger both at once, and write whole seconds.
APART_S = 1.0
DRONE = re.compile(r"DJI_(\d{14})_(\d{4})", re.IGNORECASE)  # when, and the number of the exposure
NUMBER_APART_S = 2.0  # of two photos with one number: their cameras write one after the other
EXIF, TAKEN, FRACTION = 0x8769, 0x9003, 0x9291  # the directory; DateTimeOriginal; its fraction
# Which of several visible cameras shows most like the thermal one: never the zoom's first.
ORDER = {"V": 0, "W": 1, "": 2, "Z": 3}


@dataclass(frozen=True)
class PhotoFile:
    name: str  # path below the folder of photos, with /
    size: tuple[int, int]  # width, height in pixels, as stored
    orientation: int  # EXIF, 1 to 8
    mode: str = "RGB"  # of its pixels, as PIL names it


def camera_letter(name: str) -> str:
    """T, V, W or Z of a drone's photo; "" of others."""
    found = LETTER.findall(PurePosixPath(name).stem)
    return found[0].upper() if len(found) == 1 else ""


def find_pairs(
    root: Path, heat: Sequence[PhotoFile], light: Sequence[PhotoFile]
) -> dict[PhotoFile, str]:
    """Of photos of heat the name of the photo of visible light that was taken with each.

    Heat has too few features to find poses by; a rig's second camera has those of the first.
    Raises BadFile where some have none.  Heat alone is searched as any photos are.
    """
    if not light or not heat:
        return {}
    light = sorted(light, key=lambda photo: (ORDER.get(camera_letter(photo.name), 2), photo.name))
    found = by_series(heat, light)
    found |= by_name([photo for photo in heat if photo not in found], light)
    left = [photo for photo in heat if photo not in found]
    found |= by_number(left, light)
    left = [photo for photo in left if photo not in found]
    found |= by_time(root, left, light)
    alone = [photo for photo in heat if photo not in found]
    if alone:
        raise BadFile(
            f"{len(alone)} thermal photos, for example {path_end(alone[0].name)}, have no photo "
            "of visible light of the same name, number or time of exposure; name the two of a pair "
            "alike, or leave them out."
        )
    return found


def by_series(heat: Iterable[PhotoFile], light: Iterable[PhotoFile]) -> dict[PhotoFile, str]:
    """Names that one camera writes for both, with one number, in folders as of by_name."""
    found: dict[PhotoFile, str] = {}
    for forms in SERIES:
        of: dict[tuple, str] = {}
        for photo in light:
            if (told := role_in(forms, PurePosixPath(photo.name).stem)) and told[0] == LIGHT:
                of.setdefault((place_of(photo.name)[0], told[1]), photo.name)
        for photo in heat if of else ():
            told = role_in(forms, PurePosixPath(photo.name).stem)
            name = of.get((place_of(photo.name)[0], told[1])) if told else None
            if told and told[0] == HEAT and name is not None:
                found.setdefault(photo, name)
    return found


def by_name(heat: Iterable[PhotoFile], light: Iterable[PhotoFile]) -> dict[PhotoFile, str]:
    """Names without the words and letters of a sort; in folders that differ in such words alone,
    or in any, where one photo of light is called so.
    """
    near: dict[tuple, str] = {}
    far: dict[str, list[str]] = defaultdict(list)
    for photo in light:
        place, stem = place_of(photo.name)
        near.setdefault((place, stem), photo.name)
        far[stem].append(photo.name)
    found = {}
    for photo in heat:
        place, stem = place_of(photo.name)
        others = far[stem] if len({place_of(name)[0] for name in far[stem]}) == 1 else []
        name = near.get((place, stem)) or next(iter(others), None)
        if name is not None:
            found[photo] = name
    return found


def place_of(name: str) -> tuple[tuple[str, ...], str]:
    """The folders of a name without those of a sort, and what its file shares with its pair's."""
    path = PurePosixPath(name)
    folders = [part for part in path.parent.parts if not sort_of_name(part) and len(part) > 1]
    return tuple(folders), stem_of(path.stem)


def by_number(heat: Iterable[PhotoFile], light: Iterable[PhotoFile]) -> dict[PhotoFile, str]:
    """DJI's names, where the two of a pair have one number and times that differ by a second."""
    numbered: dict[str, list[tuple[float, str]]] = defaultdict(list)
    for photo in light:
        if (said := numbered_at(photo.name)) is not None:
            numbered[said[0]].append((said[1], photo.name))
    found = {}
    for photo in heat:
        said = numbered_at(photo.name)
        near = [(abs(at - said[1]), name) for at, name in numbered[said[0]]] if said else []
        if near and (best := min(near, key=lambda row: row[0]))[0] <= NUMBER_APART_S:
            found[photo] = best[1]
    return found


def numbered_at(name: str) -> tuple[str, float] | None:
    """The number and the seconds in one of DJI's names."""
    match = DRONE.match(PurePosixPath(name).name)
    at = seconds_of(match[1], "%Y%m%d%H%M%S") if match else None
    return None if match is None or at is None else (match[2], at)


def by_time(
    root: Path, heat: Sequence[PhotoFile], light: Sequence[PhotoFile]
) -> dict[PhotoFile, str]:
    """The nearest in time of exposure, each of light for one of heat."""
    if not heat:
        return {}
    taken = [(at, p.name) for p in light if (at := taken_at(root / p.name)) is not None]
    rows = []
    for photo in heat:
        at = taken_at(root / photo.name)
        rows += [(abs(t - at), n, photo) for t, n in taken] if at is not None else []
    found: dict[PhotoFile, str] = {}
    used: set[str] = set()
    for apart, name, photo in sorted(rows, key=lambda row: row[0]):
        if not apart <= APART_S:
            break
        if photo not in found and name not in used:
            found[photo] = name
            used.add(name)
    return found


def taken_at(path: Path) -> float | None:
    """Seconds when a photo was exposed, by its EXIF; None where that does not say it."""
    with open_image(path) as image:
        try:
            said = image.getexif().get_ifd(EXIF)
            at = seconds_of(str(said.get(TAKEN, "")).strip(), "%Y:%m:%d %H:%M:%S")
            digits = str(said.get(FRACTION, "")).strip()
        except (ValueError, TypeError, OSError, SyntaxError, KeyError):  # damaged EXIF is none
            return None
    if at is None:
        return None
    return at + (float(f"0.{digits}") if digits.isascii() and digits.isdecimal() else 0.0)


def seconds_of(text: str, form: str) -> float | None:
    try:
        when = datetime.datetime.strptime(text, form).replace(tzinfo=datetime.UTC)
    except ValueError:
        return None
    return when.timestamp()
