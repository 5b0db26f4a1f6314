"""A new stop from words, or from what a picture means: the paper's equations 10 to 13, by turns."""

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.style_features.clip_model import NO_STYLE, TEMPLATES, ClipModel
from shapeshift.training.style_features.clip_patches import PatchSettings, patch_matrix
from shapeshift.training.style_features.nnfm_pictures import covered_part
from shapeshift.training.style_features.pixel_descent import DescentSettings, PixelDescent, Slope
from shapeshift.training.styles.style_pictures import StyleView

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
