"""The stops of frames in JSON, and which each frame is of; capture.json beside them."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, own_keys, read_json, shown
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.stop_names import guess_kind, sort_of_name
from shapeshift.scene.capture_files import ENDINGS, find_file, parts_of
from shapeshift.scene.capture_photos import image_size
from shapeshift.scene.captures.capture_rules import spread_stops, stops_from
from shapeshift.scene.captures.colmap_tables import Posed
from shapeshift.scene.captures.dated_stops import day_of_frame
from shapeshift.scene.captures.modalities.photo_modality import SPLITS, modalities_of
from shapeshift.scene.captures.modalities.said_modalities import (
    PhotoGroup,
    said_modality_of,
    settling_line,
)
from shapeshift.scene.captures.modalities.two_sorts import has_grey_mode

MOST_BYTES = 1 << 30  # of JSON


def read_capture_json(file: Path) -> dict:
    """The object of a file; a version of our own form that is not known is refused."""
    data = read_json(file, most_bytes=MOST_BYTES)
    if not isinstance(data, dict):
        raise BadFile(f"{file} holds {shown(data)}; an object with 'frames' is wanted")
    if data.get("format", "shapeshift-capture") == "shapeshift-capture":
        version = data.get("version", 1)
        if version != 1:
            raise BadFile(
                f"{file}: version {shown(version)} of the capture form; this program reads 1"
            )
    return data


def said_beside(folder: Path) -> dict:
    """What capture.json in the folder of a capture says; {} without one."""
    path = folder / "capture.json"
    return read_capture_json(path) if path.is_file() else {}


def stops_of_frames(
    folder: Path, data: dict, entries: Sequence[Mapping], where: str
) -> tuple[tuple[Stop, ...], list[str], list]:
    """Stops; of each frame the stop that it is of where it names none itself, "" where it stands
    for one of each; and 'modalities' of capture.json, where they were needed.
    """
    days = [
        "" if "modality" in entry else day_of_frame(entry, f"{where}: frame {i}")
        for i, entry in enumerate(entries)
    ]
    listed = data.get("modalities")
    if listed:
        if isinstance(listed, list) and all(isinstance(name, str) and name for name in listed):
            if len(set(listed)) < len(listed):
                raise BadFile(f"{where}: two modalities have the same name; rename one")
            return spread_stops(listed), days, []
        stops = tuple(sorted(stops_from(listed, where), key=lambda stop: stop.x))
        return stops, days, []
    bare = [i for i, entry in enumerate(entries) if "modality" not in entry]
    names = [named_file(entries[i]) for i in bare]
    if len(bare) == len(entries) and (told := said_beside(folder).get("modalities")):
        place = f"{folder}/capture.json"
        told_stops = stops_from(told, place)

        def cameras_of(row: int) -> set[str]:
            path = find_file(folder, names[row]).path
            return {"{}x{}".format(*image_size(path, None))} if os.path.isfile(path) else set()

        of = said_modality_of(told, told_stops, names, place, cameras_of)
        return tuple(sorted(told_stops, key=lambda stop: stop.x)), of, told
    own = [own_keys(entries[i]) for i in bare]
    found, of = modalities_of(
        names, folder, own, False, lambda row: has_grey_mode(find_file(folder, names[row]).path)
    )
    usual = dict(zip(bare, of, strict=True))
    if len(found) > 1 and any(days):
        raise of_days(days, found, usual, entries, where)
    said = [
        Fields(entry, f"{where}: frame {i}").text("modality", days[i] or usual.get(i, "RGB"))
        for i, entry in enumerate(entries)
    ]
    if "" in said:
        raise BadFile(f"{where}: frame {said.index('')}: 'modality' is empty; give it a name")
    stops = found if set(said) == {s.name for s in found} else spread_stops(light_first(said))
    return stops, said, []


def light_first(names: Sequence[str]) -> list[str]:
    """Each name once, as they come; where the first are heat, what shows visible light before."""
    listed = list(dict.fromkeys(names))
    order = {"rgb": 0, "thermal": 1, "layer": 2}
    rank = {name: order[guess_kind(name, len(listed))] for name in listed}
    places = [rank[name] for name in listed if rank[name] < 2]
    return listed if places == sorted(places) else sorted(listed, key=rank.__getitem__)


def of_days(
    days: list[str],
    stops: Sequence[Stop],
    usual: Mapping[int, str],
    entries: Sequence[Mapping],
    where: str,
) -> BadFile:
    """Of frames of several days of which some show heat: each would be of two stops."""
    groups: dict[tuple[str, str], PhotoGroup] = {}
    kinds = {stop.name: stop.kind for stop in stops}
    for row, name in sorted(usual.items(), key=lambda item: (days[item[0]], kinds[item[1]])):
        each = PhotoGroup(f"{name} {days[row]}".strip(), kinds[name])
        groups.setdefault((days[row], name), each).rows.append(row)
    line = settling_line(list(groups.values()), [named_file(entry) for entry in entries])
    return BadFile(
        f"{where}: its frames have dates, and some show heat and others do not; say which are of "
        f"which stop in capture.json beside it, such as {line}"
    )


def named_file(entry: Mapping) -> str:
    """The photo that a frame names; "" where it is no text, which shots_of refuses."""
    name = entry.get("file_path") or entry.get("file") or ""
    return name if isinstance(name, str) else ""


# One image of a COLMAP model that stands for a photo of light and one of heat.


def with_twins(posed: list[Posed], root: Path) -> tuple[list[Posed], tuple[str, ...]]:
    """The images, each once for each photo that stands for it, and what is doubtful.

    In the form of Thermal-Gaussian a bare name of the model is that of a photo in rgb/train or
    rgb/test, and of one in thermal/train or thermal/test, of the same camera and place.
    """
    sorts = [sub for sub in sorted(root.iterdir()) if sub.is_dir() and sort_of_name(sub.name)]
    if not sorts:
        return posed, ()
    places = [[p for p in (sub, *(sub / split for split in SPLITS)) if p.is_dir()] for sub in sorts]
    out, lone = [], []
    for image in posed:
        if os.path.isfile(find_file(root, image.name, ("",)).path):
            out.append(image)
            continue
        *above, file = parts_of(image.name)
        if above and (root / above[0]).is_dir():  # it is said where the photo lay
            out.append(image)
            continue
        found = [twin for each in places if (twin := first_of(each, file)) is not None]
        out += [replace(image, name=p.relative_to(root).as_posix()) for p in found] or [image]
        lone += [image.name] if 0 < len(found) < len(sorts) else []
    folders = ", ".join(sub.name for sub in sorts)
    said = f"{len(lone)} images of the model have no photo in each of {folders}, for example "
    return out, (f"{said}{path_end(lone[0])}.",) if lone else ()


def first_of(places: Sequence[Path], file: str) -> Path | None:
    """The photo of that name in one of the folders; its ending may be another."""
    for name, endings in ((file, ("",)), (Path(file).stem, ENDINGS)):
        for place in places:
            path = find_file(place, name, endings).path
            if os.path.isfile(path):
                return path
    return None
