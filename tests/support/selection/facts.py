"""What a file says of others: its imports, the names in its texts, the fixtures it asks for."""

import ast
import json
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeGuard

FORM = 1  # of the facts that are kept
NAMING = re.compile(r"[\w.][\w./:-]{0,99}")  # a text that may name a file or a module
INCLUDES = re.compile(r'^\s*#include\s+"([^"]+)"', re.M)
SCRIPTS = re.compile(r'(?:from|import|src=)\s*\(?\s*"(\.{0,2}/?[\w./-]+\.m?js)"')
READ_BY = {
    **dict.fromkeys((".cl", ".glsl", ".comp", ".vert", ".frag"), INCLUDES),
    **dict.fromkeys((".js", ".mjs", ".html"), SCRIPTS),
}
PACKAGE = "shapeshift"
LEAVES = {
    ast.Name,
    ast.Load,
    ast.Store,
    ast.Del,
    ast.Pass,
}  # most nodes, and they say nothing


class Facts(dict[str, Any]):
    """imports, names, offers, uses, fixtures, lazy: lists of texts, kept as JSON has them."""


def facts_of(root: Path, path: str, kept: dict) -> Facts:
    """Of a file of the checkout; of `kept` (path -> [time, bytes, facts]) where it is the same."""
    try:
        stat = (root / path).stat()
    except OSError:  # it was deleted: others may still name it
        return Facts()
    known = kept.get(path)
    if known and known[:2] == [stat.st_mtime_ns, stat.st_size]:
        return Facts(known[2])
    found = read_facts(path, (root / path).read_text("utf-8", "replace"))
    kept[path] = [stat.st_mtime_ns, stat.st_size, found]
    return found


def read_facts(path: str, text: str) -> Facts:
    """Of the text of a file; {} of one that names no others, or is no Python yet."""
    suffix = Path(path).suffix
    if suffix in READ_BY:
        return Facts(names=READ_BY[suffix].findall(text))
    if suffix != ".py":
        return Facts()
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return Facts()
    is_conftest = Path(path).name == "conftest.py"
    fixtures = {node.name: node for node in tree.body if is_fixture(node) and is_conftest}
    others = [node for node in tree.body if getattr(node, "name", "") not in fixtures]
    found = said_in(others)
    found["fixtures"] = {
        name: {**said_in([node]), "autouse": "autouse=True" in ast.unparse(node.decorator_list[0])}
        for name, node in fixtures.items()
    }
    found["lazy"] = lazy_names(tree) if path == f"{PACKAGE}/__init__.py" else {}
    return found


def is_text(node: ast.AST) -> TypeGuard[ast.Constant]:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def is_fixture(node: ast.AST) -> TypeGuard[ast.FunctionDef]:
    return isinstance(node, ast.FunctionDef) and any(
        "fixture" in ast.unparse(each) for each in node.decorator_list
    )


def said_in(body: list) -> Facts:
    """Of statements, functions within them included."""
    found: dict[str, set[str]] = {key: set() for key in ("imports", "names", "offers", "uses")}
    aliases, attributes = set(), set()
    for node in walk(body):
        if isinstance(node, ast.Import):
            found["imports"] |= {alias.name for alias in node.names}
            aliases |= {a.asname or a.name for a in node.names if a.name == PACKAGE}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            if node.module == PACKAGE:
                found["offers"] |= {alias.name for alias in node.names}
            found["imports"] |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            if NAMING.fullmatch(node.value):
                found["names"].add(node.value)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            attributes.add((node.value.id, node.attr))
        elif isinstance(node, ast.FunctionDef):
            found["uses"] |= {a.arg for a in (*node.args.args, *node.args.kwonlyargs)}
        elif isinstance(node, ast.Call):
            asked = getattr(node.func, "attr", "") in ("getfixturevalue", "usefixtures")
            found["uses"] |= {str(a.value) for a in node.args if asked and is_text(a)}
        elif isinstance(node, ast.List | ast.Tuple):
            found["imports"] |= set(started_modules(node))
    found["offers"] |= {name for alias, name in attributes if alias in aliases}
    return Facts({key: sorted(values) for key, values in found.items()})


def walk(body: list) -> Iterator[ast.AST]:
    """All nodes; without docstrings, and without what is imported for types."""
    waiting = list(body)
    while waiting:
        node = waiting.pop()
        kind = type(node)
        if kind in LEAVES:
            continue
        if kind is ast.If and "TYPE_CHECKING" in ast.dump(node.test):
            waiting += node.orelse
            continue
        if kind is ast.Expr and type(node.value) is ast.Constant:
            continue
        yield node
        for name in node._fields:
            value = getattr(node, name)
            if type(value) is list:
                waiting += [each for each in value if isinstance(each, ast.AST)]
            elif isinstance(value, ast.AST):
                waiting.append(value)


def started_modules(node: ast.List | ast.Tuple) -> Iterator[str]:
    """Of a command line, [..., "-m", NAME, ...]: the module that runs."""
    texts = [each.value if isinstance(each, ast.Constant) else None for each in node.elts]
    for flag, name in pairwise(texts):
        if flag == "-m" and isinstance(name, str):
            yield f"{name}.__main__"


def lazy_names(tree: ast.Module) -> dict[str, str]:
    """name -> module of a table {module: (names, ...)}, whose modules load when they are asked."""
    out = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict):
            try:
                table = ast.literal_eval(node.value)
            except ValueError:
                continue
            out |= {
                name: f"{PACKAGE}.{module}" for module, names in table.items() for name in names
            }
    return out


def load_kept(file: Path) -> dict:
    """What an earlier run has read; {} where there is none."""
    try:
        data = json.loads(file.read_bytes())
        return data["files"] if data["form"] == FORM else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def save_kept(file: Path, kept: dict) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps({"form": FORM, "files": kept}))
