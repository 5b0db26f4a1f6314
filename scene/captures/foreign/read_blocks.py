"""Blocks Exchange, the XML of ContextCapture and iTwin Capture, which Metashape and DJI Terra write
as well ("CC Orientations": developer.bentley.com/apis/contextcapture/cc-ori).
"""

from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from shapeshift.runtime_models.files.memory import Memory, refuse_empty
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture_rules import LARGEST_NUMBER
from shapeshift.scene.captures.colmap_tables import BROWN, ColmapCamera
from shapeshift.scene.captures.foreign.foreign_frames import (
    Z_UP,
    Gathered,
    PhotoIndex,
    checked_lens,
    checked_size,
    geocentric_up,
    world_from,
)
from shapeshift.scene.captures.scans.posed_frames import PosedFrames

# OpenCV's axes of the camera (right, down, ahead) from those that the file turns its world to.
AXES = {
    "XRightYDown": ((1, 0), (0, 1)), "XLeftYDown": ((-1, 0), (0, 1)),
    "XLeftYUp": ((-1, 0), (0, -1)), "XRightYUp": ((1, 0), (0, -1)),
    "XDownYRight": ((0, 1), (1, 0)), "XDownYLeft": ((0, -1), (1, 0)),
    "XUpYLeft": ((0, -1), (-1, 0)), "XUpYRight": ((0, 1), (-1, 0)),
}  # fmt: skip
DEGREES = ("EPSG:4326", "EPSG:4979", "GEOGCS", "GEOGCRS", "WGS84")


def blocks_frames(path: Path, photos: PhotoIndex) -> PosedFrames:
    """Raises BadFile."""
    root = read_xml(path)
    block = root.find("Block")
    groups = [] if block is None else block.findall("Photogroups/Photogroup")
    if not groups:
        raise BadFile(f"{path} holds no Photogroup; export the block with its photos")
    refuse_degrees(root, block, str(path))
    out = Gathered(path, "Blocks Exchange", photos)
    places = []
    for number, group in enumerate(groups):
        where = f"{path}: Photogroup {number}"
        lens = lens_of(group, where)
        turn = axes_of(text_of(group, "CameraOrientation", "XRightYDown"), where)
        for photo in group.iterfind("Photo"):
            name = text_of(photo, "ImagePath")
            where_photo = f"{where}, photo {name[-60:]!r}"
            rotation = rotation_of(photo.find("Pose/Rotation"), where_photo)
            centre = photo.find("Pose/Center")
            if rotation is None or centre is None:
                out.leave(name, "have no pose, or one of yaw, pitch and roll alone")
            elif lens is None:
                out.leave(name, "have a lens that is not read here (fisheye)")
            else:
                place = np.array([number_of(centre, axis, where_photo) for axis in "xyz"])
                places.append(place)
                out.add(name, world_from(turn @ rotation, place), lens)
    if places:
        out.up = geocentric_up(np.array(places)) or Z_UP
    return out.finished()


def refuse_degrees(root: Element, block: Element | None, where: str) -> None:
    """Raises BadFile where places are longitudes and latitudes."""
    number = text_of(block, "SRSId")
    for system in root.iterfind("SpatialReferenceSystems/SRS"):
        named = text_of(system, "Definition").upper()
        if number and text_of(system, "Id") == number and named.startswith(DEGREES):
            raise BadFile(
                f"{where}: its places are degrees ({named:.40}); export the block in a system of "
                "metres, such as UTM"
            )


def axes_of(name: str, where: str) -> np.ndarray:
    """(3, 3) OpenCV from the file's axes of a camera."""
    if name not in AXES:
        raise BadFile(f"{where}: CameraOrientation is {name[:40]!r}; XRightYDown is wanted")
    out = np.zeros((3, 3))
    out[:2, :2] = AXES[name]
    out[2, 2] = np.linalg.det(out[:2, :2])
    return out


def rotation_of(element: Element | None, where: str) -> np.ndarray | None:
    """(3, 3) camera from world, of its nine numbers or of omega, phi, kappa in degrees."""
    if element is None:
        return None
    if element.find("M_00") is not None:
        rows = range(3)
        return np.array([[number_of(element, f"M_{r}{c}", where) for c in rows] for r in rows])
    if element.find("Omega") is None:
        return None
    omega, phi, kappa = (
        np.radians(number_of(element, key, where)) for key in ("Omega", "Phi", "Kappa")
    )
    return camera_from_angles(omega, phi, kappa)


def camera_from_angles(omega: float, phi: float, kappa: float) -> np.ndarray:
    """(3, 3) camera from world, photogrammetry's angles in radians: the camera is turned about x,
    then about its new y, then about its new z."""
    (so, sp, sk), (co, cp, ck) = np.sin([omega, phi, kappa]), np.cos([omega, phi, kappa])
    about_x = np.array([[1, 0, 0], [0, co, so], [0, -so, co]])
    about_y = np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
    about_z = np.array([[ck, sk, 0], [-sk, ck, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def lens_of(group: Element, where: str) -> ColmapCamera | None:
    sides = group.find("ImageDimensions")
    width, height = (number_of(sides, key, where) for key in ("Width", "Height"))
    size = checked_size(width, height, where)
    if text_of(group, "CameraModelType", "Perspective") == "Spherical":
        return ColmapCamera.panorama(size)
    if text_of(group, "CameraModelType", "Perspective") != "Perspective":
        return None
    if text_of(group, "FocalLengthPixels"):
        f = number_of(group, "FocalLengthPixels", where)
    else:  # millimetres, of the longer side
        f = number_of(group, "FocalLength", where) * max(size)
        f /= number_of(group, "SensorSize", where) or np.nan
    centre, bends = group.find("PrincipalPoint"), group.find("Distortion")
    cx, cy = (number_of(centre, key, where, side / 2) for key, side in zip("xy", size, strict=True))
    # Its P1 goes with x: OpenCV's p2.
    names = ("K1", "K2", "K3", "", "P2", "P1")
    each = [number_of(bends, key, where, 0.0) if key else 0.0 for key in names]
    skew = number_of(group, "Skew", where, 0.0) / (f or 1)
    fy = f * number_of(group, "AspectRatio", where, 1.0)
    return checked_lens(BROWN, size, (f, fy, cx, cy, *each, 0.0, 0.0, skew), where)


# XML of other programs: a tree of plain elements, and nothing that a document type may do.

A_BYTE = 48  # of memory for each byte: "<a b=''/>" becomes an element with a dictionary, 400
MOST_BYTES = 1 << 30
DEEPEST = 100  # elements in elements


def read_xml(path: Path) -> Element:
    """The root; the memory of the tree is charged before.

    A document type is refused: with entities a few lines become gigabytes, or files of this
    machine.  Raises BadFile.
    """
    refuse_empty(path)
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise BadFile(f"{path} has {size:,} bytes; at most {MOST_BYTES:,} are read.")
    Memory().of(path).charge(A_BYTE * size, "its elements")
    builder, depth = TreeBuilder(), [0]
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def start(name: str, attributes: dict) -> None:
        depth[0] += 1
        if depth[0] > DEEPEST:
            raise BadFile(f"{path}: elements lie more than {DEEPEST} deep in each other.")
        builder.start(name.rpartition(":")[2], attributes)

    def end(name: str) -> None:
        depth[0] -= 1
        builder.end(name.rpartition(":")[2])

    def refuse(*_: object) -> None:
        raise BadFile(
            f"{path} has a document type (DOCTYPE), which no program of cameras writes; export it "
            "again, or take that line out."
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(path.read_bytes(), True)
        return builder.close()
    except BadFile:  # which is a ValueError
        raise
    except (expat.ExpatError, ValueError, AssertionError, LookupError) as error:
        raise BadFile(f"{path} is no XML ({error!s:.60}); export it again.") from None


def text_of(element: Element | None, name: str, default: str = "") -> str:
    found = None if element is None else element.find(name)
    return default if found is None or found.text is None else found.text.strip()


def number_of(
    element: Element | None, name: str, where: str, default: float | None = None
) -> float:
    """The number under a name.  Raises BadFile for none where there is no default."""
    text = text_of(element, name)
    if not text and default is not None:
        return default
    try:
        return finite(float(text))
    except ValueError:
        raise BadFile(f"{where}: {name} is {text[:40]!r}; a number is wanted") from None


def numbers_in(text: str, count: int, where: str) -> list[float]:
    try:
        values = [finite(float(word)) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count:
        raise BadFile(f"{where}: {count} numbers are wanted; export it again")
    return values


def finite(value: float) -> float:
    if not abs(value) <= LARGEST_NUMBER:  # NaN is not
        raise ValueError
    return value
