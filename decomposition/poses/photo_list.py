"""The photos that poses are found for: which files, which of one camera, which come in pairs."""

from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_names import is_thermal_name
from shapeshift.scene.captures.photo import open_image
from shapeshift.scene.captures.read_capture import PICTURES, has_poses

FEWEST = 3  # photos; two give a pair, and no third that says whether it is right
ORIENTATION = 0x0112  # of EXIF: which side of the photo was up
ALIKE = 16  # pixels a side of the thumbnails by which copies of one photo are found


@dataclass(frozen=True)
class PhotoFile:
    name: str  # path below the folder of photos, with /
    size: tuple[int, int]  # width, height in pixels, as stored
    orientation: int  # EXIF, 1 to 8


@dataclass(frozen=True)
class PhotoList:
    """Photos to find poses for, and photos of a second camera that were taken with them."""

    root: Path
    photos: tuple[PhotoFile, ...]
    paired: dict[PhotoFile, str]  # a thermal photo -> the name of the photo taken with it

    @property
    def groups(self) -> list[list[str]]:
        """Names by camera: photos of one folder and one size."""
        found: dict[tuple, list[str]] = defaultdict(list)
        for photo in self.photos:
            found[Path(photo.name).parent, photo.size].append(photo.name)
        return list(found.values())


def list_photos(root: Path, every: int = 1) -> PhotoList:
    """Every `every`th photo of each folder in or below `root`, by name.  Raises BadFile."""
    root = Path(root)
    if not root.is_dir():
        found = "is no folder" if root.exists() else "does not exist"
        raise BadFile(f"{root} {found}; give a folder of photos, or a video.")
    if has_poses(root):
        raise BadFile(f"{root} has poses already; give it to train.")
    paths = sorted(p for p in root.rglob("*") if p.suffix.lower() in PICTURES and p.is_file())
    if len({path.parent for path in paths}) == 1:
        root = paths[0].parent  # one folder, however deep: its name says nothing
    folders: dict[Path, list[Path]] = defaultdict(list)
    for path in paths:
        folders[path.parent].append(path)
    chosen = [read_photo(path, root) for group in folders.values() for path in group[::every]]
    paired = find_pairs(chosen)
    photos = tuple(photo for photo in chosen if photo not in paired)
    if len(photos) < FEWEST:
        raise BadFile(
            f"{root} holds {len(photos)} photos ({', '.join(sorted(PICTURES))}) to find poses for; "
            f"at least {FEWEST} that overlap are needed, better 30."
        )
    refuse_copies(root, photos)
    return PhotoList(root, photos, paired)


def read_photo(path: Path, root: Path) -> PhotoFile:
    with open_image(path) as image:
        try:
            orientation = int(image.getexif().get(ORIENTATION, 1))
        except (ValueError, TypeError, OSError, SyntaxError):  # damaged EXIF is none
            orientation = 1
        return PhotoFile(path.relative_to(root).as_posix(), image.size, orientation)


def find_pairs(photos: list[PhotoFile]) -> dict[PhotoFile, str]:
    """Thermal photos that have one of visible light of the same name in another folder.

    Heat has too few features to find poses by; a rig's second camera has those of the first.
    """
    folder = {photo: Path(photo.name).parent for photo in photos}
    visible: dict[str, str] = {}
    for photo in photos:
        if not is_thermal_name(str(folder[photo])):
            visible.setdefault(Path(photo.name).stem, photo.name)
    thermal = [photo for photo in photos if is_thermal_name(str(folder[photo]))]
    found = {p: visible[Path(p.name).stem] for p in thermal if Path(p.name).stem in visible}
    alone = [photo for photo in thermal if photo not in found]
    if visible and alone:
        raise BadFile(
            f"{len(alone)} thermal photos, for example {path_end(alone[0].name)}, have no photo "
            "of visible light with the same name; name the two of a pair alike, or leave them out."
        )
    return found


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
