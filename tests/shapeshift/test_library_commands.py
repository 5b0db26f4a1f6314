"""What a library gives beside the commands: exports, comparisons, figures, motion, training."""

import json

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.app.command_line import parse
from tests.support.splat_scenes import random_layers
from tests.support.touch_scene import TOUCH

SMALL = (64, 48)


@pytest.fixture(scope="module")
def demo() -> ss.Scene:
    return ss.load(ss.DEMO)


# ---- files and figures


def test_exports_are_those_of_the_command(tmp_path):
    from shapeshift.app.commands import export as command

    scene = ss.Scene.from_model(random_layers(60))
    first = scene.export(tmp_path / "a.ply")
    words = [str(first.path), "--out", str(tmp_path / "b.ply")]
    assert command.run(parse(command.Options, words, "export")) == 0
    again = ss.export(tmp_path / "a.ply", tmp_path / "c.ply")
    assert (tmp_path / "b.ply").read_bytes() == again.path.read_bytes()
    assert again.bytes == again.path.stat().st_size and again.splats == first.splats
    with pytest.raises(ss.UsageError, match=r"^out .*a\.ply is the scene that is read"):
        ss.export(tmp_path / "a.ply", tmp_path / "a.ply", overwrite=True)
    with pytest.raises(ss.UsageError, match="exists; overwrite replaces it"):
        scene.export(tmp_path / "a.ply")
    with pytest.raises(ss.BadFile, match="no ending that can be written"):
        scene.export(tmp_path / "a.xyz")
    with pytest.raises(ss.UsageError, match="plain splats cannot become a package"):
        scene.save(tmp_path / "a.shift")


def test_a_package_is_saved_whole(demo, tmp_path):
    saved = demo.save(tmp_path / "scene.shift")
    again = ss.load(saved.path)
    np.testing.assert_array_equal(again.model.features, demo.model.features)
    assert again.stops == demo.stops and saved.splats == demo.splat_count
    with pytest.raises(ss.UsageError, match="every x and every part"):
        demo.export(tmp_path / "b.shift", x=0.5)
    with pytest.raises(ss.UsageError, match="exists"):
        demo.save(saved.path)
    demo.save(saved.path, overwrite=True)


def test_a_package_of_one_object_is_its_anchors(tmp_path):
    from dataclasses import replace

    from shapeshift.runtime_models.model import ObjectLabel
    from tests.support.models import make_random_model

    labels = np.array([0, 1, 0, 1, 1, 0], np.uint8)
    model = make_random_model(anchors=6, k=2, features=4, hidden=(4,))
    whole = ss.Scene.from_model(replace(model, labels=labels, objects=(ObjectLabel(1, "mug"),)))
    for name, label in (("a", "mug"), ("b", 1)):
        saved = whole.export(tmp_path / f"{name}.shift", label=label)
        mug = ss.load(saved.path)
        assert saved.splats == mug.splat_count == 6
        np.testing.assert_array_equal(mug.model.anchors, model.anchors[labels == 1])
    with pytest.raises(ss.UsageError, match="jug"):
        whole.export(tmp_path / "c.shift", label="jug")
    plain = ss.Scene.from_model(model)
    with pytest.raises(ss.UsageError, match="label"):
        plain.export(tmp_path / "d.shift", label=1)


def test_comparing_a_scene_with_itself_and_with_another_stop(demo, tmp_path):
    same = demo.compare(demo, size=SMALL)
    assert len(same["views"]) == 8 and same["mean"]["psnr_db"] == "equal"
    other = ss.compare(f"{ss.DEMO}@RGB", demo.at("Thermal"), size=SMALL, out=tmp_path / "diff",
                       cameras=demo.views("orbit", 2))  # fmt: skip
    assert other["a"] == "workshop.shift @ RGB" and other["b"] == "workshop.shift @ Thermal"
    view = demo.views("orbit", 2)[0].resized(SMALL)
    wanted = ss.psnr(demo.render("RGB", view), demo.render("Thermal", view))
    assert other["views"][0]["psnr_db"] == pytest.approx(wanted, abs=1e-6)
    assert len(list((tmp_path / "diff").iterdir())) == 4


def test_bench_and_chart_give_rows(tmp_path):
    scene = ss.Scene.from_model(random_layers(100))  # few: the float64 reference takes its time
    row = scene.bench(frames=2, sweep=2, size=SMALL, quality_size=(32, 24))
    assert row["psnr_db"] > 60 and row["size"] == "64x48" and row["scene"] == "scene"
    json.dumps(row, allow_nan=False)
    with pytest.raises(ss.UsageError, match=r"^frames is 1, expected 2"):
        scene.bench(frames=1)
    told = []
    rows = ss.chart(scene, tmp_path / "chart", size=SMALL, frames=2, only=["exact"],
                    progress=lambda what, part: told.append(what))  # fmt: skip
    assert [row.name for row in rows] == ["exact"] == told and rows[0].psnr_db >= 100
    assert (tmp_path / "chart/chart.png").stat().st_size
    with pytest.raises(ss.UsageError, match="there is no setting 'fast'"):
        ss.chart(scene, size=SMALL, frames=2, only=["fast"])


# ---- motion


def test_a_simulation_is_that_of_the_command(tmp_path):
    from shapeshift.app.commands import simulate as command

    script = TOUCH.with_name("touch.jsonl")
    words = [str(TOUCH), "--out", str(tmp_path), "--script", str(script), "--seconds", "0.7"]
    assert command.run(parse(command.Options, words, "simulate")) == 0
    rows = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    steps = list(ss.simulate(TOUCH, script, seconds=0.7))
    news = [step.row for step in steps if len(step.row) > 2]
    assert json.loads(json.dumps(news)) == rows[1:-1]
    assert steps[-1].number == len(steps) == 63 and steps[-1].seconds == pytest.approx(0.7)
    ring = steps[-1].scene.object("ring").world_from_object.position
    assert not np.allclose(ring, steps[0].scene.object("ring").world_from_object.position)


def test_a_simulation_goes_on_for_a_while_after_its_script(tmp_path, monkeypatch):
    monkeypatch.setattr("shapeshift.api.play.AFTER_S", 0.1)
    script = tmp_path / "script.jsonl"
    script.write_text('{"t": 0.1, "do": "hand", "position": [0, 2, 0]}')
    assert len(list(ss.simulate(TOUCH, script))) == 18  # 0.2 s at 90 Hz
    assert len(list(ss.simulate(TOUCH))) == 9


def test_what_falls_falls_as_newton_says():
    """From 0.5 m up, nothing below it for 0.25 s: g t^2 / 2 within a step's rounding."""
    scene = ss.load(TOUCH).with_object("cube", position=(-0.22, 0.8, 0.05))
    steps = list(ss.simulate(scene, seconds=0.25))
    dropped = 0.8 - steps[-1].scene.object("cube").world_from_object.position[1]
    t = steps[-1].seconds
    assert dropped == pytest.approx(9.81 * t * t / 2, rel=0.06)  # of symplectic Euler: 1/(90 t)


def test_what_cannot_move_is_refused_before_the_first_step(demo):
    with pytest.raises(ss.UsageError, match="this is one model"):
        ss.simulate(demo)
    for wrong in (0, -1, float("nan"), 1e9):
        with pytest.raises(ss.UsageError, match="seconds is"):
            ss.simulate(TOUCH, seconds=wrong)
    with pytest.raises(ss.BadFile, match="is no file"):
        ss.simulate(TOUCH, "nothing.jsonl")


# ---- training


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Eight photos each of a cloud of splats in two modalities, with poses."""
    folder = tmp_path_factory.mktemp("capture")
    scene, frames = ss.Scene.from_model(random_layers(40, layers=2)), []
    for modality, x in (("RGB", 0.0), ("Thermal", 1.0)):
        for i, view in enumerate(scene.views("orbit", 8, (32, 24))):
            name = f"{modality}/{i}.png"
            scene.render(x, view).save(folder / name)
            pose = view.world_from_eye.matrix().tolist()
            frames.append({"file_path": name, "modality": modality, "transform_matrix": pose})
    focal = 24 / (2 * np.tan(0.4))
    rows = {"convention": "opengl", "w": 32, "h": 24, "fl_x": focal, "fl_y": focal,
            "modalities": [{"name": "RGB", "x": 0.0}, {"name": "Thermal", "x": 1.0}],
            "frames": frames}  # fmt: skip
    (folder / "transforms.json").write_text(json.dumps(rows))
    return folder


def test_training_gives_a_scene_and_the_same_bits_as_the_command(capture, tmp_path):
    from shapeshift.app.training import train as command

    how = {"iterations": 12, "max_anchors": 60, "points": "random", "device": "cpu"}
    told = []
    model = ss.train(capture, tmp_path / "a.shift", pace=False, progress=told.append, **how)
    words = [str(capture), "--out", str(tmp_path / "b.shift")]
    for name, value in how.items():
        words += ["--" + name.replace("_", "-"), str(value)]
    assert command.run(parse(command.Options, words, "train")) == 0
    other = ss.load(tmp_path / "b.shift")
    np.testing.assert_array_equal(model.model.anchors, other.model.anchors)
    assert [stop.name for stop in model.stops] == ["RGB", "Thermal"]
    assert [step.iteration for step in told] == list(range(1, 13)) and model.steps == 12
    assert set(model.psnr_db) == {"RGB", "Thermal"}
    assert model.render(0.5, size=SMALL).shape == (48, 64, 3)
    scores = ss.evaluate(model, capture, device="cpu")["modalities"]
    for name, db in model.psnr_db.items():
        assert scores[name]["psnr_db"] == pytest.approx(db, abs=0.01)  # another decoder, float32


def test_a_run_goes_on_from_its_checkpoint_and_ends_when_told(capture, tmp_path):
    how = {"max_anchors": 60, "points": "random", "device": "cpu", "pace": False}
    ss.train(capture, tmp_path / "a.shift", iterations=6, **how)
    more = ss.train(capture, tmp_path / "a.shift", iterations=12, resume=True, device="cpu",
                    pace=False)  # fmt: skip
    assert more.steps == 12
    short = ss.train(capture, iterations=50, progress=lambda step: step.iteration < 3, **how)
    assert short.steps == 3 and short.path is None
    with pytest.raises(ss.UsageError, match="resume goes on with the settings of the checkpoint"):
        ss.train(capture, tmp_path / "a.shift", resume=True, max_anchors=70)
    with pytest.raises(ss.UsageError, match="give out, too"):
        ss.train(capture, resume=True)


def test_photos_that_do_not_fit_into_memory_give_the_same_bits(capture, tmp_path, monkeypatch):
    """Pixels of sixteen photos of 32x24 are 37 kB at three bytes each; 20 kB hold some of them."""
    from shapeshift.training.photo_store import open_photos

    stores, store = [], open_photos.PhotoStore
    monkeypatch.setattr(
        open_photos, "PhotoStore", lambda *given: stores.append(given[-1]) or store(*given)
    )
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))  # of a run without out
    how = {"iterations": 6, "max_anchors": 60, "points": "random", "device": "cpu", "pace": False}
    whole = ss.train(capture, **how).model
    for out in (None, tmp_path / "a.shift"):
        model = ss.train(capture, out, photo_mb=0.02, **how).model
        np.testing.assert_array_equal(model.anchors, whole.anchors)
        np.testing.assert_array_equal(model.features, whole.features)
    assert stores == [20_000, 20_000]  # the first run holds all photos
    assert not (tmp_path / "a.shift.photos").exists()
    assert not [path for path in tmp_path.rglob("cache/**/*photos*") if path.is_file()]
    for wrong in (0, -1, float("nan"), float("inf")):
        with pytest.raises(ss.UsageError, match=r"^photo_mb is .*, expected MB above 0"):
            ss.train(capture, photo_mb=wrong, **how)


def test_ctrl_c_loses_nothing(capture, tmp_path):
    def interrupt(step) -> None:
        if step.iteration == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ss.train(capture, tmp_path / "a.shift", iterations=50, max_anchors=60, points="random",
                 device="cpu", progress=interrupt)  # fmt: skip
    assert [stop.name for stop in ss.load(tmp_path / "a.shift").stops] == ["RGB", "Thermal"]
    model = ss.train(capture, tmp_path / "a.shift", resume=True, iterations=8, pace=False)
    assert model.steps == 8


def test_what_a_training_does_not_know_is_refused(capture, tmp_path):
    with pytest.raises(ss.UsageError, match="no setting 'anchor' of a training; did you mean"):
        ss.train(capture, anchor=60)
    with pytest.raises(ss.UsageError, match="iterations is 0"):
        ss.train(capture, iterations=0)
    with pytest.raises(ss.BadFile, match="does not exist"):
        ss.train(tmp_path / "nowhere", iterations=1)
    for left in ("preset", "encoding", "rise", "balance"):  # what trainings had once
        with pytest.raises(ss.UsageError, match=f"^{left} left the program: .*[^-]$"):
            ss.train(capture, **{left: "fast"})
    with pytest.raises(ss.UsageError, match="no modality 'Heat'"):
        ss.evaluate(ss.DEMO, capture, modality="Heat")


def test_the_front_page_of_the_readme_runs(capture, tmp_path, monkeypatch):
    """Its five lines as they stand there: a second, not a minute; a small film of few frames."""
    import re
    import shutil
    from pathlib import Path

    text = (Path(__file__).resolve().parents[2] / "README.md").read_text()
    lines = re.search(r"## From Python\n```python\n(.*?)```", text, re.S)[1]
    assert len(lines.split("\n\n")[1].splitlines()) <= 5 and "seconds=60" in lines
    monkeypatch.chdir(tmp_path)
    shutil.copy(ss.DEMO, tmp_path / "workshop.shift")
    shutil.copytree(capture, tmp_path / "capture")
    names = {}
    lines = lines.replace("seconds=60", "seconds=1, max_anchors=60, points='random'")
    exec(lines.replace('Opened@6s")', 'Opened@6s", fps=1, size=(64, 48))'), names)
    assert names["picture"].shape == (360, 640, 3)
    assert [stop.name for stop in ss.load("scene.shift").stops] == ["RGB", "Thermal"]
    assert (tmp_path / "thermal.png").exists()
