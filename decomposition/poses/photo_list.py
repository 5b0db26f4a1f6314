"""The photos that poses are found for: which files, which of one camera, which come in pairs."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from shapeshift.decomposition.poses.pairs import PhotoFile, camera_letter, find_pairs
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.stop_names import sort_of_name
from shapeshift.scene.captures.capture_rules import stops_from
from shapeshift.scene.captures.modalities.frame_modalities import said_beside
from shapeshift.scene.captures.modalities.photo_modality import HEAT, modalities_of
from shapeshift.scene.captures.modalities.said_modalities import said_modality_of
from shapeshift.scene.captures.modalities.two_sorts import GREY, Opened, check_two_sorts
from shapeshift.scene.captures.photo import open_image
from shapeshift.scene.captures.read_capture import PICTURES, has_poses
from shapeshift.scene.mask_files import is_grey_file
from shapeshift.scene.other_pictures import MASKS, other_pictures

TIFFS = {".tif", ".tiff"}  # of heat alone: what else is a TIFF is the twin of a JPEG as a rule
FEWEST = 3  # photos; two give a pair, and no third that says whether it is right
ORIENTATION = 0x0112  # of EXIF: which side of the photo was up
ALIKE = 16  # pixels a side of the thumbnails by which copies of one photo are found


@dataclass(frozen=True)
class PhotoList:
    """Photos to find poses for, and photos of a second camera that were taken with them."""

    root: Path
    photos: tuple[PhotoFile, ...]
    paired: dict[PhotoFile, str]  # a thermal photo -> the name of the photo taken with it
    stops: tuple[Stop, ...] = ()
    stop_of: tuple[tuple[str, str], ...] = ()  # name of a photo, name of its stop
    said: tuple[dict, ...] = ()  # 'modalities' of the capture.json that lay with them
    others: tuple[tuple[str, str], ...] = ()  # name of a picture that is no photo, its kind
    doubts: tuple[str, ...] = ()  # of its stops, a sentence each

    @property
    def sentences(self) -> list[str]:
        """What of the pictures is left out, and why; what is doubtful of their stops."""
        out = list(self.doubts)
        for kind in dict.fromkeys(kind for _, kind in self.others):
            mine = [name for name, each in self.others if each == kind]
            use = "; --masks with their folder hides what is black" if kind == MASKS else ""
            out.append(f"{len(mine)} pictures are {kind} by their names, and no photos, for "
                       f"example {path_end(mine[0])}{use}.")  # fmt: skip
        return out

    @property
    def groups(self) -> list[list[str]]:
        """Names by camera: photos of one folder, of one size and with one of a drone's letters."""
        found: dict[tuple, list[str]] = defaultdict(list)
        for photo in self.photos:
            about = Path(photo.name).parent, photo.size, camera_letter(photo.name)
            found[about].append(photo.name)
        return list(found.values())


def list_photos(root: Path, every: int = 1) -> PhotoList:
    """Every `every`th photo of each folder in or below `root`, by name.  Raises BadFile."""
    root = Path(root)
    if not root.is_dir():
        found = "is no folder" if root.exists() else "does not exist"
        raise BadFile(f"{root} {found}; give a folder of photos, or a video.")
    if has_poses(root):
        raise BadFile(f"{root} has poses already; give it to train.")
    above = root
    paths = sorted(path for path in root.rglob("*") if is_taken(path, root) and path.is_file())
    if len({path.parent for path in paths}) == 1:
        root = paths[0].parent  # one folder, however deep: its name says nothing
    names = [path.relative_to(root).as_posix() for path in paths]
    others = other_pictures(names, lambda row: is_grey_file(paths[row]))
    folders: dict[Path, list[Path]] = defaultdict(list)
    for row, path in enumerate(paths):
        if row not in others:
            folders[path.parent].append(path)
    chosen = [read_photo(path, root) for group in folders.values() for path in group[::every]]
    stops, of, said, doubts = stops_of_photos(chosen, root, above)
    hot = {stop.name for stop in stops if stop.kind == HEAT}
    heat = [photo for photo, stop in zip(chosen, of, strict=True) if stop in hot]
    light = [photo for photo, stop in zip(chosen, of, strict=True) if stop not in hot]
    paired = find_pairs(root, heat, light)
    photos = tuple(photo for photo in chosen if photo not in paired)
    if len(photos) < FEWEST:
        raise BadFile(
            f"{root} holds {len(photos)} photos ({', '.join(sorted(PICTURES))}) to find poses for; "
            f"at least {FEWEST} that overlap are needed, better 30."
        )
    refuse_copies(root, photos)
    stop_of = tuple(zip((photo.name for photo in chosen), of, strict=True))
    kinds = tuple((names[row], kind) for row, kind in others.items())
    return PhotoList(root, photos, paired, stops, stop_of, said, kinds, doubts)


def read_photo(path: Path, root: Path) -> PhotoFile:
    with open_image(path) as image:
        try:
            orientation = int(image.getexif().get(ORIENTATION, 1))
        except (ValueError, TypeError, OSError, SyntaxError):  # damaged EXIF is none
            orientation = 1
        return PhotoFile(path.relative_to(root).as_posix(), image.size, orientation, image.mode)


def is_taken(path: Path, root: Path) -> bool:
    """Whether a file is a photo for poses: a picture, or a TIFF of heat without a picture of it."""
    if path.suffix.lower() in PICTURES:
        return True
    name = path.relative_to(root).as_posix()
    hot = sort_of_name(name) == HEAT or camera_letter(name) == "T"
    twins = [path.with_suffix(e) for ending in PICTURES for e in (ending, ending.upper())]
    return path.suffix.lower() in TIFFS and hot and not any(twin.is_file() for twin in twins)


def stops_of_photos(
    photos: Sequence[PhotoFile], root: Path, above: Path
) -> tuple[tuple[Stop, ...], list[str], tuple[dict, ...], tuple[str, ...]]:
    """Stops, of each photo the name of its stop, the entries of a capture.json that says so, which
    lies in `root` or in the folder that was given, and what is doubtful.  Raises BadFile.
    """
    names = [photo.name for photo in photos]
    folder = root if (root / "capture.json").is_file() else above
    if said := said_beside(folder).get("modalities"):
        where = f"{folder}/capture.json"
        listed = stops_from(said, where)

        def cameras_of(row: int) -> set[str]:
            return {"{}x{}".format(*photos[row].size)}

        of = said_modality_of(said, listed, names, where, cameras_of)
        return tuple(sorted(listed, key=lambda stop: stop.x)), of, tuple(said), ()
    stops, of = modalities_of(names, root, is_grey=lambda row: photos[row].mode in GREY)
    rows = zip(photos, of, strict=True)
    opened = [Opened(photo.name, stop, photo.mode, photo.size) for photo, stop in rows]
    return stops, of, (), check_two_sorts(opened, stops, root)


def refuse_copies(root: Path, photos: tuple[PhotoFile, ...]) -> None:
    """Raises BadFile where all photos are copies of one: nothing moves between them."""
    first = photos[0]
    if Counter(photo.size for photo in photos)[first.size] < len(photos):
        return
    small = None
    for photo in photos:
        with open_image(root / photo.name) as image:
            image.draft("RGB", (ALIKE * 8, ALIKE * 8))  # a JPEG is then decoded small
            now = image.convert("L").resize((ALIKE, ALIKE)).tobytes()
        if small is not None and now != small:
            return
        small = now
    raise BadFile(f"{root}: its {len(photos)} photos are all alike; move the camera between them.")
