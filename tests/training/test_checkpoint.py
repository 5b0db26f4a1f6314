"""What a run goes on with: the checkpoint that it wrote, and the photos that it began with."""

import json
import shutil
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.checkpoint import (
    checkpoint_path,
    contents_of,
    read_checkpoint,
    refuse_other_capture,
    write_checkpoint,
)
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer

SETTINGS = TrainSettings(iterations=1, grow=False, max_anchors=100)


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Capture:
    return make_balls(tmp_path_factory.mktemp("balls"), size=24, views=4, test_views=1)


def test_a_checkpoint_of_other_numbers_is_refused(tmp_path):
    """A file that is whole and was written by somebody else, or by a version without a seal."""
    path = checkpoint_path(tmp_path / "a.shift")
    state, notes = {"a": np.arange(6.0).reshape(2, 3)}, {"iteration": 3, "settings": {}}
    write_checkpoint(path, state, notes)
    assert read_checkpoint(path)[1] == notes
    with np.load(path) as file:
        sealed = str(file["notes"])
    for other, text in (
        ({"a": state["a"].reshape(3, 2)}, sealed),
        ({"a": state["a"].astype("f4")}, sealed),
        ({}, sealed),
        (state | {"b": np.zeros(1)}, sealed),
        (state, sealed.replace("3", "-3")),
        (state, json.dumps(notes)),
        (state, "[]"),
        (state, "{"),
    ):
        arrays: dict[str, Any] = {**other, "notes": np.array(text)}
        np.savez(path, **arrays)
        with pytest.raises(BadFile, match=r"delete it, and train anew without --resume"):
            read_checkpoint(path)


def test_a_run_goes_on_with_its_own_photos_alone(balls, tmp_path):
    """By content: other pictures under the same names, other places, more photos, fewer."""
    shutil.copytree(balls.folder, tmp_path / "moved")
    before = contents_of(balls)
    assert len(before) == len(balls.photos)
    moved = read_capture(tmp_path / "moved")
    refuse_other_capture(moved, before)  # the folder may lie elsewhere
    first, second = moved.photos[:2]
    name = first.path.relative_to(moved.folder).as_posix()
    pose = first.view.world_from_eye
    turned = replace(pose, wxyz=tuple(-c for c in pose.wxyz))  # the same rotation

    def with_pose(pose):
        other = replace(first, view=replace(first.view, world_from_eye=pose))
        return replace(moved, photos=(other, *moved.photos[1:]))

    refuse_other_capture(with_pose(turned), before)
    far = replace(pose, position=tuple(c + 0.1 for c in pose.position))
    with pytest.raises(BadFile, match=rf"another capture than .* \({name} .* stands elsewhere\)"):
        refuse_other_capture(with_pose(far), before)
    fewer = replace(moved, photos=moved.photos[1:])
    with pytest.raises(BadFile, match=r"is not there\); give the one that the run began with"):
        refuse_other_capture(fewer, before)
    with pytest.raises(BadFile, match="is new"):
        refuse_other_capture(moved, contents_of(fewer))
    first.path.write_bytes(second.path.read_bytes())
    with pytest.raises(BadFile, match=rf"{name} .* is another picture"):
        refuse_other_capture(moved, before)


def test_a_checkpoint_of_another_capture_spoils_nothing(device, balls, tmp_path):
    trainer = Trainer(device, balls, SETTINGS)
    state, notes = trainer.checkpoint()
    fewer = replace(balls, photos=tuple(p for p in balls.photos if p is not balls.photos[0]))
    with pytest.raises(BadFile, match="another capture than"):
        Trainer(device, fewer, SETTINGS, (state, notes))


def test_a_photo_that_could_not_be_read_may_be_mended(device, balls, tmp_path):
    shutil.copytree(balls.folder, tmp_path / "moved")
    moved = read_capture(tmp_path / "moved")
    broken, other = moved.photos[:2]
    whole = broken.path.read_bytes()
    broken.path.write_bytes(whole[:100])
    trainer = Trainer(device, balls, SETTINGS)
    trainer.capture = moved
    trainer.forget_photo(f"{broken.path}: the image is cut off.")
    broken.path.write_bytes(whole)
    refuse_other_capture(moved, trainer.contents)
    other.path.write_bytes(whole)
    with pytest.raises(BadFile, match="is another picture"):
        refuse_other_capture(moved, trainer.contents)
