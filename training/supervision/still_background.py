"""What stands still behind a turntable: recognised, and cut out of a run's photos.

A camera on a tripod sees its room at the same pixels in every photo, while the poses, which are
those about the subject, go around.  That picture belongs to the camera, not to the scene: where a
photo shows it, the photo does not show the subject.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from shapeshift.training.first_anchors.hull import (
    UNKNOWN,
    VOTE_SIDE,
    Silhouette,
    carve,
    uncovered,
)
from shapeshift.training.first_anchors.views import common_box
from shapeshift.training.photo_store.open_photos import TrainingPhotos
from shapeshift.training.photos import LoadedPhoto, sampled
from shapeshift.training.supervision.backgrounds import (
    ALIKE,
    BACKDROP,
    EMPTY,
    counting,
    near,
    shared_color,
)

# The picture that a camera sees behind a subject that turns, and what photos show before it.

STILL = 0.9  # of the photos that have the same colour in a pixel: there nothing moves
LEAST_TOLERANCE = 3.0  # of 255: what rounding leaves of one colour, and a little
NOISES = 4.0  # standard deviations of the camera's noise that pass for the same colour
RARE = 0.998  # of the deviations: JPEG has few large ones, beside edges
FEWEST = 3  # photos that must show the background at a pixel, more than half of those beside it
# From a pixel to the next a subject's outline passes in so many photos, or in this share of them:
# where more do, it may be a wall of few colours that is alike in them, before a bonnet.
LOST, LOST_SHARE = 2, 0.3
# Photos that show something else around a pixel and are like its background there, of those that
# show it: more are a subject of that colour, which rounds a corner into the background.
STRAY = 0.5
# Of the photos within three tolerances, those within one: noise is narrow, a subject that turns
# and happens to be alike is spread.
SHARP = 0.85
MEASURED = 320  # pixels a side, at most, that the noise is measured from
GAPS = 0.02  # of the longer side: in outlines, where the subject has the background's colour


@dataclass(frozen=True)
class StillPicture:
    """Of the photos of one camera."""

    rgb: np.ndarray  # (H, W, 3) uint8
    known: np.ndarray  # (H, W) bool
    tolerance: float  # of 255: what differs by no more is the background
    hidden: float  # of the pixels that are not always alike, those that are known: something hid it


def still_picture(photos: list[np.ndarray]) -> StillPicture:
    """What photos (H, W, 3) uint8 show behind what turns before them.

    It begins where nearly all are alike, in connection with their edges (a plain turntable's middle
    is the same in all photos, and the subject), and grows inwards from pixel to pixel: of the
    photos that show the background beside a pixel, most do so there, too, and then they are alike.
    So a stripe that a few photos from low down show beside a table's rim is known by these few, and
    a table of few colours, alike in as many photos, is none, since photos that do not show the
    background beside it have its colours, too.
    """
    pixels = np.stack(photos)  # (N, H, W, 3)
    tolerance = tolerance_of(pixels)
    rgb = np.median(pixels, axis=0).astype(np.float32)
    agree = np.stack([np.abs(photo - rgb).max(axis=2) <= tolerance for photo in photos])
    known = touching_edges(agree.mean(axis=0) >= STILL)
    rgb[known] = mean_where(pixels[:, known], agree[:, known])
    moved = near(pixels, rgb).mean(axis=0) < STILL
    shows = np.pad(agree & known, ((0, 0), (1, 1), (1, 1)))  # (N, 1 + H + 1, 1 + W + 1)
    grow(pixels, rgb, known, shows, tolerance, LOST_SHARE)
    hidden = float(known[moved].mean()) if moved.any() else 0.0
    if hidden:  # what is behind a subject is known by half
        grow(pixels, rgb, known, shows, tolerance, 1.0)
    return StillPicture(np.rint(rgb).astype(np.uint8), known, tolerance, hidden)


def grow(
    pixels: np.ndarray, rgb: np.ndarray, known: np.ndarray, shows: np.ndarray,
    tolerance: float, lost: float,
) -> None:  # fmt: skip
    """Adds to what is known of the background, from pixel to pixel.

    Changed in place: rgb (H, W, 3) float32; known (H, W) bool; shows (N, H + 2, W + 2) bool, which
    photos show the background there.  lost: as LOST_SHARE.
    """
    from scipy.ndimage import binary_dilation

    left = ~known  # what is still to be tried
    while (front := np.nonzero(left & binary_dilation(known)))[0].size:
        left[front] = False
        row, column = front
        beside = (
            shows[:, row, column + 1]
            | shows[:, row + 2, column + 1]
            | shows[:, row + 1, column]
            | shows[:, row + 1, column + 2]
        )  # fmt: skip  (N, F)
        colors, there = behind(pixels[:, row, column], beside, tolerance, lost)
        found = there.any(axis=0)
        row, column = row[found], column[found]
        rgb[row, column], known[row, column] = colors[found], True
        shows[:, row + 1, column + 1] = there[:, found]
        again = np.zeros_like(known)  # around what is new there is more to go by
        again[row, column] = True
        left |= binary_dilation(again) & ~known


def touching_edges(known: np.ndarray) -> np.ndarray:
    """(H, W) bool: the parts of it that reach the picture's edges."""
    from scipy.ndimage import label

    parts, _ = label(known)
    edges = np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]])
    return np.isin(parts, np.unique(edges[edges > 0]))


def behind(
    pixels: np.ndarray, beside: np.ndarray, tolerance: float, lost: float
) -> tuple[np.ndarray, np.ndarray]:
    """(F, 3) the background's colours at F pixels (N, F, 3) uint8 of N photos, and (N, F) bool
    which photos show it there; none do where it cannot be told.

    beside: (N, F) which photos show the background in a neighbour of the pixel.  Of more than half
    of these that are alike their median is one.  lost: as LOST_SHARE.
    """
    count = beside.sum(axis=0)
    ordered = np.sort(np.where(beside[..., None], pixels, np.int16(256)), axis=0)
    middle = ordered[np.maximum(count - 1, 0) // 2, np.arange(len(count))]  # (F, 3)
    away = np.abs(pixels - middle).max(axis=2)
    alike = away <= tolerance
    shown = (alike & beside).sum(axis=0)
    known = (shown >= FEWEST) & (2 * shown > count)
    known &= count - shown <= np.maximum(LOST, lost * count)
    known &= (alike & ~beside).sum(axis=0) <= STRAY * shown
    known &= shown >= SHARP * ((away <= 3 * tolerance) & beside).sum(axis=0)
    there = alike & beside & known
    return mean_where(pixels, there), there


def mean_where(pixels: np.ndarray, there: np.ndarray) -> np.ndarray:
    """(F, 3) means over the photos of pixels (N, F, 3) where `there` (N, F); 0 where none is."""
    total = np.einsum("nf,nfc->fc", there.astype(np.float32), pixels.astype(np.float32))
    return total / np.maximum(there.sum(axis=0), 1)[:, None]


def tolerance_of(pixels: np.ndarray) -> float:
    """Of 255: how far photos (N, H, W, 3) of one still thing differ, by where most are alike."""
    step = -(-max(pixels.shape[1:3]) // MEASURED)
    pixels = pixels[:, ::step, ::step]
    middle = np.median(pixels, axis=0)
    still = near(pixels, middle).mean(axis=0) >= STILL
    away = np.abs(pixels[:, still] - middle[still])
    noise = away[away <= 255 * BACKDROP]  # the rest is what hides it in single photos
    sigma = float(np.sqrt((noise**2).mean())) if noise.size else 0.0
    tail = float(np.quantile(noise, RARE)) if noise.size else 0.0
    return max(LEAST_TOLERANCE, NOISES * sigma, tail)


def subject_mask(rgb: np.ndarray, still: StillPicture) -> np.ndarray:
    """(H, W) bool: where a photo (H, W, 3) uint8 shows something else than what stands still."""
    from scipy.ndimage import binary_closing, binary_fill_holes, median_filter

    differs = np.abs(rgb.astype(np.int16) - still.rgb).max(axis=2) > still.tolerance
    shown = median_filter((differs | ~still.known).astype(np.uint8), 3) > 0  # without noise
    reach = max(1, round(GAPS * max(shown.shape)))
    closed = binary_closing(np.pad(shown, reach, "edge"), iterations=reach)
    return binary_fill_holes(closed)[reach:-reach, reach:-reach]


def cut_out(photo: LoadedPhoto, still: StillPicture) -> LoadedPhoto:
    """The photo with an alpha that leaves the subject alone; of the rest nothing else is known.

    What does not count, as beyond a lens's edge, is no background.
    """
    rgba = photo.rgba.copy()
    mask = subject_mask(rgba[..., :3], still)
    nothing = photo.weight is not None and ~(photo.weight > 0)
    rgba[..., 3] = np.where(mask | nothing, np.uint8(255), np.uint8(0))
    depth, normals = photo.depth, photo.normals
    if depth is not None:
        depth = np.where(mask, depth, np.float32(0))
    if normals is not None:
        normals = np.where(mask[..., None], normals, np.int8(0))
    return replace(photo, rgba=rgba, masked=True, depth=depth, normals=normals)


STILL_PHOTOS = 24  # that are compared; fewer than 8 may be alike by chance
STILL_PIXELS = 160  # a side that are compared
PICTURE_PHOTOS = 64  # that the picture behind is taken from
TURNED = 30.0  # degrees between two cameras that cannot see the same background
# Of the pixels that do not stand still, those in which something hides the still picture at times:
# 0.12 (a flat disc seen from one height) to 0.66 on turntables; of what nothing ever hides, before
# a room, 0.01 and, JPEGs of a corridor of two colours, 0.06 by chance.
HIDDEN = 0.1
KNOWN = 0.5  # of the photos that must know a pixel before it can be said to stand still
COVERED = 0.05  # of a silhouette may miss the hull of all of them, in the median
Key = tuple[str, tuple[int, int]]  # modality and size: photos of one camera


@dataclass(frozen=True)
class StillBackground:
    """What of some photos stands still while their cameras turn."""

    share: float = 0.0  # of the pixels; 0: nothing does, or one colour is behind the subject
    pictures: dict[Key, StillPicture] = field(default_factory=dict)  # of what is behind the subject

    def cut(self, photo: LoadedPhoto) -> LoadedPhoto:
        """The photo without what stands still behind its subject."""
        picture = self.pictures.get(key_of(photo))
        return photo if picture is None else cut_out(photo, picture)

    def warnings(self) -> list[str]:
        """What a person should know, a sentence each."""
        if not self.share:
            return []
        found = f"{self.share:.0%} of the photos' pixels show the same in all of them, while their "
        if self.pictures:
            return [
                f"{found}cameras turn: what is behind the subject stands still, as behind a "
                "turntable, and is left out; the scene holds the subject alone.  If it is none, "
                "train with --background random."
            ]
        return [
            f"{found}cameras turn, and nothing ever stands before them: it belongs to the camera "
            "and cannot be learned; give masks that leave it out (docs/training.md)."
        ]


def key_of(photo: LoadedPhoto) -> Key:
    return photo.modality, photo.view.size


def leave_out_still(
    photos: TrainingPhotos, background: str, known: tuple | None
) -> tuple[TrainingPhotos, StillBackground]:
    """The photos of a run without what stands still behind their subject, and what that is.

    background: the setting; where it or the capture (`known`) names one, nothing is looked for.
    """
    if background != "auto" or known is not None:
        return photos, StillBackground()
    if photos.left_out is None:
        found = still_background(photos.train)
        photos = photos.changed(found.cut, found.pictures.keys()) if found.pictures else photos
        photos.left_out = found
    return photos, photos.left_out


def still_background(photos: list[LoadedPhoto]) -> StillBackground:
    """What stands still in photos of any cameras, and where that is behind a subject.

    It assumes that the subject is seen from around and hides its background in some photos more
    than in others; what a camera carries before it (a bonnet, a helmet's rim) is no background.
    """
    cameras: dict[Key, list[LoadedPhoto]] = {}
    for photo in photos:
        cameras.setdefault(key_of(photo), []).append(photo)
    shares = {key: still_share(mine) for key, mine in cameras.items()}
    if not any(shares.values()) or shared_color(photos) is not None:
        return StillBackground()
    pictures: dict[Key, StillPicture] = {}
    for key in (key for key, share in shares.items() if share):
        mine = chosen(cameras[key], PICTURE_PHOTOS)
        pixels = as_others_show(mine)
        picture = still_picture(pixels)
        shapes = [
            (p.view, np.where(counting(p), subject_mask(rgb, picture), UNKNOWN))
            for p, rgb in zip(mine, pixels, strict=True)
        ]
        if picture.hidden >= HIDDEN and fit_together(shapes):
            pictures[key] = picture
    return StillBackground(max(shares.values(), default=0.0), pictures)


def chosen(photos: list, most: int) -> list:
    """At most so many, evenly."""
    return photos[:: -(-len(photos) // most)] if photos else []


def still_share(photos: list[LoadedPhoto]) -> float:
    """How much of the photos shows a picture that stands still while their cameras turn; 0: none.

    It assumes photos of one size that are no picture of one colour there, without masks; a car's
    bonnet is found, too, an even sky is not.  At most STILL_PHOTOS are compared.
    """
    if not photos or any(photo.see_through for photo in sampled(photos)):
        return 0.0
    alike = chosen([p for p in photos if key_of(p) == key_of(photos[0])], STILL_PHOTOS)
    ahead = np.array([photo.view.world_from_eye.matrix()[:3, 2] for photo in alike])
    turned = np.degrees(np.arccos(np.clip((ahead @ ahead.T).min(), -1, 1)))
    if len(alike) < STILL_PHOTOS // 3 or not turned >= TURNED:
        return 0.0
    step = -(-max(photos[0].view.size) // STILL_PIXELS)
    pixels = np.stack([rgb[::step, ::step] for rgb in as_others_show(alike)])  # (N, h, w, 3)
    middle = np.median(pixels, axis=0)
    still = near(pixels, middle).mean(axis=0) >= STILL
    still &= np.mean([counting(photo)[::step, ::step] for photo in alike], axis=0) >= KNOWN
    plain = not still.any() or near(middle[still], np.median(middle[still], axis=0)).mean() >= ALIKE
    return 0.0 if plain or still.mean() < EMPTY else float(still.mean())


def as_others_show(photos: list[LoadedPhoto]) -> list[np.ndarray]:
    """(H, W, 3) uint8 of photos of one camera; what one does not know as most of the others have
    it, so that it speaks for nothing else.
    """
    pixels = [photo.rgba[..., :3] for photo in photos]
    counts = [counting(photo) for photo in photos]
    lacking = ~np.logical_and.reduce(counts)
    if not lacking.any():
        return pixels
    there = np.stack([known[lacking] for known in counts])  # (N, P)
    values = np.stack([rgb[lacking] for rgb in pixels]).astype(np.float32)  # (N, P, 3)
    values[~there] = np.inf
    last = np.maximum(there.sum(axis=0), 1) - 1
    usual = np.sort(values, axis=0)[last // 2, np.arange(len(last))]  # the lower median
    usual = np.where(np.isfinite(usual), usual, 0).astype(np.uint8)
    out = []
    for rgb, known in zip(pixels, counts, strict=True):
        made = rgb.copy()
        made[lacking & ~known] = usual[~known[lacking]]
        out.append(made)
    return out


def fit_together(shapes: list[Silhouette]) -> bool:
    """Whether silhouettes are those of one object that all photos look at."""
    centre, half = common_box([view for view, _ in shapes])
    hull = carve(shapes, centre - half, centre + half, VOTE_SIDE)
    if not len(hull):
        return False
    return bool(np.median(uncovered(shapes, hull, 2 * half / VOTE_SIDE)) <= COVERED)
