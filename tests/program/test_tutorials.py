"""README and docs/: commands and options that are named exist, links lead to files and headings,
pages are short and begin with what they are for.

The tutorials run whole in tests/slow/test_tutorials_run.py.
"""

import importlib
import re
import shlex
from operator import attrgetter
from pathlib import Path

import pytest

import shapeshift as ss
from shapeshift.app.cli import COMMANDS, LAUNCHED
from shapeshift.app.command_line import parse, wants_help
from shapeshift.app.errors import UsageError

ROOT = Path(__file__).resolve().parents[2]
DOCS = sorted((ROOT / "docs").rglob("*.md"))
PAGES = sorted([ROOT / "README.md", *DOCS])
LINKED = [*PAGES, *(ROOT / name for name in ("CONTRIBUTING.md", "CONVENTIONS.md",
                                             "examples/README.md"))]  # fmt: skip
MOST_WORDS, MOST_NEWS = 35_000, 15_000  # of docs/; bytes of CHANGELOG.md
TOP = 40  # lines in which a page's example has to begin
TUTORIALS = sorted((ROOT / "docs/tutorials").glob("*.md"))
SHELL = re.compile(r"^```sh\n(.*?)^```", re.M | re.S)
INLINE = re.compile(r"`((?:python3 )?launch\.py [^`]+)`")
USAGE = re.compile(r"\[-|[|]|\.\.\.|\b(COMMAND|SCENE SCENE)\b")  # a form to fill in, no command
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
ANCHORED = re.compile(r"\]\(([^)#\s]*)#([^)\s]+)\)")
FENCE = re.compile(r"^```.*?^```", re.M | re.S)
FOLDERS = (
    "app|assets|docs|examples|rasterizer|renderer|runtime_models|scene|shapeshift|tests|tools|"
)
NAMED = re.compile(rf"`((?:{FOLDERS}training|vr)/[\w./-]+\.\w+)`")


def commands_of(text: str) -> list[str]:
    """The lines of a page that start the program, in blocks and within sentences."""
    lines = [line for block in SHELL.findall(text) for line in block.splitlines()]
    told = [line for line in lines if "launch.py" in line] + INLINE.findall(text)
    return [line for line in told if not USAGE.search(line.split("#")[0])]


def check_command(line: str) -> None:
    """Raises UsageError where the program would not take this line."""
    words = shlex.split(line, comments=True)
    words = words[words.index("launch.py") + 1 :]
    if not words or words[0] in (*LAUNCHED, "--help", "--version"):
        return
    if words[0] not in COMMANDS:  # a file that is viewed
        if not words[0].startswith("-") and "." not in words[0] and not words[0].isupper():
            raise UsageError(f"'{words[0]}' is neither a command nor a file.")
        words = ["view", *words]
    name, *rest = words
    options = importlib.import_module(f"shapeshift.app.{COMMANDS[name][0]}").Options
    if not wants_help(rest):
        parse(options, rest, name)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_of_a_page_are_taken(page):
    failed = {}
    for line in commands_of(page.read_text()):
        try:
            check_command(line)
        except UsageError as error:
            failed[line] = str(error)
    # A sentence may name a command without what it needs.
    wrong = {k: v for k, v in failed.items() if "missing" not in v or line_of_a_block(page, k)}
    assert not wrong


def line_of_a_block(page: Path, line: str) -> bool:
    return any(line in block.splitlines() for block in SHELL.findall(page.read_text()))


@pytest.mark.parametrize("line", [
    "python3 launch.py train capture --out a.shift --no-such 1",
    "python3 launch.py traim capture",
    "python3 launch.py render",
    "python3 launch.py export a.shift --x Thermal",
    "python3 launch.py simulate a.scene.json --out b --pictures many",
])  # fmt: skip
def test_what_is_wrong_is_found(line):
    with pytest.raises(UsageError):
        check_command(line)


def test_every_command_is_listed():
    text = (ROOT / "docs/commands.md").read_text()
    words = [shlex.split(line, comments=True)[2:3] for line in commands_of(text)]
    listed = {word for found in words for word in found}
    assert set(COMMANDS) | set(LAUNCHED) <= listed


def test_every_command_stands_beside_what_the_library_has():
    text = (ROOT / "docs/commands.md").read_text().split("\n## From Python\n")[1].split("\n## ")[0]
    rows = dict(re.findall(r"^\| `([a-z]+)` \| (.+) \|$", text, re.M))
    assert list(rows) == [*COMMANDS, *LAUNCHED]
    for words in rows.values():
        names = re.findall(r"`([A-Za-z_.]+)`", words)
        assert names or words.startswith("none")
        for name in names:
            assert name.split(".")[0] in ss.__all__ and attrgetter(name)(ss) is not None, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_named_files_are_there(page):
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.S)
    links = {link for link in LINK.findall(text) if "://" not in link}
    lost = {link for link in links if not (page.parent / link).exists()}
    lost |= {name for name in NAMED.findall(text) if not (ROOT / name).exists()}
    assert not lost


def words_of(text: str) -> int:
    """As `wc -w` counts, without the bars and rules of tables."""
    return sum(1 for word in text.split() if re.search(r"\w", word))


def anchors_of(page: Path) -> set[str]:
    """What GitHub makes of its headings."""
    heads = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text("utf-8")), re.M)
    kept = (re.sub(r"[^\w\- ]", "", re.sub(r"\[(.*?)\]\(.*?\)", r"\1", head)) for head in heads)
    return {head.lower().replace(" ", "-") for head in kept}


@pytest.mark.parametrize("page", LINKED, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_headings_that_are_there(page):
    """Files are looked at above; here what stands behind #."""
    lost = set()
    for path, anchor in ANCHORED.findall(FENCE.sub("", page.read_text("utf-8"))):
        there = (page.parent / path).resolve() if path else page
        if "://" not in path and (not there.exists() or anchor not in anchors_of(there)):
            lost.add(f"{path}#{anchor}")
    assert not lost


def test_docs_are_short():
    """All pages under docs/, tables and examples with them; rows of docs/bench are .csv."""
    assert sum(words_of(page.read_text("utf-8")) for page in DOCS) <= MOST_WORDS
    assert (ROOT / "CHANGELOG.md").stat().st_size <= MOST_NEWS


@pytest.mark.parametrize("page", DOCS, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_begins_with_what_it_is_for_and_an_example(page):
    lines = page.read_text("utf-8").splitlines()
    assert lines[0].startswith("# ")
    first = next(line for line in lines[1:] if line)
    assert len(first.split()) >= 10 and not first.startswith(("|", "```", "#", "- ", "!", "<"))
    if page.name != "README.md" or page.parent.name != "tutorials":  # a list of five pages
        assert any(line.startswith("```") for line in lines[:TOP])


def test_the_glossary_has_the_public_names():
    """Types of the library, settings of a frame and of a training; functions are commands'."""
    from dataclasses import fields

    from shapeshift.training.settings import TrainSettings

    page = FENCE.sub("", (ROOT / "docs/glossary.md").read_text("utf-8"))
    told = {word for each in re.findall(r"`([^`]+)`", page) for word in re.findall(r"\w+", each)}
    public = {name for name in ss.__all__ if name[0].isupper()} | {"tile_bounds", "intersections"}
    public |= {f.name for kind in (ss.RenderSettings, ss.FrameStats, TrainSettings)
               for f in fields(kind)}  # fmt: skip
    plain = {"background", "seed", "splats", "sorts"}  # what they say
    assert public - told - plain == set()


def test_every_page_is_in_the_index():
    """Nobody finds a page that nothing leads to."""
    index = ROOT / "docs/README.md"
    linked = {(index.parent / link).resolve() for link in LINK.findall(index.read_text())}
    pages = set((ROOT / "docs").glob("*.md")) | set(TUTORIALS)
    assert pages - {index, ROOT / "docs/tutorials/README.md"} <= linked


def test_the_thermal_capture_is_read_as_it_is_shown(tmp_path):
    from PIL import Image

    from shapeshift.scene.captures.read_capture import read_capture

    page = (ROOT / "docs/tutorials/thermal.md").read_text()
    (text,) = re.findall(r"^```json\n(.*?)^```", page, re.M | re.S)
    for modality in ("RGB", "Thermal"):
        (tmp_path / modality).mkdir()
        Image.new("RGB", (160, 120), (200, 90, 20)).save(tmp_path / modality / "000.png")
    (tmp_path / "transforms.json").write_text(text)
    capture = read_capture(tmp_path)
    assert [stop.name for stop in capture.stops] == ["RGB", "Thermal"]
    assert capture.stops[1].value_range == (15, 95) and capture.stops[1].unit == "°C"
    assert [photo.modality for photo in capture.photos] == ["RGB", "Thermal"]


def test_the_moving_picture_is_short_and_light():
    from PIL import Image

    path = ROOT / "docs/shapeshift.webp"
    assert path.stat().st_size < 1_000_000  # a front page that loads at once
    with Image.open(path) as film:
        assert film.is_animated and film.size == (480, 270) and 60 <= film.n_frames <= 120
