"""Nobody writes files but by runtime_models/files/whole_file.py."""

import ast
import re
from pathlib import Path

from tests.support.sources import nodes_of

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("app", "decomposition", "rasterizer", "renderer", "runtime_models", "scene", "training",
           "vr")  # fmt: skip

# Files in temporary folders of our own, in .venv, and in a folder that is not in its place yet; a
# journal of the editor, which grows at its end and is set aside where it is damaged.
OWN = {"first_start.py", "whole_file.py", "las_run.py", "coacd_run.py", "point_clouds.py",
       "convex_parts.py", "colmap_run.py", "colmap_child.py", "triangulation.py",
       "triangulate_run.py", "write_package.py", "read_usd.py", "usd_run.py",
       "read_wrapped.py", "write_video.py", "extras.py", "caches.py", "match_run.py",
       "find_change.py", "journal_file.py"}  # fmt: skip
METHODS = {"write_text", "write_bytes", "savez", "savez_compressed", "savetxt", "savefig",
           "tofile", "imwrite", "save", "export", "rename", "os.replace"}  # fmt: skip
NOT_NAMES = {"file", "held", "arrays", "data"}  # what is open already, or lies in memory


def test_every_file_is_written_by_these_functions():
    """Elsewhere, what writes gets an open file (or bytes in memory), never a path."""
    wrong = []
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):
            if path.name not in OWN:
                wrong += [f"{path.relative_to(ROOT)}:{line}" for line in writes(path)]
    assert not wrong, wrong


def writes(path: Path) -> list[int]:
    """The lines that open a file for writing, or hand a name to something that does."""
    found = []
    for node in nodes_of(path):
        if not isinstance(node, ast.Call):
            continue
        words = [a.value for a in node.args if isinstance(a, ast.Constant)]
        opens = any(isinstance(w, str) and re.fullmatch("[wax][bt+]*", w) for w in words)
        name = ast.unparse(node.func)
        if opens and name.rpartition(".")[2] == "open":
            found.append(node.lineno)
        method = name if name == "os.replace" else name.rpartition(".")[2]
        first = ast.unparse(node.args[0]) if node.args else ""
        if "." in name and method in METHODS and node.args and first not in NOT_NAMES:
            found.append(node.lineno)
    return found
