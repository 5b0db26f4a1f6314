"""A segmenter out of the ONNX files that the user has: SAM, MobileSAM, SAM 2, SAM 3.

Nothing is fetched.  What the files of a folder are is told by the names and ranks of their inputs,
not by their own names; docs/objects.md lists the exports.  Kirillov et al. 2023, Zhang et al. 2023,
Ravi et al. 2024, Carion et al. 2025.
"""

from pathlib import Path

from shapeshift.decomposition.masks.clip_words import FILES, read_words
from shapeshift.decomposition.masks.sam_concepts import ConceptSam
from shapeshift.decomposition.masks.sam_network import Network, list_of
from shapeshift.decomposition.masks.sam_points import PointSam
from shapeshift.decomposition.masks.segmenter import Segmenter
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
