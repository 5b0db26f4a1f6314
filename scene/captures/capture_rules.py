"""What every reader of captures holds to: rigid poses, up, stops, splits, sizes, background."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, is_number, rows_of, shown
from shapeshift.runtime_models.model import STOP_KINDS, BadFile, Stop
from shapeshift.runtime_models.shapes import three
from shapeshift.runtime_models.stop import USUAL_PALETTE
from shapeshift.runtime_models.stop_names import guess_kind
from shapeshift.runtime_models.stops.stop_formula import check_formulas, read_formula
from shapeshift.scene.cameras.photo_view import subject_distance
from shapeshift.scene.cameras.upright import (
    ASSUMED,
    STATED,
    UNIT_M,
    Up,
    doubts_of_up,
    turn_of_world,
    unit_from,
    up_of_cameras,
    up_of_photos,
    up_of_points,
)
from shapeshift.scene.captures.capture import LEFT_HANDED, ORIGIN, Capture, Photo
from shapeshift.scene.captures.dated_stops import (
    NO_PLACE,
    date_in_entry,
    named_by_date,
    placed_by_date,
)
from shapeshift.scene.captures.photo import decoded, over_black
from shapeshift.scene.captures.radiometric.no_value import SAID_NOTHING, NoValue
from shapeshift.scene.captures.radiometric.number_photos import JPEGS
from shapeshift.scene.captures.radiometric.stated_bands import with_bands
from shapeshift.scene.captures.value_ranges import with_own_ranges

ORTHONORMAL = 1e-3  # largest entry of R^T R - 1 that rounding in a text file may leave
LARGEST_NUMBER = 1e30  # of a value range: what float32 products hold
FARTHEST = 1e12  # metres from zero: beyond that no photo was taken
FINE = 1e-5  # of the cameras' extent, or of a metre: finer steps than float32's are never needed
TOO_NEAR = 4  # near planes: a subject nearer than that has some of it cut off ...
NEAR_SHARE = 0.1  # ... and a near plane at this share of how far away it is
TEST_EVERY = 8  # the held-out photos of the splatting literature: every 8th, from the first
# Worlds of COLMAP's axes are turned as 3DGS PLY files are, whatever their photos say: splats
# trained elsewhere from the same model then lie where the capture is.
COLMAP_UP = (0.0, -1.0, 0.0)
OWN_FORM = "shapeshift-capture"  # is in metres
PLAIN_BORDER = 0.5  # share of a photo's border that must have exactly one colour


@dataclass(frozen=True)
class CaptureWorld:
    """The one turn from a capture's own world to ours, for its cameras and for its points."""

    ours_from_file: np.ndarray  # (4, 4) a rotation; of a left-handed world its x turned round first
    up: tuple[float, float, float]  # what points up in the file's world
    # Metres, our axes: the capture's zero, where the file's own is so far that float32 would lose
    # what lies there (survey coordinates); zeros nearly always.
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ups: tuple[Up, ...] = ()  # in our axes: what was taken, and what the photos say
    unit_m: float = 1.0  # metres of one unit of the file's world

    metres: str = ""  # who says how long a metre is in it; "": nobody yet

    @staticmethod
    def of(
        cameras: np.ndarray, otherwise: tuple, said: Mapping, where: str, usual: tuple | None = None
    ) -> "CaptureWorld":
        """By the 'up' and 'unit_m' that a file has `said`; without 'up' by `usual`, else as photos
        (N, 4, 4; world from camera, OpenCV axes) tell: the world axis nearest to their mean, or
        `otherwise` where they disagree.
        """
        up, unit_m = said.get("up"), unit_from(said, where)
        taken = Up(ASSUMED if up is None else STATED, (0.0, 1.0, 0.0))
        up = usual if up is None else up
        up = up_of_cameras(cameras, otherwise) if up is None else up
        turn = turn_of_world(up, is_left_handed(cameras, where), where)
        ours = turn[:3, :3] @ cameras[:, :3]
        origin, photos = near_origin(ours[:, :, 3] * unit_m), up_of_photos(ours)
        own = "its own form" if said.get("format") == OWN_FORM else ""
        return CaptureWorld(
            turn, three(np.asarray(up, np.float64) + 0.0), origin,  # + 0.0: never -0.0
            (taken,) if photos is None else (taken, photos), unit_m,
            "its own word" if unit_m != 1 else own or "survey coordinates" * any(origin),
        )  # fmt: skip

    @property
    def left_handed(self) -> bool:
        return bool(np.linalg.det(self.ours_from_file[:3, :3]) < 0)

    def turned(self, matrix: np.ndarray) -> np.ndarray:
        out = self.ours_from_file @ matrix
        out[:3, 3] = out[:3, 3] * self.unit_m - self.origin
        return out

    def capture(
        self,
        folder: Path,
        stops: tuple[Stop, ...],
        photos: list[Photo],
        points: np.ndarray | None,
        colors: np.ndarray | None,
        background: tuple | None,
        guessed: bool,
        notes: dict | None = None,
        doubts: tuple[str, ...] = (),
    ) -> Capture:
        """The finished capture; `guessed` = nobody said what the modalities are."""
        formulas = tuple(stop for stop in stops if stop.formula)
        stops = tuple(stop for stop in stops if not stop.formula)
        stops, photos, more = with_own_ranges(stops, photos)
        try:
            check_formulas((*stops, *formulas))
        except ValueError as error:
            raise BadFile(f"{folder}: {error}") from None
        notes = {"up_in_file": self.up} | (notes or {})
        if self.left_handed:
            notes[LEFT_HANDED] = True
            more += (
                "Its poses mirror the world, as those of left-handed axes do; its x axis is turned "
                "round, so that left and right are as in the photos.",
            )
        if background is None:
            background = plain_background(photos)
            notes["background"] = "found in the photos" if background else "none stated, none found"
        for stop in stops:
            if not any(p.modality == stop.name and p.split == "train" for p in photos):
                raise BadFile(f"{folder}: modality {shown(stop.name)} has no photos to train on")
        ups = self.ups
        if points is not None:
            points = points @ self.ours_from_file[:3, :3].T * self.unit_m - np.array(self.origin)
            points = points.astype(np.float32)
            eyes = np.array([photo.view.world_from_eye.position for photo in photos])
            plane = up_of_points(points, eyes, self.ups) if self.ups else None
            ups += () if plane is None else (plane,)
        more += doubts_of_up(ups, self.ours_from_file)
        notes.pop(UNIT_M, None)  # of a capture that this one was made of
        notes |= {UNIT_M: self.unit_m} if self.unit_m != 1 else {}
        if any(self.origin):
            notes[ORIGIN] = self.origin
            x, y, z = self.origin
            more += (f"It lies far from zero; {x:.0f}, {y:.0f}, {z:.0f} (+Y up) is taken off.",)
        return Capture(
            folder,
            colored_by_palette(stops, photos) if guessed else stops,
            with_near_planes(photos),
            points,
            colors,
            background,
            notes,
            doubts + more,
            formulas,
            metres=self.metres or "its depth photos" * any(p.depth is not None for p in photos),
            ups=ups,
        )


def near_origin(eyes: np.ndarray) -> tuple[float, float, float]:
    """What to take off all places: whole kilometres, so that two captures of a site have the same.

    eyes: (N, 3) float64 metres.
    """
    middle = np.median(eyes, axis=0)
    extent = float(np.abs(eyes - middle).max())
    if not np.spacing(np.float32(np.abs(eyes).max())) > FINE * max(extent, 1.0):
        return (0.0, 0.0, 0.0)
    return three(np.round(middle / 1000) * 1000 + 0.0)


def with_near_planes(photos: list[Photo]) -> tuple[Photo, ...]:
    """The photos, with planes near enough for what is photographed from centimetres away, or in a
    unit in which it is.
    """
    views = [photo.view for photo in photos]
    away = subject_distance(views)
    if not 0 < away < TOO_NEAR * min(view.near for view in views):
        return tuple(photos)
    near = NEAR_SHARE * away
    return tuple(replace(photo, view=replace(photo.view, near=near)) for photo in photos)


def rigid(matrix: object, where: str, may_mirror: bool = False) -> np.ndarray:
    """(4, 4) float64 world_from_camera, its rotation made exactly orthonormal; or BadFile.

    A scale of the matrix is left out: it moves neither the camera nor what it sees.
    may_mirror: as in a left-handed world, which CaptureWorld then turns round.
    """
    try:
        m = np.asarray(matrix, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise BadFile(f"{where}: the pose is no matrix of numbers; give 4 rows of 4") from None
    if m.shape not in ((3, 4), (4, 4)):
        raise BadFile(f"{where}: the pose has shape {m.shape!s:.40}; give 4 rows of 4 numbers")
    if not np.isfinite(m).all():
        raise BadFile(f"{where}: the pose holds NaN or Inf; pose this photo again or drop it")
    if not np.abs(m[:3, 3]).max() <= FARTHEST:
        raise BadFile(
            f"{where}: the pose is beyond {FARTHEST:g} m; pose this photo again or drop it"
        )
    with np.errstate(over="ignore", invalid="ignore"):  # 1e300 is no rotation either
        # Of one scale in all directions, as Blender's and Unity's cameras have, nothing is seen.
        scale = float(np.cbrt(np.abs(np.linalg.det(m[:3, :3]))))
        rotation = m[:3, :3] / (scale if 0 < scale < np.inf else 1.0)
        error = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if not error <= ORTHONORMAL:
        raise BadFile(
            f"{where}: the pose is no rotation (R^T R differs from 1 by {error:.3g}); "
            "give camera-to-world matrices without shear, and of one scale in all directions"
        )
    if not (may_mirror or np.linalg.det(rotation) > 0):
        raise BadFile(f"{where}: the pose mirrors the world; flip one axis of its matrix")
    out = np.eye(4)
    u, _, vt = np.linalg.svd(rotation)
    out[:3, :3], out[:3, 3] = u @ vt, m[:3, 3]
    return out


def is_left_handed(world_from_cameras: np.ndarray, where: str) -> bool:
    """Whether all poses (N, 4, 4) mirror.  Raises BadFile where some do and others do not."""
    mirrored = np.linalg.det(np.asarray(world_from_cameras)[:, :3, :3]) < 0
    if mirrored.any() and not mirrored.all():
        raise BadFile(
            f"{where}: {mirrored.sum()} of {len(mirrored)} poses mirror the world and the others "
            "do not; flip one axis of their matrices, or drop them"
        )
    return bool(mirrored.any())


def spread_stops(names: Iterable[str], kinds: Sequence[str] = ()) -> tuple[Stop, ...]:
    """Stops evenly from 0 to 1 in the order of the names, the kind read from the name unless it is
    given; names that are dates are stops of visible light as far apart as these.
    """
    names = list(names)
    kinds = kinds or [guess_kind(name, len(names)) for name in names]
    if dated := named_by_date(names):
        return dated
    xs = np.linspace(0, 1, len(names)) if len(names) > 1 else [0.0]
    return tuple(Stop(name, float(x), kind) for name, x, kind in zip(names, xs, kinds, strict=True))


def colored_by_palette(stops: tuple[Stop, ...], photos: list[Photo]) -> tuple[Stop, ...]:
    """Stops of values get a palette where their photos are grey; false colours stay as they are."""
    first = {photo.modality: photo for photo in reversed(photos)}

    def grey(name: str) -> bool:
        photo = first[name]
        return is_grey(photo.path, photo.counts, photo.band)

    return tuple(
        replace(s, palette=USUAL_PALETTE[s.kind]) if s.is_measured and grey(s.name) else s
        for s in stops
    )


def is_grey(path: Path, counts: tuple[float, float] | None = None, band: int = 0) -> bool:
    """Whether no pixel of a photo has a colour.  counts, band: as of Photo."""
    image = decoded(path, counts, band=band).image
    return image.mode == "L" or bool((np.ptp(np.asarray(over_black(image)), axis=2) == 0).all())


def stops_from(listed: object, where: str) -> list[Stop]:
    """The stops of a list of JSON objects, in its order, every field checked."""
    if not isinstance(listed, list) or not all(isinstance(entry, dict) for entry in listed):
        raise BadFile(f"{where}: 'modalities' must be a list of names or of objects")
    stops = [stop_from(row, where) for row in rows_of(listed, f"{where}: modality", 1)]
    if len({stop.name for stop in stops}) < len(stops):
        raise BadFile(f"{where}: two modalities have the same name; rename one")
    return list(placed_by_date(stops, where))


def stop_from(entry: Fields, where: str) -> Stop:
    name = entry.text("name")
    entry.where = f"{where}: modality {shown(name)}"
    date = date_in_entry(entry)
    x, kind = NO_PLACE, "rgb"
    if entry.has("x") or not date:
        x = entry.number("x", wanted="0 to 1", low=0, high=1)
    if entry.has("kind"):
        kind = entry.line("kind", "rgb", known=STOP_KINDS)
    ends = entry.pair("value_range", most=LARGEST_NUMBER) if entry.has("value_range") else None
    palette, unit, formula = (entry.text(key, "") for key in ("palette", "unit", "formula"))
    try:
        if formula:  # of which stops is looked at when their photos are there
            read_formula(formula)
        return Stop(name, x, kind, palette, ends, unit, date, formula)
    except ValueError as error:
        raise BadFile(f"{entry.where}: {error}") from None


def counts_from(listed: object, where: str) -> dict[str, tuple[float, float]]:
    """Of the modalities that have 'counts': which numbers of a grey photo stand for 0 and 1."""
    out: dict[str, tuple[float, float]] = {}
    for entry in listed if isinstance(listed, list) else ():
        if isinstance(entry, dict) and entry.get("counts") is not None:
            fields = Fields(entry, f"{where}: modality {shown(entry.get('name'))}")
            out[fields.text("name")] = fields.pair("counts", most=LARGEST_NUMBER)
    return out


def with_counts(photos: list[Photo], listed: object, where: str) -> list[Photo]:
    """The photos with what the list of modalities says of the numbers in them."""
    if not (isinstance(listed, list) and any(isinstance(entry, dict) for entry in listed)):
        return photos
    counts, no_value = counts_from(listed, where), no_value_from(listed, where)
    out = []
    for photo in with_bands(photos, listed, where):
        ends, said = counts.get(photo.modality), no_value.get(photo.modality, SAID_NOTHING)
        # A camera's own numbers lie in JPEG files, whose header is that of a picture.
        numbers = ends is not None and photo.path.suffix.lower() in JPEGS and not photo.band
        gaps = photo.may_lack_values or numbers or said != SAID_NOTHING
        out.append(replace(photo, counts=ends, no_value=said, may_lack_values=gaps))
    return out


def no_value_from(listed: object, where: str) -> dict[str, NoValue]:
    """Of the modalities that have 'no_data' or 'valid_range': what is no value in their photos."""
    out: dict[str, NoValue] = {}
    for entry in listed if isinstance(listed, list) else ():
        if not isinstance(entry, dict):
            continue
        fields = Fields(entry, f"{where}: modality {shown(entry.get('name'))}")
        numbers: tuple = ()
        if fields.has("no_data"):
            said = entry["no_data"]
            numbers = tuple(said) if isinstance(said, list) else (said,)
            numbers = tuple(n for n in numbers if not is_nan(n))  # is none in any case
            if not all(is_number(n) for n in numbers):
                raise fields.error("no_data", "a number, or a list of numbers, that hold no value")
        valid = fields.pair("valid_range") if fields.has("valid_range") else None
        if fields.has("no_data") or valid is not None:
            out[fields.text("name")] = NoValue(tuple(map(float, numbers)), valid)
    return out


def is_nan(value: object) -> bool:
    """As JSON may have it, or a text."""
    return str(value).strip().lower() == "nan"


def background_from(entry: Mapping, where: str) -> tuple[float, float, float] | None:
    """The colour 'background', display sRGB; None where none is stated."""
    fields = Fields(entry, where)
    if not fields.has("background"):
        return None
    color = three(fields.numbers("background", 3))
    if not all(0 <= c <= 1 for c in color):
        raise fields.error("background", "a list of three numbers from 0 to 1")
    return color


def split_every_8th(photos: list[Photo]) -> list[Photo]:
    """Every 8th photo of each modality, by name, becomes a test photo; fewer than 3 all train."""
    tests = set()
    for name in {p.modality for p in photos}:
        paths = {p.path for p in photos if p.modality == name}  # once of a panorama
        mine = sorted(paths, key=lambda path: path.parts)
        tests |= set(mine[::TEST_EVERY]) if len(mine) >= 3 else set()
    rows = [(p, "test" if p.path in tests else "train") for p in photos]
    return [p if p.split == split else replace(p, split=split) for p, split in rows]


def plain_background(photos: list[Photo]) -> tuple[float, float, float] | None:
    """The one colour that most of the border of (nearly) all photos has exactly, else None.

    Rendered captures have such a border, photographed ones do not.  Looks at up to 8 photos.
    """
    found = []
    for photo in photos[:: max(1, len(photos) // 8)][:8]:
        image, _, known = decoded(
            photo.path, photo.counts, no_value=photo.no_value, band=photo.band
        )
        if photo.mask is not None or image.mode == "RGBA":
            return None
        border = border_of(np.asarray(image.convert("RGB")))
        if known is not None:  # what has no value is no colour
            border = border[border_of(np.asarray(known)) > 0]
        if not len(border):
            continue
        colors, counts = np.unique(border, axis=0, return_counts=True)
        if counts.max() >= PLAIN_BORDER * len(border):
            color = colors[counts.argmax()].astype(np.float32) / 255
            found.append(three(color))
    if not found or Counter(found).most_common(1)[0][1] < min(4, len(photos)):
        return None
    return Counter(found).most_common(1)[0][0]


def border_of(pixels: np.ndarray) -> np.ndarray:
    """(P, ...) the outermost pixels of a picture (H, W, ...)."""
    return np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
