"""The package index that pip is set to: the files of a version, where they fit, what they need."""

import email.parser
import io
import json
import re
import subprocess
import sys
import urllib.error
import urllib.request
import zipfile
from dataclasses import dataclass
from functools import cache, cached_property

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.tags import Tag
from packaging.utils import (
    InvalidSdistFilename,
    InvalidWheelFilename,
    canonicalize_name,
    parse_sdist_filename,
    parse_wheel_filename,
)
from packaging.version import InvalidVersion, Version

ACCEPTED = "application/vnd.pypi.simple.v1+json"
TAIL = 1 << 16  # bytes of a wheel's end that are read first: its list of files lies there
TRIES = 3
PYTHONS = (11, 12, 13, 14, 15)  # of 3
GLIBC = {"manylinux1": (2, 5), "manylinux2010": (2, 12), "manylinux2014": (2, 17)}


@dataclass(frozen=True)
class Place:
    """A kind of machine; its name is that of shapeshift/which_python.py."""

    name: str
    sys_platform: str
    machine: str  # platform.machine()
    tags: tuple[str, ...]  # patterns of what wheels call it; groups are the oldest system


LINUX = (r"manylinux_(\d+)_(\d+)_", r"(manylinux\d+)_")  # groups as Place has them
PLACES = (
    Place("linux-x86_64", "linux", "x86_64", tuple(f"{tag}x86_64" for tag in LINUX)),
    Place("linux-aarch64", "linux", "aarch64", tuple(f"{tag}aarch64" for tag in LINUX)),
    Place("win-amd64", "win32", "AMD64", ("win_amd64",)),
    Place("win-arm64", "win32", "ARM64", ("win_arm64",)),
    Place("macos-arm64", "darwin", "arm64", (r"macosx_(\d+)_(\d+)_(?:arm64|universal2)",)),
    Place("macos-x86_64", "darwin", "x86_64",
          (r"macosx_(\d+)_(\d+)_(?:x86_64|intel|universal2)",)),
)  # fmt: skip
SYSTEMS = {"linux": ("posix", "Linux"), "win32": ("nt", "Windows"), "darwin": ("posix", "Darwin")}


@dataclass(frozen=True)
class Environment:
    """One Python on one kind of machine."""

    minor: int
    place: Place

    @cached_property
    def markers(self) -> dict[str, str]:
        """What a marker of a requirement is compared with."""
        os_name, system = SYSTEMS[self.place.sys_platform]
        version = f"3.{self.minor}"
        return {
            "python_version": version, "python_full_version": f"{version}.0",
            "implementation_name": "cpython", "implementation_version": f"{version}.0",
            "platform_python_implementation": "CPython", "os_name": os_name,
            "sys_platform": self.place.sys_platform, "platform_system": system,
            "platform_machine": self.place.machine, "platform_release": "",
            "platform_version": "", "extra": "",
        }  # fmt: skip


ALL = tuple(Environment(minor, place) for place in PLACES for minor in PYTHONS)


def oldest_system(tag: Tag, environment: Environment) -> tuple[int, ...] | None:
    """The oldest glibc or macOS that a wheel's tag asks for, () for any; None: does not fit."""
    found = re.fullmatch(r"(cp|py)3(\d*)", tag.interpreter)
    if not found:
        return None
    minor, own = int(found[2] or 0), found[1] == "cp" and tag.abi == f"cp{tag.interpreter[2:]}"
    if own and minor != environment.minor:
        return None
    if not own and (tag.abi not in ("none", "abi3") or minor > environment.minor):
        return None
    if tag.platform == "any":
        return ()
    for pattern in environment.place.tags:
        if match := re.fullmatch(pattern, tag.platform):
            name = match.groups()
            return GLIBC.get(name[0]) if name and name[0] in GLIBC else tuple(map(int, name))
    return None


@dataclass(frozen=True)
class File:
    """One file of a version in the index."""

    name: str
    url: str
    sha256: str
    requires_python: SpecifierSet
    tags: frozenset[Tag]  # empty: source

    def oldest_system(self, environment: Environment) -> tuple[int, ...] | None:
        """As of the tag that fits the oldest; None: the file does not fit."""
        if not self.requires_python.contains(f"3.{environment.minor}.0"):
            return None
        found = [s for t in self.tags if (s := oldest_system(t, environment)) is not None]
        return min(found, default=None)


def index_url() -> str:
    """As pip is set here; else pip's own."""
    from pip._internal.models.index import PyPI

    command = [sys.executable, "-m", "pip", "config", "list"]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    found = re.findall(r"^\S*\.index-url='(.*)'$", listed, re.M)
    return (found[-1] if found else PyPI.simple_url).rstrip("/")


def read_url(url: str, **headers: str) -> bytes:
    for left in reversed(range(TRIES)):
        try:
            request = urllib.request.Request(url, headers=headers)
            with urllib.request.urlopen(request, timeout=60) as answer:
                return answer.read()
        except urllib.error.HTTPError:
            raise
        except OSError:
            if not left:
                raise
    raise AssertionError("unreachable")


@cache
def versions(name: str) -> dict[Version, tuple[File, ...]]:
    """All files of a package that were not taken back, by version."""
    answer = json.loads(read_url(f"{_index()}/{canonicalize_name(name)}/", Accept=ACCEPTED))
    found: dict[Version, list[File]] = {}
    for each in answer["files"]:
        try:
            if each["filename"].endswith(".whl"):
                _, version, _, tags = parse_wheel_filename(each["filename"])
            else:
                _, version = parse_sdist_filename(each["filename"])
                tags = frozenset()
        except (InvalidWheelFilename, InvalidSdistFilename, InvalidVersion):
            continue  # eggs and installers
        if not each.get("yanked"):
            asked = SpecifierSet(each.get("requires-python") or "")
            file = File(each["filename"], each["url"], each["hashes"]["sha256"], asked, tags)
            found.setdefault(version, []).append(file)
    return {version: tuple(files) for version, files in found.items()}


@cache
def _index() -> str:
    return index_url()


def wheel_for(name: str, version: Version, environment: Environment) -> File | None:
    """The one that runs on the oldest system."""
    files = versions(name).get(version, ())
    fitting = [(s, f.name, f) for f in files if (s := f.oldest_system(environment)) is not None]
    return min(fitting)[2] if fitting else None


class _Remote(io.BytesIO):
    """A file of the index of which the end is read first, and of the rest what is asked for."""

    def __init__(self, url: str) -> None:
        request = urllib.request.Request(url, method="HEAD")
        with urllib.request.urlopen(request, timeout=60) as answer:
            self._size = int(answer.headers["Content-Length"])
        self._url, self._at = url, 0
        self._from = max(0, self._size - TAIL)
        self._end = self._bytes(self._from, self._size)

    def _bytes(self, first: int, last: int) -> bytes:
        return read_url(self._url, Range=f"bytes={first}-{last - 1}")

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        return self._at

    def tell(self) -> int:
        return self._at

    def read(self, count: int | None = -1) -> bytes:
        left = self._size - self._at
        first, last = (
            self._at,
            self._at + (left if count is None or count < 0 else min(count, left)),
        )
        self._at = last
        if last <= first:
            return b""
        if first >= self._from:
            return self._end[first - self._from : last - self._from]
        return self._bytes(first, last)


@cache
def needs(wheel: File) -> tuple[Requirement, ...]:
    """What a wheel says that it needs."""
    with zipfile.ZipFile(_Remote(wheel.url)) as opened:
        (name,) = (n for n in opened.namelist() if re.fullmatch(r"[^/]+\.dist-info/METADATA", n))
        text = opened.read(name).decode(errors="replace")
    lines = email.parser.Parser().parsestr(text).get_all("Requires-Dist", [])
    return tuple(Requirement(line) for line in lines)
