"""What the masks of a capture mean: an object cut out, or parts of photos that do not count.

nerfstudio takes all masks for the latter; masks of a turntable or of one thing are the former.
Their shape tells: an object ends inside of most photos, so its mask is black along their edges;
what is hidden (people, a tripod, a sky) leaves most of the edges white; what hides the same pixels
in all photos is a lens's rim or the vehicle that carries it.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.scene.capture_photos import image_size
from shapeshift.scene.captures.capture import MASKS, Photo
from shapeshift.scene.captures.photo import load_mask, refuse_other_view

LOOKED_AT = 16  # masks of a modality
SMALL = 64  # pixels of a mask's longer side, to be looked at
EDGE = 0.03  # of its sides
HIDES = 0.6  # of the edges, in the mean, that are white where masks hide something
UNSURE = 0.3  # less than that is an object's; between the two a person is told
SAME = 24  # of 255: masks that differ by less everywhere are one
HALF = 0.5  # of a photo that a mask of all photos leaves, at least
MIDDLE_BLACK = 0.5  # of the middle third that is black where the subject itself is hidden ...
IN_MOST = 0.8  # ... in so many of the photos


class MaskShapes(NamedTuple):
    """Of the masks of one modality, shares 0 to 1."""

    edges: float  # white along the photos' edges
    same: bool  # one and the same in all photos
    middles: float  # photos whose middle is mostly black


def stated_meaning(fields: Fields) -> str:
    """What a frame, or a file for all, says of its masks; empty where it is silent."""
    return fields.line("mask_means", "", known=("", *MASKS)) if fields.has("mask_means") else ""


def refuse_other_mask(path: Path, size: tuple[int, int]) -> None:
    """Raises BadFile where a mask has another shape than its photo; it may have other pixels."""
    refuse_other_view(image_size(path, None), size, f"{path_end(path)}: the mask")


def meant_by_masks(photos: Sequence[Photo]) -> tuple[list[Photo], tuple[str, ...]]:
    """The photos with what their masks mean where the capture is silent, and what a person should
    know of it.  Raises BadFile.
    """
    out, sentences = [replace(p, mask_means=p.mask_means or "object") for p in photos], []
    for name in dict.fromkeys(photo.modality for photo in photos):
        mine = [i for i, p in enumerate(photos) if p.modality == name and is_silent(p)]
        if not mine:
            continue
        shapes = shapes_of([photos[i] for i in mine])
        mask = photos[mine[0]].mask
        assert mask is not None
        means, said = meaning_of(shapes, f"{name}: the masks, for example {path_end(mask)},")
        sentences += [said] if said else []
        for i in mine:
            out[i] = replace(photos[i], mask_means=means)
    return out, tuple(sentences)


def is_silent(photo: Photo) -> bool:
    return photo.mask is not None and not photo.mask_means


def shapes_of(photos: Sequence[Photo]) -> MaskShapes:
    """Of photos with masks, of which a few are looked at.  Raises BadFile."""
    few = [photos[i * len(photos) // LOOKED_AT] for i in range(LOOKED_AT)]
    few = list({photo.mask: photo for photo in few}.values())
    masks = [small_mask(photo) for photo in few]
    sizes = {mask.shape for mask in masks}
    same = len(photos) > 2 and len(sizes) == 1
    if same:
        stack = np.stack(masks).astype(np.int16)
        same = bool((np.ptp(stack, axis=0) < SAME).all() and stack.min() < 128)
        # Of a ball from all sides the masks are alike, too; but nobody names one file for all.
        same &= len(masks) == 1 or bool((stack >= 128).mean() >= HALF)
    edges = [(edge_of(mask) >= 128).mean() for mask in masks]
    middles = [(middle_of(mask) < 128).mean() >= MIDDLE_BLACK for mask in masks]
    return MaskShapes(float(np.mean(edges)), same, float(np.mean(middles)))


def meaning_of(shapes: MaskShapes, what: str) -> tuple[str, str]:
    """One of MASKS, and a sentence where a person might mean something else."""
    if shapes.same:
        return "valid", (
            f"{what} hide the same pixels in all photos: what is black is taken as unknown, not as "
            "empty; --masks object says that nothing lies there."
        )
    if shapes.edges >= HIDES:
        inverted = shapes.middles >= IN_MOST
        doubt = (
            "look inverted, white around a black subject"
            if inverted
            else "are white along most of the photos' edges, as those that hide something are"
        )
        more = (
            "if the subject is what is black, invert them"
            if inverted
            else "--masks object says that nothing lies there"
        )
        return "valid", f"{what} {doubt}: what is black is taken as unknown, not as empty; {more}."
    if shapes.edges >= UNSURE:
        return "object", (
            f"{what} are white along {100 * shapes.edges:.0f} % of the photos' edges; they are "
            "taken as of an object with nothing around it; if they hide something, people or a "
            "tripod, train with --masks valid."
        )
    return "object", ""


def small_mask(photo: Photo) -> np.ndarray:
    """(h, w) uint8 of its mask, SMALL pixels a side at most.  Raises BadFile."""
    assert photo.mask is not None
    grey = load_mask(photo.mask, photo.file_size)
    return np.asarray(grey.reduce(max(-(-max(grey.size) // SMALL), 1)))


def edge_of(mask: np.ndarray) -> np.ndarray:
    """(P,) the pixels along its four edges."""
    height, width = mask.shape
    y, x = max(round(EDGE * height), 1), max(round(EDGE * width), 1)
    inside = np.zeros(mask.shape, bool)
    inside[y : height - y, x : width - x] = True
    return mask[~inside]


def middle_of(mask: np.ndarray) -> np.ndarray:
    """The third of its width and height in its middle; at least a pixel."""
    height, width = mask.shape
    return mask[height // 3 : -(-2 * height // 3), width // 3 : -(-2 * width // 3)]
