"""JSON from files: every reader checks it here, and a wrong value becomes one sentence."""

import enum
import json
import math
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeGuard, TypeVar

from shapeshift.runtime_models.files.memory import read_json_file
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_weights import Control, StopWeights

MOST_BYTES = 32 << 20  # of JSON: a million painted weights
LONGEST_TEXT = 1000  # letters of a line
LONGEST_SHOWN = 60  # letters of a wrong value in a message
LIKE = 0.7  # of difflib's ratio: as alike a key is taken for a typing error
LARGEST = 1e12  # of numbers, where a reader does not say


TYPE_NAMES = {dict: "an object in braces", list: "a list", str: "a text", bool: "true or false",
              int: "a whole number from 0 below 2^63"}  # fmt: skip


class _Required(enum.Enum):
    """The type of REQUIRED, so that a default of None is still a default."""

    REQUIRED = 0


REQUIRED = _Required.REQUIRED  # as a default: the key has to be there
Default = TypeVar("Default")


def parse_json(text: bytes | str, where: str, unique: bool = False) -> Any:
    """What JSON text holds; `where` is for messages.  Raises BadFile.

    unique: a key that stands twice in one object is refused, too.
    """

    def unique_keys(pairs: list[tuple[str, object]]) -> dict[str, object]:
        seen: dict[str, object] = {}
        for key, value in pairs:
            if key in seen:
                raise BadFile(f"{where}: '{key:.60}' stands twice in one object; leave one out.")
            seen[key] = value
        return seen

    try:
        return json.loads(text, object_pairs_hook=unique_keys if unique else None)
    except BadFile:
        raise
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, " if error.lineno > 1 else ""
        fault = f"{error.msg} at {place}column {error.colno}"
    except UnicodeDecodeError:
        fault = "it is no text at all"
    except RecursionError:
        fault = "it is nested too deep"
    except ValueError as error:  # numbers of thousands of digits
        fault = str(error)[:80]
    raise BadFile(f"{where} is not JSON ({fault}); write it again.")


def read_json(
    path: Path, where: str = "", most_bytes: int = MOST_BYTES, unique: bool = False
) -> Any:
    """What a JSON file holds, its memory charged; `where` is for messages.  Raises BadFile."""
    if not path.is_file():  # reading a pipe would wait for ever
        raise BadFile(f"{path} is no file; a JSON file is wanted.")
    if (size := path.stat().st_size) > most_bytes:
        raise BadFile(f"{path} has {size:,} bytes; at most {most_bytes:,} are read.")
    return parse_json(read_json_file(path), where or str(path), unique)


def saved_object(path: Path, most_bytes: int) -> dict[str, Any]:
    """The object of a file that this program keeps for itself.

    {} where there is no such file, or none that can be read: it is written anew.
    """
    try:
        if path.stat().st_size > most_bytes:
            return {}
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return data if isinstance(data, dict) else {}


def is_number(value: object) -> TypeGuard[int | float]:
    """A finite number; true and false are none, and neither are integers beyond every float."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= 1e300 and math.isfinite(value)


def is_count(value: object) -> TypeGuard[int]:
    """A whole number from 0 on."""
    return type(value) is int and value >= 0


def shown(value: object) -> str:
    """A value for a message: as JSON has it if that is short, else what it is."""
    if isinstance(value, str):
        text = json.dumps(value[: LONGEST_SHOWN + 1], ensure_ascii=False)
        return text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "…"
    if isinstance(value, list | tuple):
        small = len(value) <= 16 and not any(isinstance(p, list | tuple | dict) for p in value)
        text = f"[{', '.join(map(shown, value))}]" if small else ""
        return text if 0 < len(text) <= LONGEST_SHOWN else f"a list of {len(value):,}"
    if isinstance(value, Mapping):
        return "an object" if value else "{}"
    if isinstance(value, int) and abs(value) > 1e30:
        return "a number beyond measure"  # Python does not print the longest ones
    return json.dumps(value, default=str)[:LONGEST_SHOWN]


def control_row(control: Control, decimals: int | None = None) -> float | dict[str, float]:
    """A control as JSON has it: the inverse of Fields.control; `decimals`: rounded, for reports."""

    def number(value: float) -> float:
        return value if decimals is None else round(float(value), decimals) + 0.0  # never -0

    if isinstance(control, StopWeights):
        return {name: number(weight) for name, weight in control.parts}
    return number(control)


class Inherited(ChainMap):
    """An object of JSON, and behind it what is said for all of its kind; maps[0]: its own.

    Thousands of frames are asked a hundred keys each: ChainMap is slow to say that there is none.
    """

    def __contains__(self, key: object) -> bool:
        for held in self.maps:  # any() makes a generator each time
            if key in held:
                return True
        return False

    def get(self, key: Any, default: Any = None) -> Any:
        for held in self.maps:
            if key in held:
                return held[key]
        return default


def own_keys(entry: Mapping) -> Mapping:
    """What an object says itself, without what is said for all of its kind."""
    return entry.maps[0] if isinstance(entry, Inherited) else entry


class Fields:
    """The values of one JSON object, each of the type that it has to have."""

    def __init__(self, data: object, where: str, advice: str = "") -> None:
        """`where` is for messages, `advice` what to do about a wrong file.  Raises BadFile."""
        if not isinstance(data, Mapping):
            end = f"; {advice}" if advice else ""
            raise BadFile(f"{where} is {shown(data)}; one object in braces is wanted{end}.")
        self.data: Mapping[str, Any] = data
        self.where, self.advice = where, advice
        self.asked: list[str] = []

    def error(self, key: str, wanted: str) -> BadFile:
        """The sentence about a wrong value."""
        end = f"; {self.advice}" if self.advice else ""
        found = shown(self.data.get(key)) if key in self.data else "missing"
        return BadFile(f"{self.where}: '{key}' is {found}; {wanted} is wanted{end}.")

    def has(self, key: str) -> bool:
        """Whether the key is there and not null."""
        return self.data.get(key) is not None

    def value(self, key: str, default: object = REQUIRED) -> Any:
        """The value as it is; without a default it must be there."""
        self.asked.append(key)
        if key not in self.data and default is REQUIRED:
            raise BadFile(f"{self.where}: '{key}' is missing; {self.advice or 'add it'}.")
        return self.data.get(key, default)

    def number(
        self, key: str, default: Default | _Required = REQUIRED, wanted: str = "a finite number",
        low: float = -LARGEST, high: float = LARGEST,
    ) -> float | Default:  # fmt: skip
        """From low to high, both included."""
        value = self.value(key, default)
        if key not in self.data:
            return value
        if not (is_number(value) and low <= value <= high):
            raise self.error(key, wanted)
        return float(value)

    def count(self, key: str, low: int, high: int, default: int | _Required = REQUIRED) -> int:
        """A whole number from low to high."""
        value = self.value(key, default)
        if not (type(value) is int and low <= value <= high):
            raise self.error(key, f"a whole number from {low:,} to {high:,}")
        return value

    def numbers(
        self, key: str, count: int, default: Default | _Required = REQUIRED, most: float = LARGEST
    ) -> tuple[float, ...] | Default:
        """So many, none larger than `most` either way."""
        value = self.value(key, default)
        if key not in self.data:
            return value
        if not (isinstance(value, list) and len(value) == count and all(map(is_number, value))):
            raise self.error(key, f"a list of {count} finite numbers")
        if not all(abs(n) <= most for n in value):
            raise self.error(key, f"a list of {count} finite numbers up to {most:g}")
        return tuple(map(float, value))

    def pair(self, key: str, most: float = LARGEST) -> tuple[float, float]:
        """Two numbers, the lower one first."""
        low, high = self.numbers(key, 2, most=most)
        if not low < high:
            raise self.error(key, "[low, high]")
        return low, high

    def control(
        self, key: str, default: Default | _Required = REQUIRED,
        wanted: str = "0 to 1, or weights in braces,",
    ) -> Control | Default:  # fmt: skip
        """A number from 0 to 1, or weights by the names of stops: {"RGB": 0.5, "Opened": 0.5}."""
        value = self.value(key, default)
        if key not in self.data or not isinstance(value, dict):
            return self.number(key, default, wanted, 0, 1)
        if not all(map(is_number, value.values())):
            raise self.error(key, "weights that are numbers from 0 to 1, 1 in the sum,")
        try:
            return StopWeights(tuple(value.items()))
        except ValueError:
            raise self.error(key, "weights from 0 to 1, 1 in the sum,") from None

    def flag(self, key: str, default: bool = False) -> bool:
        value = self.value(key, default)
        if not isinstance(value, bool):
            raise self.error(key, "true or false")
        return value

    def typed(self, key: str, kind: type, default: object = None) -> Any:
        """A value of one type: dict, list, str, bool, or int from 0 on; `default` if absent."""
        value = self.value(key, default)
        if key not in self.data:
            return value
        usual = isinstance(value, kind) and (kind is not int or not isinstance(value, bool))
        if not usual or (kind is int and not 0 <= value < 1 << 63):
            raise self.error(key, TYPE_NAMES[kind])
        return value

    def text(self, key: str, default: str | _Required = REQUIRED) -> str:
        """Any text; without a default one that is not blank.  Null counts as absent."""
        value = self.value(key, default)
        if value is None and default is not REQUIRED:
            return default
        if not (isinstance(value, str) and (default is not REQUIRED or value.strip())):
            raise self.error(key, "a text")
        return value

    def texts(self, key: str, default: Default | _Required = REQUIRED) -> list[str] | Default:
        value = self.value(key, default)
        if key not in self.data:
            return value
        if not (isinstance(value, list) and all(isinstance(text, str) for text in value)):
            raise self.error(key, "a list of texts")
        return value

    def line(
        self, key: str, default: Default | _Required = REQUIRED, known: Sequence[str] = (),
        wanted: str = "",
    ) -> str | Default:  # fmt: skip
        """One line of text; one of `known` where there are such."""
        value = self.value(key, default)
        if key not in self.data:
            return value
        fits = isinstance(value, str) and 0 < len(value) <= LONGEST_TEXT and value.isprintable()
        if not fits or (known and value not in known):
            options = " or ".join(f"'{word}'" for word in known if word)
            raise self.error(key, wanted or options or "one line of text")
        return value

    def path(self, key: str) -> str:
        """A path with forward slashes, so that the file opens on every system."""
        wanted = "a path with forward slashes"
        value = self.line(key, wanted=wanted)
        if "\\" in value:
            raise self.error(key, wanted)
        return value

    def object(self, key: str) -> "Fields":
        """The object under a key that has to be there."""
        if not isinstance(value := self.value(key), Mapping):
            raise self.error(key, "an object in braces")
        return Fields(value, f"{self.where}: '{key}'", self.advice)

    def optional_object(self, key: str) -> "Fields | None":
        """The object under a key, if it is there; null counts as absent."""
        return self.object(key) if self.value(key, None) is not None else None

    def rows(self, key: str, most: int, word: str, first: int = 1) -> "list[Fields]":
        """The objects of the list under a key, called `word` 1, 2, ...; [] if absent."""
        value = self.value(key, [])
        if not (isinstance(value, list) and all(isinstance(row, Mapping) for row in value)):
            raise self.error(key, "a list of objects in braces")
        if len(value) > most:
            raise BadFile(f"{self.where}: '{key}' has {len(value):,} rows; at most {most:,} fit.")
        return list(rows_of(value, f"{self.where}: {word}", first, self.advice))

    def refuse_unknown_keys(self) -> None:
        """Refuses keys that were never asked for: they are typing errors.  Raises BadFile."""
        for key in self.data:
            if key not in self.asked:
                near = get_close_matches(key, self.asked, 1, LIKE)
                advice = (
                    f"did you mean '{near[0]}'?  Else leave it out."
                    if near
                    else f"known are {', '.join(dict.fromkeys(self.asked))}."
                )
                raise BadFile(f"{self.where}: '{key:.60}' is no key here; {advice}")


def rows_of(rows: Sequence[object], where: str, first: int, advice: str = "") -> Iterator[Fields]:
    """The objects of a list; the first one is called by `where` and the number `first`."""
    for i, row in enumerate(rows, first):
        yield Fields(row, f"{where} {i}", advice)
