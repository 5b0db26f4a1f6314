"""Poses in other programs' files that lie with photos: which file is whose, and which is used."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.files.plain_text import name_line, path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.foreign.foreign_frames import (
    Z_UP,
    Gathered,
    PhotoIndex,
    brown_lens,
    checked_lens,
    checked_size,
    text_in,
    world_from,
)
from shapeshift.scene.captures.foreign.read_blocks import blocks_frames
from shapeshift.scene.captures.foreign.read_bundler import TableWords, bundler_frames, nvm_frames
from shapeshift.scene.captures.foreign.read_metashape import metashape_frames
from shapeshift.scene.captures.foreign.read_realityscan import realityscan_frames
from shapeshift.scene.captures.foreign.read_sfm_json import (
    SHOTS,
    alicevision_frames,
    odm_frames,
    openmvg_frames,
    opensfm_frames,
)
from shapeshift.scene.captures.foreign.read_xmp import xmp_frames
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

# Pix4D's params/NAME_calibrated_camera_parameters.txt, with NAME_offset.xyz beside it.
#
# Its head says the form: name and size, K (3 rows), radial (3) and tangential (2) distortion,
# place, R (3 rows), m = K [R|-Rt] X; pixels from the upper left, z of the world up.

MARK, LAST = "fileName imageWidth imageHeight", "camera model"
ROWS = 10  # lines of a photo


def pix4d_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """Raises BadFile."""
    lines = [line.strip() for line in text_in(path, photos).splitlines()]
    start = next((i for i, line in enumerate(lines) if line.startswith(LAST)), -1)
    rows = [line for line in lines[start + 1 :] if line]
    if start < 0 or not rows or len(rows) % ROWS:
        raise BadFile(
            f"{path}: {len(rows)} lines after its head; {ROWS} a photo are wanted; copy it again"
        )
    out = Gathered(path, "Pix4D", photos, Z_UP)
    shift = offset_beside(path)
    for first in range(0, len(rows), ROWS):
        words = rows[first].rsplit(maxsplit=2)
        if len(words) != 3:
            raise BadFile(f"{path}: {rows[first][:40]!r} is no name, width and height")
        name, where = words[0], f"{path}: {words[0]}"
        width, height = TableWords(path, " ".join(words[1:])).numbers(2)
        size = checked_size(width, height, where)
        numbers = TableWords(path, " ".join(rows[first + 1 : first + ROWS]))
        k = np.reshape(numbers.numbers(9), (3, 3))
        radial, tangential = numbers.numbers(3), numbers.numbers(2)
        place, rotation = np.array(numbers.numbers(3)), np.reshape(numbers.numbers(9), (3, 3))
        pinhole = (k[0, 0], k[1, 1], k[0, 2], k[1, 2])
        lens = brown_lens(size, pinhole, radial, tangential, where)
        out.add(name, world_from(rotation, place + shift), lens)
    return out.finished()


def offset_beside(path: Path) -> np.ndarray:
    """(3,) what Pix4D has taken off all places, metres; zeros without the file."""
    name = path.name.partition("_calibrated_camera_parameters")[0]
    table = path.with_name(f"{name}_offset.xyz")
    return (
        np.array(TableWords(table, text_in(table)).numbers(3)) if table.is_file() else np.zeros(3)
    )


# Scaniverse's raw data (scan.pb, frames.pb) as descaniverse writes it as JSON: 'scan' and 'frames'
# with a focal length, a principal point, a quaternion xyzw and a place each.

MOST_BYTES = 1 << 30
LARGE, SMALL = "imgl", "img"  # folders of photos; the numbers of the lens are of small ones


def scaniverse_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """World from camera, OpenCV axes; the large photos where there are such.  Raises BadFile."""
    from scipy.spatial.transform import Rotation

    said = Fields(read_json(path, most_bytes=MOST_BYTES), str(path))
    sizes = said.object("scan").object("configuration")
    small, large = (size_of(sizes, key) for key in ("smallImageSize", "largeImageSize"))
    rows = said.object("frames").rows("frames", 1 << 24, "frame", 0)
    any_large = any(row.value("isLargeImage", False) is True for row in rows)
    size, folder = (large, LARGE) if any_large else (small, SMALL)
    scale = size[0] / small[0]
    out = Gathered(path, "Scaniverse", photos)
    for row in rows:
        if any_large and row.value("isLargeImage", False) is not True:
            continue
        name = f"{folder}/{int(row.number('id', 0.0)):05d}.jpg"
        camera, place = row.object("camera"), row.object("transform")
        xyzw = place.numbers("rotation", 4)
        if not math.hypot(*xyzw) > 0.5:
            raise BadFile(f"{row.where}: its quaternion has no direction; write it again")
        turn = Rotation.from_quat(xyzw).as_matrix()
        pose = world_from(turn.T, np.array(place.numbers("translation", 3)))
        f, *centre = (scale * camera.number(key) for key in ("f", "px", "py"))
        out.add(name, pose, checked_lens("PINHOLE", size, (f, f, *centre), row.where))
    return out.finished()


def size_of(said: Fields, key: str) -> tuple[int, int]:
    size = said.object(key)
    return checked_size(size.value("width"), size.value("height"), size.where)


PEEK_BYTES = 1 << 16
MOST_LOOKED_AT = 400  # files of a folder, and folders in it
ENDINGS = {".xml", ".csv", ".json", ".sfm", ".out", ".nvm", ".txt", ".geojson", ".xmp"}
XMP = ".xmp"  # one beside each photo
NO_POINTS = "points3D.txt"  # of COLMAP; without points it has no bytes


@dataclass(frozen=True)
class Form:
    """One form of file."""

    program: str
    read: Callable[[Path, PhotoIndex], PosedFrames]
    marks: tuple[str, ...]  # expressions that are all found at the file's beginning
    endings: tuple[str, ...]


FORMS = (
    Form("Metashape", metashape_frames, (r"<document\b", r"<chunk\b"), (".xml",)),
    Form("Blocks Exchange", blocks_frames, (r"<BlocksExchange\b",), (".xml",)),
    Form("RealityScan", realityscan_frames,
         (r"(?im)^\ufeff?#?name *[,;\t] *x *[,;\t] *y *[,;\t].*(heading|yaw)",), (".csv", ".txt")),
    Form("OpenMVG", openmvg_frames, (r'"sfm_data_version"',), (".json",)),
    Form("Scaniverse", scaniverse_frames, (r'"largeImageSize"', r'"smallImageSize"'), (".json",)),
    Form("Meshroom", alicevision_frames, (r'"version"', r'"viewId"|"intrinsicId"|"poseId"'),
         (".sfm", ".json")),
    Form("OpenDroneMap", odm_frames, (r'"FeatureCollection"', r'"rotation"', r'"filename"'),
         (".geojson", ".json")),
    Form("OpenSfM", opensfm_frames, (r"^\s*\[\s*\{", r'"projection_type"'), (".json",)),
    Form("Bundler", bundler_frames, (r"^\s*# Bundle file",), (".out", ".txt")),
    Form("RealityScan", xmp_frames, (r"xcr:Rotation",), (XMP,)),
    Form("VisualSFM", nvm_frames, (r"^\s*NVM_V3",), (".nvm",)),
    Form("Pix4D", pix4d_frames, (MARK,), (".txt",)),
)  # fmt: skip
# Of OpenDroneMap's folder: the reconstruction has the lenses with it.
LENSES = "cameras.json"
ODM = ("opensfm/reconstruction.json", SHOTS)


def head_of(path: Path) -> bytes:
    """Its first bytes; b"" of what cannot be read, which is then nobody's."""
    try:
        with path.open("rb") as file:
            return file.read(PEEK_BYTES)
    except OSError:
        return b""


def form_of(path: Path, head: bytes | None = None) -> Form | None:
    """Whose form a file has, by its ending and its beginning."""
    if path.suffix.lower() not in ENDINGS or not path.is_file():
        return None
    head = head_of(path) if head is None else head
    text = head.decode(
        "utf-16" if head[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", "replace"
    )
    for form in FORMS:
        if path.suffix.lower() in form.endings and all(re.search(m, text) for m in form.marks):
            return form
    return None


def is_table_of_lenses(path: Path) -> bool:
    """Whether a cameras.json is OpenSfM's or OpenDroneMap's, which has no poses."""
    head = head_of(path) if path.name == LENSES else b""
    return b'"projection_type"' in head and b'"frames"' not in head


def files_of(folder: Path) -> list[Path]:
    found = sorted(p for p in folder.iterdir() if p.suffix.lower() in ENDINGS)
    return found[:MOST_LOOKED_AT]


def forms_in(folder: Path) -> list[tuple[Path, Form]]:
    """The files of other programs' poses in a folder, the newest first."""
    found = [(p, form) for p in files_of(folder) if (form := form_of(p)) is not None]
    found.sort(key=lambda row: -row[0].stat().st_mtime_ns)
    whole = [row for row in found if row[0].suffix.lower() != XMP]
    return whole or found[:1]  # all of them are read together


def find_foreign(folder: Path) -> list[tuple[Path, Form]]:
    """Files with poses of photos in `folder`, best first: in it, below it, above it.

    Of several in one place the newest is first.
    """
    for name in ODM:
        if (form := form_of(folder / name)) is not None:
            return [(folder / name, form)]
    if found := forms_in(folder):
        return found
    inside = sorted(p for p in folder.iterdir() if p.is_dir() and not p.name.startswith("."))
    for place in inside[:MOST_LOOKED_AT]:
        if found := forms_in(place):
            return found
    above = folder.absolute().parent
    return forms_in(above) if above != folder.absolute() else []


def read_foreign(path: Path) -> PosedFrames | None:
    """The frames of a file, or of a folder with photos; None where none of these forms is there.

    Raises BadFile.
    """
    if path.is_file():
        form = form_of(path)
        return None if form is None else form.read(path, photos_of(path))
    if not path.is_dir() or not (found := find_foreign(path)):
        return None
    photos = PhotoIndex(path)
    if not photos.by_name and found[0][0].parent != path:
        return None  # what lies elsewhere is of this folder only where it has photos
    file, form = found[0]
    posed = form.read(file, photos)
    if file.parent == path.absolute().parent and not any(
        (path / frame["file_path"]).is_file() for frame in posed.frames
    ):
        return None  # of other photos
    return replace(posed, doubts=(*posed.doubts, *said_of(found[1:])))


def said_of(others: Sequence[tuple[Path, Form]]) -> tuple[str, ...]:
    """That there are more of them."""
    if not others:
        return ()
    listed = ", ".join(f"{name_line(path.name)} ({form.program})" for path, form in others[:3])
    return (f"Beside it lie {listed}; the newest is used, name another file to use that.",)


def photos_of(path: Path) -> PhotoIndex:
    """The photos of a file that was named: below its folder, else beside that, no deeper, since
    what lies there may be of others."""
    own = path.absolute().parent
    photos = PhotoIndex(own)
    if photos.by_name or own.parent == own:
        return photos
    above = PhotoIndex(own.parent, 1)
    return above if above.by_name else photos


def is_blank(path: Path) -> bool:
    """Whether a file that may be of poses begins with nothing: it has no bytes, or blanks and
    zeros, as a disk leaves one that was full.
    """
    if path.suffix.lower() not in ENDINGS or path.name == NO_POINTS or not path.is_file():
        return False
    return not head_of(path).removeprefix(b"\xef\xbb\xbf").strip(b"\0 \t\r\n")


def refuse_known(path: Path) -> None:
    """Raises BadFile for a file that holds, or stands for, poses in a form that is not read, or
    holds nothing.
    """
    if is_blank(path):
        raise BadFile(f"{path} is empty: it has {blank_bytes(path)}; copy or export it again.")
    if path.is_file() and (program := program_of(path, head_of(path))) is not None:
        raise BadFile(f"{path} is {program.what}, which is not read here; {program.advice}.")


def blank_bytes(path: Path) -> str:
    size = path.stat().st_size
    return f"{size:,} bytes, all blanks or zeros" if size else "0 bytes"


def blank_beside(folder: Path) -> str:
    """What to do about an empty file that may have been of poses, where forms are looked for: in
    a folder, below it, above it; "" where there is none.
    """
    inside = sorted(p for p in folder.iterdir() if p.is_dir() and not p.name.startswith("."))
    for place in (folder, *inside[:MOST_LOOKED_AT], folder.absolute().parent):
        for path in files_of(place):
            if is_blank(path):
                return f"{path_end(path)} is empty, it has {blank_bytes(path)}"
    return ""


def known_beside(folder: Path) -> str:
    """What to do about a file in a folder, or in the one above, whose poses are not read; "" where
    there is none."""
    for place in (folder, folder.absolute().parent):
        for path in sorted(place.iterdir())[:MOST_LOOKED_AT]:
            program: Program | None = None
            if path.is_file() and path.suffix.lower() not in (".jpg", ".jpeg", ".png"):
                program = program_of(path, head_of(path))
            if program is not None:
                return f"{path_end(path)} is {program.what}: {program.advice}"
    return ""


# Files of other programs that hold poses which are not read: what each is, and the way there.

METASHAPE = "in Metashape: File, Export, Export Cameras (Agisoft XML), and name that file"
REALITYSCAN = (
    "in RealityScan: Alignment, Export, Registration, and there COLMAP or Internal/External camera "
    "parameters"
)
PIX4D = "copy params/NAME_calibrated_camera_parameters.txt from its folder 1_initial"
NETWORK = (
    "save its poses as transforms.json or a COLMAP model where it was made (VGGT: demo_colmap.py)"
)


@dataclass(frozen=True)
class Program:
    what: str
    advice: str
    endings: tuple[str, ...] = ()
    names: tuple[str, ...] = ()  # of whole files
    within: tuple[bytes, ...] = ()  # words that all stand in the first kilobytes


PROGRAMS = (
    Program("a project of Metashape", METASHAPE, (".psx", ".psz")),
    Program("a project of RealityScan", REALITYSCAN, (".rcproj", ".rsproj", ".rcalign")),
    Program("a project of Pix4D", PIX4D, (".p4d", ".p4m")),
    Program("a project of 3DF Zephyr",
            "in Zephyr: Export, Export Cameras, COLMAP or Bundler", (".zep",)),
    Program("a project of Meshroom",
            "add its node ConvertSfMFormat (json), run it, and name the sfm.json that it writes",
            (".mg",)),
    Program("an Alembic file of cameras (Meshroom)",
            "export sfm.json with Meshroom's node ConvertSfMFormat", (".abc",)),
    Program("a project of ContextCapture or iTwin Capture",
            "there: Export, Block to XML (BlocksExchange)", (".ccm", ".s3c")),
    Program("COLMAP's data base, which has photos and matches and no poses",
            "name the model that its mapper makes (sparse/0)", (".db",)),
    Program("OpenMVG's binary scene",
            "openMVG_main_ConvertSfM_DataFormat -i sfm_data.bin -o sfm_data.json", (),
            ("sfm_data.bin",)),
    Program("Scaniverse's raw data",
            "descaniverse (scaniverse_to_json) makes JSON of it, name that", (),
            ("frames.pb", "scan.pb")),
    Program("Stray Scanner's recording, whose photos are a film",
            "find the poses of its photos: the command poses, of rgb.mp4", (),
            ("odometry.csv",)),
    Program("a table of omega, phi and kappa without lenses",
            "export one that has them: Metashape's Agisoft XML, Blocks Exchange, or a COLMAP model",
            within=(b"omega", b"phi", b"kappa")),
    Program("Pix4D's matrices without lenses", PIX4D, ("_pmatrix.txt",)),
    Program("a pickle or arrays of a network (VGGT, DUSt3R, MASt3R, VGGSfM)", NETWORK,
            (".npz", ".npy", ".pkl", ".pt", ".pth")),
)  # fmt: skip


def program_of(path: Path, head: bytes) -> Program | None:
    """What a file is, by its name and its first kilobytes."""
    name, lower = path.name.lower(), head.lower()
    for program in PROGRAMS:
        named = name.endswith(program.endings) if program.endings else False
        inside = bool(program.within) and all(word in lower for word in program.within)
        if name in program.names or (inside if program.within else named):
            return program
    return None
