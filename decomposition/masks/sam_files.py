"""A segmenter out of the ONNX files that the user has: SAM, MobileSAM, SAM 2, SAM 3.

Nothing is fetched.  What the files of a folder are is told by the names and ranks of their inputs,
not by their own names; docs/objects.md lists the exports.  Kirillov et al. 2023, Zhang et al. 2023,
Ravi et al. 2024, Carion et al. 2025.
"""

from pathlib import Path

import numpy as np

from shapeshift.decomposition.masks.clip_words import FILES, ClipWords, read_words
from shapeshift.decomposition.masks.sam import Network, PointSam, Square, list_of
from shapeshift.decomposition.masks.segmenter import Candidate, Prompt, Segmenter
from shapeshift.runtime_models.model import BadFile

MOST_FILES = 8  # networks of a folder: each is opened
ENCODER, POINTS, CONCEPTS, WORDS = (
    "image encoder",
    "point decoder",
    "concept decoder",
    "text encoder",
)
WANTED = "an image encoder and a mask decoder of SAM, MobileSAM, SAM 2 or SAM 3 as ONNX files"


def open_segmenter(folder: Path, threads: int = 2) -> Segmenter:
    """The segmenter whose networks lie in the folder.  Raises BadFile, one sentence."""
    parts = open_parts(folder, threads)
    if ENCODER not in parts or not {POINTS, CONCEPTS} & parts.keys():
        there = ", ".join(f"{n.path.name} ({part})" for part, n in parts.items()) or "none of them"
        raise BadFile(f"{folder} holds {there}; {WANTED} are wanted.")
    if POINTS in parts:
        return PointSam(parts[ENCODER], parts[POINTS])
    words = read_words(folder)
    if WORDS not in parts:
        raise BadFile(
            f"{folder} holds SAM 3 without its text encoder; put the ONNX file that takes 'tokens' "
            "beside the others."
        )
    if words is None:
        raise BadFile(
            f"{folder} holds SAM 3 without its vocabulary; put {' or '.join(FILES)} beside it."
        )
    return ConceptSam(parts[ENCODER], parts[CONCEPTS], parts[WORDS], words)


def open_parts(folder: Path, threads: int) -> dict[str, Network]:
    """What each ONNX file of the folder is for.  Raises BadFile."""
    if not folder.is_dir():
        raise BadFile(f"{folder} is no folder; name the one with {WANTED}.")
    paths = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".onnx" and p.is_file())
    if not paths:
        raise BadFile(f"{folder} holds no .onnx file; {WANTED} are wanted.")
    if len(paths) > MOST_FILES:
        raise BadFile(
            f"{folder} holds {len(paths)} ONNX files; leave those of one segmenter, at most "
            f"{MOST_FILES}."
        )
    parts: dict[str, Network] = {}
    for path in paths:
        network = Network(path, threads)
        part = part_of(network)
        if part in parts:
            raise BadFile(
                f"{folder} holds two files that are a SAM's {part}, {parts[part].path.name} and "
                f"{path.name}; leave one."
            )
        if not part:
            raise BadFile(
                f"{path}: it takes {list_of(list(network.inputs))}, which is no part of a "
                f"segmenter; {WANTED} are wanted."
            )
        parts[part] = network
    return parts


def part_of(network: Network) -> str:
    """What the network is for, by the names and ranks of its inputs; "" if for nothing here."""
    names, inputs = network.inputs.keys(), list(network.inputs.values())
    if {"point_coords", "point_labels"} <= names or {"input_points", "input_labels"} <= names:
        return POINTS
    if {"box_coords", "box_labels", "box_masks"} <= names:
        return CONCEPTS
    if names == {"tokens"} and len(inputs[0].shape) == 2:
        return WORDS
    if len(inputs) == 1 and len(inputs[0].shape) in (3, 4):
        return ENCODER
    return ""


# SAM 3: every thing that a text or a box describes.  Exports of samexporter.

SIDE = 1008  # pixels of the square
VISUAL = "visual"  # the text where there is none: what the network was trained with for boxes
POINT = 0.01  # sides of the box that stands for a click, of the photo's
LEAST_SCORE = 0.3  # of 200 answers nearly all are near 0
MOST_MASKS = 16


class ConceptSam:
    """A segmenter that reads."""

    reads_text, takes_boxes, wants_click = True, True, False  # a click is a small box to it

    def __init__(self, encoder: Network, decoder: Network, text: Network, words: ClipWords) -> None:
        self.encoder, self.decoder, self.text, self.words = encoder, decoder, text, words
        self.entry = next(iter(encoder.inputs))
        sides = encoder.shape(self.entry)
        self.side = sides[-1] or SIDE
        self.name = f"SAM 3 of {decoder.path.name}"

    def encode(self, image: np.ndarray) -> tuple[Square, dict[str, np.ndarray]]:
        """image (H, W, 3 or more) uint8 -> its place in the square, and its features by name."""
        square = Square((image.shape[1], image.shape[0]), self.side, padded=False)
        pixels = square.shrink(image[..., :3])
        entry = self.encoder.inputs[self.entry]
        if entry.type != "tensor(uint8)":  # else the network does so itself
            pixels = pixels / 127.5 - 1
        planes = square.pad(pixels)
        return square, self.encoder.run(
            {self.entry: planes[0] if len(entry.shape) == 3 else planes}
        )

    def candidates(self, encoded: tuple[Square, dict[str, np.ndarray]], prompt: Prompt) -> list:
        square, features = encoded
        width, height = square.size
        said = self.text.run({"tokens": self.words.tokens(prompt.text or VISUAL)})
        mask, memory, embeds = self.text_outputs(said)
        given = features | {
            "original_height": np.array(height), "original_width": np.array(width),
            "language_mask": mask, "language_features": memory, "language_embeds": embeds,
            **self.boxes_of(prompt, square),
        }  # fmt: skip
        found = self.decoder.run(given)
        if "pred_logits" in found:
            logits = self.decoder.floats(found, "pred_logits", 3).ravel()
            there = self.decoder.floats(found, "presence_logit_dec", 2).ravel()[0]
            masks = self.decoder.floats(found, "pred_masks", 4)[0]
            return self.masks_of(masks, sigmoid(logits) * sigmoid(there), square)
        if not {"masks", "scores"} <= found.keys():
            self.decoder.floats(found, "pred_logits", 3)  # says what is there
        if not np.asarray(found["scores"]).size:
            return []  # none that is sure enough
        scores, masks = (self.decoder.floats(found, n, r) for n, r in (("scores", 1), ("masks", 4)))
        return self.masks_of(masks[:, 0] - 0.5, scores, square)  # 0 and 1

    def text_outputs(self, said: dict[str, np.ndarray]) -> list[np.ndarray]:
        """What the text encoder says, in the order of its outputs.  Raises BadFile."""
        if len(said) != 3:
            raise BadFile(
                f"{self.text.path}: it gives {len(said)} outputs; a mask, a memory and embeddings "
                "are wanted."
            )
        return list(said.values())

    def boxes_of(self, prompt: Prompt, square: Square) -> dict[str, np.ndarray]:
        """A box, and a small one for each click: middle and sides over those of the photo."""
        rows, labels = [], []
        if prompt.box is not None:
            left, top, right, bottom = prompt.box
            rows.append(((left + right) / 2, (top + bottom) / 2, right - left, bottom - top))
            labels.append(1)
        sides = np.multiply(square.size, POINT)
        for places, label in ((prompt.inside, 1), (prompt.outside, 0)):
            rows += [(*place, *sides) for place in np.reshape(places, (-1, 2))]
            labels += [label] * len(places)
        room = self.decoder.shape("box_coords")[0] or max(len(rows), 1)
        if len(rows) > room:  # an export has as many places as it was made with
            rows, labels = rows[:room], labels[:room]
        coords = np.zeros((room, 1, 4), np.float32)
        if rows:
            coords[: len(rows), 0] = np.array(rows) / np.tile(square.size, 2)
        used = np.arange(room) < len(rows)
        whole = np.ones(room, np.int64)
        whole[: len(labels)] = labels
        return {"box_coords": coords, "box_labels": whole[:, None], "box_masks": ~used[None]}

    def masks_of(self, masks: np.ndarray, scores: np.ndarray, square: Square) -> list[Candidate]:
        """Logits (m, h, w) and scores (m,) as candidates, the surest first."""
        if len(masks) != len(scores):
            raise BadFile(
                f"{self.decoder.path}: it gives {len(masks)} masks and {len(scores)} scores; as "
                "many scores as masks are wanted."
            )
        order = np.argsort(-scores, kind="stable")[:MOST_MASKS]
        return [
            Candidate(square.stretch(masks[i]) > 0, float(np.clip(scores[i], 0, 1)))
            for i in order
            if scores[i] >= LEAST_SCORE
        ]


def sigmoid(logits: np.ndarray | float) -> np.ndarray:
    return 1 / (1 + np.exp(-np.clip(logits, -80, 80)))
