"""What stands still behind a turntable: recognised, and cut out of a run's photos.

A camera on a tripod sees its room at the same pixels in every photo, while the poses, which are
those about the subject, go around.  That picture belongs to the camera, not to the scene: where a
photo shows it, the photo does not show the subject.
"""

from dataclasses import dataclass, field

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
    EMPTY,
    counting,
    near,
    shared_color,
)
from shapeshift.training.supervision.still_picture import (
    STILL,
    StillPicture,
    cut_out,
    still_picture,
    subject_mask,
)

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
