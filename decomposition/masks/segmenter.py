"""What every source of masks has in common: a photo is encoded once, then asked with prompts."""

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np


def no_points() -> np.ndarray:
    return np.zeros((0, 2))


@dataclass(frozen=True)
class Prompt:
    """What is known of an object in one photo; pixels, x right, y down."""

    box: tuple[float, float, float, float] | None = None  # left, top, right, bottom
    inside: np.ndarray = field(default_factory=no_points)  # (n, 2) on the object
    outside: np.ndarray = field(default_factory=no_points)  # (m, 2) beside it
    mask: np.ndarray | None = None  # (H, W) bool: about where it is
    text: str = ""  # "a red mug": for a segmenter that reads


@dataclass(frozen=True)
class Candidate:
    """One answer to a prompt."""

    mask: np.ndarray  # (H, W) bool
    score: float  # 0..1: how sure the segmenter is


class Segmenter(Protocol):
    """A promptable segmenter.  What it needs of a photo is computed once, by `encode`."""

    name: str  # for messages: "SAM 2 of sam2_tiny.decoder.onnx"
    reads_text: bool  # else Prompt.text is not used
    takes_boxes: bool  # else a box counts as a click in its middle
    wants_click: bool  # whether a box alone is asked about again, with a click inside

    def encode(self, image: np.ndarray) -> Any:
        """image: (H, W, C) uint8; the first three channels are display sRGB, further ones other
        stops of the same photo, such as heat.
        """
        ...

    def candidates(self, encoded: Any, prompt: Prompt) -> list[Candidate]:
        """Masks of the photo's size, the surest first.  Raises BadFile where a network of the
        user's gives what is no mask.
        """
        ...
