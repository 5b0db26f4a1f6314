"""The locks hold all that the default install and the tests need, wherever they say that they fit.

From what the locks themselves record of each package's needs; the network is not asked.
"""

import csv
import importlib.metadata
import re
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("requirements", "requirements-test", "requirements-opencl")
# What markers compare with, of each kind of machine.
PLACES = {
    "linux-x86_64": ("posix", "linux", "Linux", "x86_64"),
    "linux-aarch64": ("posix", "linux", "Linux", "aarch64"),
    "win-amd64": ("nt", "win32", "Windows", "AMD64"),
    "win-arm64": ("nt", "win32", "Windows", "ARM64"),
    "macos-arm64": ("posix", "darwin", "Darwin", "arm64"),
    "macos-x86_64": ("posix", "darwin", "Darwin", "x86_64"),
}


@dataclass(frozen=True)
class Line:
    """A package of a lock."""

    pin: Requirement
    needs: tuple[Requirement, ...]
    hashes: tuple[str, ...]


@cache
def lines(name: str) -> tuple[Line, ...]:
    """Of a lock."""
    found, needs = [], []
    text = (ROOT / f"{name}.lock").read_text().replace("\\\n", " ")
    for line in text.splitlines():
        if line.startswith("# needs "):
            needs.append(Requirement(line.removeprefix("# needs ")))
        elif re.match(r"\w", line):
            pin, *hashes = line.split("--hash=sha256:")
            found.append(Line(Requirement(pin), tuple(needs), tuple(h.strip() for h in hashes)))
            needs = []
    assert not needs and found
    return tuple(found)


@cache
def fits(name: str) -> dict[str, list[str]]:
    """Kind of machine -> Pythons."""
    text = (ROOT / f"{name}.lock").read_text()
    found = re.findall(r"^# fits (\S+) ?[\d.]*: (.+)$", text, re.M)
    return {place: pythons.split() for place, pythons in found}


def environments(name: str):
    for place, pythons in fits(name).items():
        os_name, sys_platform, system, machine = PLACES[place]
        for python in pythons:
            yield f"{python} on {place}", {
                "python_version": python, "python_full_version": f"{python}.1",
                "implementation_name": "cpython", "implementation_version": f"{python}.1",
                "platform_python_implementation": "CPython", "os_name": os_name,
                "sys_platform": sys_platform, "platform_system": system,
                "platform_machine": machine, "platform_release": "", "platform_version": "",
                "extra": "",
            }  # fmt: skip


def applies(marker: Marker | None, environment: dict[str, str]) -> bool:
    return marker is None or marker.evaluate(environment)


def pins(name: str) -> list[Requirement]:
    text = (ROOT / f"{name}.txt").read_text()
    return [Requirement(each) for line in text.splitlines() if (each := line.partition("#")[0])]


@pytest.mark.parametrize("names", [NAMES[:1], NAMES[:2], NAMES[2:]])
def test_what_a_package_needs_is_locked_in_a_version_that_it_takes(names):
    """And nothing else: what nobody needs is not installed."""
    count = 0
    for where, environment in environments(names[-1]):
        here: dict[str, Line] = {}
        for line in (each for name in names for each in lines(name)):
            if applies(line.pin.marker, environment):
                key = canonicalize_name(line.pin.name)
                assert key not in here, f"{key} stands twice for {where}"
                here[key] = line
        todo, needed = [pin for name in names for pin in pins(name)], set()
        while todo:
            wanted = todo.pop()
            if not applies(wanted.marker, environment):
                continue
            key = canonicalize_name(wanted.name)
            assert key in here, f"{wanted} is not locked for {where}"
            (version,) = here[key].pin.specifier
            assert wanted.specifier.contains(version.version), f"{key} {version}: {wanted}, {where}"
            if key not in needed:
                needed.add(key)
                todo += here[key].needs
        assert needed == here.keys(), where
        count += 1
    assert count >= 4


@pytest.mark.parametrize("name", NAMES)
def test_every_line_is_one_version_with_the_hashes_of_its_files(name):
    for line in lines(name):
        (specifier,) = line.pin.specifier
        assert specifier.operator == "==" and Version(specifier.version)
        assert line.hashes and all(re.fullmatch("[0-9a-f]{64}", each) for each in line.hashes)
        assert len(set(line.hashes)) == len(line.hashes) and not line.pin.extras
    text = (ROOT / f"{name}.lock").read_text()
    assert "--only-binary :all:" in text, "a package built from source needs others, without hashes"
    assert "://" not in text and "://" not in (ROOT / f"{name}.txt").read_text()


def test_the_locks_say_what_the_installed_packages_say():
    """Against the metadata that pip has put here: the same needs, word by word."""
    compared = 0
    for line in (each for name in NAMES for each in lines(name)):
        try:
            installed = importlib.metadata.distribution(line.pin.name)
        except importlib.metadata.PackageNotFoundError:
            continue  # of another kind of machine, or not needed beside a system's driver
        if not line.pin.specifier.contains(installed.version):
            continue
        theirs = [Requirement(each) for each in installed.requires or []]
        needed = {str(each) for each in theirs if "extra ==" not in str(each.marker)}
        assert {str(each) for each in line.needs} >= needed, line.pin.name
        compared += 1
    assert compared > 40


def test_pythons_are_those_of_the_locks_everywhere():
    """In pyproject and README, without gaps."""
    minors = sorted({int(p.split(".")[1]) for each in fits(NAMES[0]).values() for p in each})
    first, last = minors[0], minors[-1]
    assert minors == list(range(first, last + 1)) and first == 11
    assert fits(NAMES[1]).keys() == fits(NAMES[0]).keys() >= {"linux-x86_64", "win-amd64"}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["requires-python"] == f">=3.{first},<3.{last + 1}"
    told = re.findall(r"Python :: 3\.(\d+)", " ".join(project["classifiers"]))
    assert list(map(int, told)) == minors
    assert f"3.{first} to 3.{last}" in (ROOT / "README.md").read_text()


def test_ranges_of_the_project_take_what_is_locked():
    ranges = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    locked = {canonicalize_name(line.pin.name): line.pin for line in lines(NAMES[0])}
    for each in map(Requirement, ranges):
        (version,) = locked[canonicalize_name(each.name)].specifier
        assert each.specifier.contains(version.version), each


def test_the_table_has_every_pin_and_agrees_with_the_locks():
    text = (ROOT / "docs/bench/pins.csv").read_text().splitlines()
    rows = list(csv.DictReader(text[1:]))
    by_pin = {(row["package"], row["python"]): row for row in rows}
    assert len(by_pin) == len(rows)
    states = {row[place] for row in rows for place in PLACES}
    assert states <= {"wheel", "source only", "none", "-"} and "wheel" in states
    for name in NAMES:
        for pin in pins(name):
            versions = {row["pin"] for row in rows if row["package"] == pin.name}
            assert versions == {str(pin.specifier).removeprefix("==")}, pin
            for place, pythons in fits(name).items():
                for python in pythons:
                    assert by_pin[pin.name, python][place] in ("wheel", "-"), (pin, place, python)
