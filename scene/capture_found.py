"""What a capture's reader found, used and left out, and why: one table for all readers."""

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.scene.capture_files import files_below, is_picture, photo_key
from shapeshift.scene.captures.capture import FoundFiles, Photo

NO_POSE = "they have no pose"
NO_FRAME = "no frame names them"
# Of pictures that programs leave among photos.
NO_PHOTO = re.compile(r"(depth|normal|mask|disp|segm|semantic|albedo|flow)", re.IGNORECASE)
NUMBERS = (".npy", ".exr")  # files of depth photos and normal maps besides pictures
NOT_THERE = "the capture names them and they are not there"


class FileTable:
    """Rows as a reader goes along, and a sentence for each that a person has to know."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder  # names below it are said without it
        self.rows: list[FoundFiles] = []
        self.sentences: list[str] = []
        self.accounted: set[str] = set()  # photo_key of paths that a row has already

    def used(self, kind: str, count: int, why: str = "") -> None:
        if count:
            self.rows.append(FoundFiles(kind, count, count, 0, why))

    def left_out(
        self, kind: str, names: Sequence[object], why: str, there: bool = True, said: bool = False
    ) -> None:
        """names: of all of it; there: else it should be; said: a sentence says it already."""
        if not names:
            return
        count, first = len(names), self.short(names[0])
        self.rows.append(FoundFiles(kind, count if there else 0, 0, count, why, first))
        if not said:
            self.sentences.append(f"{count} {kind} are left out: {why}, for example {first}.")

    def short(self, name: object) -> str:
        return path_end(str(name).removeprefix(f"{self.folder}{os.sep}"))

    def photos(self, photos: Sequence[Photo], missing: Sequence[str]) -> None:
        """Of a panorama all faces are one photo.  missing: named, and not there."""
        self.used("photos", len({photo.path for photo in photos}))
        self.left_out("photos", missing, NOT_THERE, there=False, said=True)

    def partners(self, kind: str, photos: Sequence[Photo], missing: Sequence[str] = ()) -> None:
        """Masks, depth photos or normal maps: used, and what some photos of a modality lack.

        missing: photos whose partner is named and not there.
        """
        absent = set(missing)
        key = {"masks": "mask", "depth photos": "depth", "normal maps": "normals"}[kind]
        self.used(kind, len({getattr(photo, key) for photo in photos} - {None}))
        self.left_out(kind, missing, NOT_THERE, there=False, said=True)
        for name in dict.fromkeys(photo.modality for photo in photos):
            mine = [photo for photo in photos if photo.modality == name]
            lack = [p.path for p in mine if getattr(p, key) is None and str(p.path) not in absent]
            lack = list(dict.fromkeys(lack))
            have = len({photo.path for photo in mine if getattr(photo, key) is not None})
            if lack and have:
                why = f"{have} photos of {name} have one and these have none"
                self.left_out(kind, lack, why, there=False, said=True)
                self.sentences.append(
                    f"{len(lack)} photos of {name} have none of the {kind} that {have} others "
                    f"have, for example {self.short(lack[0])}."
                )

    def sorted_rows(self) -> tuple[FoundFiles, ...]:
        """Kind by kind, photos first, what is used before what is not."""
        kinds = list(dict.fromkeys(["photos", *(row.kind for row in self.rows)]))
        return tuple(sorted(self.rows, key=lambda row: (kinds.index(row.kind), -row.used)))

    def unposed(self, paths: Iterable[Path]) -> None:
        """Leaves out pictures among the photos."""
        found: tuple[list[Path], list[Path]] = ([], [])
        for path in paths:
            found[bool(NO_PHOTO.search(path.name))].append(path)
        self.left_out("photos", found[0], NO_POSE)
        self.left_out("other pictures", found[1], "nothing names them, nor are they called photos")

    def unnamed(self, kind: str, places: Iterable[Path], named: set[str]) -> None:
        """Leaves out what lies in these folders and is none of the named (photo_key of paths)."""
        more = NUMBERS if kind != "photos" else ()
        others = [
            place / name
            for place in sorted(set(places))
            for name in files_below(place, deep=False)
            if (is_picture(name) or name.lower().endswith(more))
            and photo_key(str(place / name)) not in named
        ]
        if kind == "photos":
            self.unposed(others)
        else:
            self.left_out(kind, others, NO_FRAME)
