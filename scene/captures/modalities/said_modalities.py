"""The modalities that capture.json says, and the line of it that settles what photos do not say."""

import fnmatch
import glob
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import PurePosixPath

from shapeshift.runtime_models.files.json_fields import Fields, shown
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.capture_files import SMALLER, is_strange, parts_of
from shapeshift.scene.captures.radiometric.stated_bands import only_bands, sharing_folders

IMAGES = {"images", *(f"images_{factor}" for factor in SMALLER)}
CHOICES = ("folder", "photos", "camera")  # keys of an entry that say which photos it has
MOST_LISTED = 20  # photos in a line that is proposed
FEW = 4  # folders that a line lists before it looks for a pattern
DEEPEST = 1000  # a pattern has fewer folders; what names photos or cameras goes before


@dataclass
class PhotoGroup:
    """A modality that a line of capture.json is to say: which photos it has."""

    name: str
    kind: str
    palette: str = ""
    rows: list[int] = field(default_factory=list)  # numbers of photos


@dataclass(frozen=True)
class PhotoChoice:
    """Which photos an entry of 'modalities' takes; what is None takes all."""

    folders: tuple[str, ...] | None
    photos: tuple[str, ...] | None
    cameras: tuple[str, ...] | None

    def depths(self, names: Sequence[str], cameras_of: Callable[[int], set[str]]) -> list[int]:
        return [self.depth(name, partial(cameras_of, row)) for row, name in enumerate(names)]

    def folded(self) -> "PhotoChoice":
        """The same for names in small letters."""
        lists = (self.folders, self.photos, self.cameras)
        return PhotoChoice(*(found and tuple(map(str.lower, found)) for found in lists))

    def depth(self, name: str, cameras: Callable[[], set[str]]) -> int:
        """How exactly it names that photo; 0: not at all."""
        forms = forms_of(name)
        found = 1
        if self.folders is not None:
            found = max(folder_depth(pattern, f) for pattern in self.folders for f in forms)
        if self.photos is not None:
            hit = any(names_photo(pattern, f) for pattern in self.photos for f in forms)
            found = found and hit and found + DEEPEST
        if self.cameras is not None:
            found = found and not cameras().isdisjoint(self.cameras) and found + DEEPEST
        return int(found)


def said_modality_of(
    entries: Sequence[Mapping],
    stops: Sequence[Stop],
    names: Sequence[str],
    where: str,
    cameras_of: Callable[[int], set[str]] = lambda row: set(),
) -> list[str]:
    """Of each photo the name of its stop, as the entries of 'modalities' say it.

    names: as the capture writes them; cameras_of: how 'camera' may name the camera of a photo, by
    its row.  A photo that several entries name is of the one that names it most exactly, and of the
    last of those.  Raises BadFile where an entry has no photo, or a photo no entry.
    """
    choices = [choice_of(Fields(e, where), s.name) for s, e in zip(stops, entries, strict=True)]
    out: list[tuple[int, str]] = [(0, "")] * len(names)
    bands = only_bands(sharing_folders(entries, where))
    for stop, choice in zip(stops, choices, strict=True):
        if stop.formula or stop.name in bands:  # it has no photos of its own
            continue
        depths = choice.depths(names, cameras_of)
        if not any(depths):
            depths = choice.folded().depths([name.lower() for name in names], cameras_of)
        if not any(depths):
            raise BadFile(
                f"{where}: modality {shown(stop.name)} has no images under images/"
                f"{said_in_words(choice)}; add them to the capture or drop the modality"
            )
        out = [
            (depth, stop.name) if depth and depth >= had[0] else had
            for had, depth in zip(out, depths, strict=True)
        ]
    left = [name for name, (depth, _) in zip(names, out, strict=True) if not depth]
    if left:
        raise BadFile(f"{where}: image {path_end(min(left))} belongs to no listed modality")
    return [name for _, name in out]


def choice_of(entry: Fields, name: str) -> PhotoChoice:
    """Of an entry of 'modalities'; one that says nothing of its photos has the folder of its name.

    Raises BadFile.
    """
    said = {key: texts_of(entry, key) for key in CHOICES}
    if not any(said.values()):
        said["folder"] = (name,)
    return PhotoChoice(said["folder"], said["photos"], said["camera"])


def texts_of(entry: Fields, key: str) -> tuple[str, ...] | None:
    """A text or a list of texts; of a camera also numbers."""
    value = entry.value(key, None)
    if value is None:
        return None
    listed = value if isinstance(value, list) else [value]
    if key == "camera":
        listed = [str(v) if isinstance(v, int) and not isinstance(v, bool) else v for v in listed]
    if not listed or not all(isinstance(text, str) for text in listed):
        numbers = " or numbers" if key == "camera" else ""
        raise entry.error(key, f"a text or a list of texts{numbers}")
    return tuple(listed)


def said_in_words(choice: PhotoChoice) -> str:
    listed = choice.photos or choice.cameras or choice.folders or ()
    return path_end(", ".join(listed))


def forms_of(name: str) -> list[list[str]]:
    """The parts of a photo's name, and the same below images/, where it begins with that; of a name
    of another machine every end of it.
    """
    parts = [part for part in parts_of(name) if part not in (".", "..")]
    if is_strange(name):
        return [parts[start:] for start in range(len(parts))]
    return [parts, parts[1:]] if len(parts) > 1 and parts[0] in IMAGES else [parts]


def plain_parts(names: Sequence[str]) -> list[list[str]]:
    """The parts of photos' names as a line of capture.json names them."""
    if any(map(is_strange, names)):
        every = [forms_of(name)[0] for name in names]
        shared = shared_folders([parts[:-1] for parts in every])
        return [parts[shared:] for parts in every]
    return [forms_of(name)[-1] for name in names]


def shared_folders(parts: Sequence[Sequence[str]]) -> int:
    """How many folders all begin with."""
    count, least = 0, min(map(len, parts), default=0)
    while count < least and len({part[count] for part in parts}) == 1:
        count += 1
    return count


def folder_depth(pattern: str, parts: Sequence[str]) -> int:
    """How many folders of the pattern a photo lies below, and one more; 0: not below it."""
    wanted = split_pattern(pattern)
    if not wanted:
        return int(len(parts) == 1)
    if any(matches(wanted, parts[:count]) for count in range(len(parts))):
        return 1 + len(wanted)
    return folder_depth("/".join(wanted[1:]), parts) if wanted[0] in IMAGES else 0


def names_photo(pattern: str, parts: Sequence[str]) -> bool:
    """Whether a pattern names a photo: by its file's name alone, or with its folders."""
    wanted = split_pattern(pattern)
    return matches(wanted, parts if len(wanted) > 1 else parts[-1:])


def split_pattern(pattern: str) -> list[str]:
    return [part for part in re.split(r"[\\/]+", pattern) if part not in ("", ".")]


def matches(pattern: Sequence[str], parts: Sequence[str]) -> bool:
    """Whether the parts of a path are those of a pattern: * within a name, ** any folders."""
    here = after_any(pattern, {0})
    for part in parts:
        here = after_any(pattern, {
            at + (pattern[at] != "**") for at in here if at < len(pattern)
            and (pattern[at] in ("**", part) or fnmatch.fnmatchcase(part, pattern[at]))
        })  # fmt: skip
    return len(pattern) in here


def after_any(pattern: Sequence[str], places: set[int]) -> set[int]:
    """Places in the pattern, and those behind its ** that stand for nothing."""
    out = set(places)
    for at in range(len(pattern)):
        if at in out and pattern[at] == "**":
            out.add(at + 1)
    return out


def settling_line(
    groups: Sequence[PhotoGroup], names: Sequence[str], cameras: Sequence[str] = ()
) -> str:
    """What capture.json is to hold so that each group is a modality.

    cameras: of each photo, as 'camera' names it.
    """
    return json.dumps({"modalities": entries_of(groups, names, cameras)}, ensure_ascii=False)


def entries_of(
    groups: Sequence[PhotoGroup], names: Sequence[str], cameras: Sequence[str] = ()
) -> list[dict]:
    """The entries of 'modalities' that read_capture takes for these groups, light first."""
    groups = [group for group in groups if group.rows]
    chosen = choices_of(groups, names, cameras)
    out = []
    for number, (group, choice) in enumerate(zip(groups, chosen, strict=True)):
        x = round(number / max(len(groups) - 1, 1), 6)
        entry = {"name": group.name, "x": x, "kind": group.kind}
        entry |= {"palette": group.palette} if group.palette else {}
        out.append(entry | choice)
    return out


def choices_of(
    groups: Sequence[PhotoGroup], names: Sequence[str], cameras: Sequence[str]
) -> list[dict]:
    """By folders where these tell the groups apart, else by cameras, by patterns, or one by one."""
    parts = plain_parts(names)
    folders = [{"/".join(parts[row][:-1]) for row in group.rows} for group in groups]
    if are_apart(folders):
        return [{"folder": one_or_list(below(found, folders))} for found in folders]
    if cameras and are_apart(used := [{cameras[row] for row in group.rows} for group in groups]):
        return [{"camera": one_or_list(sorted(found))} for found in used]
    files = [{parts[row][-1] for row in group.rows} for group in groups]
    patterns = [pattern_of(found) for found in files]
    hits = [{n for n, other in enumerate(files) if any(names_photo(p, [f]) for f in other)}
            for p in patterns]  # fmt: skip
    if all(hit == {number} for number, hit in enumerate(hits)):
        return [{"photos": pattern} for pattern in patterns]
    listed = [sorted("/".join(parts[row]) for row in group.rows) for group in groups]
    least = min(range(len(groups)), key=lambda number: len(listed[number]))
    out: list[dict] = [{"photos": one_or_list(found[:MOST_LISTED])} for found in listed]
    if len(groups) == 2:  # the rest of two is whatever is not listed
        out[1 - least] = {"folder": "**"}
    return out


def are_apart(sets: Sequence[set[str]]) -> bool:
    return sum(map(len, sets)) == len(set().union(*sets))


def below(mine: set[str], every: Sequence[set[str]]) -> list[str]:
    """Folders of a group, or one pattern of them where they are many and it is of no other's."""
    others = set().union(*every) - mine
    last = {PurePosixPath(name).name for name in mine}
    if len(mine) > FEW and len(last) == 1:
        pattern = f"**/{last.pop()}"
        if not any(folder_depth(pattern, [*name.split("/"), "x"]) for name in others):
            return [pattern]
    return sorted(mine)


def pattern_of(files: Iterable[str]) -> str:
    """What the names of files have in common at both ends, with * between."""
    stems = [PurePosixPath(name).stem for name in files]
    start = shared_start(stems)
    end = shared_start([stem[len(start) :][::-1] for stem in stems])[::-1]
    start, end = start.rstrip("0123456789"), end.lstrip("0123456789")
    return f"{glob.escape(start)}*{glob.escape(end)}.*"


def shared_start(texts: Sequence[str]) -> str:
    low, high = min(texts), max(texts)
    same = [one == other for one, other in zip(low, high, strict=False)]
    return low[: [*same, False].index(False)]


def one_or_list(texts: Sequence[str]) -> str | list[str]:
    return texts[0] if len(texts) == 1 else list(texts)
