"""The colour behind everything: the capture's, one that is asked for, or one that photos show."""

import numpy as np

from shapeshift.training.photos import LoadedPhoto, sampled

NAMED = {"black": (0.0, 0.0, 0.0), "white": (1.0, 1.0, 1.0), "gray": (0.5, 0.5, 0.5)}
NOISE = 0.03  # display sRGB: a photo that differs more from a known background shows the object
BACKDROP = 0.06  # display sRGB: a photographed backdrop is lit unevenly, see docs/bench/bare.csv
EDGE = 0.02  # of a photo's sides: its outermost pixels, where a subject stands before something
ALIKE = 0.7  # of these, in every modality, that have the colour: some photos cut their subject
EMPTY = 0.2  # of all pixels, at least, that have it: the black rims of undistorted photos are fewer
DARK = 0.5  # of the brightest channel: a darker backdrop looks much alike at every exposure
Background = tuple[float, float, float]


def choose_background(
    setting: str, capture_background: Background | None, photos: list[LoadedPhoto] | tuple = ()
) -> Background | None:
    """The fixed background of a run; None = random where photos show it.

    auto: the capture's; where it has none, the one that its photos show.
    """
    if setting == "auto":
        return shared_color(photos) if capture_background is None else capture_background
    if setting == "random":
        return None
    if setting not in NAMED:
        raise ValueError(
            f"There is no background '{setting}'; use auto, random, {', '.join(NAMED)}."
        )
    return NAMED[setting]


def shared_color(photos: list[LoadedPhoto] | tuple) -> Background | None:
    """The one colour that all photos show about their subject; None where there is no such one.

    It assumes a subject before one even colour, in the middle of most photos.  Photos with alpha or
    an object's mask say themselves what is background.  Of many photos a sample tells.
    """
    photos = sampled(list(photos))
    if not photos or any(photo.see_through for photo in photos):
        return None
    rims: dict[str, list[np.ndarray]] = {}
    for photo in photos:
        rims.setdefault(photo.modality, []).append(rim_of(photo.rgba[..., :3], counting(photo)))
    edges = [np.concatenate(parts) for parts in rims.values()]
    if not all(map(len, edges)):
        return None
    color = np.median(edges[0], axis=0)
    if not all(near(edge, color).mean() >= ALIKE for edge in edges):
        return None
    empty = [near(photo.rgba[..., :3][counting(photo)], color).mean() for photo in photos]
    return tuple((color / 255).tolist()) if np.mean(empty) >= EMPTY else None


def has_one_exposure(photos: list[LoadedPhoto] | tuple) -> bool:
    """Whether a bright backdrop in all photos has one colour: then they have one exposure.

    What else differs is no camera's doing: an object on a turntable turns in its light, and photos
    evened out by that would have as many backdrops as gains.
    """
    color = shared_color(photos)
    return color is not None and max(color) >= DARK


def background_warning(color: Background) -> str:
    """What a person should know of a background that was found."""
    name = "#" + "".join(f"{round(255 * value):02x}" for value in color)
    return (
        f"All photos show their subject before one colour, {name}, which is taken as the "
        "background; if it belongs to the scene, train with --background random."
    )


def counting(photo: LoadedPhoto) -> np.ndarray:
    """(H, W) bool which pixels of a photo count."""
    return np.ones(photo.rgba.shape[:2], bool) if photo.weight is None else photo.weight > 0


def rim_of(rgb: np.ndarray, counts: np.ndarray | None = None) -> np.ndarray:
    """(P, 3) the pixels along the edges of a photo (H, W, 3); of what counts (H, W), if given."""
    height, width = rgb.shape[:2]
    inside = np.zeros((height, width), bool)
    y, x = max(round(EDGE * height), 1), max(round(EDGE * width), 1)
    inside[y : height - y, x : width - x] = True
    if counts is None or counts.all():
        return rgb[~inside]
    from scipy.ndimage import binary_fill_holes, minimum_filter

    whole = binary_fill_holes(counts).astype(np.uint8)
    inside = minimum_filter(whole, (2 * y + 1, 2 * x + 1), mode="constant") > 0
    return rgb[counts & ~inside]


def near(rgb: np.ndarray, color: np.ndarray) -> np.ndarray:
    """(...) bool which of 8-bit colours (..., 3) are this one but for noise and uneven light."""
    return np.asarray((np.abs(rgb.astype(np.int16) - color) <= 255 * BACKDROP).all(axis=-1))
