"""Parents above leaves: what they stand for, and what moments say of it."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.splats.operations.moment_matching import shown_area
from shapeshift.runtime_models.splats.parents import CHILDREN, SPLATS, with_parents
from tests.support.splat_scenes import shell
from tests.support.streamed_scenes import open_levels, write_levels


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = write_levels(shell(6000, 4), tmp_path_factory.mktemp("levels") / "shell", leaf=100)
    return open_levels(folder, 1000)


def test_each_node_but_the_root_has_a_parent_and_leaves_stay_as_they_are(model):
    many, tree = with_parents(model)
    before, after = model.leaves, many.leaves
    count = len(before.part)
    assert count == 64 and len(tree.parent) == 64 + 8 + 1
    assert np.flatnonzero(tree.parent < 0).tolist() == [72]
    below = np.flatnonzero(tree.parent >= 0)
    assert (tree.height[tree.parent[below]] == tree.height[below] + 1).all()
    assert np.bincount(tree.parent[below])[count:].tolist() == [CHILDREN] * 9
    assert (tree.error[tree.parent[below]] >= 0).all()
    np.testing.assert_array_equal(after.levels.counts[:count], before.levels.counts)
    np.testing.assert_array_equal(after.levels.errors[:count], before.levels.errors)
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        rows = getattr(many, name)[: model.splat_count]
        np.testing.assert_array_equal(rows, getattr(model, name))
    assert (np.bincount(after.coarse_leaf, minlength=73)[count:]
            == after.levels.counts[count:, -1]).all()  # fmt: skip
    assert 0 < after.levels.counts[72, -1] <= SPLATS


def test_boxes_hold_their_children_and_splats_keep_what_they_show(tmp_path):
    """Merging keeps opacity times area in sum, and its centre, where no opacity would pass 1."""
    faint = shell(6000, 4)
    faint = replace(faint, opacity=np.full_like(faint.opacity, 4 / 255))
    model = open_levels(write_levels(faint, tmp_path / "shell", leaf=100), 1000)
    many, tree = with_parents(model)
    levels, node = many.leaves.levels, many.leaves.coarse_leaf
    below = np.flatnonzero(tree.parent >= 0)
    assert (levels.low[tree.parent[below]] <= levels.low[below]).all()
    assert (levels.high[tree.parent[below]] >= levels.high[below]).all()
    np.testing.assert_array_equal(levels.low[-1], model.leaves.levels.low.min(axis=0))
    weight = shown_area(many.scales, many.opacity).astype(np.float64)
    for name in range(len(tree.parent)):
        children = np.flatnonzero(tree.parent == name)
        if len(children):
            mine, theirs = node == name, np.isin(node, children)
            assert weight[mine].sum() == pytest.approx(weight[theirs].sum(), rel=1e-4)
            centre = np.average(many.means[mine], axis=0, weights=weight[mine])
            expected = np.average(many.means[theirs], axis=0, weights=weight[theirs])
            np.testing.assert_allclose(centre, expected, atol=1e-4)


def test_a_scene_of_one_leaf_is_its_own_root(tmp_path):
    model = open_levels(write_levels(shell(50, 1), tmp_path / "one"), 1000)
    many, tree = with_parents(model)
    assert tree.parent.tolist() == [-1] and tree.height.tolist() == [0]
    assert many.splat_count == model.splat_count


def test_the_same_scene_has_the_same_parents(model):
    one, other = with_parents(model)[0], with_parents(model)[0]
    np.testing.assert_array_equal(one.means, other.means)
    np.testing.assert_array_equal(one.leaves.coarse_leaf, other.leaves.coarse_leaf)
