"""Labels: the classifier of Gaussian Grouping, and columns of whole numbers."""

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.formats import (
    CLASSIFIER,
    most_likely,
    read_classifier,
    with_labels,
)
from shapeshift.runtime_models.splats.plain_splats import RawSplats
from tests.support.splats.torch_files import write_tensors


def raw(count: int, extra: dict) -> RawSplats:
    zeros = np.zeros((count, 3), np.float32)
    return RawSplats(
        zeros, zeros, np.zeros((count, 4), np.float32), zeros[:, 0], zeros[:, None],
        "a.ply", "3DGS PLY", extra=extra,
    )  # fmt: skip


def features(count: int, width: int = 16) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(count)
    return {f"obj_dc_{i}": rng.normal(size=count).astype(np.float32) for i in range(width)}


@pytest.mark.parametrize("count", [1, 255, (1 << 14) - 1, 1 << 14, (1 << 14) + 1])
def test_labels_are_the_largest_of_the_classifier(tmp_path, count):
    rng = np.random.default_rng(5)
    weight, bias = rng.normal(size=(9, 16, 1, 1)), rng.normal(size=9)
    write_tensors(tmp_path / CLASSIFIER, {"weight": weight, "bias": bias})
    extra = features(count)
    labels = with_labels(raw(count, extra), tmp_path / "a.ply").labels
    assert labels.dtype == np.int32 and len(labels) == count
    for row in range(0, count, max(1, count // 50)):  # the slow twin, row by row
        values = [float(extra[f"obj_dc_{i}"][row]) for i in range(16)]
        scores = [np.dot(weight[c, :, 0, 0], values) + bias[c] for c in range(9)]
        assert labels[row] == int(np.argmax(scores))


def test_without_a_classifier_a_finding_says_which_file_is_wanted(tmp_path):
    read = with_labels(raw(4, features(4)), tmp_path / "a.ply")
    assert read.labels is None and "obj_dc_0" in read.extra
    (finding,) = read.findings
    assert CLASSIFIER in finding.what and CLASSIFIER in finding.done


def test_a_classifier_of_another_width_is_refused(tmp_path):
    write_tensors(tmp_path / CLASSIFIER, {"weight": np.ones((3, 8, 1, 1)), "bias": np.ones(3)})
    with pytest.raises(BadFile, match="takes 8"):
        with_labels(raw(4, features(4)), tmp_path / "a.ply")


@pytest.mark.parametrize(
    "tensors",
    [
        {"weight": np.ones((3, 16)), "bias": np.ones(3)},
        {"weight": np.ones((3, 16, 3, 3)), "bias": np.ones(3)},
        {"weight": np.ones((3, 16, 1, 1)), "bias": np.ones(4)},
        {"weight": np.ones((3, 16, 1, 1))},
        {"weight": np.full((3, 16, 1, 1), np.nan), "bias": np.ones(3)},
        {"other": np.ones(3)},
    ],
)
def test_what_is_no_classifier_is_refused(tmp_path, tensors):
    write_tensors(tmp_path / CLASSIFIER, tensors)
    with pytest.raises(BadFile, match=CLASSIFIER):
        read_classifier(tmp_path / CLASSIFIER)


def test_a_column_of_whole_numbers_is_taken_as_labels(tmp_path):
    for name in ("label", "object_id", "segment"):
        for kind in (np.uint8, np.int32, np.float32):
            column = np.array([0, 2, 7, 2], kind)
            read = with_labels(raw(4, {name: column, "other": column}), tmp_path / "a.ply")
            assert read.labels.tolist() == [0, 2, 7, 2] and read.labels.dtype == np.int32
            assert list(read.extra) == ["other"]


@pytest.mark.parametrize("bad", [[0.5, 1], [-1, 0], [np.nan, 1], [2.0**31, 0], [np.inf, 0]])
def test_a_column_of_other_numbers_is_kept_as_it_is(tmp_path, bad):
    read = with_labels(raw(2, {"label": np.array(bad)}), tmp_path / "a.ply")
    assert read.labels is None and "label" in read.extra


def test_nan_features_get_some_label():
    labels = most_likely(np.full((2, 4), np.nan, np.float32), np.ones((3, 4)), np.zeros(3))
    assert ((labels >= 0) & (labels < 3)).all()


def test_the_object_view_counts_labels_and_colours_them():
    from dataclasses import replace

    from shapeshift.renderer.debug.debug import MOST_LABELS, label_ranks, object_counts
    from shapeshift.scene.scene import Scene, SceneObject
    from tests.support.splat_scenes import random_layers

    plain = random_layers(60)
    labels = np.repeat([5, 0, 9], [10, 30, 20]).astype(np.int32)
    found, ranks = label_ranks(replace(plain, labels=labels))
    assert found == [0, 9, 5] and ranks.tolist() == [2] * 10 + [0] * 30 + [1] * 20
    objects = (SceneObject("a", replace(plain, labels=labels)), SceneObject("b", plain))
    told = object_counts(Scene(objects), [60, 60])
    assert told == {"a, label 0": 30, "a, label 9": 20, "a, label 5": 10, "b": 60}
    many = label_ranks(replace(plain, labels=np.arange(60, dtype=np.int32)))
    assert len(many[0]) == MOST_LABELS and many[1].max() == MOST_LABELS - 1
