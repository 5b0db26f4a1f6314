"""pyproject lists the packages by hand; this keeps the list, the pins and the README true."""

import re
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
NOT_SHIPPED = {"tests", "tools", "docs", "examples", "build", "dist", ".venv", "out"}
SHIPPED_KINDS = ("*.py", "*.glsl", "*.comp", "*.vert", "*.frag", "*.cl", "*.shift", "*.pyi")


def test_every_folder_is_shipped():
    listed = set(PROJECT["tool"]["setuptools"]["packages"])
    folders = {p.parent.relative_to(ROOT).parts for kind in SHIPPED_KINDS for p in ROOT.rglob(kind)}
    needed = {
        ".".join(f if f[0] == "shapeshift" else ("shapeshift", *f))
        for f in folders
        if f and f[0] not in NOT_SHIPPED and not f[0].startswith(".")
    }
    assert needed == listed


def test_every_kind_of_file_is_shipped():
    kinds = set(PROJECT["tool"]["setuptools"]["package-data"]["*"])
    assert set(SHIPPED_KINDS) - {"*.py"} <= kinds


def test_every_dependency_is_pinned_and_explained():
    names = {re.split(r"[<>=~]", d)[0] for d in PROJECT["project"]["dependencies"]}
    pins = dict(
        line.split("==")
        for line in (ROOT / "requirements.txt").read_text().splitlines()
        if line and not line.startswith("#")
    )
    assert names <= set(pins)
    readme = (ROOT / "README.md").read_text()
    unexplained = {name for name in pins if not re.search(rf"^\| {name} \|", readme, re.M)}
    assert not unexplained


def test_an_index_can_show_what_it_is():
    """What people see of a package before they have it."""
    project = PROJECT["project"]
    assert (ROOT / project["readme"]).is_file() and len(project["description"]) > 40
    assert project["authors"][0]["name"] and project["keywords"]
    told = {c.split(" :: ")[0] for c in project["classifiers"]}
    assert {"Development Status", "Intended Audience", "Operating System", "Topic"} <= told
    # A licence is named as soon as the repository has one, and none before.
    has_licence = any(ROOT.glob("LICEN[CS]E*"))
    assert ("license" in project) == has_licence


def test_top_level_of_the_readme_tree_is_the_top_level():
    tree = (ROOT / "README.md").read_text().split("```")
    block = next(b for b in tree if "launch.py " in b and "renderer/" in b)
    named = {line.split()[0] for line in block.splitlines() if line and not line.startswith(" ")}
    folders = {f"{p.parent.name}/" for p in ROOT.glob("*/__init__.py")} | {
        "docs/",
        "tests/",
        "tools/",
    }
    assert folders <= named, f"README's tree lacks {folders - named}"
    missing = {n for n in named if n.endswith(("/", ".py", ".md")) and not (ROOT / n).exists()}
    assert not missing, f"README's tree names {missing}"


def test_committed_rows_name_a_program_that_is_there():
    programs = {}
    for path in sorted((ROOT / "docs" / "bench").rglob("*")):
        if path.suffix in (".csv", ".md") and "at commit" not in path.read_text()[:2000]:
            first = path.read_text().splitlines()[0].strip("# ")
            programs[path.name] = re.match(r"python3? (\S+\.py) ?", first)
    rows = {name: found for name, found in programs.items() if name.endswith(".csv")}
    assert len(rows) > 20 and all(rows.values()), rows
    missing = {found[1] for found in programs.values() if found and not (ROOT / found[1]).is_file()}
    assert not missing


def test_nothing_is_kept_in_git_that_is_ignored():
    """A link to an environment was, once: whoever checked it out lost the one that was there."""
    listed = ["git", "ls-files", "--cached", "--ignored", "--exclude-standard"]
    done = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip("no checkout of git")
    assert not done.stdout.splitlines()
