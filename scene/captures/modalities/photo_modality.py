"""Which modality is this photo?  Asked by every reader of captures, and by `poses`.

Evidence is every folder of its name (with either slash), the words and letters of its file's name,
and the keys of its frame.  What its pixels are is asked in two_sorts.py, when files are open.
"""

import os
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.splats.layers.frames import DATED
from shapeshift.runtime_models.stop_names import (
    COLOR_NAMES,
    LIGHT_WORDS,
    guess_kind,
    is_heat_maker,
    is_thermal_word,
    sort_of_name,
    words_of,
)
from shapeshift.scene.capture_files import is_strange, parts_of
from shapeshift.scene.captures.capture_rules import spread_stops
from shapeshift.scene.captures.modalities.said_modalities import (
    PhotoGroup,
    settling_line,
    shared_folders,
)
from shapeshift.scene.captures.modalities.two_sorts import BLEND, HEAT, LIGHT, roles_of

# Sorts of photos, HEAT and LIGHT, are names of STOP_KINDS; "": not known.
SAYS = {HEAT: "heat", LIGHT: "visible light"}
SPLITS = {"train": "train", "test": "test", "val": "test", "validation": "test", "eval": "test"}
# Words of folders that say where a camera was, or which of several alike, and not what it measured.
PLACES = set(
    "images image imgs img photos photo pictures pics frames frame raw data input dcim media dji "
    "cam cams camera cameras rig rigs sensor lens view views drone uav flight session sequence seq "
    "run part set batch scan walk pass strip orbit capture left right front back rear top bottom "
    "up down upper lower center centre middle mid side main north south east west hall room house "
    "roof floor yard garden street site place undistorted rectified aligned registered resized "
    "train test val validation eval t v w z".split()
)
# Keys of a frame that name its camera; and letters that drones put behind a photo's number, of
# heat and of the cameras beside: visible, wide and zoom.
CAMERA_KEYS = {
    "sensor", "camera", "cam", "lens", "device", "imager", "spectrum", "spectral", "wavelength",
    "band", "channel", "modality", "modalities", "type", "kind", "source", "stream", "label",
}  # fmt: skip  # words of them
NO_CAMERA = {"model", "path", "file"}  # a lens's form; where a file lies
LETTER = re.compile(r"(?:^|(?<=[_. -]))([TVWZ])(?=$|[_. -])", re.IGNORECASE)
DRONE = re.compile(r"DJI_(?:\d{14}_)?\d{4}_T(?![a-z0-9])", re.IGNORECASE)
RADIOMETRIC = re.compile(r"DJI_\d{4}_R(?![a-z0-9])", re.IGNORECASE)  # of its Zenmuse XT2
OTHER_LETTERS = re.compile(r"DJI_\d{4}_(?!R(?![a-z0-9]))", re.IGNORECASE)  # beside: R is red
KEY_WORDS = {"is", "image", "photo", "frame", "camera"}  # beside the one of a sort in a key
MAKERS = {"flir", "flir_one", "boson", "lepton"}  # folders of cameras of heat
PARTNERS = {"MAX", "MIX", "DC", "YUN"}  # before numbers of Autel's, FLIR's and Yuneec's photos
MIXED = "Mix"  # the stop of photos of light and heat laid over each other
FEW_LOOKED_AT = 8  # photos, for whether some have colours
FEWEST_PAIRS = 2  # one pair may be two letters of an alphabet
FLAGS = {"true": True, "false": False, "1": True, "0": False, "yes": True, "no": False}


@dataclass(frozen=True)
class SeenPhoto:
    """What is known of a photo before its file is opened."""

    folders: tuple[str, ...]  # of its name, without those that all photos share
    file: str  # without its ending
    by_key: str = ""  # the sort that its frame says
    by_folder: str = ""
    by_file: str = ""
    blend: bool = False  # light and heat laid over each other, by its name
    maker: bool = False  # a folder that is called as a camera of heat is, whose pixels are so

    @property
    def sorts(self) -> set[str]:
        return {self.by_key, self.by_folder, self.by_file} - {""}

    @property
    def sort(self) -> str:
        return next(iter(self.sorts), "")

    @property
    def upto(self) -> tuple[str, ...]:
        """The folders down to the one that says its sort; all where none does."""
        said = [i for i, name in enumerate(self.folders) if self.sort_in(name)]
        return self.folders[: said[0] + 1] if said else self.folders

    def sort_in(self, folder: str) -> str:
        return sort_of_name(folder) or (HEAT if self.maker and is_heat_maker(folder) else "")

    @property
    def state(self) -> tuple[str, ...]:
        """Words of its folders that are neither a sort nor a place: "closed", "attic"."""
        folders = self.upto if self.sort else self.folders[:1]
        dates = [name for name in folders if DATED.fullmatch(name)]
        made = [name for name in folders if not (self.maker and is_heat_maker(name))]
        words = [word for name in made for word in words_of(name)]
        none = PLACES | LIGHT_WORDS
        return tuple(dates + [w for w in words if not (w in none or is_thermal_word(w))])


def modalities_of(
    names: Sequence[str],
    folder: Path,
    keys: Sequence[Mapping] = (),
    folders_are_stops: bool = True,
    is_grey: Callable[[int], bool] | None = None,
) -> tuple[tuple[Stop, ...], list[str]]:
    """Stops, and of each photo the name of its stop, where nobody says them.

    names: of photos as the capture in `folder` writes them; keys: of their frames;
    folders_are_stops: whether the first folders of photos are modalities where no heat is among
    them, as in a COLMAP model's images; is_grey: whether the photo of a row has one channel or
    numbers, asked of folders that are called as makers of cameras are.  Raises BadFile, with the
    line of capture.json that settles it, where evidence disagrees.
    """
    if not names:
        return (), []
    seen = seen_of(names, keys or [{}] * len(names), is_grey)
    refuse_contradictions(seen, names, folder)
    if len({photo.sort == HEAT for photo in seen}) == 2 or any(photo.blend for photo in seen):
        return of_two_sorts(seen, names, folder, folders_are_stops)
    if all(photo.by_key == HEAT for photo in seen):
        return spread_stops(["Thermal"]), ["Thermal"] * len(names)
    if not folders_are_stops:
        return spread_stops(["RGB"]), ["RGB"] * len(names)
    first = [(folders or ("RGB",))[0] for folders in folders_of(names)]
    order = {"rgb": 0, "thermal": 1, "layer": 2}  # visible light first, then heat, then by name
    found = sorted(set(first), key=lambda name: (order[guess_kind(name, 2)], name))
    return spread_stops(found), first


def folders_of(names: Iterable[str]) -> list[tuple[str, ...]]:
    """The folders of each name, without those of a split and, of absolute names, shared ones."""
    parts = [[part for part in parts_of(name)[:-1] if part not in (".", "..")] for name in names]
    if any(map(is_strange, names)):
        shared = shared_folders(parts)
        parts = [part[shared:] for part in parts]
    splits = is_split_by_folder(parts)
    return [tuple(p for p in part if not (splits and p.lower() in SPLITS)) for part in parts]


def is_split_by_folder(parts: Iterable[Sequence[str]]) -> bool:
    """Whether folders say what is held out: there is one of training and another."""
    said = {SPLITS[name.lower()] for part in parts for name in part if name.lower() in SPLITS}
    return said == {"train", "test"}


def splits_of(names: Sequence[str]) -> list[str]:
    """train or test of each photo, by its folders; "" of all where these do not say it."""
    parts = [parts_of(name)[:-1] for name in names]
    if not is_split_by_folder(parts):
        return [""] * len(names)
    found = [[SPLITS[name.lower()] for name in part if name.lower() in SPLITS] for part in parts]
    return [said[0] if said else "train" for said in found]


def seen_of(
    names: Sequence[str],
    keys: Sequence[Mapping],
    is_grey: Callable[[int], bool] | None = None,
) -> list[SeenPhoto]:
    folders = folders_of(names)
    shared = shared_folders(folders) if len(names) > 1 else 0
    folders = [part[shared:] for part in folders]
    files = [os.path.splitext(parts_of(name)[-1])[0] for name in names]
    by_folder = [sort_of_folders(part) for part in folders]
    letters = {part.upper() for found in folders for part in found if len(part) == 1}
    if "T" in letters and (letters & set("VWZ") or (letters == {"T"} and LIGHT in by_folder)):
        by_letter = [sort_of_letter([p.upper() for p in part if len(p) == 1]) for part in folders]
        by_folder = [one or other for one, other in zip(by_folder, by_letter, strict=True)]
    made = grey_makers(folders, by_folder, is_grey) if is_grey else set()
    by_folder = [HEAT if row in made else sort for row, sort in enumerate(by_folder)]
    roles = roles_of(files)
    by_file = [
        one or role.replace(BLEND, "") or ("" if role else other or (HEAT if own else ""))
        for one, role, other, own in zip(
            by_letters(files), roles, by_words(files), radiometric(files), strict=True
        )
    ]
    by_key = [sort_of_keys(frame) for frame in keys]
    more = ([role == BLEND for role in roles], [row in made for row in range(len(names))])
    rows = zip(folders, files, by_key, by_folder, by_file, *more, strict=True)
    return [SeenPhoto(*row) for row in rows]


def grey_makers(
    folders: Sequence[tuple[str, ...]], by_folder: Sequence[str], is_grey: Callable[[int], bool]
) -> set[int]:
    """Rows in folders that are called as makers and parts of cameras of heat are (`TH`, `seek`),
    of which every photo has one channel or numbers, while others have colours.
    """
    called: dict[tuple[str, ...], list[int]] = defaultdict(list)
    rest = []
    for row, (found, sort) in enumerate(zip(folders, by_folder, strict=True)):
        if not sort and any(map(is_heat_maker, found)):
            called[found].append(row)
        elif sort != HEAT:
            rest.append(row)
    few = rest[:: max(len(rest) // FEW_LOOKED_AT, 1)][:FEW_LOOKED_AT]
    if not called or all(map(is_grey, few)):
        return set()
    return {row for rows in called.values() if all(map(is_grey, rows)) for row in rows}


def sort_of_folders(folders: Sequence[str]) -> str:
    """Of the outermost folder that says one; where two contradict each other, of both."""
    found = {sort_of_name(name) for name in folders} - {""}
    if len(found) > 1:  # flir/visible: a camera of heat has a lens of light, too
        found = {sort_of_name(name) for name in folders if name.lower() not in MAKERS} - {""}
    return found.pop() if len(found) == 1 else "both" if found else ""


def by_words(files: Sequence[str]) -> list[str]:
    """By the words of the files' names; what all of them say tells none from another."""
    found = [sort_of_name(name) for name in files]
    return found if len(set(found)) > 1 else [""] * len(files)


def by_letters(files: Sequence[str]) -> list[str]:
    """By the letters of drones, where there are pairs of photos that differ in them alone.

    A T behind DJI's own number needs no partner.
    """
    letters = [LETTER.findall(name) for name in files]
    if not any("T" in found or "t" in found for found in letters):
        return [""] * len(files)
    stems = [stem_of(name) for name in files]
    kinds: dict[str, set[str]] = defaultdict(set)
    for stem, found in zip(stems, letters, strict=True):
        kinds[stem].add(found[0].upper() if len(found) == 1 else "")
    pairs = [stem for stem, found in kinds.items() if stem and "T" in found and len(found) > 1]
    paired = len(pairs) >= FEWEST_PAIRS
    drones = [DRONE.match(name) is not None for name in files]
    if not paired and not any(drones):
        return [""] * len(files)
    found = [
        sort_of_letter([x.upper() for x in each]) if paired or drone else ""
        for each, drone in zip(letters, drones, strict=True)
    ]
    return found if len(set(found)) > 1 else [""] * len(files)


def radiometric(files: Sequence[str]) -> list[bool]:
    """Which DJI calls so; not where all are, nor where letters are bands, or left and right."""
    found = [RADIOMETRIC.match(name) is not None for name in files]
    told = any(found) and not all(found) and not any(map(OTHER_LETTERS.match, files))
    return found if told else [False] * len(files)


def stem_of(file: str) -> str:
    """What two photos of a pair have in common: the name without words and letters of a sort."""
    parts = re.split(r"[_. -]+", LETTER.sub("", file))
    kept = [part for part in parts if part and not sort_of_name(part)]
    return "_".join(part for part in kept if part.upper() not in PARTNERS).lower()


def sort_of_letter(letters: Sequence[str]) -> str:
    return "" if len(letters) != 1 else HEAT if letters[0] == "T" else LIGHT


def sort_of_keys(frame: Mapping) -> str:
    """By a frame's own keys: is_thermal, sensor ..., not by what its file says for all frames."""
    for key, value in frame.items():
        if (what := use_of_key(key)) and isinstance(value, str | bool | int | float):
            flag = FLAGS.get(str(value).strip().lower().removesuffix(".0"))
            if what in (HEAT, LIGHT) and flag is not None:
                return what if flag else LIGHT if what == HEAT else HEAT
            if what == "camera" and isinstance(value, str) and sort_of_name(value):
                return sort_of_name(value)
    return ""


@lru_cache(maxsize=1024)
def use_of_key(key: str) -> str:
    """The sort of which a key of a frame says yes or no; "camera" of one that names its camera."""
    said = words_of(key)
    words = set(said) - KEY_WORDS
    if words and all(map(is_thermal_word, words)):
        return HEAT
    if "is" in said and words and words <= LIGHT_WORDS:
        return LIGHT
    return "camera" if CAMERA_KEYS & set(said) and NO_CAMERA.isdisjoint(said) else ""


def refuse_contradictions(seen: Sequence[SeenPhoto], names: Sequence[str], folder: Path) -> None:
    """Raises BadFile where a photo's folders, name and keys say different things."""
    odd = [i for i, photo in enumerate(seen) if len(photo.sorts) > 1 or "both" in photo.sorts]
    if not odd:
        return
    photo = seen[odd[0]]
    said = {"its frame": photo.by_key, "its folder": photo.by_folder, "its name": photo.by_file}
    words = " and ".join(f"{what} says {SAYS[sort]}" for what, sort in said.items() if sort in SAYS)
    if photo.by_folder == "both":
        words = "its folders say both"
    heat = [p.by_key == HEAT or (not p.by_key and is_hot(p)) for p in seen]
    if len(set(heat)) == 1:  # then keys tell none from another
        heat = [is_hot(p) for p in seen]
    groups = [PhotoGroup("RGB", LIGHT), PhotoGroup("Thermal", HEAT)]
    for i, hot in enumerate(heat):
        groups[hot].rows.append(i)
    raise BadFile(
        f"{folder}: what {len(odd)} photos show is said in two ways, for example of "
        f"{path_end(names[odd[0]])}: {words}; say which are which in capture.json beside them, "
        f"such as {settling_line(groups, names)}"
    )


def is_hot(photo: SeenPhoto) -> bool:
    """By what is nearest to the file, for a proposal."""
    said = [sort_of_name(name) for name in photo.folders if sort_of_name(name)]
    return (said[-1] if said else photo.by_file) == HEAT


def of_two_sorts(
    seen: Sequence[SeenPhoto], names: Sequence[str], folder: Path, folders_are_stops: bool
) -> tuple[tuple[Stop, ...], list[str]]:
    """Stops of photos of which some show heat and others do not: light, heat, then the rest."""
    mixed = of_both_sorts(seen) if folders_are_stops else set()
    states = sorted({p.state for p in seen if p.folders[:1] in mixed})
    if len(states) > 1:
        raise ambiguous(seen, names, folder, mixed)
    groups: dict[tuple[str, tuple[str, ...]], list[int]] = defaultdict(list)
    for i, photo in enumerate(seen):
        state = () if not folders_are_stops or photo.folders[:1] in mixed else photo.state
        if photo.blend:
            groups["", (MIXED,)].append(i)
            continue
        sort = photo.sort or (LIGHT if not state or photo.folders[:1] in mixed else "")
        groups[sort, state].append(i)
    lit = any(sort == LIGHT for sort, _ in groups)
    rest = [group for group in groups if not group[0]]
    order = {LIGHT: 0, HEAT: 1, "": 2 if lit else 0.5}
    named = {group: name_of(group, [seen[i] for i in rows]) for group, rows in groups.items()}
    listed: list[str] = []
    of, kinds = [""] * len(seen), []
    for group, name in sorted(named.items(), key=lambda row: (order[row[0][0]], row[1])):
        name = name if name not in listed else f"{name} {len(listed) + 1}"
        listed.append(name)
        kinds.append(group[0] or (LIGHT if not lit and len(rest) == 1 else guess_kind(name, 2)))
        for i in groups[group]:
            of[i] = name
    return spread_stops(listed, kinds), of


def of_both_sorts(seen: Iterable[SeenPhoto]) -> set[tuple[str, ...]]:
    """First folders below which there is heat and something else."""
    found: dict[tuple[str, ...], set[bool]] = defaultdict(set)
    for photo in seen:
        found[photo.folders[:1]].add(photo.sort == HEAT)
    return {first for first, sorts in found.items() if len(sorts) > 1 and first}


def name_of(group: tuple[str, tuple[str, ...]], photos: Sequence[SeenPhoto]) -> str:
    """Of a stop: its folder's where there is one, as it is written there."""
    sort, state = group
    if not sort:
        return MIXED if photos[0].blend else photos[0].folders[0]
    folders = {photo.upto[-1] if photo.upto else "" for photo in photos}
    name = folders.pop() if len(folders) == 1 else ""
    words = set(words_of(name))
    plain = name.lower() in COLOR_NAMES - {"images", "photo"} or bool(state)
    plain |= sort == HEAT and words.isdisjoint({"images", "image", "photos"})
    if plain and photos[0].sort_in(name) == sort:
        return name
    return " ".join(["Thermal" if sort == HEAT else "RGB", *state])


def ambiguous(
    seen: Sequence[SeenPhoto], names: Sequence[str], folder: Path, mixed: set[tuple[str, ...]]
) -> BadFile:
    """Of first folders that hold both sorts and may be places, or states of what is shown."""
    groups = [PhotoGroup("RGB", LIGHT), PhotoGroup("Thermal", HEAT)]
    for i, photo in enumerate(seen):
        groups[photo.sort == HEAT].rows.append(i)
    folders = sorted(first[0] for first in mixed)
    shown = ", ".join(folders[:3]) + (" ..." if len(folders) > 3 else "")
    return BadFile(
        f"{folder}: the folders {path_end(shown)} hold photos of heat and others each, and may "
        "be places, or states such as closed and opened; say it in capture.json beside them: of "
        f"places {settling_line(groups, names)}, of states with a modality for each folder"
    )
