"""What a person asked for cannot be done: the message is one sentence for them."""

import re
from collections.abc import Mapping
from dataclasses import fields

BEGINNING = re.compile(r"[a-z_]+")  # of a sentence: a setting's name, where it is about one


class UsageError(ValueError):
    """An option or a combination of options that cannot work."""


def as_typed(
    error: ValueError, settings: type, options: Mapping[str, str] | None = None, said: str = "--"
) -> UsageError:
    """What a dataclass of settings says of a field, as UsageError that names the option instead.

    "max_anchors is 0; ..." becomes "--max-anchors is 0; ...": a refusal of settings begins with the
    field that it is about.  options: a field -> the option that gave it, where they differ; said:
    what stands before a name where it is typed, "" in Python.
    """
    sentence = str(error)
    beginning = BEGINNING.match(sentence)
    name = beginning[0] if beginning else ""
    if not said or name not in {field.name for field in fields(settings)}:
        return UsageError(sentence)
    option = (options or {}).get(name, name).rstrip("_").replace("_", "-")
    return UsageError(f"{said}{option}{sentence[len(name) :]}")
