"""Hashes of what a task is made of: files, folders, and the code that does it."""

import hashlib
import json
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from shapeshift.app.program import ROOT, version

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
