"""A task of a cluster: a command of this program, with the files that it reads and writes.

Only words and names of files travel, never objects.  What is done stands in files beside what was
written, so a second start does nothing twice, whoever did it first.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from shapeshift.app.command_line import Argument, arguments_of, dicts_of
from shapeshift.app.paths import file_name, full
from shapeshift.runtime_models.files.json_fields import saved_object
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.program import ROOT, version

MOST_BYTES = 1 << 16  # of a note
CODE_DIGITS = 24  # of a key's 64
DONE, BEGUN = ".done.json", ".begun.json"  # notes beside the first file that is written


@dataclass(frozen=True)
class Task:
    """`launch.py argv...`, or `python3 argv...` where the first word is a program NAME.py, run once
    anywhere that sees the same files.

    All paths are absolute and stand in `argv` as they do in `reads` and `writes`.
    """

    name: str  # for people, and of its own among those that run together
    argv: tuple[str, ...]  # a command with its options
    reads: tuple[str, ...]  # files and folders
    writes: tuple[str, ...]  # the same; all are there once it is done
    slots: Mapping[str, int] = field(default_factory=dict)  # what it holds, such as {"gpu": 1}
    checkpoint: str = ""  # a file that an attempt leaves that was ended early
    resume: tuple[str, ...] = ()  # words for `argv` that make it go on from that file
    notes: str = ""  # a folder for its notes; "": beside the first file that it writes

    def __post_init__(self) -> None:
        if not (self.name and self.argv and self.writes):
            raise ValueError(f"task '{self.name}': a name, a command and what it writes are wanted")
        for path in (*self.reads, *self.writes, *filter(None, [self.checkpoint, self.notes])):
            if not os.path.isabs(path):
                raise ValueError(f"task {self.name}: '{path}' is not absolute")

    @property
    def done_note(self) -> Path:
        return self._note(DONE)

    @property
    def begun_note(self) -> Path:
        """Locked as long as an attempt lives."""
        return self._note(BEGUN)

    def _note(self, ending: str) -> Path:
        if self.notes:
            return Path(self.notes, file_name(self.name) + ending)
        return Path(self.writes[0] + ending)

    def key(self) -> str:
        """A hash of the command, of what it reads and of the program's code, which is its
        beginning (`is_of_code_here`); where the files lie is not in it."""
        places = {path: f"<read {i}>" for i, path in enumerate(self.reads)}
        places |= {path: f"<write {i}>" for i, path in enumerate(self.writes)}
        words = [places.get(word, word) for word in self.argv]
        inputs = [digest_of(Path(path)) for path in self.reads]
        work = hashlib.sha256(json.dumps([words, inputs]).encode()).hexdigest()
        return own_code()[:CODE_DIGITS] + work[CODE_DIGITS:]

    def is_done(self, key: str) -> bool:
        """Whether this very task, by its key, has left all that it writes."""
        noted = saved_object(self.done_note, MOST_BYTES).get("key") == key
        return noted and all(os.path.exists(path) for path in self.writes)

    def note_done(self, key: str) -> None:
        text = json.dumps({"task": self.name, "key": key}, ensure_ascii=False)
        write_whole(self.done_note, text.encode() + b"\n")

    def words(self, begun: str) -> tuple[str, ...]:
        """The command of the next attempt; begun: the key of the one before, "" of none."""
        goes_on = begun and self.checkpoint and os.path.exists(self.checkpoint)
        return (*self.argv, *self.resume) if goes_on else self.argv


def is_of_code_here(key: str) -> bool:
    """Whether the code that lies on this machine now is that of a task's key."""
    return key.startswith(code_digest()[:CODE_DIGITS])


def forget(tasks: Iterable[Task]) -> None:
    """Takes the notes of tasks away, and their folders of notes where nothing else is in them."""
    for task in tasks:
        task.done_note.unlink(missing_ok=True)
        if task.notes and os.path.isdir(task.notes) and not os.listdir(task.notes):
            os.rmdir(task.notes)


def is_task() -> bool:
    """Whether this process does a task: who reads its words cannot type what comes next."""
    return "SHAPESHIFT_TASK" in os.environ


# Hashes of what a task is made of: files, folders, and the code that does it.

CODE = (".py", ".cl", ".comp", ".vert", ".frag", ".glsl")
_digests: dict[tuple[str, int, int], str] = {}  # by path, bytes and time


@cache
def own_code() -> str:
    """code_digest of when this process first asked: results of other code are not its own."""
    return code_digest()


def code_digest() -> str:
    """A hash of the program's version and of all code in its packages; where it lies is not in it.

    A file is read again where it has changed.
    """
    root = str(ROOT)
    packages = [folder.path for folder in os.scandir(root)
                if os.path.isfile(os.path.join(folder.path, "__init__.py"))]  # fmt: skip
    paths = sorted(path for package in packages for path in code_files(package))
    rows = [[path[len(root) :], digest_of_file(path)] for path in paths]
    return hashlib.sha256(json.dumps([version(), rows]).encode()).hexdigest()


def code_files(folder: str) -> Iterator[str]:
    for entry in os.scandir(folder):
        if entry.name.endswith(CODE):
            yield entry.path
        elif entry.is_dir() and entry.name != "__pycache__":
            yield from code_files(entry.path)


def digest_of(path: Path) -> str:
    """A hash of a file's bytes, or of all files of a folder with their names."""
    if path.is_dir():
        found = sorted(file for file in path.rglob("*") if file.is_file())
        rows = [[file.relative_to(path).as_posix(), digest_of(file)] for file in found]
        return hashlib.sha256(json.dumps(rows).encode()).hexdigest()
    return digest_of_file(str(path))


def digest_of_file(path: str) -> str:
    stat = os.stat(path)
    known = (path, stat.st_size, stat.st_mtime_ns)
    if known not in _digests:
        with open(path, "rb") as file:
            _digests[known] = hashlib.file_digest(file, "sha256").hexdigest()
    return _digests[known]


# Options of a command as the words that stand for them: app/command_line.py the other way.


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
