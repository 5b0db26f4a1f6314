"""Photos of two sorts in one stop, which their pixels show where nothing else says it."""

import os
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.capture_files import parts_of
from shapeshift.scene.captures.capture import Photo
from shapeshift.scene.captures.modalities.said_modalities import PhotoGroup, settling_line
from shapeshift.scene.captures.photo import open_image
from shapeshift.scene.captures.radiometric.number_photos import is_radiometric

ONE_CHANNEL = {"L", "LA", "La", "1"}  # how PIL names pictures of a byte without colours,
NUMBERS = {"I;16", "I;16B", "I;16L", "I;16N", "I", "F"}  # and what is 16 bits or more
GREY = ONE_CHANNEL | NUMBERS
DIGITS = re.compile(r"\d+")
MOST_SERIES = 6  # of a stop that are compared
FEWEST = 3  # photos: one or two grey ones are no camera of another sort


class Opened(NamedTuple):
    """What is known of a photo when its file was opened."""

    name: str  # as the capture writes it
    stop: str
    mode: str  # as PIL names it
    size: tuple[int, int]  # of its file
    camera: str = ""  # as the capture numbers it

    @property
    def grey(self) -> bool:
        return self.mode in GREY


def opened_photos(
    photos: Iterable[Photo], root: Path, cameras: Mapping[Path, str] | None = None
) -> list[Opened]:
    """Of a reader's photos, below `root`; cameras: as the capture numbers them."""
    cameras, above = cameras or {}, f"{root}{os.sep}"
    return [
        Opened(
            str(path).removeprefix(above).replace(os.sep, "/"),
            photo.modality,
            photo.mode,
            photo.file_size,
            cameras.get(path, ""),
        )
        for path, photo in {photo.path: photo for photo in photos}.items()
    ]


def has_grey_mode(path: Path) -> bool:
    """Whether a photo has one channel, or numbers of its camera; one that is not there has not."""
    if not os.path.isfile(path):
        return False
    if is_radiometric(path):
        return True
    with open_image(path) as image:
        return image.mode in GREY


def check_two_sorts(
    photos: Sequence[Opened], stops: Sequence[Stop], folder: Path
) -> tuple[str, ...]:
    """A sentence where names alone tell two sorts apart.  Raises BadFile where a stop that nobody
    named has colour photos, and a folder or a camera of which every photo has one channel or 16
    bits.

    Size, camera, or single grey photos are no reason.
    """
    cameras = cameras_of(photos)
    for stop in stops:
        mine = [row for row, photo in enumerate(photos) if photo.stop == stop.name]
        grey = grey_groups(photos, mine, cameras)
        if grey:
            raise mixed(photos, stops, stop, grey, cameras, folder)
    refuse_swapped(photos, stops, folder)
    found = ((stop, series_in(photos, stop)) for stop in stops)
    return tuple(of_two_series(photos, stops, stop, *rows) for stop, rows in found if rows)


def series_in(photos: Sequence[Opened], stop: Stop) -> tuple[list[int], list[int]] | None:
    """Rows of the two series of names in one folder of a stop that may be two sorts, heat behind:
    of other sizes and the same numbers, or called as a camera of both calls them.
    """
    groups: dict[tuple, list[int]] = defaultdict(list)
    for row, photo in enumerate(photos):
        if photo.stop == stop.name:
            *folders, file = parts_of(photo.name)
            groups[tuple(folders), DIGITS.sub("#", os.path.splitext(file)[0])].append(row)
    large = sorted(((k, rows) for k, rows in groups.items() if len(rows) >= FEWEST and "#" in k[1]),
                   key=lambda group: -len(group[1]))[:MOST_SERIES]  # fmt: skip
    for (one, mine), (other, theirs) in combinations(large, 2):
        if one[0] != other[0]:
            continue
        sizes = [{photos[row].size for row in rows} for rows in (mine, theirs)]
        numbers = [{tuple(DIGITS.findall(photos[row].name)) for row in r} for r in (mine, theirs)]
        shared = len(numbers[0] & numbers[1])
        alike = shared >= FEWEST and 2 * shared >= min(map(len, numbers))
        pair = mine, theirs
        names = [os.path.splitext(parts_of(photos[rows[0]].name)[-1])[0] for rows in pair]
        if roles := told_apart(*names):
            return (mine, theirs) if roles == (LIGHT, HEAT) else (theirs, mine)
        if alike and sizes[0].isdisjoint(sizes[1]):
            areas = [min(w * h for w, h in each) for each in sizes]
            return (mine, theirs) if areas[0] > areas[1] else (theirs, mine)
    return None


def of_two_series(
    photos: Sequence[Opened],
    stops: Sequence[Stop],
    stop: Stop,
    light: list[int],
    heat: list[int],
) -> str:
    rest = [r for r, p in enumerate(photos) if p.stop == stop.name and r not in set(heat)]
    line = line_of_two(photos, stops, stop, rest, set(heat), [""] * len(photos))
    one, other = photos[light[0]], photos[heat[0]]
    return (
        f"{stop.name} has two series of names in one folder, {len(light)} photos such as "
        f"{path_end(one.name)} of {of(one)} and {len(heat)} such as {path_end(other.name)} of "
        f"{of(other)}, and they are one stop; where one of them shows heat, capture.json beside "
        f"them makes two of it: {line}"
    )


def cameras_of(photos: Sequence[Opened]) -> list[str]:
    """Of each photo: the capture's number where several photos have it, else the size."""
    used = Counter(photo.camera for photo in photos)
    if any(used[photo.camera] < 2 or not photo.camera for photo in photos):
        return ["{}x{}".format(*photo.size) for photo in photos]
    return [photo.camera for photo in photos]


def grey_groups(photos: Sequence[Opened], mine: list[int], cameras: list[str]) -> set[int]:
    """Rows of a stop's photos in folders and of cameras that are all grey; empty where no photo of
    the stop has colours.
    """
    found: set[int] = set()
    if all(photos[row].grey for row in mine) or not any(photos[row].grey for row in mine):
        return found
    groups: dict[tuple, list[int]] = defaultdict(list)
    for row in mine:
        groups["folder", *parts_of(photos[row].name)[:-1]].append(row)
        groups["camera", cameras[row]].append(row)
    for rows in groups.values():
        if len(rows) >= FEWEST and all(photos[row].grey for row in rows):
            found |= set(rows)
    return found


def mixed(
    photos: Sequence[Opened],
    stops: Sequence[Stop],
    stop: Stop,
    grey: set[int],
    cameras: list[str],
    folder: Path,
) -> BadFile:
    """Of a stop whose rows `grey` are of another sort than its others."""
    rest = [row for row, p in enumerate(photos) if p.stop == stop.name and row not in grey]
    line = line_of_two(photos, stops, stop, rest, grey, cameras)
    colour = next((p for i, p in enumerate(photos) if i in rest and not p.grey), photos[rest[0]])
    one = photos[min(grey)]
    return BadFile(
        f"{folder}: photos of two sorts would be one stop, {stop.name}: {len(grey)} of "
        f"{bits_of(one)} and {of(one)}, for example {path_end(one.name)}, beside {len(rest)} in "
        f"colours of {of(colour)}, for example {path_end(colour.name)}; say which are which in "
        f"capture.json beside them, such as {line}"
    )


def line_of_two(
    photos: Sequence[Opened],
    stops: Sequence[Stop],
    stop: Stop,
    rest: list[int],
    grey: set[int],
    cameras: list[str],
) -> str:
    """The line that makes two of a stop: rows `rest` of light, `grey` of heat."""
    light = PhotoGroup("RGB" if stop.kind == "layer" else stop.name, stop.kind, stop.palette, rest)
    light.kind = "rgb" if stop.kind == "layer" and len(stops) == 1 else stop.kind
    heat = PhotoGroup("Thermal", "thermal", "ironbow", sorted(grey))
    if stop.kind == "thermal":  # then those in colours are the odd ones
        light, heat = (
            PhotoGroup("RGB", "rgb", "", rest),
            PhotoGroup(stop.name, "thermal", "ironbow", sorted(grey)),
        )
    others = [g for g in groups_of(photos, stops) if g.name != stop.name]
    names = [photo.name for photo in photos]
    taken = {group.name for group in others}
    for group in (light, heat):
        while group.name in taken:
            group.name += " 2"
    groups = sorted([light, heat, *others], key=lambda g: g.kind != "rgb")
    return settling_line(groups, names, [] if not any(cameras) else cameras)


def groups_of(photos: Sequence[Opened], stops: Sequence[Stop]) -> list[PhotoGroup]:
    """The stops as they are."""
    return [
        PhotoGroup(s.name, s.kind, s.palette, [i for i, p in enumerate(photos) if p.stop == s.name])
        for s in stops
    ]


def bits_of(photo: Opened) -> str:
    return "numbers" if photo.mode in NUMBERS else "one channel"


def of(photo: Opened) -> str:
    return "{}x{} pixels".format(*photo.size)


def refuse_swapped(photos: Sequence[Opened], stops: Sequence[Stop], folder: Path) -> None:
    """Raises BadFile where names say heat of photos that are all in colours, and light of those
    that are all grey.
    """
    light = [photo for photo in photos if photo.stop in {s.name for s in stops if s.kind == "rgb"}]
    heat = [
        photo for photo in photos if photo.stop in {s.name for s in stops if s.kind == "thermal"}
    ]
    if not min(len(light), len(heat)) >= FEWEST:
        return
    if all(photo.grey for photo in light) and not any(photo.grey for photo in heat):
        line = settling_line(groups_of(photos, stops), [photo.name for photo in photos])
        raise BadFile(
            f"{folder}: names and pixels disagree: {path_end(light[0].name)} and the other "
            f"{len(light) - 1} photos of visible light are of {bits_of(light[0])}, "
            f"{path_end(heat[0].name)} and the other {len(heat) - 1} of heat are in colours; if "
            f"the names are right, say so in capture.json beside them: {line}"
        )


# Series of names that cameras of heat write: a photo of heat and one of light with one number.
#
# Their colours are alike, and no word says what they show; that both are there, with the same
# numbers, does.

HEAT, LIGHT, BLEND = "thermal", "rgb", "blend"  # BLEND: one laid over the other
ROLES = (HEAT, LIGHT, BLEND)
DIGIT = re.compile(r"\d")  # names are matched once a shape: no pattern below may name a digit
FEWEST_SHARED = 2  # numbers: one may be by chance


class Series(NamedTuple):
    """Whole names without their endings by what they show; the first group is what is shared."""

    heat: re.Pattern
    light: re.Pattern
    blend: re.Pattern


def series(heat: str, light: str, blend: str = r"(?!)") -> Series:
    return Series(*(re.compile(pattern, re.IGNORECASE) for pattern in (heat, light, blend)))


TAKEN = r"(\d{8}[_-]\d{6}(?:[_-]\d{3})?)"  # day and time of FLIR's Vue and Duo
HELD = r"((?:FLIR|HM|HIK|HIKMICRO)[_-]?\d{4,}(?:[_-]\d+)*)"  # FLIR and HIKMICRO, held in a hand
SERIES = (
    series(r"T(\d{6,})", r"P(\d{6,})"),  # Parrot's Anafi Thermal
    series(r"IRX_?(\d+)", r"MAX_?(\d+)", r"MIX_?(\d+)"),  # Autel
    series(r"([A-Z]*\d{3,})T", r"([A-Z]*\d{3,})V", r"([A-Z]*\d{3,})X"),  # Snap-on
    series(
        rf"{HELD}(?:[ _-]?(?:IR|T))?",
        rf"{HELD}[ _-]?(?:photo|visual|visible|vis|vl|v|dc|rgb|digital|camera)",
        rf"{HELD}[ _-]?(?:msx|pip|fusion|blend|mix)",
    ),
    series(r"(?:HM|IR)_?(\d{6,})", r"(?:VL|VM|VIS|DC|V)_?(\d{6,})"),  # HIKMICRO
    series(rf"{TAKEN}_(?:\d\d?b|R|IR)", TAKEN),  # FLIR's Duo Pro
)


def roles_of(files: Sequence[str]) -> list[str]:
    """Of each name, without ending, one of ROLES where it is of a series that shows two of them
    with the same numbers; else "".
    """
    out = [""] * len(files)
    shapes = [DIGIT.sub("0", name) for name in files]
    for forms in SERIES:
        fitting = {shape for shape in set(shapes) if role_in(forms, shape)}
        if not fitting:  # nearly always: thousands of photos have a few shapes
            continue
        rows: dict[str, dict[str, list[int]]] = {role: defaultdict(list) for role in ROLES}
        for row, name in enumerate(files):
            if out[row] or shapes[row] not in fitting:
                continue
            if (found := role_in(forms, name)) is not None:
                rows[found[0]][found[1]].append(row)
        for role in ROLES:
            mine = rows[role].keys()
            if any(len(mine & rows[o].keys()) >= FEWEST_SHARED for o in ROLES if o != role):
                for row in (row for each in rows[role].values() for row in each):
                    out[row] = role
    return out


def role_in(forms: Series, name: str) -> tuple[str, str] | None:
    """The role of a name in a series, and its number; None: it is not of that."""
    for role, form in zip(ROLES, forms, strict=True):
        if found := form.fullmatch(name):
            return role, found[1].lower()
    return None


def told_apart(one: str, other: str) -> tuple[str, str] | None:
    """HEAT and LIGHT of two names that are so in one series, whatever their numbers."""
    for forms in SERIES:
        roles = [found[0] if (found := role_in(forms, name)) else "" for name in (one, other)]
        if set(roles) == {HEAT, LIGHT}:
            return roles[0], roles[1]
    return None
