"""Runs that grow in each of the ways, on a small capture: caps, bits, resuming."""

import argparse
import csv
import importlib.util
import runpy
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.baselines.plain import one_modality
from shapeshift.training.checkpoint import read_checkpoint, write_checkpoint
from shapeshift.training.first_anchors import first_anchors
from shapeshift.training.first_anchors.first_anchors import base_colors
from shapeshift.training.losses.losses import MIN_OPACITY_SHARE
from shapeshift.training.schedule import LIGHT_FROM
from shapeshift.training.settings import ONE_MODALITY, TrainSettings
from shapeshift.training.supervision.exposure import Exposures
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import SETTLE, Trainer
from tests.support.training.training_runs import bits, run_keeping

BASE = TrainSettings(iterations=120, grow_every=30, max_anchors=900)
FIRST = 600  # points that the capture is left with
WAYS = {
    "to the cap": {},
    "at the cap": {"max_anchors": FIRST},
    "no attributes": {"anchor_attributes": ""},
    "with light": {"anchor_attributes": "frame,stop_color,light"},
    "one base colour": {"anchor_attributes": "frame,color"},
}


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Capture:
    made = make_balls(tmp_path_factory.mktemp("balls"), size=68, views=20, test_views=2)
    return replace(made, points=made.points[:: len(made.points) // FIRST][:FIRST])


def run(trainer: Trainer, steps: int | None = None) -> Trainer:
    for now in trainer.steps():
        assert now.anchors <= trainer.anchor_cap
        if steps is not None and now.iteration >= steps:
            break
    return trainer


LONG = ("no attributes", "one base colour")


@pytest.mark.parametrize(
    "way", [pytest.param(way, marks=[pytest.mark.slow] * (way in LONG)) for way in WAYS]
)
def test_a_way_to_grow_gives_the_same_bits_whole_and_resumed(device, balls, way, tmp_path):
    settings = replace(BASE, **WAYS[way])
    whole = Trainer(device, balls, settings)
    _, kept = run_keeping(whole, tmp_path, 33, most=whole.anchor_cap)  # with some statistics
    cap = settings.max_anchors
    assert (cap == FIRST or whole.anchors_count > FIRST) and whole.anchors_count <= cap
    assert whole.densified_at > 0 and whole.guard.rollbacks == 0
    resumed = run(Trainer(device, balls, settings, *kept))
    assert bits(resumed) == bits(whole)
    untrained = Trainer(device, balls, settings).held_out_psnr(9)
    for name, psnr in whole.held_out_psnr(9).items():
        assert psnr > untrained[name] + 5, name


@pytest.mark.parametrize("by_shape", [True, False])
def test_a_cap_of_shapes_is_kept_by_a_checkpoint(device, balls, by_shape, monkeypatch, tmp_path):
    """Hulls are not carved again when a run goes on."""
    monkeypatch.setattr(first_anchors, "cap_of_shapes", lambda first, most: most + 77)
    settings = replace(BASE, max_anchors=100, max_by_shape=by_shape)
    trainer = Trainer(device, balls, settings)
    assert trainer.anchor_cap == trainer.anchors_count == 100 + 77 * by_shape
    write_checkpoint(tmp_path / "c.npz", *trainer.checkpoint())
    monkeypatch.undo()
    resumed = Trainer(device, balls, settings, read_checkpoint(tmp_path / "c.npz"))
    assert resumed.anchor_cap == trainer.anchor_cap


def test_first_base_colours_of_a_stop_are_those_of_its_photos(device, balls):
    trainer = Trainer(device, balls, BASE)
    anchors = device.download(trainer.adam["anchors"])
    groups = trainer.layout.color_groups
    assert len(groups) == 2 and "colors" not in trainer.adam.groups
    for group, stop in zip(groups, trainer.stops, strict=True):
        mine = [photo for photo in trainer.photos.train if photo.modality == stop.name]
        wanted = base_colors(anchors, mine, trainer.schedule.background)
        np.testing.assert_array_equal(device.download(trainer.adam[group]), wanted)
        assert np.ptp(wanted, axis=0).min() > 1  # the balls are no grey fog


def test_a_run_of_two_stops_ends_the_loss_of_faint_splats(device, balls, monkeypatch):
    trainer, shares = Trainer(device, balls, replace(BASE, iterations=20, max_anchors=100)), []
    gradients = trainer.step.gradients
    monkeypatch.setattr(trainer.step, "gradients", lambda *a: shares.append(a[-1]) or gradients(*a))
    run(trainer)
    assert shares[-20:] == [MIN_OPACITY_SHARE] * 7 + [0.0] * 13  # before them kernels are compiled


def test_nothing_changes_within_the_steps_that_a_picture_needs_to_settle(device, balls):
    """The end of a run is exported, so the last growing lies at least SETTLE steps before it."""
    for steps in (SETTLE + 19, SETTLE + 20, 100):
        trainer = run(Trainer(device, balls, replace(BASE, iterations=steps, grow_every=20)))
        assert trainer.settled, steps
        assert (trainer.densified_at > 0) == (steps >= SETTLE + 20)


def test_a_run_keeps_within_its_megabytes(device, balls, tmp_path):
    settings = replace(BASE, max_mb=0.085, max_anchors=12000)
    trainer = run(Trainer(device, balls, settings))
    assert FIRST < trainer.anchors_count <= trainer.anchor_cap < 12000
    assert write_package(trainer.model(), tmp_path / "a.shift") <= 0.085e6
    finite = all(np.isfinite(a).all() for a in trainer.adam.state().values())
    assert finite


@pytest.mark.parametrize("alike", [True, False])
def test_light_rests_until_its_share_of_the_run_and_where_exposures_differ(
    device, balls, alike, monkeypatch
):
    """Step 6 of 20 is the first that moves it, where photos are alike."""
    monkeypatch.setattr(Exposures, "alike", lambda self, modality: alike)
    settings = replace(BASE, **WAYS["with light"], iterations=20, grow=False)
    trainer, moved = Trainer(device, balls, settings), []
    for _ in trainer.steps():
        moved.append(bool(device.download(trainer.adam["light"]).any()))
    begun = round(LIGHT_FROM * 20)
    assert LIGHT_FROM * 20 == begun == 6, "no step lies on either side by rounding alone"
    assert moved == [False] * begun + [alike] * (20 - begun)


def test_a_checkpoint_with_one_channel_of_light_goes_on_with_one(device, balls, monkeypatch):
    """As this program wrote them before it had three."""
    monkeypatch.setattr(Exposures, "alike", lambda self, modality: True)
    settings = replace(BASE, **WAYS["with light"], iterations=20, grow=False)
    state, notes = run(Trainer(device, balls, replace(settings, iterations=12))).checkpoint()
    assert state["light.value"].shape[1] == 24
    old = state | {name: state[name][:, :8] for name in state if name.startswith("light.")}
    trainer = run(Trainer(device, balls, settings, resume=(old, notes)))
    model = trainer.model()
    assert trainer.layout.light_channels == 1 and model.light.shape[1] == 8
    assert (model.light != old["light.value"]).any(), "it still learns"
    eye, stop = np.array([0.3, 1.0, 2.5]), balls.stops[0]
    drawn = trainer.step.decode(trainer.control(stop.name), eye)
    shown = evaluate(model, stop.x, eye).color
    np.testing.assert_allclose(device.download(drawn.color), shown, rtol=0, atol=2e-5)


def start(words: list[str], monkeypatch) -> None:
    """A program of tools/, in this process."""
    root = Path(__file__).resolve().parents[3]
    monkeypatch.chdir(root)
    monkeypatch.setattr(sys, "argv", words)
    monkeypatch.setattr(sys, "path", [*sys.path])  # which it adds to
    try:
        runpy.run_path(words[0], run_name="__main__")
    except SystemExit as ended:
        assert not ended.code, ended.code


@pytest.mark.slow
def test_the_table_of_light_has_both_ways_from_their_packages(balls, tmp_path, monkeypatch):
    out = tmp_path / "light.csv"
    program = ["tools/colors/light.py", str(balls.folder), "--out", str(out)]
    # So many that photos are known to be alike, and light is learned: before, it is all zeros.
    program += ["--iterations", "160", "--max-anchors", "300"]
    start(program, monkeypatch)
    rows = list(csv.DictReader(out.read_text().splitlines()[2:]))
    assert [row["modality"] for row in rows] == 2 * ["RGB", "Thermal", "mean"]
    size = [int(row["package_bytes"]) for row in rows]
    # 24 bytes an anchor, less what deflating saves, and two arrays more with their names.
    assert 300 * 12 < size[3] - size[0] < 300 * 24 + 1000
    assert all(float(row["psnr_db"]) > 10 for row in rows)


@pytest.mark.slow
def test_the_table_of_ways_has_a_row_for_each(balls, tmp_path, monkeypatch):
    out = tmp_path / "growth.csv"
    ways = ["no growth", "default"]
    program = ["tools/training/growth.py", str(balls.folder), "--out", str(out)]
    program += ["--iterations", "90", "--grow-every", "30", "--max-anchors", "400", "--ways", *ways]
    start(program, monkeypatch)
    lines = out.read_text().splitlines()
    assert lines[0].startswith("# python3 tools/training/growth.py ")
    rows = list(csv.DictReader(lines[2:]))
    last = [row for row in rows if row["steps"] == "90"]
    assert [row["way"] for row in last if row["modality"] == "mean"] == ways
    assert {row["modality"] for row in last} == {"RGB", "Thermal", "mean"}
    assert last[3]["psnr_db"] != last[0]["psnr_db"]  # of the same 400 anchors, some have moved
    for row in rows:
        assert float(row["psnr_db"]) > 10 and int(row["package_bytes"]) > 10_000
        assert 0 < int(row["splats"]) <= 5 * int(row["anchors"])


@pytest.fixture(scope="module")
def ways():
    """The program tools/training/ways.py."""
    path = Path(__file__).resolve().parents[3] / "tools" / "training" / "ways.py"
    spec = importlib.util.spec_from_file_location("ways", path)
    sys.modules["ways"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    del sys.modules["ways"]


@pytest.mark.parametrize("modality", ["RGB", ""])
def test_a_way_changes_what_train_would_take_for_the_capture(ways, balls, modality, monkeypatch):
    capture = one_modality(balls, modality) if modality else balls
    monkeypatch.setattr(ways, "read_capture", lambda folder: capture)

    def settings_of(way, **given) -> TrainSettings:
        options = argparse.Namespace(downscale=1, **({"max_anchors": None} | given))
        (found,) = ways.rows_of_turn({}, balls.folder, options, BASE, way, lambda turn: [turn])
        return found.settings

    usual = ONE_MODALITY if modality else {"max_by_shape": True}
    assert settings_of({}) == replace(BASE, **usual)
    assert settings_of({"grow": False}) == replace(BASE, grow=False, **usual)
    assert settings_of({}, max_anchors=900) == settings_of({}, max_mb=0.5) == BASE
    lacks = {"frame": "color,light", "color": "frame,light", "light": "frame,color"}
    if not modality:
        lacks = {"frame": "stop_color", "color": "frame", "light": "frame,stop_color"}
    for attribute, left in lacks.items():
        changed = settings_of(ways.without(attribute))
        assert changed == replace(BASE, **usual | {"anchor_attributes": left})
