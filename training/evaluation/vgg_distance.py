"""How far apart two pictures look to VGG16: a distance of its features, 0 where they are equal.

The form is that of Zhang et al., 2018, without their learnt weights: at every pixel of four layers
the channels are brought to unit length and the squared difference is summed; mean over pixels, then
over layers.  Those weights were fitted to another VGG16, so these figures are not LPIPS and compare
only with figures of the same file.
"""

import hashlib
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.gate.network import StrangeNetwork
from shapeshift.runtime_models.model import BadFile

LAYERS = ("relu1_2", "relu2_2", "relu3_3", "relu4_3")
MEAN_BGR = np.array([103.939, 116.779, 123.68], np.float32)  # of ImageNet, as the file wants it off
LEAST_SIDE = 16  # pixels: three halvings leave two
LARGEST_FILE = 1 << 30  # bytes
DISTANCE = f"{__name__}:distance_of"  # in the process that has the features
TINY = 1e-10  # added to a length before dividing by it


class VggDistance:
    """The distance by one ONNX file: (n, 3, h, w) BGR 0..255 less MEAN_BGR in, LAYERS out."""

    def __init__(self, path: Path) -> None:
        """Raises BadFile where the file is not such a network."""
        if not path.is_file():
            raise BadFile(f"{path} is no file; --vgg names an ONNX file of VGG16's first layers.")
        if path.stat().st_size > LARGEST_FILE:
            raise BadFile(f"{path} has {path.stat().st_size:,} bytes; VGG16 has fewer.")
        data = path.read_bytes()
        self.name = f"{path.name}, sha256 {hashlib.sha256(data).hexdigest()[:12]}"
        self.session = opened(data, path)
        inputs = [node.name for node in self.session.get_inputs()]
        outputs = {node.name for node in self.session.get_outputs()}
        if len(inputs) != 1 or not outputs >= set(LAYERS):
            raise BadFile(
                f"{path} has inputs {inputs} and outputs {sorted(outputs)}; wanted are one input "
                f"and the outputs {', '.join(LAYERS)}."
            )
        (self.input,) = inputs

    def __call__(
        self, image: np.ndarray, photo: np.ndarray, weight: np.ndarray | None = None
    ) -> float:
        """Of a picture (H, W, 3) to a photo, display sRGB, the picture clipped to 0..1 first.

        weight (H, W) 0..1: where it is 0 the picture is taken to be as the photo.
        """
        check_size(photo.shape[1], photo.shape[0])
        image = np.clip(image, 0, 1)
        if weight is not None:
            image = photo + weight[..., None] * (image - photo)
        pair = 255 * np.stack([image, photo])[..., ::-1] - MEAN_BGR
        pair = np.ascontiguousarray(pair.transpose(0, 3, 1, 2), np.float32)
        return self.session.run(list(LAYERS), {self.input: pair}, then=DISTANCE)


def check_size(width: int, height: int) -> None:
    """Raises BadFile for photos of which three halvings leave nothing."""
    if not min(width, height) >= LEAST_SIDE:
        raise BadFile(
            f"photos of {width}x{height} pixels are too small for VGG16, which needs "
            f"{LEAST_SIDE} a side; leave out --vgg."
        )


def opened(data: bytes, path: Path) -> StrangeNetwork:
    """A network's bytes, opened behind the gate on all cores.  Raises BadFile."""
    from shapeshift.training.gradients.read_network import check_network

    check_network(data, path)
    return StrangeNetwork(path, 0, data)


def distance_of(layers: list[np.ndarray]) -> float:
    """The distance of features (2, channels, h, w) of each layer: the picture's, the photo's."""
    total = 0.0
    for features in layers:
        length = np.sqrt(np.einsum("nchw,nchw->nhw", features, features))
        a, b = features / (length[:, None] + TINY)
        total += float(np.mean(((a - b) ** 2).sum(axis=0), dtype=np.float64))
    return total / len(layers)
