"""The docs stay short, begin with what they are for, and lead where they say."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = sorted((ROOT / "docs").rglob("*.md"))
LINKED = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CONVENTIONS.md",
          ROOT / "examples/README.md", *DOCS]  # fmt: skip
MOST_WORDS = 35_000
MOST_NEWS = 15_000  # bytes
LINK = re.compile(r"\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```.*?^```", re.M | re.S)
TOP = 40  # lines in which an example has to begin


def words_of(text: str) -> int:
    """As `wc -w` counts, without the bars and rules of tables."""
    return sum(1 for word in text.split() if re.search(r"\w", word))


def anchors_of(page: Path) -> set[str]:
    """What GitHub makes of its headings."""
    heads = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text("utf-8")), re.M)
    kept = (re.sub(r"[^\w\- ]", "", re.sub(r"\[(.*?)\]\(.*?\)", r"\1", head)) for head in heads)
    return {head.lower().replace(" ", "-") for head in kept}


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


@pytest.mark.parametrize("page", LINKED, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_headings_that_are_there(page):
    """Files are looked at in test_tutorials.py; here what stands behind #."""
    lost = set()
    for link in LINK.findall(FENCE.sub("", page.read_text("utf-8"))):
        path, _, anchor = link.partition("#")
        if "://" in link:
            continue
        there = (page.parent / path).resolve() if path else page
        if not there.exists() or (anchor and anchor not in anchors_of(there)):
            lost.add(link)
    assert not lost


def test_the_glossary_has_the_public_names():
    """Types of the library, settings of a frame and of a training; functions are commands'."""
    from dataclasses import fields

    import shapeshift as ss
    from shapeshift.training.settings import TrainSettings

    page = FENCE.sub("", (ROOT / "docs/glossary.md").read_text("utf-8"))
    told = {word for each in re.findall(r"`([^`]+)`", page) for word in re.findall(r"\w+", each)}
    public = {name for name in ss.__all__ if name[0].isupper()} | {"tile_bounds", "intersections"}
    public |= {f.name for kind in (ss.RenderSettings, ss.FrameStats, TrainSettings)
               for f in fields(kind)}  # fmt: skip
    plain = {"background", "seed", "splats", "sorts"}  # what they say
    assert public - told - plain == set()
