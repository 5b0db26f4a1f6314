"""Says whether a renderer took a poisoned scene as it must; shared by both drawings' tests."""

import warnings

import numpy as np
import poison

from app.stability_cases.finding import covered
from renderer.reference import reference_image
from renderer.renderer import Renderer

TOLERANCE = 0.012  # of the largest colour: three grey steps; rounding at the 1/255 cut is one
STEEP = 0.05  # where an opacity far above 1 makes an edge: half axes are rounded by 0.0005


def judge(renderer: Renderer, seed: int) -> str:
    """Nothing where the seed's scene was drawn cleanly or refused in a sentence, else the fault."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", RuntimeWarning)
            made = poison.make(seed)
            renderer.settings = made.settings
            renderer.update(made.scene)
            told = ""
            for frame, views in enumerate(poison.walk(made)):
                renderer.draw(views)
                pictures = [np.array(renderer.image(i)) for i in range(len(views))]
                shown = [np.array(renderer.resolved(i)) for i in range(len(views))]
                told = told or wrong(made, pictures, shown, frame)
    except ValueError as refusal:
        if is_precise(str(refusal)):
            return ""
        return f"seed {seed}: {type(refusal).__name__} is no sentence: {refusal}"
    return f"seed {seed} ({made.told}; {made.settings}): {told}" if told else ""


def wrong(made: poison.Poisoned, pictures: list, shown: list, frame: int) -> str:
    for picture, seen in zip(pictures, shown, strict=True):
        if not np.isfinite(picture).all():
            return f"{np.count_nonzero(~np.isfinite(picture).all(axis=2))} pixels are not finite"
        if not covered(picture[..., 3]).all():
            return f"coverage {picture[..., 3].min()} to {picture[..., 3].max()}"
        if not np.isfinite(seen).all():
            return "resolved() is not finite"
    # The third frame may stand on an order and on colours of the first: the same view again.
    return differs(made, pictures[0]) if made.exact and frame != 1 else ""


def differs(made: poison.Poisoned, picture: np.ndarray) -> str:
    """Nothing where float64 draws that picture, with or without the doubtful splats."""
    least = np.inf
    for scene in poison.possible(made):
        want = reference_image(scene, made.views[0], made.settings)
        scale = max(1.0, float(np.abs(want).max()))
        least = min(least, float(np.abs(picture - want).max()) / scale)
        if least <= (STEEP if poison.steep(made) else TOLERANCE):
            return ""
    bare = reference_image(poison.possible(made)[-1], made.views[0], made.settings)
    if poison.wild(made) and (picture[..., 3] >= bare[..., 3] - TOLERANCE).all():
        return ""  # something of no known shape covers the good splats
    return f"off by {least:.4f} from every picture that can be meant"


def is_precise(text: str) -> bool:
    """One line that says what was found: several words, no dump."""
    return len(text.split()) >= 4 and "\n" not in text.strip() and len(text) < 400
