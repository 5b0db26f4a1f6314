"""Feed-forward style networks: ONNX files that take a picture and give it in another style."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.evaluation.vgg_distance import LARGEST_FILE, opened
from shapeshift.training.styles.style_pictures import StyleView, Turns

BYTES = 3.0  # a picture with values above it is in 0..255, not in 0..1
USUAL_SIDE = 256  # pixels, of an encoder that takes any size
MOST_SIDE = 4096  # pixels, that a file may ask for


class ImageNetwork:
    """A StylePictures: every view's picture through a network, once.

    The file has one input of pictures, (1, 3, H, W) or (1, H, W, 3), of 0..1 or 0..255, of any size
    or one of its own; and perhaps one more, of so many numbers: weights of the styles that it
    knows, or the code of a style picture, which a second network, the encoder, makes.
    """

    turns = Turns()

    def __init__(self, path: Path, weights: dict[int, float], code: np.ndarray | None = None):
        """weights: of the styles, by number from 0.  code: of an encoder.  Raises BadFile."""
        self.path, self.session = path, open_network(path)
        pictures = [node for node in self.session.get_inputs() if layout_of(node.shape)]
        others = [node for node in self.session.get_inputs() if not layout_of(node.shape)]
        outputs = self.session.get_outputs()
        if len(pictures) != 1 or len(others) > 1 or not layout_of(outputs[0].shape):
            raise BadFile(
                f"{path} has inputs {described(self.session.get_inputs())} and outputs "
                f"{described(outputs)}; wanted is a picture of 3 channels in, at most one input of "
                "weights, and a picture out."
            )
        self.picture, self.shown = pictures[0], outputs[0]
        self.given: dict[str, np.ndarray] = {}
        if others:
            self.given[others[0].name] = style_input(path, others[0], weights, code)
        elif weights or code is not None:
            what = "--weights" if weights else "a style picture"
            raise BadFile(f"{path} takes a picture alone and knows one style; leave out {what}.")
        self.scale = 0.0  # of its values; 0: not known yet

    def make(self, views: Sequence[StyleView], done: float) -> list[np.ndarray]:
        return [self.stylise(view.source) for view in views]

    def stylise(self, picture: np.ndarray) -> np.ndarray:
        """(H, W, 3) float32 of a picture (H, W, 3), display sRGB 0..1 both."""
        height, width = picture.shape[:2]
        size = fixed_size(self.picture.shape) or (width, height)
        image = resized(np.clip(picture, 0, 1), size)
        if not self.scale:
            self.scale = 255.0 if np.nanmax(self.run(image, 1.0)) > BYTES else 1.0
        found = self.run(image, self.scale) / self.scale
        if found.shape[0] < size[1] or found.shape[1] < size[0]:
            found = resized(found, size)  # networks of even strides lose a row or two
        found = found[: size[1], : size[0]]
        if not np.isfinite(found).all():
            raise BadFile(f"{self.path} gives NaN or Inf for a picture of the scene.")
        return np.clip(resized(np.clip(found, 0, 1), (width, height)), 0, 1)

    def run(self, image: np.ndarray, scale: float) -> np.ndarray:
        """(H', W', 3) what the network gives for (H, W, 3), in its own values."""
        planes = layout_of(self.picture.shape) == "planes"
        given = (image.transpose(2, 0, 1) if planes else image)[None] * np.float32(scale)
        inputs = {self.picture.name: np.ascontiguousarray(given, np.float32)} | self.given
        found = self.session.run([self.shown.name], inputs)[0]
        if found.ndim != 4 or len(found) != 1:
            raise BadFile(f"{self.path} gives {found.shape} for a picture; one picture is wanted.")
        planes = layout_of(self.shown.shape) == "planes"
        return found[0].transpose(1, 2, 0) if planes else found[0]


def encode_style(path: Path, picture: np.ndarray) -> np.ndarray:
    """What an encoder's ONNX file gives for a style picture (H, W, 3) in 0..1.  Raises BadFile."""
    session = open_network(path)
    inputs, outputs = session.get_inputs(), session.get_outputs()
    if len(inputs) != 1 or not layout_of(inputs[0].shape):
        raise BadFile(f"{path} has inputs {described(inputs)}; one, a picture, is wanted.")
    image = resized(picture, fixed_size(inputs[0].shape) or (USUAL_SIDE, USUAL_SIDE))
    given = image.transpose(2, 0, 1) if layout_of(inputs[0].shape) == "planes" else image
    rows = {inputs[0].name: np.ascontiguousarray(given[None], np.float32)}
    return session.run([outputs[0].name], rows)[0]


def open_network(path: Path):
    """The session of a network's file.  Raises BadFile."""
    if not path.is_file():
        raise BadFile(f"{path} is no file; an ONNX file of a style network is wanted.")
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise BadFile(
            f"{path} has {path.stat().st_size:,} bytes, at most {LARGEST_FILE:,} are read."
        )
    return opened(path.read_bytes(), path)


def layout_of(shape: list) -> str:
    """How an input or output holds pictures: planes, pixels, or "" for none."""
    if len(shape) != 4:
        return ""
    if shape[3] == 3:
        return "pixels"
    return "planes" if shape[1] == 3 else ""


def fixed_size(shape: list) -> tuple[int, int] | None:
    """(width, height) of an input that takes one size alone.  Raises BadFile for no such size."""
    height, width = shape[2:4] if layout_of(shape) == "planes" else shape[1:3]
    if not (isinstance(height, int) and isinstance(width, int)):
        return None
    if not (0 < width <= MOST_SIDE and 0 < height <= MOST_SIDE):
        raise BadFile(
            f"a style network takes {width}x{height} pixels, 1 to {MOST_SIDE} are wanted."
        )
    return width, height


def style_input(path: Path, node, weights: dict[int, float], code: np.ndarray | None) -> np.ndarray:
    """The input that says which style: weights of known ones, or a code.  Raises BadFile."""
    sizes = [n for n in node.shape if isinstance(n, int)]
    count = int(np.prod(sizes)) if len(sizes) == len(node.shape) else 0
    if code is not None and not weights:
        if code.size != count:
            raise BadFile(f"{path} takes {count or 'other'} numbers of a style, the encoder gives "
                          f"{code.size}; they are not of one kind.")  # fmt: skip
        return np.ascontiguousarray(code.reshape(node.shape), np.float32)
    if not count:
        raise BadFile(f"{path} has an input {node.name} of shape {node.shape}; a number is wanted.")
    if not weights:
        raise BadFile(f"{path} knows {count} styles; --weights says which, as 3=0.5,12=0.5.")
    if wrong := [n for n in weights if not 0 <= n < count]:
        raise BadFile(f"{path} knows the styles 0 to {count - 1}, not {wrong[0]}.")
    row = np.zeros(count, np.float32)
    row[list(weights)] = list(weights.values())
    return row.reshape(node.shape)


def described(nodes: Sequence) -> str:
    return ", ".join(f"{node.name} {node.shape}" for node in nodes) or "none"


def resized(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A picture (H, W, 3) float32 at (width, height)."""
    if (picture.shape[1], picture.shape[0]) == size:
        return np.ascontiguousarray(picture, np.float32)
    planes = [
        Image.fromarray(np.ascontiguousarray(picture[..., c], np.float32)).resize(
            size, Image.Resampling.LANCZOS
        )
        for c in range(3)
    ]
    return np.clip(np.stack([np.asarray(plane) for plane in planes], axis=-1), 0, None)
