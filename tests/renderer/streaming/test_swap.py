"""Parents and children that follow each other: together they are drawn once, and none is a jump."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.streaming import stream as stream_module
from shapeshift.renderer.streaming.changing import PARTS, comes_finer, patient, related, swapped
from shapeshift.renderer.streaming.choose import NOT_DRAWN
from shapeshift.runtime_models.splats.parents import NodeTree
from shapeshift.scene.pose import Pose
from tests.support.splat_scenes import shell
from tests.support.streamed_scenes import open_levels, rest, scene_of, view_at, write_levels

BUDGET = 4000
VIEW = view_at((0, 2, 9), (0, 0, -6))
#        6
#    4       5
#  0   1   2   3
TREE = NodeTree(
    np.array([4, 4, 5, 5, 6, 6, -1]), np.array([0, 0, 0, 0, 1, 1, 2]), np.zeros(7)
)  # fmt: skip


def nodes(*numbers: int) -> np.ndarray:
    """(7,) bool"""
    return np.isin(np.arange(7), numbers)


@pytest.mark.parametrize(
    ("some", "expected"),
    [
        ((), ()),
        ((0,), (0, 4, 6)),
        ((4,), (0, 1, 4, 6)),
        ((6,), range(7)),
        ((1, 2), (1, 2, 4, 5, 6)),
    ],
)
def test_related_are_those_above_and_below(some, expected):
    assert set(np.flatnonzero(related(TREE, nodes(*some)))) == set(expected)


def levels(*there: int) -> np.ndarray:
    return np.where(nodes(*there), 0, NOT_DRAWN)


@pytest.mark.parametrize(
    ("before", "after", "out", "into"),
    [
        ((6,), (4, 5), (6,), (4, 5)),
        ((4, 5), (6,), (4, 5), (6,)),
        ((6,), (0, 1, 5), (6,), (0, 1, 5)),
        ((4, 2, 3), (0, 1, 5), (2, 3, 4), (0, 1, 5)),
        ((4, 5), (4,), (), ()),  # 5 has left the picture
        ((4,), (4, 5), (), ()),  # it has come into it
        ((0, 1), (0, 1), (), ()),
        ((), (6,), (), ()),
        ((0,), (2,), (), ()),  # one goes, another one comes: strangers
    ],
)
def test_who_fades_with_whom(before, after, out, into):
    found = swapped(TREE, levels(*after), levels(*before))
    assert [set(each) for each in found] == [set(out), set(into)]


@pytest.mark.parametrize(
    ("before", "after", "finer"),
    [
        ((6,), (4, 5), (4, 5, 6)),
        ((4, 5), (6,), ()),
        ((6,), (0, 1, 5), (0, 1, 5, 6)),
        ((4, 2, 3), (0, 1, 5), (0, 1, 4)),
        ((4, 5), (4,), ()),
        ((4,), (4, 5), (5,)),
        ((), (6,), (6,)),
    ],
)
def test_which_way_a_swap_goes(before, after, finer):
    """All that fade into each other go the same way; what comes alone comes as what is finer."""
    found = comes_finer(TREE, levels(*after), levels(*before))
    assert set(np.flatnonzero(found)) == set(finer)


def test_a_level_of_its_own_goes_its_own_way():
    before, after = np.full(7, NOT_DRAWN), np.full(7, NOT_DRAWN)
    before[:3], after[:3] = (2, 1, 1), (1, 2, 1)
    for tree in (TREE, None):
        np.testing.assert_array_equal(comes_finer(tree, after, before), nodes(0))


def test_without_a_tree_nobody_does():
    for part in swapped(None, levels(0), levels(1)):
        assert part.shape == (0,)
    wanted = levels(3)
    assert patient(None, wanted, levels(1), nodes(1)) is wanted
    assert patient(TREE, wanted, levels(1), nodes()) is wanted


def test_relatives_of_what_fades_wait_and_others_do_not():
    now = levels(4, 5)
    held = patient(TREE, levels(6), now, nodes(4))  # 5 may go, but 6 above 4 may not come yet
    np.testing.assert_array_equal(held, levels(4))
    held = patient(TREE, levels(4, 2, 3), now, nodes(0, 1))
    np.testing.assert_array_equal(held, levels(4, 2, 3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_levels(shell(3000), tmp_path_factory.mktemp("levels") / "shell", 200)


@pytest.fixture
def crowd(folder, monkeypatch):
    """Forty copies in a square, by a budget that parents are needed for, and room for any fade."""
    monkeypatch.setattr(stream_module, "SPARE", 1.0)
    one = open_levels(folder, BUDGET)
    scene = scene_of(*[one] * 40)
    places = [Pose(np.array([2.2 * (i % 5) - 4.4, 0, -2.2 * (i // 5)]), np.array([1.0, 0, 0, 0]))
              for i in range(40)]  # fmt: skip
    objects = [replace(o, world_from_object=p) for o, p in zip(scene.objects, places, strict=True)]
    with Renderer(None, "tiles") as renderer:
        renderer.streaming.converges = False
        renderer.update(replace(scene, objects=tuple(objects)))
        yield renderer


def check_parts(renderer) -> int:
    """What is drawn of a node, its parents and its children adds up to 1; how many of them fade."""
    stream, pages = renderer.streaming.stream, renderer.drawing.paged
    table, tree = stream.table, stream.tree
    leaving = np.unique(table.left[table.left >= 0])
    alone = leaving[table.level[leaving] == NOT_DRAWN]
    count = 0
    for node in alone:
        parts = pages.weight[table.leaving(np.array([node]))]
        assert np.ptp(parts) == 0
        assert np.abs(parts[0] - np.array([*PARTS, *(1 - np.array(PARTS))])).min() < 1e-6
        one = np.arange(len(table.level)) == node
        mine = np.flatnonzero(related(tree, one) & (table.level != NOT_DRAWN))
        count += len(mine) > 0  # else it goes and leaves nothing
        np.testing.assert_allclose(
            pages.weight[table.pages_of(mine)], 1 - parts[0], atol=1e-6, err_msg=f"{node}"
        )
    return count


def test_parts_of_parents_and_children_add_up_to_one(crowd):
    rest(crowd, VIEW)
    most = 0
    for part in np.linspace(0, 1, 30):
        view = view_at((4 * part, 2, 9 - 8 * part), (0, 0, -6))
        crowd.draw([view])
        most = max(most, check_parts(crowd))
    assert most > 3  # or nothing was tested
    rest(crowd, view)
    stream, pages = crowd.streaming.stream, crowd.drawing.paged
    assert (pages.weight[pages.stored >= 0] == 1).all() and (stream.table.left < 0).all()


@pytest.mark.parametrize("fewer", [0.7, 0.5])
def test_a_swap_changes_a_still_picture_by_less_in_each_frame(crowd, monkeypatch, fewer):
    """Half of what changes at once, at most: three frames show both."""
    worst, anew = {}, replace(VIEW, near=0.051)  # the same picture, which is chosen for again
    for weighs in (True, False):
        monkeypatch.setattr(type(crowd.drawing), "weighs_pages", weighs)
        stream = crowd.streaming.stream
        whole = stream.left
        rest(crowd, VIEW)
        pictures = [crowd.image(0).copy()]
        stream.left = int(fewer * whole)
        fading = 0
        for _ in range(80):
            pending = crowd.draw([anew]).streaming.pending
            fading += check_parts(crowd)
            pictures.append(crowd.image(0).copy())
            if not pending:
                break
        steps = [float(np.abs(b - a).mean()) for a, b in pairwise(pictures)]
        worst[weighs] = max(steps)
        assert (fading > 0) is weighs
        stream.left = whole
    assert 0 < worst[True] < 0.5 * worst[False]


def test_what_goes_and_leaves_nothing_fades_and_so_does_what_comes(crowd, monkeypatch):
    """Copies that a small budget has nothing for, and has again, while their places are in sight.

    The largest step of a still picture is under 0.7 of that at once: parts are even, three of four.
    """
    worst, anew = {}, replace(VIEW, near=0.051)
    stream = crowd.streaming.stream
    whole = stream.left
    for weighs in (True, False):
        monkeypatch.setattr(type(crowd.drawing), "weighs_pages", weighs)
        rest(crowd, VIEW)
        pictures, drawn, lone = [crowd.image(0).copy()], [], 0
        for part, view in ((0.15, anew), (1.0, VIEW)):
            stream.left = int(part * whole)
            for _ in range(80):
                pending = crowd.draw([view]).streaming.pending
                fades = stream.fades.leaves & ~related(stream.tree, stream.table.level >= 0)
                lone += np.count_nonzero(fades)
                pictures.append(crowd.image(0).copy())
                if not pending:
                    break
            drawn.append(set(crowd.drawing.paged.owner) - {-1})
        assert len(drawn[0]) < 0.8 * len(drawn[1])  # or nothing was tested
        assert bool(lone) is weighs
        worst[weighs] = max(float(np.abs(b - a).mean()) for a, b in pairwise(pictures))
    assert 0 < worst[True] < 0.7 * worst[False]
