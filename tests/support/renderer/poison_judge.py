"""Says whether a renderer took a poisoned scene as it must; shared by both drawings' tests."""

import warnings

import numpy as np

import tests.support.renderer.poison as poison
from shapeshift.app.stability_cases.case_context import covered
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.pose import View

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
                told = told or wrong(pictures, shown)
                # The third frame may stand on an order and on colours of the first: the same views.
                if made.exact and frame != 1:
                    told = told or next(filter(None, map(differs, *beside(made, pictures))), "")
    except ValueError as refusal:
        if is_precise(str(refusal)):
            return ""
        return f"seed {seed}: {type(refusal).__name__} is no sentence: {refusal}"
    return f"seed {seed} ({made.told}; {made.settings}): {told}" if told else ""


def wrong(pictures: list, shown: list) -> str:
    for picture, seen in zip(pictures, shown, strict=True):
        if not np.isfinite(picture).all():
            return f"{np.count_nonzero(~np.isfinite(picture).all(axis=2))} pixels are not finite"
        if not covered(picture[..., 3]).all():
            return f"coverage {picture[..., 3].min()} to {picture[..., 3].max()}"
        if not np.isfinite(seen).all():
            return "resolved() is not finite"
    return ""


def beside(made: poison.Poisoned, pictures: list) -> tuple[list, list, list]:
    """What `differs` takes, for each view."""
    return [made] * len(pictures), made.views, pictures


def differs(made: poison.Poisoned, view: View, picture: np.ndarray) -> str:
    """Nothing where float64 draws that picture, with or without the doubtful splats."""
    # Two eyes may share colours, and share distances of the order, of their middle.
    middle = np.mean([v.world_from_eye.position for v in made.views], axis=0)
    eye = middle if made.settings.stereo_colors == "shared" else None
    order = middle if made.settings.stereo_sort == "shared" else view.world_from_eye.position
    tolerance = STEEP if poison.steep(made) else TOLERANCE
    least, scenes = np.inf, poison.possible(made)
    for scene in scenes:
        want = reference_image(scene, view, made.settings, eye, order)
        scale = max(1.0, float(np.abs(want).max()))
        least = min(least, float(np.abs(picture - want).max()) / scale)
        if least <= tolerance:
            return ""
    bare = reference_image(scenes[-1], view, made.settings, eye, order)
    if poison.wild(made) and (picture[..., 3] >= bare[..., 3] - TOLERANCE).all():
        return ""  # something of no known shape covers the good splats
    return f"off by {least:.4f} from every picture that can be meant"


def is_precise(text: str) -> bool:
    """One line that says what was found: several words, no dump."""
    return len(text.split()) >= 4 and "\n" not in text.strip() and len(text) < 400
