"""Play space of a real runtime: the floor is at y = 0 in every kind of it."""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.vr.openxr.room import EYE_HEIGHT_M, KINDS

PROGRAM = Path(__file__).resolve().parents[1] / "support" / "xr" / "tell_room.py"
STANDS_M = 1.6  # where Monado's remote head is until a script moves it, above STAGE's floor


@pytest.mark.parametrize("kind", KINDS)
def test_the_head_is_as_high_as_a_person(stand, kind):
    told = stand.tell(PROGRAM, kind)
    assert told["kind"] == kind
    height = EYE_HEIGHT_M if kind == "LOCAL" else STANDS_M
    np.testing.assert_allclose(told["heads"][-1], (0.0, height, 0.0), atol=1e-4)
