"""Where the overlay's parts lie: nothing covers anything else, at every size and scale."""

from itertools import combinations, product

import pytest

from shapeshift.app.editor.state.layout import FOLDED, LEGEND, Layout, lay_out

SIZES = ((800, 600), (1280, 720), (1366, 768), (1920, 1080), (2560, 1440), (3840, 2160))
SCALES = (1.0, 1.25, 1.5, 2.0)


def boxes(layout: Layout) -> dict[str, tuple]:
    names = ("panel", "bar", "legend", "left_legend", "status", "strip")
    found = {name: getattr(layout, name) for name in names}
    return {name: box for name, box in found.items() if box is not None}


def overlap(one: tuple, other: tuple) -> bool:
    across = min(one[2], other[2]) - max(one[0], other[0])
    down = min(one[3], other[3]) - max(one[1], other[1])
    return across > 1e-6 and down > 1e-6


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scale", SCALES)
def test_no_part_covers_another_and_none_covers_what_is_free(size, scale):
    no_or_yes = (False, True)
    for way in product((0, 1, 2), no_or_yes, no_or_yes, no_or_yes, (None, True, False)):
        rows, legend, both, film, wanted = way
        rows = min(rows, 1) if size[1] / scale < 420 else rows  # as the viewer does
        layout = lay_out(size, scale, rows, legend, wanted, both=both, film=film)
        found = boxes(layout)
        assert ("bar" in found) == (rows > 0) and ("strip" in found) == film, way
        for left, top, right, low in (*found.values(), layout.free):
            assert 0 <= left < right <= size[0] + 1e-6 and 0 <= top < low <= size[1] + 1e-6, way
        for (one, a), (other, b) in combinations(found.items(), 2):
            assert not overlap(a, b), (one, other, way)
        if layout.folded:  # a square in the corner takes nothing away
            assert found.pop("panel")[2] <= (16 + FOLDED) * scale + 1e-6, way
        assert not any(overlap(box, layout.free) for box in found.values()), way


def test_most_of_a_window_is_the_scenes():
    """A third of the width at least beside an open panel and legend, and 55 % of the height."""
    for size, scale, legend in product(SIZES, SCALES, [False, True]):
        left, top, right, low = lay_out(size, scale, 1, legend).free
        assert right - left >= 0.49 * size[0] or size[0] / scale < 850, (size, scale, legend)
        assert right - left >= 0.33 * size[0] and low - top >= 0.55 * size[1], (size, scale, legend)


@pytest.mark.parametrize("legend", [False, True])
def test_the_panel_folds_where_it_would_leave_too_little(legend):
    least = 334 + LEGEND * legend + 280
    for width, height, folded in (
        (least, 380, False), (least - 1, 380, True), (least, 379, True), (5000, 379, True),
    ):  # fmt: skip
        assert lay_out((width, height), 1.0, 1, legend).folded == folded
    assert not lay_out((least - 1, 300), 1.0, 1, legend, True).folded
    assert lay_out((5000, 5000), 1.0, 1, legend, False).folded


def test_a_hidden_overlay_leaves_everything_free():
    layout = lay_out((640, 480), 2.0, 1, True, overlay=False)
    assert layout.free == (0, 0, 640, 480) and not boxes(layout)


def test_the_legend_keeps_its_room_and_goes_where_there_is_none():
    with_it, without = (lay_out((1280, 720), 1.0, 1, legend) for legend in (True, False))
    assert without.free[2] - with_it.free[2] == LEGEND
    left, top, right, low = with_it.legend
    assert (top + low) / 2 == pytest.approx((with_it.free[1] + with_it.free[3]) / 2)
    assert with_it.free[2] < left and right < 1280
    narrow = lay_out((470, 600), 1.0, 1, True, True)
    assert narrow.legend is None and narrow.free[2] == 470
    both = lay_out((1280, 720), 1.0, 1, True, both=True)
    assert both.free[0] - with_it.free[0] == LEGEND and both.legend == with_it.legend


@pytest.mark.parametrize("size", [(1, 1), (40, 30), (200, 150), (320, 90), (100, 2000)])
@pytest.mark.parametrize("wanted", [None, True])
def test_windows_too_small_for_anything_still_have_a_free_part(size, wanted):
    left, top, right, low = lay_out(size, 1.0, 2, True, wanted).free
    assert right > left and low > top


def test_everything_grows_with_the_scale():
    one, two = lay_out((1280, 720), 1.0, 1, True), lay_out((2560, 1440), 2.0, 1, True)
    for name, box in boxes(one).items():
        assert getattr(two, name) == pytest.approx([2 * side for side in box])
    assert two.free == pytest.approx([2 * side for side in one.free])
