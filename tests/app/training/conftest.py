"""Commands that train measure a pace: here by nine pictures of a way in place of 33."""

import pytest


@pytest.fixture(autouse=True)
def few_blends(monkeypatch):
    """tests/renderer/test_pace.py has the pace itself."""
    from shapeshift.renderer import pace

    monkeypatch.setattr(pace, "MOST", pace.FIRST)
