"""Draws the rooms of the program by its imports: docs/architecture.svg, and the table of rooms in
docs/architecture.md.

    python3 tools/program/architecture.py [--check]

Which room imports which, its floor and its shelves are those of now; what a room is for is what
README's tree says.  A number is kept as it stands while it is right within a tenth, so that not
every change of the code is one of the picture.  --check writes nothing.
"""

import argparse
import re
import sys
from collections import Counter
from collections.abc import Mapping, Set
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.terminal import print_text  # noqa: E402
from shapeshift.runtime_models.files.whole_file import write_whole  # noqa: E402
from tools.program.house_picture import picture_of  # noqa: E402

PAGE, PICTURE = ROOT / "docs/architecture.md", ROOT / "docs/architecture.svg"
BEGIN, END = "<!-- rooms: written by tools/program/architecture.py -->\n", "<!-- end -->\n"
HEAD = "| room | floor | what for | files | lines | imports |\n|---|---|---|---|---|---|\n"
BESIDE = ("web", "assets")  # folders of the program without Python
SOURCE = ".py"
EXACT, SLACK = 20, 0.1  # numbers up to EXACT stand as they are; others may be a tenth off

Graph = Mapping[str, Set[str]]  # module: modules of ours that it imports


@dataclass(frozen=True)
class Room:
    """A folder at the top."""

    name: str
    floor: int  # 0: imports no other room
    purpose: str
    shelves: tuple[str, ...]  # its folders
    files: int
    lines: int
    imports: dict[str, int]  # room: how often a file of this one imports a file of that


def room_of(module: str) -> str:
    """shapeshift.scene.pose lies in scene, shapeshift.api.load in shapeshift."""
    second = module.split(".")[1:2]
    return second[0] if second and (ROOT / second[0] / "__init__.py").exists() else "shapeshift"


def rooms_of(graph: Graph, paths: Mapping[str, Path]) -> list[Room]:
    """All of them, from the highest floor to the lowest.  paths: the file of each module."""
    counts: dict[str, Counter[str]] = {}
    for module, imported in graph.items():
        found = counts.setdefault(room_of(module), Counter())
        found.update(room for room in map(room_of, imported) if room != room_of(module))
    files: dict[str, list[Path]] = {name: [] for name in counts}
    for module, path in paths.items():
        files[room_of(module)].append(path)
    said, floors = purposes(), floors_of({name: set(found) for name, found in counts.items()})
    rooms = [
        Room(
            name, floors[name], said[name], shelves_of(name), len(files[name]),
            sum(len(path.read_bytes().splitlines()) for path in files[name]),
            dict(sorted(found.items(), key=lambda each: (-floors[each[0]], each[0]))),
        )
        for name, found in counts.items()
    ]  # fmt: skip
    return sorted(rooms, key=lambda room: (-room.floor, room.name))


def floors_of(imports: Mapping[str, Set[str]]) -> dict[str, int]:
    """Each room stands right above the highest that it imports.  RecursionError in a circle."""
    floors: dict[str, int] = {}

    def floor(name: str) -> int:
        if name not in floors:
            floors[name] = 1 + max(map(floor, imports[name]), default=-1)
        return floors[name]

    return {name: floor(name) for name in imports}


def shelves_of(room: str) -> tuple[str, ...]:
    """The folders right below a room that hold Python."""
    holding = {path.parent for path in (ROOT / room).glob(f"*/*{SOURCE}")}
    return tuple(sorted(folder.name for folder in holding))


def purposes() -> dict[str, str]:
    """What README's tree says of each folder at the top."""
    text = (ROOT / "README.md").read_text("utf-8")
    return dict(re.findall(r"^(\w+)/ +(\S.*)$", text, re.M))


def settled(now: int, before: int | None) -> int:
    """The number that stands there, where it is right within a tenth; else one of two digits."""
    if now <= EXACT:
        return now
    if before is not None and abs(before - now) <= SLACK * now:
        return before
    return round(now, 2 - len(str(now)))


def numbers_in(page: str) -> dict[tuple[str, str], int]:
    """(room, what): the numbers of the table in a page; what: files, lines, or a room imported."""
    found = {}
    for row in table_in(page).splitlines()[2:]:
        cells = [cell.strip().replace(",", "") for cell in row.strip("|").split("|")]
        name = cells[0].strip("`")
        found[name, "files"], found[name, "lines"] = int(cells[3]), int(cells[4])
        for room, count in re.findall(r"`(\w+)` (\d+)", cells[5]):
            found[name, room] = int(count)
    return found


def settled_rooms(rooms: list[Room], page: str) -> list[Room]:
    """The same with the numbers that a page has, as far as they are right."""
    before = numbers_in(page)

    def number(room: Room, what: str, now: int) -> int:
        return settled(now, before.get((room.name, what)))

    return [
        Room(
            room.name, room.floor, room.purpose, room.shelves,
            number(room, "files", room.files), number(room, "lines", room.lines),
            {other: number(room, other, count) for other, count in room.imports.items()},
        )
        for room in rooms
    ]  # fmt: skip


def table_of(rooms: list[Room]) -> str:
    def row(room: Room) -> str:
        imports = ", ".join(f"`{name}` {count:,}" for name, count in room.imports.items())
        cells = (
            f"`{room.name}`", str(room.floor), room.purpose, f"{room.files:,}", f"{room.lines:,}",
            imports or "none",
        )  # fmt: skip
        return f"| {' | '.join(cells)} |\n"

    return HEAD + "".join(map(row, rooms))


def table_in(page: str) -> str:
    return page.split(BEGIN)[1].split(END)[0] if BEGIN in page and END in page else ""


def made(graph: Graph, paths: Mapping[str, Path], page: str) -> tuple[str, str]:
    """The page with its table as it has to be, and the picture."""
    rooms = settled_rooms(rooms_of(graph, paths), page)
    before, rest = page.split(BEGIN)
    said = purposes()
    beside = [(name, said[name]) for name in BESIDE]
    whole = before + BEGIN + table_of(rooms) + END + rest.split(END, 1)[1]
    return whole, picture_of(rooms, beside)


def ways_in(page: str) -> dict[str, list[tuple[str, str]]]:
    """heading: (function, the name that it is called by) of each stay of a page's numbered lists.

    A stay is `1. `module.function`, called as `name`: what it does`; without `called as` its own.
    """
    ways = {}
    for section in page.split("\n## ")[1:]:
        found = re.findall(r"^\d+\. `([\w.]+)`(?:, called as `(\w+)`)?:", section, re.M)
        if found:
            ways[section.split("\n")[0]] = [
                (function, name or function.split(".")[-1]) for function, name in found
            ]
    return ways


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    from tests.program.test_layers import import_graph, modules

    page = PAGE.read_text("utf-8")
    whole, picture = made(import_graph(), modules(), page)
    if options.check:
        same = whole == page and PICTURE.exists() and picture == PICTURE.read_text("utf-8")
        print_text("as they have to be" if same else "other than they have to be")
        return 0 if same else 1
    write_whole(PAGE, whole.encode())
    write_whole(PICTURE, picture.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
