"""The room that is free to walk in, as a stand-in for a runtime tells it."""

from types import SimpleNamespace as Thing

import numpy as np
import pytest

from shapeshift.vr.openxr.room import LEAST_M, Bounds, Space

xr = pytest.importorskip("xr", reason="pyopenxr is not installed", exc_type=ImportError)
KNOWN = int(xr.SpaceLocationFlags.POSITION_VALID_BIT) | int(
    xr.SpaceLocationFlags.ORIENTATION_VALID_BIT
)


class Runtime:
    """With a STAGE of that size; None: nobody has drawn one."""

    def __init__(self, size, stage: bool = True, flags: int = KNOWN) -> None:
        self.size, kinds = size, xr.ReferenceSpaceType
        mine = {name: getattr(xr, name) for name in vars(xr)}
        mine |= {
            "enumerate_reference_spaces": lambda session: [
                int(kinds.LOCAL),
                *([int(kinds.STAGE)] if stage else []),
            ],
            "create_reference_space": lambda session, info: "stage",
            "get_reference_space_bounds_rect": self.bounds,
            "locate_space": lambda space, base, now: Thing(
                pose=xr.Posef(xr.Quaternionf(0, 1, 0, 0), xr.Vector3f(1, 0, 2)),
                location_flags=flags,
            ),
        }
        self.bounds_of = Bounds(Thing(xr=Thing(**mine)), None)

    def bounds(self, session, kind):
        if self.size is None:
            raise xr.exception.SpaceBoundsUnavailable
        return xr.Extent2Df(*self.size)

    def area(self):
        return self.bounds_of.area(Space("play", "LOCAL"), 1)


def test_it_lies_where_the_stage_does():
    area = Runtime((3.0, 2.0)).area()
    assert area.size_m == (3.0, 2.0)
    np.testing.assert_allclose(area.play_from_area.position, (1, 0, 2))
    np.testing.assert_allclose(area.play_from_area.wxyz, (0, 0, 1, 0))


@pytest.mark.parametrize(
    "size", [None, (0.0, 0.0), (3.0, np.nan), (np.inf, 2.0), (-3.0, 2.0), (2.0, LEAST_M * 0.99)]
)
def test_no_rectangle_is_no_area(size):
    assert Runtime(size).area() is None


def test_without_a_stage_or_where_it_is_not_known_there_is_none():
    assert Runtime((3.0, 2.0), stage=False).area() is None
    for flags in (0, int(xr.SpaceLocationFlags.POSITION_VALID_BIT)):
        assert Runtime((3.0, 2.0), flags=flags).area() is None


def test_another_one_that_is_drawn_is_asked_for():
    runtime = Runtime((3.0, 2.0))
    runtime.size = None
    assert runtime.area() is not None
    runtime.bounds_of.ask()
    assert runtime.area() is None
