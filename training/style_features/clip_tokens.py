"""Words to the numbers that CLIP's text tower reads: byte-pair encoding by a tokenizer.json.

The package that is usual for this brings a client for downloads and a dozen others; the encoding
of CLIP alone (Radford et al. 2021) is short, so it is here.
"""

import unicodedata
from itertools import pairwise
from pathlib import Path

from shapeshift.runtime_models.files.json_fields import Fields, read_json
from shapeshift.runtime_models.model import BadFile

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
