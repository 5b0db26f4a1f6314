"""Values out of a JSON object, each of the type that it has to have; BadFile names its key."""

import math
from typing import TypeGuard

from shapeshift.runtime_models.model import BadFile

LONGEST_NAME = 80  # letters of a file's own words in a message


def is_number(value: object) -> TypeGuard[int | float]:
    """A finite number; true and false are none, and neither are integers beyond every float."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= 1e300 and math.isfinite(value)


def text_in(entry: dict, key: str, where: str, otherwise: str = "") -> str:
    """The text of a key that may be absent or null."""
    value = entry.get(key)
    if value is None:
        return otherwise
    if not isinstance(value, str):
        raise BadFile(f"{where}: '{key}' is {shown(value)}; a text is wanted.")
    return value


def number_in(entry: dict, key: str, where: str) -> float:
    """The number of a key that has to be there."""
    if not is_number(entry.get(key)):
        raise BadFile(f"{where}: '{key}' is {shown(entry.get(key))}; a number is wanted.")
    return float(entry[key])


def numbers_in(entry: dict, key: str, count: int, where: str) -> tuple[float, ...] | None:
    """The list of `count` numbers of a key; None where it is absent or null."""
    value = entry.get(key)
    if value is None:
        return None
    if not (isinstance(value, list) and len(value) == count and all(map(is_number, value))):
        raise BadFile(f"{where}: '{key}' is {shown(value)}; a list of {count} numbers is wanted.")
    return tuple(map(float, value))


def shown(value: object) -> str:
    """A value for a message: as it stands in the file if that is short, else what it is."""
    if isinstance(value, list):
        small = len(value) <= 4 and not any(isinstance(part, list | dict) for part in value)
        return f"[{', '.join(map(shown, value))}]" if small else f"a list of {len(value)}"
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, int) and abs(value) > 1e30:
        return "a number beyond measure"  # Python does not print the longest ones
    return "null" if value is None else f"{value!r:.40}"


def shortened(name: object) -> str:
    """The end of a path or name for a message."""
    text = str(name)
    return text if len(text) <= LONGEST_NAME else f"...{text[-LONGEST_NAME:]}"
