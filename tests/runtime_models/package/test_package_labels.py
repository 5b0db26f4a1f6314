"""Labels of anchors: what is written comes back, who has none notices nothing, wrong ones are
told in one sentence.
"""

import json
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.paths import DEMO
from shapeshift.runtime_models.bake import bake
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import BadFile, ObjectLabel
from shapeshift.runtime_models.package.package_files import ANCHORS, MANIFEST
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import package_files, write_package
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from tests.support.models import make_random_model

PLAIN = make_random_model()
MUG, MOTOR = ObjectLabel(2, "mug"), ObjectLabel(254, "a “motor”")
LABELS = np.resize(np.array([0, 2, 254, 2, 0, 0], np.uint8), len(PLAIN.anchors))
LABELLED = replace(PLAIN, labels=LABELS, objects=(MUG, MOTOR))


def geometry(model):
    return Evaluator(model).geometry(0.0)


@pytest.mark.parametrize("ending", ["", ".shift"])
@pytest.mark.parametrize("features", ["float32", "uint8"])
def test_labels_come_back_and_nothing_else_changes(tmp_path, ending, features):
    path = tmp_path / f"a{ending}"
    write_package(LABELLED, path, features)
    found = read_package(path)
    assert found.labels.dtype == np.uint8 and np.array_equal(found.labels, LABELS)
    assert found.objects == (MUG, MOTOR)
    write_package(PLAIN, tmp_path / f"b{ending}", features)
    plain = read_package(tmp_path / f"b{ending}")
    for one, other in zip(geometry(found), geometry(plain), strict=True):
        assert np.array_equal(one, other)


def test_a_package_without_labels_has_not_one_byte_of_them():
    files = package_files(PLAIN, "float32")
    assert b"labels" not in files[ANCHORS] and "objects" not in json.loads(files[MANIFEST])
    # The bundled package was written before there were labels.
    before = read_package(DEMO)
    assert before.labels is None and before.objects == ()


def test_taking_anchors_takes_their_labels():
    rows = np.arange(len(LABELS))[::-3]
    few = LABELLED.with_anchors(rows)
    assert np.array_equal(few.labels, LABELS[rows]) and few.objects == LABELLED.objects
    assert PLAIN.with_anchors(rows).labels is None


def test_baked_splats_have_the_labels_of_their_anchors():
    baked = bake(LABELLED, 0.0)
    there = geometry(LABELLED)[3] >= 1 / 255
    assert np.array_equal(baked.labels, np.repeat(LABELS, LABELLED.splats_per_anchor)[there])
    assert bake(PLAIN, 0.0).labels is None


def test_info_counts_splats_and_knows_names(tmp_path):
    write_package(LABELLED, tmp_path / "a.shift")
    facts = describe(read_model(tmp_path / "a.shift"), tmp_path / "a.shift")
    counts = {str(n): int((LABELS == n).sum()) * PLAIN.splats_per_anchor for n in (0, 2, 254)}
    assert facts["labels"] == counts and facts["label_names"] == {"2": "mug", "254": MOTOR.name}
    assert "labels" not in describe(PLAIN, DEMO)


def manifest(**entries):
    def change(folder):
        path = folder / MANIFEST
        rows = json.loads(path.read_text()) | entries
        path.write_text(json.dumps({k: v for k, v in rows.items() if v is not None}))

    return change


def labels(array):
    def change(folder):
        old = dict(np.load(folder / ANCHORS))
        old = {k: v for k, v in (old | {"labels": array}).items() if v is not None}
        np.savez(folder / ANCHORS, **old)

    return change


def row(label=1, name="x"):
    return {"label": label, "name": name}


N = len(LABELS)
BROKEN = {
    "short": (labels(LABELS[:-1]), "labels are uint8 of shape (99,), expected uint8 of (100,)"),
    "empty": (labels(LABELS[:0]), "of shape (0,), expected uint8 of (100,)"),
    "a column": (labels(LABELS[:, None]), "of shape (100, 1)"),
    "whole numbers": (labels(LABELS.astype(np.int64)), "labels are int64"),
    "floats": (labels(np.full(N, np.nan)), "labels are float64"),
    "text": (labels(LABELS.astype("U3")), "labels holds <U3; plain numbers"),
    "objects pickled": (labels(np.array([None] * N)), "labels holds object; plain numbers"),
    "says nothing": (labels(np.full(N, 255, np.uint8)), "the label 255, which no object has"),
    "an unknown one": (labels(np.full(N, 7, np.uint8)), "the label 7, which no object has"),
    "gone": (labels(None), "scene.json has 'objects', but a/anchors.npz lacks the array 'labels'"),
    "no objects": (manifest(objects=None), "has 'labels', but scene.json lacks 'objects'"),
    "no list": (manifest(objects={"mug": 2}), "'objects' is an object; a list of objects"),
    "not rows": (manifest(objects=["mug"]), "a list of objects in braces"),
    "name twice": (manifest(objects=[row(2), row(254)]), 'the name "x" is taken by another'),
    "label twice": (manifest(objects=[row(2), row(2, "y")]), "object 1: the label 2 is taken"),
    "label 0": (manifest(objects=[row(0)]), "'label' is 0; a whole number from 1 to 254"),
    "label 255": (manifest(objects=[row(255)]), "'label' is 255; a whole number from 1 to 254"),
    "true": (manifest(objects=[row(True)]), "'label' is true; a whole number"),
    "a number": (manifest(objects=[row(2.0)]), "'label' is 2.0; a whole number"),
    "no name": (manifest(objects=[row(2, "")]), "'name' is \"\"; one line of text"),
    "two lines": (manifest(objects=[row(2, "a\nb")]), "'name' is \"a\\nb\"; one line of text"),
    "many": (manifest(objects=[row()] * 255), "'objects' has 255 rows; at most 254 fit"),
}


@pytest.mark.parametrize("how", BROKEN)
def test_wrong_labels_are_one_sentence(tmp_path, how):
    write_package(LABELLED, tmp_path / "a")
    break_it, words = BROKEN[how]
    break_it(tmp_path / "a")
    with pytest.raises(BadFile) as failure:
        read_model(tmp_path / "a")
    said = str(failure.value)
    assert words in said and "\n" not in said and len(said.replace(str(tmp_path), "")) < 300


def test_objects_without_anchors_may_be_named(tmp_path):
    absent = replace(PLAIN, labels=np.zeros(N, np.uint8), objects=(MUG,))
    write_package(absent, tmp_path / "a.shift")
    assert read_package(tmp_path / "a.shift").objects == (MUG,)


def test_labels_are_charged(tmp_path):
    many = replace(make_random_model(anchors=40_000, features=1), labels=np.zeros(40_000, np.uint8))
    write_package(many, tmp_path / "a.shift")
    with pytest.raises(BadFile, match="memory"):
        read_package(tmp_path / "a.shift", Reading(memory_gb=4e-4))
    assert len(read_package(tmp_path / "a.shift").labels) == 40_000
