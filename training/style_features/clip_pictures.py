"""A new stop from words, or from what a picture means: the paper's equations 10 to 13, by turns."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.style_features.clip_model import NO_STYLE, TEMPLATES, ClipModel
from shapeshift.training.style_features.nnfm_pictures import covered_part
from shapeshift.training.style_features.pixel_descent import DescentSettings, PixelDescent, Slope
from shapeshift.training.styles.style_pictures import StyleView

# Patches of a picture, cropped and bent in perspective (R of equation 11), as one sparse matrix.
#
# The matrix takes a picture's pixels to those of all patches; its transpose takes gradients back.

CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)


@dataclass(frozen=True)
class PatchSettings:
    """How patches are cut."""

    count: int = 4  # 1 to 64; the first one is the whole part
    share: tuple[float, float] = (0.4, 0.9)  # of the part's sides
    bend: float = 0.15  # how far corners move, of a patch's sides

    def __post_init__(self) -> None:
        if not 1 <= self.count <= 64:
            raise ValueError(f"a picture is cut into {self.count} patches; 1 to 64 are wanted.")


def patch_matrix(
    size: tuple[int, int], part: tuple[slice, slice], side: int, settings: PatchSettings,
    rng: np.random.Generator,
) -> sparse.csr_matrix:  # fmt: skip
    """(count * side^2, H * W): bilinear patches of a part of a picture of size (W, H)."""
    rows, columns, weights = [], [], []
    for k in range(settings.count):
        corners = whole(part) if k == 0 else random_corners(part, settings, rng)
        places = sampled(homography(corners), side)  # (side^2, 2) x y of the picture
        for index, weight in bilinear(places, size):
            rows.append(k * side * side + np.arange(side * side))
            columns.append(index)
            weights.append(weight)
    shape = settings.count * side * side, size[0] * size[1]
    entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_matrix(entries, shape, dtype=np.float32)


def whole(part: tuple[slice, slice]) -> np.ndarray:
    """(4, 2) corners x y of a part of a picture, given as its rows and columns."""
    down, across = part
    extent = np.array([across.stop - across.start, down.stop - down.start])
    return CORNERS * extent + [across.start, down.start]


def random_corners(
    part: tuple[slice, slice], settings: PatchSettings, rng: np.random.Generator
) -> np.ndarray:
    """(4, 2) of a piece of the part, anywhere in it, its corners moved a little."""
    outer = whole(part)
    extent = outer[2] - outer[0]
    inner = extent * rng.uniform(*settings.share)
    first = outer[0] + rng.random(2) * (extent - inner)
    moved = CORNERS + rng.uniform(-settings.bend, settings.bend, (4, 2)) / 2
    return first + moved * inner


def homography(corners: np.ndarray) -> np.ndarray:
    """(3, 3) that takes the unit square's corners to the given ones."""
    equations = []
    for (u, v), (x, y) in zip(CORNERS, corners, strict=True):
        equations += [[u, v, 1, 0, 0, 0, -x * u, -x * v], [0, 0, 0, u, v, 1, -y * u, -y * v]]
    return np.append(np.linalg.solve(np.array(equations), corners.ravel()), 1).reshape(3, 3)


def sampled(matrix: np.ndarray, side: int) -> np.ndarray:
    """(side^2, 2) where the pixels of a patch lie, row by row."""
    down, across = (np.mgrid[:side, :side].reshape(2, -1) + 0.5) / side
    points = np.stack([across, down, np.ones(side * side)], axis=1) @ matrix.T
    return points[:, :2] / points[:, 2:]


def bilinear(places: np.ndarray, size: tuple[int, int]):
    """The four pixels about each place, as numbers of pixels and weights; held at the border."""
    limit = np.array(size) - 1.0
    at = np.clip(places - 0.5, 0, limit)
    low = np.minimum(at.astype(int), np.maximum(limit.astype(int) - 1, 0))
    right = at - low
    for x, y in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = np.minimum(low[:, 0] + x, size[0] - 1), np.minimum(low[:, 1] + y, size[1] - 1)
        weight = np.abs(1 - x - right[:, 0]) * np.abs(1 - y - right[:, 1])
        yield row * size[0] + column, weight


LONGEST_TEXT = 200  # letters
DESCENT = DescentSettings(descents=8, rate=0.05, views=4, steps=20)


class ClipPictureLoss:
    """A PictureLoss: 1 - cos between the style's direction and that from the photo to patches."""

    def __init__(
        self, clip: ClipModel, towards: np.ndarray, patches: PatchSettings, seed: int = 0
    ) -> None:
        """towards (D,): delta T of equation 10."""
        self.clip, self.towards, self.patches = clip, towards, patches
        self.rng = np.random.default_rng([seed, 29])
        self.photos: dict[int, np.ndarray] = {}  # what is seen in each view's source stop

    def at(self, view: StyleView) -> Slope:
        """Patches are cut anew for each descent."""
        height, width = view.coverage.shape
        part, side = covered_part(view.coverage), self.clip.side
        if view.number not in self.photos:
            self.photos[view.number] = seen_whole(self.clip, view.source, part)
        matrix = patch_matrix((width, height), part, side, self.patches, self.rng)

        def slope(picture: np.ndarray) -> tuple[float, np.ndarray]:
            patches = (matrix @ picture.reshape(-1, 3)).reshape(-1, side, side, 3)
            value, slopes = self.clip.slope(patches, self.photos[view.number], self.towards)
            return value, (matrix.T @ slopes.reshape(-1, 3)).reshape(picture.shape)

        return slope


def seen_whole(clip: ClipModel, picture: np.ndarray, part: tuple[slice, slice]) -> np.ndarray:
    """(D,) what CLIP sees in a part of a picture (H, W, 3) as a whole."""
    one, rng = PatchSettings(count=1), np.random.default_rng(0)  # of which nothing is random
    matrix = patch_matrix((picture.shape[1], picture.shape[0]), part, clip.side, one, rng)
    pixels = matrix @ np.clip(picture, 0, 1).reshape(-1, 3)
    return clip.see(pixels.reshape(1, clip.side, clip.side, 3))[0]


def text_direction(clip: ClipModel, text: str) -> np.ndarray:
    """(D,) of unit length: from "A Photo" to what the text says in our templates.  BadFile."""
    if not (text.strip() and len(text) <= LONGEST_TEXT and text.isprintable()):
        raise BadFile(f"the style's text has {len(text)} letters; 1 to {LONGEST_TEXT} are wanted.")
    return direction(clip.read([t.format(text.strip()) for t in TEMPLATES]), clip, text)


def picture_direction(clip: ClipModel, picture: np.ndarray) -> np.ndarray:
    """(D,) of unit length: from "A Photo" to what a picture (H, W, 3) shows.  Raises BadFile."""
    part = slice(0, picture.shape[0]), slice(0, picture.shape[1])
    return direction(seen_whole(clip, picture, part), clip, "the picture")


def direction(style: np.ndarray, clip: ClipModel, what: str) -> np.ndarray:
    """Equation 10, of unit length.  Raises BadFile where CLIP sees no difference to a photo."""
    away = style - clip.read([NO_STYLE])
    length = float(np.linalg.norm(away))
    if not length > 1e-4:
        raise BadFile(f"to this CLIP '{what[:60]}' is the same as '{NO_STYLE}'; use other words.")
    return (away / length).astype(np.float32)


def clip_pictures(
    clip: ClipModel, towards: np.ndarray, patches: PatchSettings | None = None, seed: int = 0
) -> PixelDescent:
    """A StylePictures towards a direction of CLIP's."""
    loss = ClipPictureLoss(clip, towards, patches or PatchSettings(), seed)
    return PixelDescent(loss, None, DESCENT)
