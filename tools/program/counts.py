"""How large the program is, in pieces and in lines: one row a count, with what is counted.

    python3 tools/program/counts.py [--rows product|single|unreached]

--rows lists what is behind a count instead: the files of the product, those with a single importer
and that importer, or those that no front door reaches.
"""

import argparse
import ast
import re
import sys
from collections.abc import Mapping, Set
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.terminal import print_text  # noqa: E402

DOORS = ("shapeshift", "shapeshift.__main__", "shapeshift.app.cli", "shapeshift.app.first_start")
LAUNCHER = ROOT / "launch.py"  # the first door of a checkout; no module of the package

Graph = Mapping[str, Set[str]]  # module: modules of ours that it imports
Paths = Mapping[str, Path]  # module: its file


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"))


def single_importers(graph: Graph) -> dict[str, str]:
    """module: the one module that imports it, of all those that just one imports."""
    importers: dict[str, list[str]] = {}
    for name, imported in graph.items():
        for other in imported:
            importers.setdefault(other, []).append(name)
    return {name: found[0] for name, found in sorted(importers.items()) if len(found) == 1}


def texts_in(path: Path) -> list[str]:
    """How the texts in a file end that may name a module, f-strings too, but for docstrings."""
    return re.findall(r"""([\w.]+)(?::\w+)?["'](?!["'])""", path.read_text("utf-8"))


def names_of(module: str) -> set[str]:
    """How a text may name a module: a.b.c as a.b.c, b.c or c.py."""
    parts = module.split(".")
    return {".".join(parts[at:]) for at in range(len(parts) - 1)} | {module, f"{parts[-1]}.py"}


def unreached(graph: Graph, paths: Paths) -> list[str]:
    """Modules that no front door leads to, by imports or by name.

    A text names a module as `names_of` says or as one of its own folder; what follows a colon is a
    name in the module.  Texts that mean something else count too, so some may be overlooked.
    """
    called: dict[str, set[str]] = {}
    for name in paths:
        for word in names_of(name):
            called.setdefault(word, set()).add(name)

    def named_in(path: Path, folder: str) -> set[str]:
        words = {text.strip(".") for text in texts_in(path)}
        beside = {f"{folder}.{word}" for word in words} & paths.keys()
        return beside.union(*(called[word] for word in words & called.keys()))

    reached, todo = set[str](), [*DOORS, *named_in(LAUNCHER, "")]
    while todo:
        name = todo.pop()
        if name not in reached and name in paths:
            reached.add(name)
            folder = name.rpartition(".")[0]
            inside = name if paths[name].stem == "__init__" else folder
            todo += [folder, *graph[name], *named_in(paths[name], inside)]
    return sorted(paths.keys() - reached)


def code_lines(path: Path) -> int:
    """Lines with something in them besides comments and docstrings."""
    tree = parsed(path)
    said = {
        line
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    lines = enumerate(path.read_text("utf-8").splitlines(), 1)
    return sum(
        number not in said and bool(line.strip()) and not line.lstrip().startswith("#")
        for number, line in lines
    )


def import_lines(path: Path) -> int:
    """Lines of import statements, also of those inside functions."""
    return sum(
        (node.end_lineno or node.lineno) - node.lineno + 1
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Import | ast.ImportFrom)
    )


def lines_below(folder: Path) -> int:
    return sum(len(path.read_bytes().splitlines()) for path in folder.rglob("*.py"))


def words_below(folder: Path) -> int:
    """Of all pages: what begins with a letter; a path or a name with points and dashes is one."""
    pages = (path.read_text("utf-8") for path in folder.rglob("*.md"))
    return sum(len(re.findall(r"[^\W\d][\w./-]*", page)) for page in pages)


def counts(graph: Graph, paths: Paths) -> list[tuple[str, str, str]]:
    """(what, how much, what is counted) of each."""
    files, single = paths.values(), single_importers(graph)
    code, imports = sum(map(code_lines, files)), sum(map(import_lines, files))
    tests, tools = (lines_below(ROOT / folder) for folder in ("tests", "tools"))
    return [
        ("product files", f"{len(files):,}", ".py files that are installed"),
        ("single importers", f"{len(single):,}", "of these, imported by just one other of them"),
        ("code lines", f"{code:,}", "of these, without comments, docstrings and empty lines"),
        ("import lines", f"{imports:,}", "of these, lines of import statements"),
        ("share of imports", f"{100 * imports / code:.1f} %", "import lines of code lines"),
        ("unreached", f"{len(unreached(graph, paths))}", "of the files, by any front door"),
        (
            "words of docs",
            f"{words_below(ROOT / 'docs'):,}",
            "in docs/ and below, without numbers",
        ),
        ("lines of tests", f"{tests:,}", "of .py files in tests/"),
        ("lines of tools", f"{tools:,}", "of .py files in tools/"),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", choices=("product", "single", "unreached"))
    asked = parser.parse_args().rows
    from tests.program.test_layers import import_graph, modules

    graph, paths = import_graph(), modules()
    if asked == "single":
        found = [f"{name} {importer}" for name, importer in single_importers(graph).items()]
    elif asked is not None:
        found = sorted(paths) if asked == "product" else unreached(graph, paths)
    else:
        found = [f"{what:17}{count:>8}  {said}" for what, count, said in counts(graph, paths)]
    print_text("\n".join(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
