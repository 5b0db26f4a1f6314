"""What `--help` prints of a command, made of its Options: app/command_line.py."""

import inspect
import shutil
import textwrap
from collections.abc import Mapping

from shapeshift.app.command_line import Argument, arguments_of

WIDEST = 100  # letters of a line
COLUMN = 26  # where the texts begin
NOTHING = (None, "", (), float("inf"))  # defaults that the text names in words, or not at all


def help_text(kind: type, prog: str, defaults: Mapping[str, str] | None = None) -> str:
    """What `--help` prints: usage, what it does, usual options, then those for experts.

    `defaults`: in words what holds where an option is left out whose field says None.
    """
    defaults, arguments = defaults or {}, arguments_of(kind)
    needed = [a for a in arguments if a.required and not a.opt.positional]
    words = [a.invocation for a in arguments if a.opt.positional] + [a.invocation for a in needed]
    lines = [f"usage: {' '.join([prog, *words])} [options]", ""]
    if kind.__doc__ and not kind.__doc__.startswith(f"{kind.__name__}("):
        width = _width()
        for paragraph in inspect.cleandoc(kind.__doc__).split("\n\n"):
            lines += [*textwrap.wrap(paragraph, width), ""]
    groups = {
        "": [a for a in arguments if a.opt.positional],
        "usual options": [a for a in arguments if not (a.opt.positional or a.opt.expert)],
        "expert options": [a for a in arguments if a.opt.expert],
    }
    for title, members in groups.items():
        lines += [f"{title}:"] * bool(title and members)
        for each in members:
            lines += _rows(each, defaults.get(each.field.name, ""))
        lines += [""] * bool(members)
    return "\n".join(lines)


def _rows(each: Argument, default: str) -> list[str]:
    """An option in help: its name, then what it does, under each other where there is no room."""
    name, text = f"  {each.invocation}", each.help
    value = each.field.default
    if each.kind is bool and value is True:
        name = f"  {each.name}, --no-{each.name[2:]}"
    if each.required:
        text += "" if each.opt.positional else " (required)"
    elif "Default:" in text:
        pass
    elif default:
        text += f" (default: {default})"
    elif each.kind is bool:
        text += " (default: on)" if value else ""
    elif value not in NOTHING:
        values = value if isinstance(value, tuple) else (value,)
        words = (f"{each:g}" if isinstance(each, float) else str(each) for each in values)
        text += f" (default: {' '.join(words)})"
    body = textwrap.wrap(text, _width() - COLUMN, break_on_hyphens=False)
    rest = [" " * COLUMN + line for line in body]
    if body and len(name) + 2 <= COLUMN:
        return [f"{name:{COLUMN}}{body[0]}", *rest[1:]]
    return [name, *rest]


def _width() -> int:
    return min(shutil.get_terminal_size().columns, WIDEST)
