"""Six planted changes between two trained visits: the oracle of tools/inspection/change.py, small.

Photos of 96x72 pixels, 16 a stop, 300 steps a training; the whole size is
`tools/inspection/change.py WORK`.
"""

import pytest

import shapeshift as ss
from tools.inspection import visits
from tools.inspection.change import is_piece, matched


@pytest.mark.slow
def test_six_planted_changes_are_found(tmp_path, monkeypatch):
    """All six, and at most one that is false; a warm part may fall in two at this size."""
    monkeypatch.setattr(visits, "TEST_VIEWS", 1)
    for name, changed, turn in (("before", False, 0.0), ("after", True, 0.11)):
        visits.make_visit(tmp_path / name, changed, turn, (96, 72), views=16)
        ss.train(tmp_path / name, out=tmp_path / f"{name}.shift", iterations=300)
    found = ss.change(tmp_path / "before.shift", tmp_path / "after.shift", size=(240, 180))
    assert found.registration.how == "common" and found.registration.residual_m < 0.006
    pairs = matched(found.places)
    said = [(place.kind, place.centre.round(2).tolist()) for place in found.places]
    assert [planted for planted, _ in pairs] == [0, 1, 2, 3, 4, 5], said
    used = {found_at for _, found_at in pairs}
    others = [place for i, place in enumerate(found.places) if i not in used]
    assert sum(not is_piece(place) for place in others) <= 1, said
