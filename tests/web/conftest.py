"""What tests of the page share: a browser a file, and where node is."""

import shutil

import pytest

from tests.support.web.chromium import Chromium, find_chromium


@pytest.fixture(scope="module")
def browser():
    """A headless Chromium with a canvas of 320x180; skips where there is none."""
    if not find_chromium():
        pytest.skip("there is no Chromium; on Debian: apt-get install chromium")
    with Chromium((320, 180)) as page:
        yield page


@pytest.fixture(scope="session")
def node() -> str:
    """The program; skips where there is none."""
    found = shutil.which("node")
    if not found:
        pytest.skip("there is no node; on Debian: apt-get install nodejs")
    return found
