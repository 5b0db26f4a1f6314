"""Which views a session takes of those that a runtime lists, and which OpenXR is asked for."""

import ctypes
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.vr.frame import view_names
from shapeshift.vr.openxr.instance import QUAD_VIEWS, VISIBILITY_MASK
from shapeshift.vr.openxr.view_configuration import VisibilityMasks, choose_views
from tests.support.xr.masked_eyes import answer, frame_mesh

STEREO, FOUR = 2, 1000037000  # XrViewConfigurationType
TANGENTS = (-1.0, 0.5, -2.0, 1.0)


class Listed:
    """As much of pyopenxr and of an instance as lists views."""

    ViewConfigurationType = SimpleNamespace(
        PRIMARY_STEREO=STEREO, PRIMARY_STEREO_WITH_FOVEATED_INSET=FOUR
    )

    def __init__(self, kinds: list[int], views: dict[int, int]) -> None:
        self.xr, self.handle, self.system = self, "instance", 7
        self.runtime, self.extensions = "Testing", (QUAD_VIEWS, VISIBILITY_MASK)
        self._kinds, self._views = kinds, views

    def enumerate_view_configurations(self, instance, system):
        return self._kinds

    def enumerate_view_configuration_views(self, instance, system, kind):
        return [SimpleNamespace(number=i) for i in range(self._views[kind])]

    @contextmanager
    def asked(self, what: str):
        yield


@pytest.mark.parametrize(
    ("kinds", "four", "wanted", "has", "offers"),
    [
        ([STEREO], 4, True, False, False),
        ([STEREO, FOUR], 4, True, True, True),
        ([FOUR, STEREO, 1], 4, True, True, True),
        ([STEREO, FOUR], 4, False, False, True),
        ([STEREO, FOUR], 3, True, False, False),  # listed, and not what it is by its definition
        ([STEREO, FOUR], 0, True, False, False),
        ([], 4, True, False, False),
    ],
)
def test_four_views_are_taken_where_they_are_wanted_and_offered(kinds, four, wanted, has, offers):
    shown = choose_views(Listed(kinds, {STEREO: 2, FOUR: four}), wanted)
    assert (shown.has_insets, shown.offers_insets) == (has, offers)
    assert shown.kind == (FOUR if has else STEREO) and len(shown.views) == (4 if has else 2)
    assert [view.number for view in shown.views] == list(range(len(shown.views)))
    assert view_names(len(shown.views))[-1] == ("right-inset" if has else "right")


@pytest.mark.parametrize("wanted", [False, True])
def test_each_view_is_asked_for_the_mask_of_its_own_kind(monkeypatch, wanted):
    """By the function's own address, with pyopenxr's structures."""
    xr = pytest.importorskip("xr", reason="pyopenxr is not installed", exc_type=ImportError)
    asked: list[tuple[int, int]] = []
    kind_of_function = ctypes.CFUNCTYPE(
        ctypes.c_int, xr.Session, ctypes.c_int, ctypes.c_uint32, ctypes.c_int, ctypes.c_void_p
    )

    def mask_of(session, kind, i, which, address) -> int:
        asked.append((kind, i))
        mask = ctypes.cast(address, ctypes.POINTER(xr.VisibilityMaskKHR)).contents
        if i == 1:
            return -1
        left, right, down, up = TANGENTS
        return 0 if answer(mask, *frame_mesh((left, right + i, down, up))) else -1

    function = kind_of_function(mask_of)
    instance = Listed([STEREO, FOUR], {STEREO: 2, FOUR: 4})
    shown = choose_views(instance, wanted)
    instance.xr = xr
    monkeypatch.setattr(xr, "get_instance_proc_addr", lambda *given: function)
    masks = VisibilityMasks(instance, xr.Session(), shown)
    count = len(shown.views)
    assert set(asked) == {(int(shown.kind), i) for i in range(count)}
    assert masks.of(1) is None
    for i in set(range(count)) - {1}:
        assert masks.of(i).triangles[..., 0].max() == pytest.approx(TANGENTS[1] + i)
    assert np.isfinite(masks.of(0).triangles).all()
