"""SAM, MobileSAM, SAM 2 and SAM 3's tracker: masks from a box, clicks, and a mask before.

Two families of exports: the official one, which samexporter follows (point_coords, point_labels),
and that of Transformers (input_points, input_labels, perhaps input_boxes).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from shapeshift.decomposition.masks.segmenter import Candidate, Prompt
from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.gate.network import StrangeNetwork
from shapeshift.runtime_models.model import BadFile

# A photo in the square that a segmenter looks at: padded (SAM) or stretched (SAM 2 and 3).

BILINEAR = Image.Resampling.BILINEAR


@dataclass(frozen=True)
class Square:
    """A photo in a square of `side` pixels."""

    size: tuple[int, int]  # width, height of the photo, pixels
    side: int
    padded: bool  # the longer side fills the square; else both do

    @property
    def filled(self) -> tuple[int, int]:
        """Width and height of the photo within the square, pixels."""
        if not self.padded:
            return self.side, self.side
        width, height = self.size
        scale = self.side / max(width, height)
        return max(int(width * scale + 0.5), 1), max(int(height * scale + 0.5), 1)

    def shrink(self, image: np.ndarray) -> np.ndarray:
        """(h, w, 3) float32 0..255: the photo (H, W, 3) uint8 as it fills the square."""
        small = Image.fromarray(np.ascontiguousarray(image)).resize(self.filled, BILINEAR)
        return np.asarray(small, np.float32)

    def pad(self, pixels: np.ndarray) -> np.ndarray:
        """(1, 3, side, side): the shrunk photo (h, w, 3), zeros to its right and below it."""
        width, height = self.filled
        whole = np.pad(pixels, ((0, self.side - height), (0, self.side - width), (0, 0)))
        return np.ascontiguousarray(whole.transpose(2, 0, 1)[None])

    def places(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) float32 in the square of points (n, 2) of the photo."""
        scale = np.divide(self.filled, self.size)
        return (np.asarray(points, np.float64).reshape(-1, 2) * scale).astype(np.float32)

    def logits(self, mask: np.ndarray, side: int, most: float) -> np.ndarray:
        """(side, side) float32: a mask (H, W) as SAM's networks take one, -most to most."""
        width, height = (max(round(n * side / self.side), 1) for n in self.filled)
        small = Image.fromarray(mask.astype(np.float32)).resize((width, height), BILINEAR)
        out = np.full((side, side), -most, np.float32)
        out[:height, :width] = (2 * np.asarray(small) - 1) * most
        return out

    def stretch(self, logits: np.ndarray) -> np.ndarray:
        """(H, W) float32 of a square's logits (s, s): the photo's part of it, in its size."""
        rows, columns = logits.shape
        width, height = self.filled
        part = (0, 0, columns * width / self.side, rows * height / self.side)
        image = Image.fromarray(np.ascontiguousarray(logits, np.float32))
        return np.asarray(image.resize(self.size, BILINEAR, part))


# One ONNX file of the user's: its inputs and outputs by name, and refusals in a sentence.

A_BYTE = 3  # of memory for each byte of a network: read, opened, optimised
TYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(int64)": np.int64,
         "tensor(int32)": np.int32, "tensor(bool)": np.bool_,
         "tensor(uint8)": np.uint8}  # fmt: skip


class Network:
    """Opened on the CPU, behind the gate.  Raises BadFile for what is no ONNX file."""

    def __init__(self, path: Path, threads: int) -> None:
        self.path = path
        Memory().of(path).charge(A_BYTE * path.stat().st_size, "its weights")
        # By its path: weights of large networks lie in a file beside it.
        self.session = StrangeNetwork(path, threads)
        self.inputs: dict[str, Any] = {entry.name: entry for entry in self.session.get_inputs()}
        self.outputs = [out.name for out in self.session.get_outputs()]

    def shape(self, name: str) -> list[int | None]:
        """Of an input; None where a side may have any length."""
        return [n if isinstance(n, int) and n > 0 else None for n in self.inputs[name].shape]

    def run(self, given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Outputs by name; each input is turned into the type that it has.  Raises BadFile."""
        fed: dict[str, np.ndarray] = {}
        for name, entry in self.inputs.items():
            if name not in given:
                raise BadFile(f"{self.path}: it asks for '{name}', which no known segmenter has.")
            if entry.type not in TYPES:
                raise BadFile(f"{self.path}: its input '{name}' is {entry.type}, which is unknown.")
            fed[name] = np.asarray(given[name]).astype(TYPES[entry.type], copy=False)
        found = self.session.run(None, fed)
        return dict(zip(self.outputs, found, strict=True))

    def floats(self, found: dict[str, np.ndarray], name: str, rank: int) -> np.ndarray:
        """An output as float32, checked.  Raises BadFile where it cannot be what its name says."""
        if name not in found:
            raise BadFile(f"{self.path}: it gives {list_of(self.outputs)}; '{name}' is wanted.")
        array = np.asarray(found[name])
        if array.ndim != rank or not all(array.shape):
            raise BadFile(
                f"{self.path}: its '{name}' has the shape {list(array.shape)}; {rank} sides are "
                "wanted."
            )
        array = array.astype(np.float32)
        if not np.isfinite(array).all():
            raise BadFile(f"{self.path}: its '{name}' holds NaN or Inf; export it again.")
        return array


def list_of(names: list[str]) -> str:
    return ", ".join(f"'{name:.40}'" for name in names[:6]) or "nothing"


MEAN = np.array([123.675, 116.28, 103.53], np.float32)
DEVIATION = np.array([58.395, 57.12, 57.375], np.float32)
HALF = np.full(3, 127.5, np.float32)  # SAM 3's mean and deviation
OUTSIDE, INSIDE, CORNER, FAR_CORNER, NOTHING = 0, 1, 2, 3, -1  # labels of points
SIDE, SIDE_3 = 1024, 1008  # pixels of the square: SAM and SAM 2, SAM 3
PATCH_3 = 14  # pixels of a patch of SAM 3, whose image embedding has SIDE_3 / 14 a side
SURE = 10.0  # logit of a pixel of a mask that is handed on
MOST_SIDE = 4096  # pixels of a mask
MOST_MASKS = 64


class PointSam:
    """A segmenter that is asked by places.  It does not read."""

    reads_text = False

    def __init__(self, encoder: Network, decoder: Network) -> None:
        self.encoder, self.decoder = encoder, decoder
        self.entry = next(iter(encoder.inputs))
        self.transformers = "input_points" in decoder.inputs
        self.takes_boxes = not self.transformers or "input_boxes" in decoder.inputs
        self.wants_click = self.takes_boxes
        several = [
            n for n in decoder.inputs if n.startswith(("high_res_feats", "image_embeddings."))
        ]
        self.stretched = bool(several)  # SAM 2 and 3
        sides = encoder.shape(self.entry)
        last = decoder.shape(max(several))[-1] if several else None
        third = SIDE_3 in sides or last == SIDE_3 // PATCH_3
        self.side = sides[2] if len(sides) == 4 and sides[2] else (SIDE_3 if third else SIDE)
        self.mean, self.deviation = (HALF, HALF) if third else (MEAN, DEVIATION)
        kind = "SAM 3" if third else "SAM 2" if self.stretched else "SAM"
        self.name = f"{kind} of {decoder.path.name}"

    def encode(self, image: np.ndarray) -> tuple[Square, dict[str, np.ndarray]]:
        """image (H, W, 3 or more) uint8 -> its place in the square, and its features by name."""
        square = Square((image.shape[1], image.shape[0]), self.side, not self.stretched)
        pixels = square.shrink(image[..., :3])
        if len(self.encoder.inputs[self.entry].shape) == 4:
            pixels = square.pad((pixels - self.mean) / self.deviation)
        return square, self.encoder.run({self.entry: pixels})

    def candidates(self, encoded: tuple[Square, dict[str, np.ndarray]], prompt: Prompt) -> list:
        square, features = encoded
        points, labels = self.points_of(prompt, square)
        given = self.features_of(features)
        if self.transformers:
            given |= {"input_points": points[None, None], "input_labels": labels[None, None]}
            if "input_boxes" in self.decoder.inputs:
                given["input_boxes"] = self.boxes_of(prompt, square)
            masks, scores, rank = "pred_masks", "iou_scores", 5
        else:
            given |= {"point_coords": points[None], "point_labels": labels[None]}
            given |= self.mask_of(prompt, square)
            width, height = square.size
            given["orig_im_size"] = np.array([height, width], np.float32)
            # Exports of SAM freeze the crop of "masks" to the aspect of the photo they were made
            # with; the small ones are cut and stretched here.
            low = "low_res_masks" in self.decoder.outputs
            masks, scores, rank = ("low_res_masks" if low else "masks"), "iou_predictions", 4
        found = self.decoder.run(given)
        logits = self.decoder.floats(found, masks, rank)
        sure = self.decoder.floats(found, scores, rank - 2).ravel()
        return self.masks_of(logits.reshape(-1, *logits.shape[-2:]), sure, square)

    def points_of(self, prompt: Prompt, square: Square) -> tuple[np.ndarray, np.ndarray]:
        """(n, 2) places in the square and (n,) their labels; at least one."""
        places: list[np.ndarray | tuple[float, float]]
        places = [*np.reshape(prompt.inside, (-1, 2)), *np.reshape(prompt.outside, (-1, 2))]
        labels = [INSIDE] * len(prompt.inside) + [OUTSIDE] * len(prompt.outside)
        if prompt.box is not None:
            left, top, right, bottom = prompt.box
            if not self.transformers:
                places += [(left, top), (right, bottom)]
                labels += [CORNER, FAR_CORNER]
            elif not (self.takes_boxes or labels):
                places = [((left + right) / 2, (top + bottom) / 2)]
                labels = [INSIDE]
        if not places or (prompt.box is None and not self.transformers):
            places.append((0.0, 0.0))  # SAM's networks want one more where there is no box
            labels.append(NOTHING)
        return square.places(np.array(places)), np.array(labels)

    def boxes_of(self, prompt: Prompt, square: Square) -> np.ndarray:
        """(1, 0 or 1, 4) corners in the square."""
        if prompt.box is None:
            return np.zeros((1, 0, 4), np.float32)
        return square.places(np.reshape(prompt.box, (2, 2))).reshape(1, 1, 4)

    def mask_of(self, prompt: Prompt, square: Square) -> dict[str, np.ndarray]:
        """About where the object is, where that is known."""
        sides = self.decoder.shape("mask_input") if "mask_input" in self.decoder.inputs else []
        low = sides[-1] if sides and sides[-1] else self.side // 4
        before = np.zeros((low, low), np.float32)
        if prompt.mask is not None:
            before = square.logits(prompt.mask, low, SURE)
        has = np.array([prompt.mask is not None], np.float32)
        return {"mask_input": before[None, None], "has_mask_input": has}

    def features_of(self, features: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The encoder's outputs under the names by which the decoder asks for them."""
        given = {name: features[name] for name in self.decoder.inputs if name in features}
        for name in ("image_embeddings", "image_embed"):
            if name in self.decoder.inputs and name not in given:
                if len(features) != 1:
                    raise BadFile(
                        f"{self.encoder.path}: it gives {list_of(list(features))}; '{name}' is "
                        f"what {self.decoder.path.name} asks for."
                    )
                given[name] = next(iter(features.values()))
        return given

    def masks_of(self, logits: np.ndarray, scores: np.ndarray, square: Square) -> list[Candidate]:
        """Logits (m, h, w) and scores (m,) as candidates, the surest first."""
        count, height, width = logits.shape
        if count != len(scores) or count > MOST_MASKS or max(height, width) > MOST_SIDE:
            raise BadFile(
                f"{self.decoder.path}: it gives {count} masks of {width}x{height} pixels and "
                f"{len(scores)} scores; as many scores as masks are wanted."
            )
        whole = (height, width) == square.size[::-1]
        found = [
            Candidate((one if whole else square.stretch(one)) > 0, float(np.clip(score, 0, 1)))
            for one, score in zip(logits, scores, strict=True)
        ]
        return sorted(found, key=lambda candidate: -candidate.score)
