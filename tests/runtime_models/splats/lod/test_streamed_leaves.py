"""A streamed SOG leaf by leaf: the same splats as the whole file gives, and what is refused."""

import shutil

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.sog.read_streamed import read_level, read_tree
from tests.support.splat_scenes import shell
from tests.support.streamed_scenes import changed_tree, first_leaf, open_levels, write_levels

ARRAYS = ("means", "scales", "wxyz", "opacity", "sh")


@pytest.fixture(scope="module", params=[1, 4], ids=["sh0", "sh1"])
def folder(request, tmp_path_factory):
    where = tmp_path_factory.mktemp("levels") / "shell"
    return write_levels(shell(3000, request.param), where)


@pytest.fixture
def copied(tmp_path, folder):
    return shutil.copytree(folder, tmp_path / "copy")


@pytest.mark.parametrize("reading", [{}, {"up": "+Z"}, {"flip": True}], ids=str)
def test_all_leaves_at_a_level_are_that_level(folder, reading):
    """Against the reader of whole levels: numbers of the same codes, to the bit but for turns by
    a product of matrices, whose blocks round as they fall.
    """
    source = open_levels(folder, 0, **reading).leaves
    leaves, tree = np.arange(len(source.part)), read_tree(folder)
    for level in range(source.part.shape[1]):
        whole = read_level(tree, level, Reading(**reading))
        parts = list(source.read(leaves, np.full(len(leaves), level)))
        for name in ARRAYS:
            mine = np.concatenate([getattr(part, name) for part in parts])
            np.testing.assert_allclose(mine, getattr(whole, name), rtol=0, atol=2e-6)
        if not reading:
            assert all(
                (np.concatenate([getattr(p, n) for p in parts]) == getattr(whole, n)).all()
                for n in ARRAYS
            )
        counts = np.concatenate([part.counts for part in parts])
        assert (counts == source.levels.counts[:, level]).all()


def test_boxes_hold_the_splats_and_errors_rise_with_the_level(folder):
    model = open_levels(folder, 0)
    levels = model.leaves.levels
    (part,) = model.leaves.read(np.arange(len(levels.low)), np.zeros(len(levels.low), int))
    owner = np.repeat(part.leaves, part.counts)
    assert (part.means >= levels.low[owner] - 1e-5).all()
    assert (part.means <= levels.high[owner] + 1e-5).all()
    assert (np.diff(levels.errors, axis=1) >= 0).all() and (levels.errors[:, 0] == 0).all()
    facts = describe(model, folder)
    assert facts["leaves"] == len(levels.low) == describe(read_model(folder), folder)["leaves"]
    files = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    assert facts["bytes"] == files
    assert facts["levels"] == dict(enumerate(levels.counts.sum(axis=0).tolist()))


def test_the_model_itself_is_the_coarsest_level_of_every_leaf(folder):
    model = open_levels(folder, 0)
    last = model.leaves.part.shape[1] - 1
    whole = read_level(read_tree(folder), last, Reading())
    assert model.splat_count == whole.splat_count == len(model.leaves.coarse_leaf)
    np.testing.assert_array_equal(model.means, whole.means)


def test_a_file_is_decoded_once_while_it_is_kept_and_again_when_not(folder):
    source = open_levels(folder, 0).leaves
    leaf = np.arange(1)
    for _ in range(3):
        list(source.read(leaf, leaf))
    assert source.cache.decoded == 2  # of the coarsest level, and of the finest
    tight = open_levels(folder, 0, cache=1).leaves
    for _ in range(3):
        list(tight.read(leaf, leaf))
    assert tight.cache.decoded == 4 and tight.cache.taken == 0


def test_no_errors_in_the_tree_count_by_how_many_fewer_splats_there_are(copied):
    def forget(tree):
        node = first_leaf(tree["tree"])
        del node["errors"]

    changed_tree(copied, forget)
    levels = open_levels(copied, 0).leaves.levels
    counts = levels.counts[0]
    np.testing.assert_allclose(levels.errors[0], np.log(counts[0] / counts))


WRONG = {
    "a NaN in a box": (lambda leaf: leaf["bound"]["min"].__setitem__(0, float("nan")), "bound"),
    "an infinite box": (lambda leaf: leaf["bound"]["max"].__setitem__(1, float("inf")), "bound"),
    "a box inside out": (lambda leaf: leaf["bound"]["max"].__setitem__(2, -1e9), "bound"),
    "a box of two numbers": (lambda leaf: leaf["bound"]["max"].pop(), "three numbers"),
    "no box": (lambda leaf: leaf.pop("bound"), "three numbers"),
    "a NaN error": (lambda leaf: leaf["errors"].__setitem__(1, float("nan")), "errors"),
    "an error below 0": (lambda leaf: leaf["errors"].__setitem__(1, -0.5), "errors"),
    "a word as an error": (lambda leaf: leaf["errors"].__setitem__(1, "much"), "errors"),
    "too many errors": (lambda leaf: leaf["errors"].extend([1.0] * 64), "errors"),
    "an absurd row": (lambda leaf: leaf["lods"]["0"].update(offset=1 << 60), "row"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_tree_that_cannot_be_is_refused_in_one_sentence(copied, wrong):
    change, word = WRONG[wrong]
    changed_tree(copied, lambda tree: change(first_leaf(tree["tree"])))
    with pytest.raises(BadFile, match=word) as refused:
        open_levels(copied, 0)
    assert str(refused.value).count("\n") == 0


def test_a_file_that_is_broken_is_named_and_the_rest_still_comes(copied):
    source = open_levels(copied, 0).leaves
    (copied / "0_0" / "means_l.webp").write_bytes(b"RIFF no picture")
    leaves = np.arange(len(source.part))
    with pytest.raises(BadFile, match=r"0_0/meta\.json cannot be read: .*means_l"):
        source.load(int(source.part[0, 0]))
    assert "0_0/meta.json" in source.problem and source.broken().tolist().count(True) == 1
    assert sum(len(p.means) for p in source.read(leaves, np.ones(len(leaves), int)))


def test_a_run_beyond_its_file_is_refused_when_it_is_read(copied):
    changed_tree(copied, lambda t: first_leaf(t["tree"])["lods"]["0"].update(count=999_999))
    source = open_levels(copied, 0).leaves
    with pytest.raises(BadFile, match=r"0_0/meta.json has 3,000 splats, lod-meta.json names row"):
        list(source.read(np.arange(1), np.zeros(1, int)))
