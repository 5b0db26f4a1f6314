"""CLIP from a folder of the user's: pictures and words as directions of one space.

The folder holds what exporters of CLIP write: vision_model.onnx (pixel_values -> image_embeds) and
text_model.onnx (input_ids -> text_embeds), at its top or in onnx/, tokenizer.json and
preprocessor_config.json.  None is shipped with the program.
"""

import unicodedata
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.gate.network import StrangeNetwork
from shapeshift.runtime_models.model import BadFile
from shapeshift.training.gradients.onnx_graph import OnnxGraph
from shapeshift.training.gradients.read_network import check_network, read_bytes, read_network
from shapeshift.training.gradients.reverse_mode import GradientSession, open_graph

FILES = ("vision_model.onnx", "text_model.onnx", "tokenizer.json", "preprocessor_config.json")
PIXELS, SEEN, WORDS, MASK, READ = (
    "pixel_values", "image_embeds", "input_ids", "attention_mask", "text_embeds",
)  # fmt: skip
LEAST_SIDE, MOST_SIDE = 8, 1024  # pixels of what a vision tower takes
TEMPLATES = (  # a text alone lies elsewhere than the pictures that it describes
    "{}", "a photo of {}.", "a picture of {}.", "a painting of {}.", "a rendering of {}.",
    "an object made of {}.", "something in the style of {}.", "a close view of {}.",
)  # fmt: skip
NO_STYLE = "A Photo"  # where the direction of equation 10 starts
SMALL = 1e-4  # of a squared length: a patch that is still the photo has no direction yet


class ClipModel:
    """The two towers of one folder."""

    def __init__(self, folder: Path) -> None:
        """Raises BadFile where a file is missing or is not what exporters write."""
        if not folder.is_dir():
            raise BadFile(f"{folder} is no folder; --clip-model names one with {', '.join(FILES)}.")
        vision, text, tokenizer, config = (find_file(folder, name) for name in FILES)
        self.vision = vision
        self.side, self.mean, self.deviation = read_preprocessing(config)
        self.tokenizer = ClipTokenizer(tokenizer)
        self.text, self.length, self.masked = open_text(text)
        self.towers = lru_cache(4)(self._open_tower)  # by the number of pictures
        self.losses = lru_cache(4)(self._open_loss)

    def _read(self, count: int) -> OnnxGraph:
        return read_network(self.vision, {PIXELS: (count, 3, self.side, self.side)}, [SEEN])

    def _open_tower(self, count: int):
        graph = self._read(count)
        graph.outputs = [unit_rows(graph, SEEN)]
        return open_graph(graph), graph.outputs

    def _open_loss(self, count: int) -> GradientSession:
        """Equations 11 to 13: 1 - cos between the text's direction and each patch's."""
        graph = self._read(count)
        if len(graph.shape(SEEN)) != 2:
            raise BadFile(f"{self.vision}: {SEEN} is {graph.shape(SEEN)}; rows are wanted.")
        width = graph.shape(SEEN)[1]
        photo, towards = (
            graph.add_input("photo", (1, width)),
            graph.add_input("towards", (width, 1)),
        )
        moved = graph.add_node("Sub", unit_rows(graph, SEEN), photo)  # (count, D)
        squares = graph.sum(graph.add_node("Mul", moved, moved), [1])
        length = graph.add_node("Sqrt", graph.add_node("Add", squares, graph.add_constant(SMALL)))
        cosine = graph.add_node("Div", graph.add_node("MatMul", moved, towards), length)
        mean = graph.scale(graph.sum(cosine, [0, 1], keepdims=0), 1 / count)
        loss = graph.add_node("Sub", graph.add_constant(1.0), mean)
        return GradientSession(graph, {"clip": (loss, 1.0)}, PIXELS)

    def see(self, pictures: np.ndarray) -> np.ndarray:
        """(n, D) of unit length, of pictures (n, side, side, 3) display sRGB 0..1."""
        session, names = self.towers(len(pictures))
        found = session.run(names, {PIXELS: self._pixels(pictures)})[0]
        return refuse_unusual(found, self.vision)

    def read(self, texts: Sequence[str]) -> np.ndarray:
        """(D,) of unit length: the mean of what the texts say.  Raises BadFile."""
        rows = []
        for text in texts:
            ids = self.tokenizer(text)
            # Fixed lengths are filled with ends, as CLIP's own tokenizer does: it reads up to the
            # first of them.
            padded = ids + [ids[-1]] * (max(self.length, len(ids)) - len(ids))
            given = {WORDS: np.array([padded], np.int64)}
            if self.masked:
                given[MASK] = np.array([[int(i < len(ids)) for i in range(len(padded))]], np.int64)
            (row,) = self.text.run([READ], given)
            rows.append(refuse_unusual(np.atleast_2d(row), Path("text_model.onnx"))[0])
        mean = np.mean([row / (np.linalg.norm(row) + 1e-12) for row in rows], axis=0)
        return (mean / (np.linalg.norm(mean) + 1e-12)).astype(np.float32)

    def slope(
        self, pictures: np.ndarray, photo: np.ndarray, towards: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """The loss of patches (n, side, side, 3) and its gradient by them.

        photo (D,): what is seen in the photo; towards (D,): the direction of the style.
        """
        given = {PIXELS: self._pixels(pictures), "photo": photo[None], "towards": towards[:, None]}
        losses, gradient = self.losses(len(pictures))(given)
        return losses["clip"], gradient.transpose(0, 2, 3, 1) / self.deviation

    def _pixels(self, pictures: np.ndarray) -> np.ndarray:
        values = (pictures - self.mean) / self.deviation
        return np.ascontiguousarray(values.transpose(0, 3, 1, 2), np.float32)


def unit_rows(graph: OnnxGraph, value: str) -> str:
    """(n, D) of unit length."""
    squares = graph.sum(graph.add_node("Mul", value, value), [1])
    floor = graph.add_node("Add", squares, graph.add_constant(1e-12))
    return graph.add_node("Div", value, graph.add_node("Sqrt", floor))


def find_file(folder: Path, name: str) -> Path:
    """Of a folder of CLIP's: at the top or in onnx/.  Raises BadFile."""
    for path in (folder / name, folder / "onnx" / name):
        if path.is_file():
            return path
    raise BadFile(f"{folder} has no {name}; an exported CLIP is {', '.join(FILES)}.")


def read_preprocessing(path: Path) -> tuple[int, np.ndarray, np.ndarray]:
    """Side in pixels, mean and deviation (3,) of what the vision tower takes.  Raises BadFile."""
    config = Fields(read_json(path), str(path), "export CLIP's preprocessor again")
    key = "crop_size" if config.has("crop_size") else "size"
    if isinstance(config.value(key), dict):
        sizes = config.object(key)
        side = sizes.count(
            "height" if sizes.has("height") else "shortest_edge", LEAST_SIDE, MOST_SIDE
        )
    else:
        side = config.count(key, LEAST_SIDE, MOST_SIDE)
    mean, deviation = (config.numbers(k, 3, most=1e3) for k in ("image_mean", "image_std"))
    if not min(deviation) > 0:
        raise config.error("image_std", "a list of three numbers above 0")
    return side, np.array(mean, np.float32), np.array(deviation, np.float32)


def open_text(path: Path):
    """The session of a text tower, the length that it takes (0: any), and whether it wants a mask.

    Raises BadFile.
    """
    data = read_bytes(path)
    check_network(data, path)
    session = StrangeNetwork(path, 0, data)
    inputs = {node.name: node.shape for node in session.get_inputs()}
    outputs = [node.name for node in session.get_outputs()]
    if WORDS not in inputs or set(inputs) - {WORDS, MASK} or READ not in outputs:
        raise BadFile(
            f"{path} has the inputs {', '.join(inputs)} and the outputs {', '.join(outputs)}; "
            f"{WORDS}, perhaps {MASK}, and {READ} are wanted."
        )
    length = inputs[WORDS][1] if len(inputs[WORDS]) == 2 else 0
    return session, min(length, MOST_TOKENS) if isinstance(length, int) else 0, MASK in inputs


def refuse_unusual(rows: np.ndarray, path: Path) -> np.ndarray:
    """The rows (n, D).  Raises BadFile where they are none or not finite."""
    if rows.ndim != 2 or not np.isfinite(rows).all():
        raise BadFile(f"{path.name} gives no finite rows, {rows.shape}; use another CLIP.")
    return rows


# Words to the numbers that CLIP's text tower reads: byte-pair encoding by a tokenizer.json.
#
# The package that is usual for this brings a client for downloads and a dozen others; the encoding
# of CLIP alone (Radford et al. 2021) is short, so it is here.

START, END = "<|startoftext|>", "<|endoftext|>"
CONTRACTIONS = ("'s", "'t", "'re", "'ve", "'m", "'ll", "'d")
WORD_END = "</w>"
MOST_TOKENS = 77  # CLIP's context


class ClipTokenizer:
    """Encodes texts as the tokenizer of a CLIP does."""

    def __init__(self, path: Path) -> None:
        """Raises BadFile where the file is no tokenizer of CLIP's kind."""
        self.path = path
        model = Fields(read_json(path), str(path), "export CLIP's tokenizer again").object("model")
        kind, suffix = model.text("type", ""), model.text("end_of_word_suffix", "")
        if kind not in ("", "BPE") or suffix != WORD_END:
            raise BadFile(
                f"{path} is a tokenizer of another kind ({kind or 'no type'}, words end in "
                f"{suffix!r}); CLIP's byte pairs, whose words end in {WORD_END!r}, are read."
            )
        self.ids: dict[str, int] = model.typed("vocab", dict, {})
        if not all(type(n) is int and n >= 0 for n in self.ids.values()):
            raise model.error("vocab", "an object of whole numbers from 0 on")
        if missing := [token for token in (START, END) if token not in self.ids]:
            raise BadFile(f"{path} has no token {missing[0]}; export CLIP's tokenizer again.")
        pairs = [self._pair(model, row) for row in model.value("merges", [])]
        self.ranks = {pair: rank for rank, pair in enumerate(pairs)}
        self.letters = byte_letters()

    def _pair(self, model: Fields, row: object) -> tuple[str, str]:
        """A merge, written as "a b" or as ["a", "b"]."""
        parts = row.split(" ") if isinstance(row, str) else row
        if not (isinstance(parts, list) and len(parts) == 2 and all(type(p) is str for p in parts)):
            raise model.error("merges", "a list of pairs of texts")
        return parts[0], parts[1]

    def __call__(self, text: str) -> list[int]:
        """The numbers of a text, with those of its start and end.  Raises BadFile."""
        found = [self.ids[START]]
        for word in words_of(text):
            for token in self._merge("".join(self.letters[b] for b in word.encode())):
                if token not in self.ids:
                    raise BadFile(f"{self.path} knows no token for {word!r}; use other words.")
                found.append(self.ids[token])
        found.append(self.ids[END])
        if len(found) > MOST_TOKENS:
            raise BadFile(
                f"'{text[:40]}...' is {len(found)} tokens for CLIP, which reads {MOST_TOKENS}; use "
                "fewer words."
            )
        return found

    def _merge(self, word: str) -> list[str]:
        """The tokens of a word: the pair that comes first in the file is merged first."""
        parts = [*word[:-1], word[-1] + WORD_END]
        while len(parts) > 1:
            best = min(pairwise(parts), key=lambda pair: self.ranks.get(pair, len(self.ranks)))
            if best not in self.ranks:
                break
            merged, i = [], 0
            while i < len(parts):
                if tuple(parts[i : i + 2]) == best:
                    merged.append(best[0] + best[1])
                    i += 2
                else:
                    merged.append(parts[i])
                    i += 1
            parts = merged
        return parts


def words_of(text: str) -> list[str]:
    """Letters, single digits and signs apart, in small letters; what stands behind an apostrophe
    is a word of its own."""
    found = []
    for part in unicodedata.normalize("NFC", text).lower().split():
        at = 0
        while at < len(part):
            short = next((c for c in CONTRACTIONS if part.startswith(c, at)), "")
            if short:
                found.append(short)
                at += len(short)
                continue
            kind = kind_of(part[at])
            end = at + 1
            while kind != "N" and end < len(part) and kind_of(part[end]) == kind:
                end += 1
            found.append(part[at:end])
            at = end
    return found


def kind_of(letter: str) -> str:
    """L of letters, N of numbers, else an empty text."""
    kind = unicodedata.category(letter)[0]
    return kind if kind in "LN" else ""


def byte_letters() -> list[str]:
    """The letter that stands for each byte: its own if it can be printed, else one from 256 on."""
    own = [*range(ord("!"), ord("~") + 1), *range(ord("¡"), ord("¬") + 1),
           *range(ord("®"), ord("ÿ") + 1)]  # fmt: skip
    others = iter(range(256, 512))
    return [chr(b if b in own else next(others)) for b in range(256)]
