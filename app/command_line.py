"""Dataclasses as command lines: a field is an option, its docstring the help, its default too.

    @dataclass(frozen=True)
    class Options:
        scene: Annotated[Path, POSITIONAL]
        \"\"\"What to draw.\"\"\"
        fade: Annotated[float, EXPERT] = 0.0
        \"\"\"Part of each limit over which splats fade.\"\"\"

`parse` makes one of the words that were typed; app/cli.py says what may be typed.  Types
are str, int, float, bool, Path and Literal, each also in `| None` and in tuples.
"""

import ast
import contextlib
import difflib
import inspect
import json
import re
import shlex
import textwrap
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields, replace
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn, TypeVar

from shapeshift.app.errors import UsageError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Options = TypeVar("Options", bound="DataclassInstance")
LIKE = 0.7  # of difflib's ratio, of words without dashes: as alike a word is taken for a slip
#           of the hand; one changed or two swapped letters of four have 0.75
AS_JSON = "--json"  # one rule in all commands: a switch, its JSON stands alone on standard output
SWITCHED = {"True": True, "False": False}  # a switch may be followed by either
NUMBER = re.compile(r"-[\d.]")  # how a value begins that is no option


@dataclass(frozen=True)
class Opt:
    """What an annotation says about an option in addition to its type."""

    positional: bool = False
    expert: bool = False  # in help's second group
    metavar: str = ""  # how help calls its value; "": by the type


@dataclass(frozen=True, eq=False)
class FieldsOf:
    """An annotation: the options of this field, a dict, are fields of another dataclass.

    `parse` puts those that were given into the dict, by name; help shows that dataclass's defaults.
    """

    of: type
    usual: tuple[str, ...] = ()  # fields, in the order of help
    expert: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()  # of the file of --settings: app/training/train_options.py
    # Options that left the program, without their dashes -> what does their work now, in words.
    left: Mapping[str, str] | None = None


Debug = Literal[
    "", "culls", "birdseye", "overdraw", "depth", "object", "ellipses", "points", "rings"
]
POSITIONAL, EXPERT = Opt(positional=True), Opt(expert=True)
SIZE, CONTROL, REGIONS, MODALITY = (Opt(metavar=m) for m in ("SIZE", "X", "REGION", "MODALITY"))
SECTIONS = Opt(metavar="SECTION")


@dataclass(frozen=True)
class Argument:
    """One field of a dataclass as a word or an option of a command line."""

    field: Field
    opt: Opt
    kind: Any  # the type of one value: str, int, float, bool, Path or a Literal
    count: int | None  # values: 1, or of a tuple so many, None: any number
    is_tuple: bool
    help: str
    into: str = ""  # the dict among the dataclass's fields that takes the value: see FieldsOf

    @property
    def name(self) -> str:
        """As it is typed, and as errors and help call it: from_, which Python lets no field be
        called without a dash, is --from.
        """
        name = self.field.name.rstrip("_")
        return self.metavar if self.opt.positional else f"--{name.replace('_', '-')}"

    @property
    def metavar(self) -> str:
        if self.opt.metavar or self.opt.positional:
            return self.opt.metavar or self.field.name.upper().removesuffix("S" * self.many)
        if typing.get_origin(self.kind) is Literal:
            return "{" + ",".join(self.choices) + "}"
        return {int: "N", float: "NUMBER", Path: "PATH"}.get(self.kind, "TEXT")

    @property
    def choices(self) -> tuple[str, ...]:
        """The words of a Literal that somebody would type; "" stands for none of them."""
        return tuple(word for word in typing.get_args(self.kind) if word)

    @property
    def many(self) -> bool:
        return self.count is None

    @property
    def required(self) -> bool:
        return self.field.default is MISSING

    @property
    def invocation(self) -> str:
        """The option with what follows it."""
        if self.kind is bool:
            return self.name
        if self.opt.positional:
            word = f"{self.name} ..." if self.many else self.name
            return word if self.required else f"[{word}]"
        word = self.metavar
        values = f"{word} [{word} ...]" if self.count is None else " ".join([word] * self.count)
        return f"{self.name} {values}"


def parse(kind: type[Options], words: Sequence[str], prog: str) -> Options:
    """The dataclass that the words stand for.  Raises UsageError, one sentence.

    Argparse would need as many lines around it: its complaints are of its own form, it takes
    values with a dash for options, and words after options of many values for nothing.
    """
    arguments = arguments_of(kind)
    known = {name: each for each in arguments for name in _spellings(each)}
    values, loose = _values_of(words, known, partial(_refuse_unknown, kind, prog), prog)
    alone = [each for each in arguments if each.opt.positional]
    places = float("inf") if any(each.many for each in alone) else len(alone)
    for word, after in pairwise(words):
        if word == AS_JSON in known and after in loose and len(loose) > places:
            _refuse_json_file(after, prog)
    values |= _place(alone, loose, prog)
    missing = [a for a in arguments if a.required and a.field.name not in values]
    _refuse_missing(missing, values, shlex.join([*prog.split(), *loose]))
    for each in arguments:
        if each.into and each.field.name in values:
            values.setdefault(each.into, {})[each.field.name] = values.pop(each.field.name)
    return kind(**values)


def wants_help(words: Sequence[str]) -> bool:
    """Whether --help is among the words."""
    options = list(words[: words.index("--")] if "--" in words else words)
    return "-h" in options or "--help" in options


@cache
def arguments_of(kind: type) -> tuple[Argument, ...]:
    """Those of a dataclass: its own fields in order, then those that it shares with others."""
    hints, texts = typing.get_type_hints(kind, include_extras=True), _docs_of(kind)
    inherited = {
        name for base in kind.__mro__[1:] for name in vars(base).get("__annotations__", {})
    }
    rows = sorted(fields(kind), key=lambda f: (f.default is not MISSING, f.name in inherited))
    made = []
    for field in rows:
        hint, opt = hints[field.name], Opt()
        if typing.get_origin(hint) is Annotated:
            hint, *notes = typing.get_args(hint)
            if isinstance(notes[0], FieldsOf):
                made += _arguments_in(notes[0], field.name)
                continue
            opt = next((note for note in notes if isinstance(note, Opt)), opt)
        made.append(Argument(field, opt, *_value_of(hint), texts.get(field.name, "")))
    return tuple(made)


def _arguments_in(settings: FieldsOf, into: str) -> list[Argument]:
    """Those of the fields of another dataclass."""
    known = {each.field.name: each for each in arguments_of(settings.of)}
    usual = [replace(known[name], into=into) for name in settings.usual]
    expert = [replace(known[name], into=into, opt=EXPERT) for name in settings.expert]
    return usual + expert


def nearest(word: str, known: Sequence[str]) -> str:
    """The known word that somebody meant who typed this one; "" where none is like it."""
    folded = {name.casefold().lstrip("-"): name for name in known}  # dashes make all alike
    word = word.casefold().lstrip("-")
    found = difflib.get_close_matches(word, folded, 1, LIKE)
    found += [name for name in folded if len(word) > 2 and name.startswith(word)]
    return folded[found[0]] if found else ""


def _notes_of(kind: type) -> dict[str, FieldsOf]:
    """The dicts among a command's options that take fields of another dataclass."""
    return {
        name: note
        for name, hint in typing.get_type_hints(kind, include_extras=True).items()
        if typing.get_origin(hint) is Annotated
        for note in typing.get_args(hint)[1:]
        if isinstance(note, FieldsOf)
    }


def left_options_of(kind: type) -> dict[str, str]:
    """Options that a command had once -> what does their work now, in words."""
    left = (note.left or {} for note in _notes_of(kind).values())
    return {name: now for each in left for name, now in each.items()}


def line_of(each: Argument, words: Sequence[str]) -> str:
    """How a setting with this value, or its usual one, stands in the file of --settings."""
    value = each.field.default
    if words and not _is_option(words[0]):
        with contextlib.suppress(ValueError):
            value = each.kind(words[0])
    text = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
    return f"{each.field.name} = {text}"


def dicts_of(kind: type) -> dict[str, type]:
    """Each dict among a command's options -> the dataclass whose fields it takes."""
    return {name: note.of for name, note in _notes_of(kind).items()}


def lines_of(kind: type) -> dict[str, Argument]:
    """What the file of --settings may say, by name: options that are settings, then what only it
    has.
    """
    return {a.field.name: a for a in arguments_of(kind) if a.into} | _only_lines_of(kind)


def _only_lines_of(kind: type) -> dict[str, Argument]:
    return {
        each.field.name: each
        for into, note in _notes_of(kind).items()
        for each in _arguments_in(replace(note, usual=note.lines, expert=()), into)
    }


_EXPECTED = {int: "a whole number", float: "a number", Path: "a path"}


def _values_of(
    words: Sequence[str], known: Mapping[str, Argument],
    refuse: Callable[[str, Sequence[str]], NoReturn], prog: str,
) -> tuple[dict[str, Any], list[str]]:  # fmt: skip
    """Values by field of the options among the words, and the words that are none.

    known: by all spellings; refuse: raises for another option, given what follows it.  Raises
    UsageError.
    """
    rest = list(words)
    values: dict[str, Any] = {}
    loose: list[str] = []
    while rest:
        word = rest.pop(0)
        if word == "--":
            return values, loose + rest
        if not _is_option(word):
            loose.append(word)
            continue
        name, sign, value = word.partition("=")
        name = name.replace("_", "-")
        if name not in known:
            refuse(name, [value] if sign else rest)
        each = known[name]
        if each.kind is bool:
            said = value if sign else rest.pop(0) if rest and rest[0] in SWITCHED else "True"
            if said not in SWITCHED:
                if name == AS_JSON:
                    _refuse_json_file(value, prog)
                raise UsageError(f"{name} is a switch and takes no value; leave '={value}' out.")
            values[each.field.name] = (name == each.name) == SWITCHED[said]
            continue
        taken = [value] if sign else _following(each, rest)
        found = _checked(each, taken)
        if each.many:  # given twice it is both
            values[each.field.name] = values.get(each.field.name, ()) + found
        else:
            values[each.field.name] = found if each.is_tuple else found[0]
    return values, loose


def _refuse_json_file(path: str, prog: str) -> NoReturn:
    """Raises UsageError for a file after --json, which some commands once wrote to."""
    file = shlex.quote("FILE.json" if path in ("", "-") else path)
    raise UsageError(
        f"--json is a switch that prints to standard output: `{prog} ... --json > {file}` for "
        f"a file, and no '{path}' after it."
    )


def _following(each: Argument, rest: list[str]) -> list[str]:
    """Takes an option's values off the words that come after it."""
    taken: list[str] = []
    while rest and len(taken) != each.count:
        if _is_option(rest[0]) and not (rest[0] in each.choices and not taken):
            break
        taken.append(rest.pop(0))
    return taken


def _checked(each: Argument, words: Sequence[str]) -> tuple:
    """The values of an option's words.  Raises UsageError."""
    if each.count == 1 and not words:
        raise UsageError(f"{each.name} has no value, expected {expected(each)}.")
    if len(words) != each.count and not (each.many and words):
        raise UsageError(f"{each.name} has {len(words)} values, expected {each.count or 'some'}.")
    return tuple(_read(word, each) for word in words)


def _is_option(word: str) -> bool:
    """Whether a word is an option's name and no value: -1 and -.5,0,0 are values."""
    return word.startswith("-") and word != "-" and not NUMBER.match(word)


def _refuse_unknown(kind: type, prog: str, name: str, rest: Sequence[str]) -> NoReturn:
    """Raises UsageError.  rest: the words after it."""
    bare, left = name.lstrip("-"), left_options_of(kind)
    if (line := _only_lines_of(kind).get(bare.replace("-", "_"))) is not None:
        raise UsageError(
            f"{name} is a line of a settings file: write `{line_of(line, rest)}` into a file such "
            "as train.toml and add --settings train.toml."
        )
    if now := left.get(bare) or left.get(bare.removeprefix("no-")):
        raise UsageError(f"{name} left the program: {now}.")
    known = [spelling for each in arguments_of(kind) for spelling in _spellings(each)]
    meant = nearest(name, known)
    hint = f"did you mean {meant}?" if meant else f"`{prog} --help` lists them."
    raise UsageError(f"there is no option '{name}'; {hint}")


def _place(arguments: Sequence[Argument], words: Sequence[str], prog: str) -> dict[str, Any]:
    """Values of the words that stand alone, in the order of the fields.  Raises UsageError."""
    values, rest = {}, list(words)
    for each in arguments:
        taken, rest = rest[: each.count], rest[each.count :] if each.count else []
        if taken:
            found = _checked(each, taken)
            values[each.field.name] = found if each.is_tuple else found[0]
    if rest:
        names = " and ".join(each.name for each in arguments) or "no word alone"
        raise UsageError(f"'{rest[0]}' is one word too many: `{prog}` takes {names}.")
    return values


def _refuse_missing(missing: Sequence[Argument], values: Mapping[str, Any], command: str) -> None:
    """Raises UsageError that shows how it is written; command: what was written so far."""
    if not missing:
        return
    names, wanted = " and ".join(a.name for a in missing), " ".join(a.invocation for a in missing)
    hint = "--help says more."
    greedy = any(isinstance(value, tuple) and len(value) > 1 for value in values.values())
    if missing[0].opt.positional and greedy:
        hint = "write it first, since options like --x take all words that follow."
    be = "is" if len(missing) == 1 else "are"
    raise UsageError(f"{names} {be} missing: `{command} {wanted}`; {hint}")


def _read(text: str, each: Argument) -> Any:
    """The value of a word.  Raises UsageError."""
    if typing.get_origin(each.kind) is Literal:
        if text in typing.get_args(each.kind):
            return text
        meant = nearest(text, each.choices)
        hint = f"; did you mean {meant}?" if meant else "."
        raise UsageError(f"{each.name} is '{text}', expected {expected(each)}{hint}")
    try:
        return each.kind(text)
    except ValueError:
        raise UsageError(f"{each.name} is '{text}', expected {expected(each)}.") from None


def expected(each: Argument) -> str:
    """What may stand there, for messages."""
    *most, last = each.choices or ("",)
    if each.choices:
        return f"{', '.join(most)} or {last}" if most else last
    return _EXPECTED.get(each.kind, "a text")


def _spellings(each: Argument) -> tuple[str, ...]:
    """The options that set a field; a switch can be set both ways."""
    if each.opt.positional:
        return ()
    return (each.name, f"--no-{each.name[2:]}") if each.kind is bool else (each.name,)


def _value_of(hint: Any) -> tuple[Any, int | None, bool]:
    """The type of one value, how many there are, and whether that is a tuple, of a field's type."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        (hint,) = (part for part in typing.get_args(hint) if part is not type(None))
    if typing.get_origin(hint) is not tuple:
        return hint, 1, False
    parts = typing.get_args(hint)
    return parts[0], None if parts[-1] is Ellipsis else len(parts), True


def _docs_of(kind: type) -> dict[str, str]:
    """The docstrings under the fields of a dataclass and its bases."""
    found: dict[str, str] = {}
    for base in kind.__mro__:
        if "__annotations__" not in vars(base):
            continue
        (node,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        assert isinstance(node, ast.ClassDef)  # the source of a class
        for field, text in zip(node.body, node.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
                said = " ".join(ast.literal_eval(text.value).split())
                found.setdefault(ast.unparse(field.target), said)
    return found
