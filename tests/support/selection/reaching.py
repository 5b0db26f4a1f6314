"""Which test files a change reaches: imports followed backwards, from what changed to the tests.

Files are named by their paths in the checkout.  Python says what it imports, anywhere in it but for
types; kernels and shaders include others; scripts import others.  What is no Python is loaded by
its name: the program's files that name it, in their own folder at the top before all others, are
those that load it.  Of a fixture in a conftest.py it counts which tests ask for it.
"""

import subprocess
from collections import defaultdict, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath

from tests.support.selection.facts import PACKAGE, Facts, facts_of, load_kept, save_kept

CONFTEST = "conftest.py"


@dataclass(frozen=True)
class Reached:
    """A test file, and the way to it from what changed."""

    test: str
    way: tuple[str, ...]  # from the test file to the changed one

    @property
    def distance(self) -> int:
        return len(self.way) - 1


class UsedFiles:
    """Of every file of a checkout, which others it uses."""

    def __init__(self, facts: Mapping[str, Facts]) -> None:
        self.facts = facts
        self.modules = {module_of(path): path for path in facts if path.endswith(".py")}
        self.by_name: dict[str, list[str]] = defaultdict(list)
        for path in facts:
            self.by_name[path.rpartition("/")[2]].append(path)
        self.by_tail: dict[str, list[str]] = defaultdict(list)
        for module in self.modules:
            self.by_tail[module.rpartition(".")[2]].append(module)

    def used_by(self, path: str) -> set[str]:
        """Files that a file uses itself; fixtures as CONFTEST::NAME."""
        said = self.facts[path]
        used = self.said(path, said)
        if is_test(path):
            used |= self.fixtures_of(path, said.get("uses", ()))
        return used - {path}

    def said(self, path: str, said: Mapping) -> set[str]:
        used = set()
        for name in said.get("imports", ()):
            used |= self.imported(name)
        lazy = self.facts.get(f"{PACKAGE}/__init__.py", Facts()).get("lazy", {})
        for name in said.get("offers", ()):
            used |= self.imported(lazy[name]) if name in lazy else set()
        if path != f"{PACKAGE}/__init__.py":
            for name in said.get("names", ()):
                used |= self.named(path, name)
        return used

    def imported(self, name: str) -> set[str]:
        """The file of a module, or of the one that has the last name in it, and of its packages."""
        found = set()
        name = name if name in self.modules else name.rpartition(".")[0]
        if name == PACKAGE or name not in self.modules:
            return {self.modules[name]} if name in self.modules else set()
        while name and name != PACKAGE:
            if name in self.modules:
                found.add(self.modules[name])
            name = name.rpartition(".")[0]
        return found

    def named(self, path: str, name: str) -> set[str]:
        """Files that a text in a file names: by a path, or as a module in dots."""
        if name in self.facts:
            return {name}
        if "/" not in name and "." not in name:
            return set()
        here = f"{path.rpartition('/')[0]}/{name}"
        beside = str(PurePosixPath(here)) if "../" not in here else resolved(here)
        if beside in self.facts:
            return {beside}
        found = [p for p in self.by_name.get(name.rpartition("/")[2], ()) if p.endswith(f"/{name}")]
        near = [p for p in found if top_of(p) == top_of(path)]
        if name.endswith(".py") and "/" not in name:
            return set()  # __init__.py, conftest.py: a name and no file
        if near or (found and (path.startswith("tests/") or len(found) == 1)):
            return set(near or found)
        return self.module_named(path, name)

    def module_named(self, path: str, name: str) -> set[str]:
        """The module of that name below the file's own package, else the one whose name ends so;
        `package.module:function` names its module.
        """
        name = name.partition(":")[0].strip(".")
        if "." not in name or "/" in name:
            return set()
        below = f"{module_of(path).rpartition('.')[0]}.{name}"
        if below in self.modules:
            return {self.modules[below]}
        alike = self.by_tail.get(name.rpartition(".")[2], ())
        found = [module for module in alike if f".{module}".endswith(f".{name}")]
        return {self.modules[found[0]]} if len(found) == 1 else set()

    def fixtures_of(self, test: str, asked: Iterable[str]) -> set[str]:
        """The conftest.py above a test file, and those of their fixtures that it asks for."""
        above = [str(folder / CONFTEST) for folder in PurePosixPath(test).parents]
        above = [path for path in above if path in self.facts]
        used, wanted, seen = set(above), set(asked), set()
        for path in above:
            fixtures = self.facts[path].get("fixtures", {})
            wanted |= {name for name, said in fixtures.items() if said["autouse"]}
        while names := wanted - seen:
            seen |= names
            for name in names:
                for path in above:
                    said = self.facts[path].get("fixtures", {}).get(name)
                    if said is not None:
                        used.add(f"{path}::{name}")
                        wanted |= set(said["uses"])
        return used

    def of_fixture(self, node: str) -> set[str]:
        conftest, _, name = node.partition("::")
        return self.said(conftest, self.facts[conftest]["fixtures"][name])

    def loaders_of(self, path: str) -> set[str]:
        """Of a file that nobody names as a whole, those that load it by a part of its name: files
        of its folder at the top, or that name the folder in which that part begins.  Without any,
        those that name one of its folders: they take what is in it.
        """
        parts = PurePosixPath(path).with_suffix("").parts
        tails = {"/".join(parts[i:]): parts[i - 1] for i in range(1, len(parts))}
        found, takers = set(), set()
        for other, said in self.facts.items():
            names = set(said.get("names", ()))
            if top_of(other) != parts[0] and names & set(parts[:-1]):
                takers.add(other)
            for tail, folder in tails.items():
                if tail in names and (top_of(other) == parts[0] or folder in names):
                    found.add(other)
        return (found or takers) - {path}

    @cached_property
    def uses(self) -> dict[str, set[str]]:
        """file or fixture -> those that it uses itself."""
        out = {path: self.used_by(path) for path in self.facts}
        fixtures = {node for used in out.values() for node in used if "::" in node}
        return out | {node: self.of_fixture(node) for node in fixtures}

    def users(self) -> dict[str, set[str]]:
        """file -> those that use it."""
        out: dict[str, set[str]] = defaultdict(set)
        for path, used in self.uses.items():
            for each in used:
                out[each].add(path)
        return out

    def reach(self, path: str) -> int:
        """How many files one uses, through others too."""
        seen, waiting = {path}, [path]
        while waiting:
            new = self.uses.get(waiting.pop(), set()) - seen
            seen |= new
            waiting += new
        return len(seen)


def reached_tests(used: UsedFiles, changed: Iterable[str]) -> list[Reached]:
    """Every test file from which a way of imports leads to what changed, nearest first.

    Of equally near ones those come first that are called like what changed, then those that reach
    least: they tell most of it, and are quick.
    """
    users, wanted = used.users(), [path for path in changed if path in used.facts]
    for path in wanted:
        if not users[path] and not is_test(path):
            users[path] |= used.loaders_of(path)
        if path.rpartition("/")[2] == CONFTEST:
            folder = path.removesuffix(CONFTEST)
            users[path] |= {p for p in used.facts if is_test(p) and p.startswith(folder)}
    ways: dict[str, tuple[str, ...]] = {}
    waiting: deque[tuple[str, ...]] = deque((path,) for path in wanted)
    while waiting:
        way = waiting.popleft()
        if way[0] in ways:
            continue
        ways[way[0]] = way
        for user in sorted(users.get(way[0], ())):
            if "::" in user:  # a fixture is as near as what it uses
                waiting.appendleft((user, *way))
            else:
                waiting.append((user, *way))
    stems = {PurePosixPath(path).stem for path in wanted}
    found = [Reached(path, named_files(way)) for path, way in ways.items() if is_test(path)]

    def order(each: Reached) -> tuple:
        stem = PurePosixPath(each.test).stem
        alike = any(name in stem for name in stems)
        return each.distance, not alike, used.reach(each.test), each.test

    return sorted(found, key=order)


def named_files(way: tuple[str, ...]) -> tuple[str, ...]:
    """A way without the fixtures on it: what they use counts as used by who asks for them."""
    return tuple(node for node in way if "::" not in node)


def module_of(path: str) -> str:
    """The name under which a Python file is imported."""
    parts = path.removesuffix(".py").split("/")
    parts = parts[:-1] if parts[-1] == "__init__" else parts
    own = parts[:1] in (["tests"], ["tools"], [PACKAGE])
    return ".".join(parts if own else [PACKAGE, *parts])


def is_test(path: str) -> bool:
    name = path.rpartition("/")[2]
    return path.startswith("tests/") and name.startswith("test_") and name.endswith(".py")


def top_of(path: str) -> str:
    return path.partition("/")[0]


def resolved(path: str) -> str:
    """Without `..`."""
    parts: list[str] = []
    for part in path.split("/"):
        if part == "..":
            parts = parts[:-1]
        elif part != ".":
            parts.append(part)
    return "/".join(parts)


def checkout_files(root: Path, also: Iterable[str] = ()) -> list[str]:
    """What git has or would add; `also`: paths that are gone."""
    return sorted({*git(root, "ls-files", "-co", "--exclude-standard"), *also})


def changed_files(root: Path, revision: str = "HEAD") -> list[str]:
    """What differs from a revision, and what git does not know yet.  ValueError, one sentence."""
    found = git(root, "diff", "--name-only", "--no-renames", revision, "--")
    return sorted({*found, *git(root, "ls-files", "-o", "--exclude-standard")})


def git(root: Path, *words: str) -> list[str]:
    """The paths that a command prints.  Raises ValueError, one sentence, where it fails."""
    command = ["git", "-C", str(root), "-c", "core.quotePath=false", *words]
    try:
        done = subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace")
    except OSError as why:
        raise ValueError(f"git does not start ({why}); what changed is not known.") from None
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["no reason"])[0]
        raise ValueError(f"git says: {said}")
    return [line for line in done.stdout.splitlines() if line]


def used_files(root: Path, also: Iterable[str] = (), kept_in: Path | None = None) -> UsedFiles:
    """Of a checkout; what is read stays in a file for the next time."""
    kept = load_kept(kept_in) if kept_in else {}
    before = {path: row[:2] for path, row in kept.items()}
    paths = checkout_files(root, also)
    facts = {path: facts_of(root, path, kept) for path in paths}
    if kept_in and {path: row[:2] for path, row in kept.items()} != before:
        save_kept(kept_in, {path: kept[path] for path in paths if path in kept})
    return UsedFiles(facts)
