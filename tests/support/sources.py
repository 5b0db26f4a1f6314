"""Source files as trees, read once for all tests of a process that look through them."""

import ast
import gc
from functools import cache
from pathlib import Path


@cache
def parsed(path: Path) -> ast.Module:
    """Its tree stays: the collector, which finds nothing to free in it, would take twice as long
    as the parser to look through it and all that came before."""
    collects = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(path.read_text("utf-8"))
    finally:
        if collects:
            gc.enable()


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All of a file."""
    return tuple(ast.walk(parsed(path)))
