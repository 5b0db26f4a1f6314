"""What a run leaves on disk when memory, the disk or its numbers end it, and what it says then."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyopencl
import pytest

from shapeshift.app import progress
from shapeshift.app.cli import main
from shapeshift.app.errors import UsageError
from shapeshift.app.training.saving import cameras_path, check_writable, resume_hint
from shapeshift.app.training.train import doubts as doubts_of
from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.calibration import outlier_views
from shapeshift.training.calibration.outlier_views import failed_modalities
from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint, write_checkpoint
from shapeshift.training.photos import FEW, load_photos, validate_views
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer

STEPS = 12


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Capture:
    return make_balls(tmp_path_factory.mktemp("balls"), size=32, views=6, test_views=1)


@pytest.fixture
def at_step(monkeypatch):
    """Lets something happen to the run before a step."""

    def arm(step: int, do) -> None:
        plain = Trainer.one_step

        def one_step(trainer: Trainer):
            if trainer.iteration == step:
                do(trainer)
            return plain(trainer)

        monkeypatch.setattr(Trainer, "one_step", one_step)

    return arm


@pytest.fixture
def no_memory():
    """A switch: from then on the device has no memory left."""
    device, pool = open_device(), open_device().pool

    def none_left(size: int):
        raise pyopencl.MemoryError("allocate", pyopencl.status_code.MEM_OBJECT_ALLOCATION_FAILURE)

    yield lambda *_: object.__setattr__(device, "pool", none_left)
    object.__setattr__(device, "pool", pool)


def train(balls: Capture, out: Path, capsys) -> tuple[int, str]:
    words = ["train", str(balls.folder), "--out", str(out), "--iterations", str(STEPS)]
    code = main([*words, "--max-anchors", "150"])
    return code, capsys.readouterr().err


def test_memory_that_ends_leaves_the_scene(balls, tmp_path, at_step, no_memory, capsys):
    at_step(7, no_memory)
    out = tmp_path / "a.shift"
    code, said = train(balls, out, capsys)
    assert code == 2 and "memory was full after 7 steps" in said and str(out) in said
    assert read_model(out).provenance["iterations"] == 7
    assert read_checkpoint(checkpoint_path(out))[1]["iteration"] == 7


def test_memory_that_is_not_there_is_one_sentence(balls, tmp_path, no_memory, capsys):
    no_memory()
    code, said = train(balls, tmp_path / "a.shift", capsys)
    assert code == 2 and "not enough memory to begin" in said and "max-splats" not in said


def test_another_state_for_which_memory_lacks_changes_nothing(balls, no_memory):
    trainer = Trainer(open_device(), balls, TrainSettings(iterations=5, max_anchors=150))
    before, _ = trainer.checkpoint()
    fewer = {n: a[:-3] if n.split(".")[0] in ("anchors", "features") else a
             for n, a in trainer.adam.state().items()}  # fmt: skip
    no_memory()
    with pytest.raises(RuntimeError, match="no room"):
        trainer.load_state(fewer)
    after, _ = trainer.checkpoint()
    for name in before:  # of photos that were not looked at yet, NaN
        np.testing.assert_array_equal(before[name], after[name])


def test_numbers_that_end_in_the_last_step_are_not_kept(balls, tmp_path, at_step, capsys):
    def spoil(trainer: Trainer) -> None:
        state = trainer.adam.state()
        state["weights.value"][::7] = np.nan
        trainer.adam.load(state)

    at_step(STEPS - 1, spoil)
    code, said = train(balls, tmp_path / "a.shift", capsys)
    assert code == 0 and "what is kept is the last good state" in said
    assert np.isfinite(read_model(tmp_path / "a.shift").features).all()


def test_a_disk_that_is_gone_leaves_the_scene_elsewhere(
    balls, tmp_path, at_step, capsys, monkeypatch
):
    folder = tmp_path / "there"

    def unplug(_) -> None:
        folder.rmdir()
        folder.write_bytes(b"")

    at_step(6, unplug)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    code, said = train(balls, folder / "a.shift", capsys)
    (elsewhere,) = (tmp_path / "temporary").glob("shapeshift-*")
    assert code == 2 and str(elsewhere) in said
    assert read_model(elsewhere / "a.shift").provenance["iterations"] == STEPS


def test_a_place_where_nothing_can_be_written_is_refused_at_once(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(UsageError, match="name another place"):
        check_writable(tmp_path / "file" / "deeper" / "a.shift")
    check_writable(tmp_path / "new" / "a.shift")
    assert not (tmp_path / "new").exists()


def test_refined_cameras_lie_beside_the_scene(balls, tmp_path, capsys):
    """Of the training photos, by their names in the capture; stated poses need no such file."""
    out, word = tmp_path / "a.shift", ["train", str(balls.folder), "--iterations", str(STEPS)]
    assert main([*word, "--out", str(out), "--poses", "refine"]) == 0
    assert "beside the stated ones" in capsys.readouterr().err
    found = read_camera_list(cameras_path(out))
    train = [photo for photo in balls.photos if photo.split == "train"]
    assert found.names == tuple(p.path.relative_to(balls.folder).as_posix() for p in train)
    moved, places = read_checkpoint(checkpoint_path(out))[0]["poses.moved"], []
    for photo, eye_from_found in zip(train, moved, strict=True):
        places.append((photo.view.world_from_eye.matrix() @ eye_from_found)[:3, 3])
    eyes = [view.world_from_eye.position for view in found.views]
    np.testing.assert_allclose(eyes, places, atol=1e-9)
    assert main([*word, "--out", str(tmp_path / "b.shift")]) == 0
    assert not cameras_path(tmp_path / "b.shift").exists()


def test_what_a_full_disk_can_go_on_from(tmp_path):
    path = tmp_path / "a.checkpoint.npz"
    assert resume_hint(path) == "make room and train again"
    write_checkpoint(path, {"a": np.zeros(3)}, {"iteration": 40})
    assert resume_hint(path) == "make room, and --resume goes on from step 40"


def test_a_checkpoint_that_does_not_fit_leaves_no_part(tmp_path, monkeypatch):
    path = tmp_path / "a.checkpoint.npz"
    write_checkpoint(path, {"a": np.zeros(3)}, {})
    monkeypatch.setattr("numpy.savez", lambda file, **_: (_ for _ in ()).throw(OSError(28, "full")))
    with pytest.raises(OSError):
        write_checkpoint(path, {"a": np.ones(3)}, {})
    monkeypatch.undo()
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert not read_checkpoint(path)[0]["a"].any()


def test_few_photos_and_missing_masks_are_spoken_of(balls):
    photos = load_photos(balls, "train", 1, "object")
    kept, doubts = validate_views(photos, "object")
    assert kept == photos and len(doubts) == 2 and "RGB has 6 training photos only" in doubts[0]
    single = [next(photo for photo in photos if photo.modality == "RGB")]
    assert "RGB has 1 training photo only" in validate_views(single, "object")[1][0]
    many = [replace(p, modality="RGB", masked=True) for p in photos * 3]
    assert validate_views(many, "object") == (many, []) and len(many) > FEW
    some = [replace(p, masked=i % 4 > 0) for i, p in enumerate(many)]
    kept, doubts = validate_views(some, "object")
    assert len(kept) == 27 and all(p.masked for p in kept) and "9 photos" in doubts[0]
    fewer = [p for p in photos if p.modality == "Thermal"]
    assert validate_views(many + fewer, "ignore")[1][0].endswith(
        'can share them: fixed = "offset,scale,rotation,opacity" in the file of --settings.'
    )
    most = [replace(p, masked=i % 4 == 0) for i, p in enumerate(many)]
    kept, doubts = validate_views(most, "object")
    assert len(kept) == len(most) and "count as a whole" in doubts[0]
    for masks in ("valid", "ignore"):
        assert validate_views(some, masks) == (some, [])


def test_a_scene_that_shows_nothing_is_called_that(balls):
    trainer = Trainer(open_device(), balls, TrainSettings(iterations=150, max_anchors=600))
    for _ in trainer.steps():
        pass
    assert failed_modalities(trainer) == []
    state = trainer.adam.state()
    trainer.adam.load(state | {"anchors.value": state["anchors.value"] + np.float32(1000)})
    assert "RGB, Thermal: the pictures are no nearer" in failed_modalities(trainer)[0]


def test_the_look_for_photos_that_do_not_fit_tells_how_far_it_is_and_can_be_ended(
    balls, monkeypatch
):
    """Every photo of every modality counts, and Ctrl-C in the middle says that the scene is whole;
    the next look begins anew."""
    trainer = Trainer(open_device(), balls, TrainSettings(iterations=30, max_anchors=200))
    for _ in trainer.steps():
        pass
    monkeypatch.setattr(outlier_views, "failed_modalities", lambda trainer: [])
    count = sum(map(len, trainer.schedule.photos.values()))
    told, done, tracked, draw = [], [], progress.tracked, outlier_views.drawn

    def noted(work, what):
        told.append((len(work), what))
        for item in tracked(work, what):
            done.append(item)
            yield item

    def drawn(trainer, photo):
        if ends and len(done) == 3:
            raise KeyboardInterrupt
        return draw(trainer, photo)

    monkeypatch.setattr(progress, "tracked", noted)
    monkeypatch.setattr(outlier_views, "drawn", drawn)
    for ends in (True, False):
        done.clear()
        lines, ended = doubts_of(trainer)
        assert ended is ends and len(done) == (3 if ends else count)
        if ends:
            assert lines == [
                "The scene is complete; not every photo was looked at for what does not fit."
            ]
    assert told == 2 * [(count, "looking for photos that do not fit")]
