"""An object of a JSON file taken apart key by key: every wrong value is one sentence."""

import json
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from shapeshift.runtime_models.files.memory import read_json_file
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_weights import Control, StopWeights
from shapeshift.scene.cameras.camera_list import is_number

MOST_BYTES = 32 << 20  # of JSON: a million painted weights
LONGEST_TEXT = 1000  # letters
_ABSENT = object()


def read_object(text: bytes | str, where: str) -> "Fields":
    """The one object that JSON text holds.  Raises BadFile, also for a key that stands twice."""

    def unique(pairs: list[tuple[str, object]]) -> dict:
        seen: dict[str, object] = {}
        for key, value in pairs:
            if key in seen:
                raise BadFile(f"{where}: '{key:.60}' stands twice in one object; leave one out.")
            seen[key] = value
        return seen

    try:
        data = json.loads(text, object_pairs_hook=unique)
    except BadFile:
        raise
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, " if error.lineno > 1 else ""
        place += f"column {error.colno}"
        raise BadFile(f"{where} is not JSON: {error.msg} at {place}.") from None
    except UnicodeDecodeError:
        raise BadFile(f"{where} is not JSON, and no text at all.") from None
    except (ValueError, RecursionError) as error:
        raise BadFile(f"{where} is not JSON: {str(error)[:80]}.") from None
    if not isinstance(data, dict):
        raise BadFile(f"{where} holds {shown(data)}; one object in braces is wanted.")
    return Fields(data, where)


def read_object_file(path: Path) -> "Fields":
    """The same of a file."""
    if not path.is_file():  # reading a pipe would wait for ever
        raise BadFile(f"{path} is no file.")
    if (size := path.stat().st_size) > MOST_BYTES:
        raise BadFile(f"{path} has {size:,} bytes; at most {MOST_BYTES:,} are read.")
    return read_object(read_json_file(path), path.name)


def control_row(control: Control, decimals: int | None = None) -> float | dict[str, float]:
    """A control as JSON has it: the inverse of Fields.control; rounded where it is only told."""

    def number(value: float) -> float:
        return value if decimals is None else round(float(value), decimals) + 0.0  # never -0

    if isinstance(control, StopWeights):
        return {name: number(weight) for name, weight in control.parts}
    return number(control)


def shown(value: object) -> str:
    """A value as the file has it, cut short."""
    try:
        text = json.dumps(value, ensure_ascii=False)
    except (ValueError, RecursionError):
        text = type(value).__name__
    return text if len(text) <= 60 else text[:60] + "…"


class Fields:
    """Takes values out of a JSON object; what was never asked for is refused at the end."""

    def __init__(self, data: dict, where: str) -> None:
        self.data, self.where = data, where
        self.asked: list[str] = []

    def refuse(self, key: str, wanted: str) -> BadFile:
        return BadFile(f"{self.where}: '{key}' is {shown(self.data.get(key))}; {wanted} is wanted.")

    def take(self, key: str, default: object = _ABSENT) -> Any:
        """The value as it is; without a default it must be there."""
        self.asked.append(key)
        if key not in self.data and default is _ABSENT:
            raise BadFile(f"{self.where}: '{key}' is missing.")
        return self.data.get(key, default)

    def number(
        self, key: str, default: object, wanted: str, low: float = -1e12, high: float = 1e12
    ) -> float:
        """From low to high, both included."""
        value = self.take(key, default)
        if key in self.data and not (is_number(value) and low <= value <= high):
            raise self.refuse(key, wanted)
        return float(value) if is_number(value) else value

    def control(
        self, key: str, default: object = _ABSENT, wanted: str = "0 to 1, or weights in braces,"
    ) -> Control:
        """A number from 0 to 1, or weights by the names of stops: {"RGB": 0.5, "Opened": 0.5}."""
        value = self.take(key, default)
        if key not in self.data or not isinstance(value, dict):
            return self.number(key, default, wanted, 0, 1)
        if not all(map(is_number, value.values())):
            raise self.refuse(key, "weights that are numbers from 0 to 1, 1 in the sum,")
        try:
            return StopWeights(tuple(value.items()))
        except ValueError:
            raise self.refuse(key, "weights from 0 to 1, 1 in the sum,") from None

    def numbers(
        self, key: str, count: int, default: object = _ABSENT, most: float = 1e12
    ) -> tuple[float, ...]:
        """So many, none larger than `most` either way."""
        value = self.take(key, default)
        if key not in self.data:
            return value
        good = isinstance(value, list) and len(value) == count and all(map(is_number, value))
        if not (good and all(abs(n) <= most for n in value)):
            raise self.refuse(key, f"a list of {count} finite numbers up to {most:g}")
        return tuple(map(float, value))

    def flag(self, key: str, default: bool = False) -> bool:
        value = self.take(key, default)
        if not isinstance(value, bool):
            raise self.refuse(key, "true or false")
        return value

    def text(
        self, key: str, default: object = _ABSENT, known: Sequence[str] = (), wanted: str = ""
    ) -> str:
        """One line of text; one of `known` where there are such."""
        value = self.take(key, default)
        if key not in self.data:
            return value
        fits = isinstance(value, str) and 0 < len(value) <= LONGEST_TEXT and value.isprintable()
        if not fits or (known and value not in known):
            options = " or ".join(f"'{word}'" for word in known if word)
            raise self.refuse(key, wanted or options or "one line of text")
        return value

    def path(self, key: str, default: object = _ABSENT) -> str:
        """A path with forward slashes, so that the file opens on every system."""
        wanted = "a path with forward slashes"
        value = self.text(key, default, wanted=wanted)
        if key in self.data and "\\" in value:
            raise self.refuse(key, wanted)
        return value

    def inner(self, key: str) -> "Fields | None":
        """The object under a key, if it is there; null counts as absent."""
        value = self.take(key, None)
        if value is None:
            return None
        if not isinstance(value, dict):
            raise self.refuse(key, "an object in braces")
        return Fields(value, f"{self.where}: '{key}'")

    def rows(self, key: str, most: int, word: str) -> list["Fields"]:
        """The objects of the list under a key; none where it is absent."""
        value = self.take(key, [])
        if not (isinstance(value, list) and all(isinstance(row, dict) for row in value)):
            raise self.refuse(key, "a list of objects in braces")
        if len(value) > most:
            raise BadFile(f"{self.where}: '{key}' has {len(value):,} rows; at most {most:,} fit.")
        return [Fields(row, f"{self.where}: {word} {i}") for i, row in enumerate(value, 1)]

    def done(self) -> None:
        """Refuses keys that nobody has asked for: they are typing errors."""
        for key in self.data:
            if key not in self.asked:
                near = get_close_matches(key, self.asked, 1)
                advice = (
                    f"did you mean '{near[0]}'?  Else leave it out."
                    if near
                    else f"known are {', '.join(dict.fromkeys(self.asked))}."
                )
                raise BadFile(f"{self.where}: '{key:.60}' is no key here; {advice}")
