"""Makes the locks beside the requirements, and the table of what the package index has for whom.

    python3 tools/packaging/lock.py             # dependencies keep their versions where these fit
    python3 tools/packaging/lock.py --newest    # dependencies become the newest that fit

requirements.lock, requirements-test.lock and requirements-opencl.lock have every package with all
that it needs, for each Python and kind of machine that all of them have wheels for, and the hashes
of all files of each version; docs/bench/pins.csv says for each pin, Python and kind of machine
whether the index has a wheel, the source alone, or nothing.
"""

import re
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from package_index import ALL, PLACES, PYTHONS, Environment, needs, versions, wheel_for
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "docs" / "bench" / "pins.csv"
OPENCL = ROOT / "requirements-opencl.txt"
MOST_ROUNDS = 20  # until no version changes another
AT_ONCE = 8  # questions to the index

Versions = dict[str, dict[Environment, Version]]  # of each package, where it is needed


def read_requirements(path: Path) -> list[Requirement]:
    lines = (line.partition("#")[0].strip() for line in path.read_text().splitlines())
    return [Requirement(line) for line in lines if line]


def locked_before(paths: Iterable[Path]) -> dict[str, list[Version]]:
    found: dict[str, list[Version]] = {}
    for path in paths:
        if path.exists():
            for name, version in re.findall(r"^([\w.-]+)==(\S+)", path.read_text(), re.M):
                found.setdefault(name, []).append(Version(version))
    return found


def applies(requirement: Requirement, environment: Environment, extras: frozenset[str]) -> bool:
    if requirement.marker is None:
        return True
    asked = (environment.markers | {"extra": extra} for extra in extras or {""})
    return any(requirement.marker.evaluate(values) for values in asked)


class Resolution:
    """Versions of all that some requirements need, one for all environments where that can be."""

    def __init__(self, roots: list[Requirement], kept: dict[str, list[Version]]) -> None:
        self.roots, self._kept = roots, kept
        self.chosen: Versions = {}
        with ThreadPoolExecutor(AT_ONCE) as threads:
            list(threads.map(versions, {canonicalize_name(root.name) for root in roots}))
        self.targets = tuple(e for e in ALL if all(self._has_wheel(root, e) for root in roots))

    def _has_wheel(self, root: Requirement, environment: Environment) -> bool:
        if not applies(root, environment, frozenset()):
            return True
        fitting = root.specifier.filter(versions(canonicalize_name(root.name)))
        return any(wheel_for(root.name, version, environment) for version in fitting)

    def resolve(self) -> None:
        """Chooses, reads what the chosen need, and chooses anew until nothing changes; places for
        which something has no wheel are no targets any more.
        """
        for _ in range(MOST_ROUNDS):
            asked: dict[str, dict[Environment, SpecifierSet]] = {}
            for environment in self.targets:
                for name, specifier in self._asked(environment).items():
                    asked.setdefault(name, {})[environment] = specifier
            new = {name: self._choose(name, by) for name, by in asked.items()}
            lacking = {e for by in new.values() for e, version in by.items() if version is None}
            self.targets = tuple(e for e in self.targets if e not in lacking)
            known = {n: {e: v for e, v in by.items() if v is not None} for n, by in new.items()}
            if known == self.chosen and not lacking:
                return
            self.chosen = known
            with ThreadPoolExecutor(AT_ONCE) as threads:
                list(threads.map(needs, set(self._wheels())))
        raise SystemExit("the versions do not settle")

    def _wheels(self) -> Iterator:
        for name, by in self.chosen.items():
            for environment, version in by.items():
                if (wheel := wheel_for(name, version, environment)) is not None:
                    yield wheel

    def _asked(self, environment: Environment) -> dict[str, SpecifierSet]:
        """What the requirements need there, as far as versions are chosen."""
        asked: dict[str, SpecifierSet] = {}
        seen: set[tuple[str, frozenset[str]]] = set()
        todo = [(r, frozenset[str]()) for r in self.roots]
        while todo:
            requirement, extras = todo.pop()
            if not applies(requirement, environment, extras):
                continue
            name = canonicalize_name(requirement.name)
            asked[name] = asked.get(name, SpecifierSet()) & requirement.specifier
            key = (name, frozenset(requirement.extras))
            version = self.chosen.get(name, {}).get(environment)
            if key in seen or version is None:
                continue
            seen.add(key)
            wheel = wheel_for(name, version, environment)
            if wheel is not None:
                todo += [(each, key[1]) for each in needs(wheel)]
        return asked

    def _choose(
        self, name: str, asked: dict[Environment, SpecifierSet]
    ) -> dict[Environment, Version | None]:
        files = versions(name)
        newest = sorted((v for v in files if not v.is_prerelease), reverse=True)
        order = [*(v for v in self._kept.get(name, []) if v in files), *newest]
        for version in order:
            if all(
                specifier.contains(version) and wheel_for(name, version, environment)
                for environment, specifier in asked.items()
            ):
                return dict.fromkeys(asked, version)
        return {
            environment: next(
                (v for v in order if s.contains(v) and wheel_for(name, v, environment)), None
            )
            for environment, s in asked.items()
        }


@dataclass(frozen=True)
class Locked:
    """A line of a lock: one version of a package, where it is needed."""

    name: str
    version: Version
    environments: frozenset[Environment]

    def text(self, targets: tuple[Environment, ...]) -> str:
        wheels = {wheel_for(self.name, self.version, e) for e in self.environments}
        lines = {str(r) for w in wheels for r in needs(w) if "extra" not in str(r.marker)}
        marker = marker_of(self.environments, targets)
        head = f"{self.name}=={self.version}" + (f" ; {marker}" if marker else "")
        hashes = sorted({file.sha256 for file in versions(self.name)[self.version]})
        told = [f"# needs {line}" for line in sorted(lines)]
        return "\n".join([*told, " \\\n    ".join([head, *(f"--hash=sha256:{h}" for h in hashes)])])


def marker_of(needed: frozenset[Environment], targets: tuple[Environment, ...]) -> str:
    """The shortest that tells these from the other targets."""
    minors = sorted({e.minor for e in targets})
    places = [p for p in PLACES if any(e.place == p for e in targets)]
    by_minors: dict[tuple[int, ...], list] = {}
    for place in places:
        all_of = tuple(m for m in minors if Environment(m, place) in targets)
        here = tuple(m for m in all_of if Environment(m, place) in needed)
        if here:
            by_minors.setdefault(tuple(minors) if here == all_of else here, []).append(place)
    terms = []
    for here, where in by_minors.items():
        parts = [pythons_marker(here, minors), places_marker(where, places)]
        terms.append([part for part in parts if part])
    if not all(terms):
        return ""
    joined = [" and ".join(f"({p})" if " or " in p else p for p in parts) for parts in terms]
    return joined[0] if len(joined) == 1 else " or ".join(f"({each})" for each in joined)


def pythons_marker(here: tuple[int, ...], minors: list[int]) -> str:
    if list(here) == minors:
        return ""
    if list(here) == minors[: len(here)]:
        return f'python_version < "3.{here[-1] + 1}"'
    if list(here) == minors[-len(here) :]:
        return f'python_version >= "3.{here[0]}"'
    return " or ".join(f'python_version == "3.{minor}"' for minor in here)


def places_marker(where: list, places: list) -> str:
    if where == places:
        return ""
    terms = []
    for place in where:
        same_system = [p for p in places if p.sys_platform == place.sys_platform]
        machine = f' and platform_machine == "{place.machine}"' if len(same_system) > 1 else ""
        terms.append(f'sys_platform == "{place.sys_platform}"{machine}')
    return " or ".join(f"({t})" if " and " in t and len(terms) > 1 else t for t in terms)


def fits(resolved: Resolution) -> list[str]:
    """A line for each kind of machine that has Pythons for all packages, with its oldest system."""
    lines = []
    for place in PLACES:
        here = [e for e in resolved.targets if e.place == place]
        oldest: tuple[int, ...] = ()
        for name, by in resolved.chosen.items():
            for environment in here:
                wheel = wheel_for(name, by[environment], environment) if environment in by else None
                if wheel is not None:
                    oldest = max(oldest, wheel.oldest_system(environment) or ())
        if here:
            system = f" {'.'.join(map(str, oldest))}" if oldest else ""
            lines.append(f"# fits {place.name}{system}: {' '.join(f'3.{e.minor}' for e in here)}")
    return lines


def locked(resolved: Resolution, besides: Versions) -> list[Locked]:
    """All lines, without what another lock has already."""
    lines = []
    for name, by in sorted(resolved.chosen.items()):
        left = {e: v for e, v in by.items() if e not in besides.get(name, {})}
        for version in sorted(set(left.values())):
            where = frozenset(e for e, v in left.items() if v == version)
            lines.append(Locked(name, version, where))
    return lines


def write_lock(source: Path, resolved: Resolution, besides: Versions) -> None:
    head = [
        f"# Made by tools/packaging/lock.py from {source.name}: all that it needs, with the hashes",
        "# of all files of each version.  Which Pythons it fits on which machine, and from which",
        "# version of glibc or macOS on:",
        *fits(resolved),
        "--only-binary :all:",
    ]
    lines = [line.text(resolved.targets) for line in locked(resolved, besides)]
    source.with_suffix(".lock").write_text("\n\n".join(["\n".join(head), *lines]) + "\n")


def state_of(requirement: Requirement, environment: Environment) -> str:
    if not applies(requirement, environment, frozenset()):
        return "-"
    fitting = list(requirement.specifier.filter(versions(canonicalize_name(requirement.name))))
    if any(wheel_for(requirement.name, version, environment) for version in fitting):
        return "wheel"
    files = [f for v in fitting for f in versions(canonicalize_name(requirement.name))[v]]
    python = f"3.{environment.minor}.0"
    source = any(not f.tags and f.requires_python.contains(python) for f in files)
    return "source only" if source else "none"


def write_table(requirements: list[Requirement]) -> None:
    """What the index has of each pin; "-": not asked for there."""
    places = ",".join(place.name for place in PLACES)
    lines = ["# python3 tools/packaging/lock.py", f"package,pin,python,{places}"]
    for requirement in requirements:
        for minor in PYTHONS:
            states = [state_of(requirement, Environment(minor, place)) for place in PLACES]
            head = [requirement.name, str(requirement.specifier).removeprefix("==")]
            lines.append(",".join([*head, f"3.{minor}", *states]))
    TABLE.write_text("\n".join(lines) + "\n")


def main(arguments: list[str]) -> int:
    sources = [ROOT / f"requirements{of}.txt" for of in ("", "-test", "-opencl")]
    program, tests, opencl = (read_requirements(source) for source in sources)
    kept = {} if "--newest" in arguments else locked_before(s.with_suffix(".lock") for s in sources)
    default = Resolution(program, kept)
    default.resolve()
    write_lock(sources[0], default, {})
    pinned = {name: sorted(set(by.values())) for name, by in default.chosen.items()}
    for source, roots, besides in ((sources[1], [*program, *tests], default.chosen),
                                   (sources[2], opencl, {})):  # fmt: skip
        more = Resolution(roots, kept | pinned)
        more.resolve()
        write_lock(source, more, besides)
    write_table([*program, *tests, *opencl])
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
