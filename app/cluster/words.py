"""Options of a command as the words that stand for them: app/command_line.py the other way."""

import os
from pathlib import Path
from typing import Any

from shapeshift.app.command_line import Argument, arguments_of, dicts_of
from shapeshift.app.paths import full


def words_for(command: str, options: Any) -> tuple[str, ...]:
    """A command with its options, so that `parse` of them gives the same; paths are absolute.

    What is no option is in the file of --settings.  ValueError where there is none.
    """
    places, rest = [], []
    kind: type = type(options)
    asked = {name for group in dicts_of(kind) for name in getattr(options, group)}
    lines = asked - {each.field.name for each in arguments_of(kind) if each.into}
    if lines and options.settings is None:
        raise ValueError(f"{', '.join(sorted(lines))}: lines of a settings file, and none is given")
    for each in arguments_of(kind):
        given, value = _value_of(options, each)
        if not given:
            continue
        values = [_word(part) for part in (value if each.is_tuple else (value,))]
        if each.opt.positional:
            places += values
        elif each.kind is bool:
            rest.append(each.name if value else f"--no-{each.name[2:]}")
        elif each.count == 1 and values[0].startswith("-"):
            rest.append(f"{each.name}={values[0]}")
        else:
            rest += [each.name, *values]
    return (command, *places, *rest)


def _value_of(options: Any, each: Argument) -> tuple[bool, Any]:
    """(whether it is not what holds without a word, its value)."""
    if each.into:
        asked = getattr(options, each.into)
        return each.field.name in asked, asked.get(each.field.name)
    value = getattr(options, each.field.name)
    return each.required or value not in (each.field.default, None), value


def _word(value: Any) -> str:
    if isinstance(value, Path):
        return full(value) if str(value) != "-" else "-"
    return repr(value) if isinstance(value, float) else str(value)


def absolute(text: str) -> str:
    """A path in a text option, for a process that is started elsewhere."""
    return full(text) if os.path.exists(full(text)) else text
