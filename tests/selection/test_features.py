"""What a feature has in files and shelves: one table.  A feature that grows past its row is first
looked at for what it can do without; then its row is raised, in the commit that needs it.

A shelf is a top folder; app/ counts by its second level.
"""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOPS = ("app", "decomposition", "rasterizer", "renderer", "runtime_models", "scene", "shapeshift",
        "training", "vr", "web")  # fmt: skip

# feature: (which files are its own, by path; files at most; shelves at most)
FEATURES = {
    "levels of detail, streaming, paging": (
        r"^app/streaming/|/(paging|lod|streaming)/|renderer/levels|paged_tiles|leaf_levels"
        r"|splats/sog/\w*stream",
        18, 5,
    ),
    "inspection, thermal": (r"inspection/|radiometric/|api/inspect", 43, 3),
    "film, gallery": (r"^app/film/|^scene/film/|api/film", 16, 3),
    "segmentation": (r"^decomposition/(?!poses)|^app/decomposition/|api/segment", 35, 3),
    "styles": (r"training/style|api/style", 21, 3),
    "the page": (r"^web/(?!headset)|^app/page/|^runtime_models/web/", 33, 3),
    "change": (r"^app/change/|^scene/change/", 9, 2),
    "blocks": (r"/blocks/", 11, 3),
    "sections": (r"^scene/sections/|section_tool|section_handles|cuts_panel", 6, 2),
}  # fmt: skip


def files_of(pattern: str) -> list[str]:
    paths = (p for top in TOPS for p in (ROOT / top).rglob("*.*") if p.suffix in (".py", ".js"))
    named = (p.relative_to(ROOT).as_posix() for p in paths if p.name != "__init__.py")
    return sorted(name for name in named if re.search(pattern, name))


def shelf_of(name: str) -> str:
    parts = name.split("/")
    return "/".join(parts[:2]) if parts[0] == "app" else parts[0]


@pytest.mark.parametrize("feature", FEATURES)
def test_a_feature_stays_within_its_row(feature):
    pattern, most_files, most_shelves = FEATURES[feature]
    files = files_of(pattern)
    shelves = sorted({shelf_of(name) for name in files})
    assert len(files) <= most_files, (len(files), files)
    assert len(shelves) <= most_shelves, shelves
    assert len(files) > most_files - 5, f"{feature} has become smaller: lower its row"
