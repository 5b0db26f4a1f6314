"""Words to numbers as CLIP does it (byte pair encoding), for segmenters that read.

The vocabulary is a file of the user's: bpe_simple_vocab_16e6.txt(.gz), merges.txt or
tokenizer.json, as they come with the networks.  Radford et al. 2021, Sennrich et al. 2016.
"""

import re
import zlib
from itertools import pairwise
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.files.memory import Memory, read_text_file
from shapeshift.runtime_models.model import BadFile

FILES = ("bpe_simple_vocab_16e6.txt.gz", "bpe_simple_vocab_16e6.txt", "merges.txt",
         "tokenizer.json")  # fmt: skip
LENGTH = 32  # tokens of a text, with its first and last
MERGES = 49152 - 256 - 2  # of CLIP's vocabulary; more in a file are not used
MOST_BYTES = 16 << 20  # of the merges as text
END_OF_WORD = "</w>"
WORDS = re.compile(r"'s|'t|'re|'ve|'m|'ll|'d|[^\W\d_]+|\d|(?:_|[^\s\w])+", re.IGNORECASE)


class ClipWords:
    """Texts to rows of numbers."""

    def __init__(self, merges: list[tuple[str, str]]) -> None:
        letters = list(byte_letters().values())
        pieces = [*letters, *(letter + END_OF_WORD for letter in letters)]
        pieces += [first + second for first, second in merges]
        self.number_of = {piece: i for i, piece in enumerate(pieces)}
        self.rank_of = {pair: i for i, pair in enumerate(merges)}
        self.first, self.last = len(pieces), len(pieces) + 1

    def tokens(self, text: str) -> np.ndarray:
        """(1, LENGTH) int64; what is too long is cut off, what is too short filled with 0."""
        numbers = []
        letters = byte_letters()
        for word in WORDS.findall(" ".join(text.lower().split())):
            written = "".join(letters[byte] for byte in word.encode())
            numbers += [self.number_of[piece] for piece in self.pieces(written)]
        row = np.zeros((1, LENGTH), np.int64)
        whole = [self.first, *numbers[: LENGTH - 2], self.last]
        row[0, : len(whole)] = whole
        return row

    def pieces(self, word: str) -> list[str]:
        """A word's letters, joined in the order of the merges until no pair is left to join."""
        found = [*word[:-1], word[-1] + END_OF_WORD]
        while len(found) > 1:
            ranks = [self.rank_of.get(pair, MERGES) for pair in pairwise(found)]
            if min(ranks) == MERGES:
                break
            best = ranks.index(min(ranks))
            pair = found[best], found[best + 1]
            joined, i = [], 0
            while i < len(found):
                here = tuple(found[i : i + 2]) == pair
                joined.append("".join(pair) if here else found[i])
                i += 2 if here else 1
            found = joined
        return found


def byte_letters() -> dict[int, str]:
    """A printable letter for each byte: itself where it is one, else one from U+0100 on."""
    plain = [*range(33, 127), *range(161, 173), *range(174, 256)]
    others = [byte for byte in range(256) if byte not in plain]
    letters = {byte: chr(byte) for byte in plain}
    return letters | {byte: chr(256 + i) for i, byte in enumerate(others)}


def read_words(folder: Path) -> ClipWords | None:
    """The vocabulary that lies in the folder; None where there is none.  Raises BadFile."""
    path = next((folder / name for name in FILES if (folder / name).is_file()), None)
    if path is None:
        return None
    if path.suffix == ".json":
        model = Fields(read_json(path), path.name).object("model")
        rows = model.value("merges")
        if not isinstance(rows, list):
            raise model.error("merges", "a list of pairs")
        lines = [" ".join(row) if isinstance(row, list) else row for row in rows if row]
    else:
        data = read_text_file(path)
        if path.suffix == ".gz":
            data = unpacked(data, path)
        lines = data.decode("utf-8", "replace").splitlines()[1:]  # the first says the version
    merges = [tuple(line.split(" ")) for line in lines[:MERGES] if isinstance(line, str) and line]
    if not merges or any(len(pair) != 2 for pair in merges):
        raise BadFile(f"{path}: not a vocabulary of CLIP's; pairs of word parts are wanted in it.")
    return ClipWords([(first, second) for first, second in merges])


def unpacked(data: bytes, path: Path) -> bytes:
    """Of a gzip file.  Raises BadFile."""
    Memory().of(path).charge(MOST_BYTES, "its lines")
    packer = zlib.decompressobj(31)
    try:
        text = packer.decompress(data, MOST_BYTES)
    except zlib.error as error:
        raise BadFile(f"{path}: not a gzip file ({error}); copy it again.") from None
    if packer.unconsumed_tail:
        raise BadFile(f"{path}: unpacked it has over {MOST_BYTES:,} bytes; copy it again.")
    if not packer.eof:
        raise BadFile(f"{path}: it is cut off; copy it again.")
    return text
