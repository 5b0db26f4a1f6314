"""The finished search -> a capture: photos, masks, the model, and what was found, in that order.

The model comes last: a folder without one is no capture yet, so a killed writer leaves none that
looks whole.
"""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

from shapeshift.decomposition.poses.photo_list import PhotoList
from shapeshift.runtime_models.files.whole_file import discard_folder, make_folders, write_whole
from shapeshift.runtime_models.stop import USUAL_PALETTE
from shapeshift.scene.cameras.colmap_cameras import camera_bytes, image_bytes
from shapeshift.scene.captures.capture_rules import is_grey
from shapeshift.scene.captures.colmap_tables import COUNT, ColmapCamera, Posed, read_tables
from shapeshift.scene.captures.modalities.said_modalities import CHOICES, PhotoGroup, entries_of

# What a search for poses found.


@dataclass(frozen=True)
class PoseReport:
    """What was found; poses.json holds the same."""

    photos: int
    placed: int
    left_out: list[str]
    few_points: dict[str, int]  # photos with a pose that hangs on few points, and how many
    points: int
    error_px: float  # mean reprojection error
    attempts: list[dict]
    scale: str  # where metres come from
    up: str  # where upright comes from
    paired: int = 0  # photos of a second camera that got the poses of those they were taken with
    others: list[str] = field(default_factory=list)  # pictures that are masks, depth ... by name


REPORT = "poses.json"
PAIRED_LENS = "SIMPLE_PINHOLE"
TABLES = ("cameras.bin", "images.bin", "points3D.bin")


def write_posed(
    photos: PhotoList,
    placed: set[str],
    out: Path,
    work: Path,
    straight: bool,
    report: PoseReport,
) -> None:
    """Copies what has a pose into out/images and out/masks, then writes out/sparse/0.

    straight: photos and model are those that pycolmap has undistorted.  Removes the work folder.
    """
    source = work / "straight" / "images" if straight else photos.root
    for name in sorted(placed):
        copy_into(source / name, out, Path("images") / name)
    for thermal, visible in photos.paired.items():
        if visible in placed:
            copy_into(photos.root / thermal.name, out, Path("images") / thermal.name)
    if (work / "masks").is_dir():
        for name in sorted(placed):
            mask = work / "masks" / f"{name}.png"
            if mask.is_file():
                copy_into(mask, out, Path("masks") / f"{name}.png")
    model = work / "straight" / "sparse" if straight else work / "sparse"
    tables = {name: (model / name).read_bytes() for name in TABLES}
    tables |= with_pairs(photos, model, tables)
    write_whole(out / REPORT, json.dumps(asdict(report), indent=1).encode())
    if said := modalities_said(photos, placed, out / "images"):
        text = json.dumps({"modalities": said}, indent=1, ensure_ascii=False)
        write_whole(out / "capture.json", text.encode())
    target = make_folders(out, "sparse/0")
    for name in sorted(tables, key="images.bin".__eq__):  # what makes it a capture comes last
        write_whole(target / name, tables[name])
    discard_folder(work)


def modalities_said(photos: PhotoList, placed: set[str], images: Path) -> list[dict]:
    """The entries of capture.json: which photos are of which stop; [] where they are of one.

    images: where the written photos lie.
    """
    hot = {photo.name for photo, visible in photos.paired.items() if visible in placed}
    rows = [(name, stop) for name, stop in photos.stop_of if name in placed or name in hot]
    names = [name for name, _ in rows]
    groups, told = [], []
    own = {entry["name"]: entry for entry in photos.said}
    for stop in photos.stops:
        mine = [row for row, (_, name) in enumerate(rows) if name == stop.name]
        if not mine:
            continue
        usual = "" if photos.said else USUAL_PALETTE.get(stop.kind, "")
        grey = usual and is_grey(images / names[mine[0]])
        palette = stop.palette or (usual if grey else "")
        groups.append(PhotoGroup(stop.name, stop.kind, palette, mine))
        kept = own.get(stop.name, {}).items()
        told.append({key: value for key, value in kept if key not in CHOICES})
    if len(groups) < 2 and not photos.said:
        return []
    return [entry | each for each, entry in zip(told, entries_of(groups, names), strict=True)]


def copy_into(source: Path, out: Path, name: Path) -> None:
    write_whole(make_folders(out, name.parent) / name.name, source.read_bytes())


def with_pairs(photos: PhotoList, model: Path, tables: dict[str, bytes]) -> dict[str, bytes]:
    """The tables with a row for each photo of a second camera: the pose of the first, and a pinhole
    of the same field of view from top to bottom, which `train --calibrate` makes right."""
    if not photos.paired:
        return {}
    lenses, posed = read_tables(model, ".bin")
    by_name = {image.name: image for image in posed}
    next_lens, next_image = max(lenses) + 1, max(image.number for image in posed) + 1
    new_lenses: dict[ColmapCamera, int] = {}
    rows: list[Posed] = []
    for thermal, visible in photos.paired.items():
        if visible not in by_name:
            continue
        first = by_name[visible]
        lens = lenses[first.lens]
        width, height = thermal.size
        focal = lens.focal[1] * height / lens.size[1]
        like = ColmapCamera(PAIRED_LENS, thermal.size, (focal, width / 2, height / 2))
        number = new_lenses.setdefault(like, next_lens + len(new_lenses))
        rows.append(Posed(next_image + len(rows), thermal.name, first.wxyz, first.place, number))
    cameras = camera_bytes({number: lens for lens, number in new_lenses.items()})
    return {
        "cameras.bin": joined(tables["cameras.bin"], cameras),
        "images.bin": joined(tables["images.bin"], image_bytes(rows)),
    }


def joined(table: bytes, more: bytes) -> bytes:
    """Two of COLMAP's tables as one: a count, then the rows."""
    count = COUNT.unpack_from(table)[0] + COUNT.unpack_from(more)[0]
    return COUNT.pack(count) + table[COUNT.size :] + more[COUNT.size :]
