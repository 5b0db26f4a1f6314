"""Training plain splats: growing by the rules of 3DGS, quality, bits, and what is written."""

import os
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.training.train_baselines import checkpoint_of, is_unfinished
from shapeshift.rasterizer.reference import rotations
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.splats.layers.layer_list import (
    LIST,
    layer_name,
    write_layer_list,
)
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.baselines.plain import (
    AFTER_RESET,
    SMALLER,
    PlainTrainer,
    apply_densification,
    choose_densification,
    extent_of,
    one_modality,
    reset_opacity,
    split_splats,
)
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.baselines.plain_step import GROUPS
from shapeshift.training.checkpoint import read_checkpoint
from shapeshift.training.evaluation.evaluate import evaluate_model
from shapeshift.training.first_anchors.first_anchors import neighbour_distance, photo_colors
from shapeshift.training.synthetic.balls import STOPS, make_balls
from tests.support.training.training_runs import run, run_keeping

ROOT = Path(__file__).resolve().parents[3]
SETTINGS = PlainSettings(iterations=100, splats=4000, max_splats=6000, grow_every=20, sh_degree=2)


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    made = make_balls(tmp_path_factory.mktemp("balls"), size=100, views=16, test_views=3)
    return read_capture(made.folder)  # as another process has it


STEPS = (1, 20, 21, 45)  # 20: right after a change of the splats; 45: after two


@pytest.fixture(scope="module")
def rgb(device, balls, tmp_path_factory) -> tuple[PlainTrainer, dict]:
    """Trained, and the checkpoints after STEPS."""
    begun = PlainTrainer(device, one_modality(balls, STOPS[0].name), SETTINGS)
    whole, kept = run_keeping(begun, tmp_path_factory.mktemp("kept"), *STEPS)
    return whole, dict(zip(STEPS, kept, strict=True))


@pytest.fixture(scope="module")
def trained(device, balls, rgb) -> list[PlainTrainer]:
    others = [PlainTrainer(device, one_modality(balls, s.name), SETTINGS) for s in STOPS[1:]]
    return [rgb[0], *map(run, others)]


def state_of(count: int, scale: float = 0.01, seed: int = 0) -> dict[str, np.ndarray]:
    """An optimiser's state of splats of one size, all opaque enough to stay."""
    rng = np.random.default_rng(seed)
    shapes = {"means": (3,), "scales": (3,), "wxyz": (4,), "opacity": (), "base": (3,),
              "rest": (3, 3)}  # fmt: skip
    state = {"steps": np.array(7)}
    for name in GROUPS:
        for part in ("value", "mean", "square"):
            rows = rng.normal(size=(count, *shapes[name]))
            state[f"{name}.{part}"] = rows.astype(np.float32)
    state["scales.value"][:] = np.log(scale)
    return state


def test_small_splats_are_cloned_and_large_ones_split_the_strongest_first():
    state = state_of(6)
    state["scales.value"][[1, 3], 2] = np.log(0.2)  # one long axis is enough
    stats = np.array([[5, 1], [9, 3], [0, 0], [8, 2], [1, 1], [4, 1]], np.float32)
    settings = PlainSettings(grow_threshold=2.5, max_splats=9, splats=6)
    change = choose_densification(state, stats, settings, extent=10.0)
    # pulls 5, 3, 0, 4, 1, 4: over the threshold 0, 3, 5 and 1; room for three
    assert not change.gone.any()
    assert change.cloned.tolist() == [0, 5] and change.split.tolist() == [3]
    out = apply_densification(state, change, np.random.default_rng(0))
    assert {len(out[f"{name}.{part}"]) for name in GROUPS for part in ("value", "mean")} == {9}
    stay = [0, 1, 2, 4, 5]
    for name in GROUPS:
        for part in ("value", "mean", "square"):
            np.testing.assert_array_equal(out[f"{name}.{part}"][:5], state[f"{name}.{part}"][stay])
        np.testing.assert_array_equal(out[f"{name}.value"][5:7], state[f"{name}.value"][[0, 5]])
        assert not out[f"{name}.mean"][5:].any() and not out[f"{name}.square"][5:].any()
    np.testing.assert_allclose(
        out["scales.value"][7:], state["scales.value"][[3, 3]] - np.log(SMALLER), rtol=1e-6
    )
    assert out["steps"] == 7


def test_what_is_transparent_or_broken_goes_and_nothing_for_its_size():
    state, stats = state_of(4), np.full((4, 2), 100.0)
    state["opacity.value"][:] = [-9, np.nan, 1, 1]
    state["scales.value"][3] = np.log(1000.0)  # a hundred extents
    settings = PlainSettings()
    change = choose_densification(state, stats, settings, extent=10.0)
    assert change.gone.tolist() == [True, True, False, False]
    assert not set(np.flatnonzero(change.gone)) & {*change.cloned, *change.split}
    state["opacity.value"][:] = -9  # somebody has to stay
    assert not choose_densification(state, stats, settings, 10.0).gone.any()


def test_rates_by_the_length_of_the_run():
    """Never faster, nor faster at the end, for being longer; places' 6 times those of 3DGS."""
    rates = {steps: PlainSettings().rates(steps) for steps in (1, 400, 401, 1000, 1001, 30000)}
    assert rates[1] == rates[400] and rates[401] == replace(rates[1000], decay=0.1)
    assert rates[1001] == rates[30000] == replace(rates[1000], decay=0.03)
    shortest, short = asdict(rates[400]), asdict(rates[401])
    assert shortest.pop("decay") == short.pop("decay") == 0.1
    assert all(shortest[name] == 2 * value for name, value in short.items())
    assert short["means"] == pytest.approx(6 * 1.6e-4, rel=0.05)


def test_a_full_scene_does_not_grow():
    settings = PlainSettings(max_splats=5, splats=5)
    change = choose_densification(state_of(8), np.full((8, 2), 50.0), settings, 10.0)
    assert not len(change.cloned) and not len(change.split)


def test_halves_are_drawn_from_the_splat():
    """Their places have its mean and covariance: 2 x 20,000 draws, five standard errors."""
    sigma, wxyz = np.array([0.3, 0.05, 0.01]), np.array([0.5, -0.5, 0.1, 0.7])
    count = 20_000
    values = {
        "means": np.tile([1.0, 2, 3], (count, 1)), "scales": np.tile(np.log(sigma), (count, 1)),
        "wxyz": np.tile(wxyz, (count, 1)), "opacity": np.zeros(count),
    }  # fmt: skip
    means = split_splats(values, np.random.default_rng(0))["means"]
    turn = rotations(wxyz[None])[0]
    local = (means - [1.0, 2, 3]) @ turn  # along the splat's own axes
    assert np.abs(local.mean(0) / sigma).max() < 5 / np.sqrt(2 * count)
    covariance = local.T @ local / len(local) / np.outer(sigma, sigma)
    assert np.abs(covariance - np.eye(3)).max() < 5 * np.sqrt(2 / (2 * count))


def test_a_reset_leaves_nothing_brighter_than_a_hundredth():
    state = state_of(50)
    state["opacity.value"][:10] = -7
    out = reset_opacity(state)
    opacity = 1 / (1 + np.exp(-out["opacity.value"]))
    assert opacity.max() == pytest.approx(AFTER_RESET, rel=1e-5)
    np.testing.assert_array_equal(out["opacity.value"][:10], state["opacity.value"][:10])
    assert not out["opacity.mean"].any() and not out["opacity.square"].any()
    assert state["opacity.value"].max() > 0  # the one given is left alone


def test_the_extent_is_that_of_the_cameras(balls):
    views = [p.view for p in balls.photos]
    eyes = np.array([v.world_from_eye.position for v in views])
    far = np.linalg.norm(eyes - eyes.mean(0), axis=1).max()
    assert extent_of(views) == pytest.approx(1.1 * far)
    assert extent_of(views[:1]) > 0


def test_first_scales_are_the_distances_to_the_nearest():
    """Of a line of points 1, 2, 4 ... apart, by hand; and of so few that there are no three."""
    points = np.zeros((5, 3))
    points[:, 1] = [0, 1, 3, 7, 15]
    wanted = [[1, 3, 7], [1, 2, 6], [2, 3, 4], [4, 6, 7], [8, 12, 14]]
    np.testing.assert_allclose(
        neighbour_distance(points), np.sqrt(np.mean(np.square(wanted), axis=1))
    )
    assert neighbour_distance(points[:2]).tolist() == [1, 1] and neighbour_distance(
        points[:1]
    ).tolist() == [1]


def test_first_colours_are_the_photos(device, balls):
    trainer = PlainTrainer(device, one_modality(balls, "Thermal"), SETTINGS)
    photos = trainer.schedule.photos["Thermal"]
    colors = photo_colors(np.array([[0.0, 0, 0], [0, 500.0, 0]]), photos, (0.0, 0.0, 0.0))
    assert (colors[1] == 0.5).all()  # on no photo
    assert 0 < colors[0].max() < 1 and np.ptp(colors[0]) < 1e-6  # heat is grey


def test_a_hundred_steps_reach_a_picture(trained):
    psnr = trained[0].held_out_psnr(99) | trained[1].held_out_psnr(99)
    assert psnr["RGB"] > 26 and psnr["Thermal"] > 31, psnr
    for trainer in trained:
        assert trainer.guard.rollbacks == 0
        photos = trainer.schedule.photos[trainer.stop.name]
        first = trainer.first_values(photos, lambda *_: None)
        assert len(first["means"]) < trainer.count <= SETTINGS.max_splats


def same_state(state: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> None:
    """All from which a run goes on, the sums that decide about growing included."""
    assert state.keys() == wanted.keys()
    for name, values in wanted.items():
        np.testing.assert_array_equal(state[name], values, err_msg=name)


def test_the_same_seed_gives_the_same_bits(device, balls, rgb):
    capture = one_modality(balls, "RGB")
    same_state(run(PlainTrainer(device, capture, SETTINGS), 21).checkpoint()[0], rgb[1][21][0])
    other = run(PlainTrainer(device, capture, replace(SETTINGS, seed=1)), 1).checkpoint()[0]
    assert not np.array_equal(other["base.value"], rgb[1][1][0]["base.value"])


@pytest.mark.parametrize("step", STEPS)
def test_a_run_that_goes_on_ends_with_the_same_bits(device, balls, rgb, step):
    """Each goes on to where the next begins, the last to the end."""
    whole, kept = rgb
    after = next((later for later in STEPS if later > step), None)
    capture = one_modality(balls, "RGB")
    again = PlainTrainer(device, capture, SETTINGS, resume=kept[step])
    assert again.iteration == step and again.start_s > 0
    wanted = kept[after][0] if after else whole.checkpoint()[0]
    same_state(run(again, after).checkpoint()[0], wanted)
    if after is None:  # one that was done already trains nothing, and is what it was
        done = PlainTrainer(device, capture, SETTINGS, resume=again.checkpoint())
        assert run(done).iteration == SETTINGS.iterations
        np.testing.assert_array_equal(done.splats().means, again.splats().means)


def test_a_checkpoint_of_something_else_is_refused(device, balls, rgb):
    state = rgb[1][1][0], dict(rgb[1][1][1])
    with pytest.raises(BadFile, match="not of plain splats of 'Thermal'"):
        PlainTrainer(device, one_modality(balls, "Thermal"), SETTINGS, resume=state)
    del state[1]["plain_splats_of"]  # as those of anchors
    with pytest.raises(BadFile, match="not of plain splats of 'RGB'"):
        PlainTrainer(device, one_modality(balls, "RGB"), SETTINGS, resume=state)


ONE_THREAD = """
import sys
from pathlib import Path
from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.read_capture import read_capture
from tests.training.baselines.test_plain import SETTINGS, run
from shapeshift.training.baselines.plain import PlainTrainer, one_modality
from shapeshift.training.checkpoint import write_checkpoint
capture = one_modality(read_capture(Path(sys.argv[1])), "RGB")
trainer = run(PlainTrainer(open_device("cpu"), capture, SETTINGS), 45)  # over two changes
write_checkpoint(Path(sys.argv[2]), *trainer.checkpoint())
"""


def test_one_thread_gives_the_same_bits_as_all(balls, rgb, tmp_path):
    out = tmp_path / "one.npz"
    environment = {**os.environ, "POCL_MAX_PTHREAD_COUNT": "1", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", ONE_THREAD, str(balls.folder), str(out)]
    subprocess.run(command, check=True, cwd=ROOT, env=environment, timeout=120)
    same_state(read_checkpoint(out)[0], rgb[1][45][0])


def test_degrees_come_one_after_the_other(device, balls):
    settings = replace(SETTINGS, iterations=90, grow=False, sh_degree=3)
    trainer = PlainTrainer(device, one_modality(balls, "RGB"), settings)
    seen = []
    for now in trainer.steps():
        seen.append(trainer.step.used)
        rest = trainer.device.download(trainer.adam["rest"])
        assert not rest[:, trainer.step.used :].any() and now.anchors == trainer.count
        if now.iteration == 12:
            break
    assert seen == [0, 0, 0, 3, 3, 3, 8, 8, 8, 15, 15, 15]


def test_growing_never_ends_unsettled(device, balls):
    trainer = PlainTrainer(device, one_modality(balls, "RGB"), replace(SETTINGS, iterations=85))
    settled = [trainer.settled for _ in trainer.steps()]
    assert settled[18] and not settled[19] and not settled[25]  # changed at 20, the last time
    assert settled[-1]


def test_a_broken_state_is_turned_back(device, balls):
    settings = replace(SETTINGS, iterations=180, grow=False)
    trainer = PlainTrainer(device, one_modality(balls, "RGB"), settings)
    for now in trainer.steps():
        if now.iteration == 120:
            state = trainer.adam.state()
            state["means.value"][:] = np.nan
            trainer.adam.load(state)
    assert trainer.guard.rollbacks == 1 and trainer.rate_scale == 0.5
    assert np.isfinite(trainer.splats().means).all()
    assert trainer.held_out_psnr(99)["RGB"] > 26


def test_the_folder_draws_what_was_trained(trained, device, balls, tmp_path):
    out = tmp_path / "splats"
    layers = [(t.stop, t.splats()) for t in trained]
    written = write_layer_list(layers, out)
    assert written == sum(f.stat().st_size for f in out.iterdir())
    for path in (out, out / LIST):
        model = read_model(path)
        assert model.stops == balls.stops and model.mode == "exclusive"
    facts = describe(model, out / LIST)
    assert facts["splats"] == sum(t.count for t in trained) and facts["sh_degree"] == 2
    for name, score in evaluate_model(device, model, balls).items():
        trainer = next(t for t in trained if t.stop.name == name)
        assert score.psnr_db == pytest.approx(trainer.held_out_psnr(99)[name], abs=0.02)
        assert score.alive <= trainer.count


def test_what_cannot_be_trained_is_refused(device, balls):
    with pytest.raises(BadFile, match="'Xray' has no training photos"):
        one_modality(balls, "Xray")
    for wrong in ({"sh_degree": 4}, {"splats": 0}, {"iterations": None}, {"depth_share": -1}):
        with pytest.raises(ValueError):
            PlainSettings(**wrong)


def one_splat() -> PlainSplats:
    row = np.zeros((1, 3), np.float32)
    return PlainSplats(
        row, row + 0.1, np.array([[1, 0, 0, 0]], np.float32), np.array([0.5], np.float32), row[None]
    )


def test_names_of_stops_become_names_of_files():
    assert layer_name(3, Stop("a/../b: ä", 0.0)) == "3_a____b___.ply"
    assert layer_name(0, Stop("x" * 500, 0.0)) == f"0_{'x' * 40}.ply"


def test_what_a_killed_run_left_is_written_into(tmp_path):
    """Models without their list, each with a checkpoint beside the folder."""
    out = tmp_path / "splats"
    files = [out / "0_a.ply", out / "1_b.ply"]
    assert not is_unfinished(out, files)
    out.mkdir()
    (out / ".shapeshift-0123456789abcdef.part").touch()
    assert is_unfinished(out, files)  # killed in the first
    files[0].touch()
    assert not is_unfinished(out, files)  # somebody else's, of the same name
    checkpoint_of(out, files[0]).touch()
    assert is_unfinished(out, files)
    (out / "mine.txt").touch()
    assert not is_unfinished(out, files)


def test_only_a_folder_of_ours_is_written_into(tmp_path):
    layers = [(Stop("a", 0.0), one_splat()), (Stop("b", 1.0), one_splat())]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("keep")
    with pytest.raises(BadFile, match="wanted is a new folder"):
        write_layer_list(layers, tmp_path / "mine")
    with pytest.raises(BadFile, match="wanted is a new folder"):
        write_layer_list(layers, tmp_path / "mine.shift")
    write_layer_list(layers, tmp_path / "new")
    write_layer_list(layers, tmp_path / "new")  # again
    assert len(read_model(tmp_path / "new").means) == 2


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("{", "not JSON"),
        ("[]", r"is \[\]; one object in braces is wanted"),
        ('{"format": "shapeshift-layers 2"}', 'has format "shapeshift-layers 2"'),
        ('{"format": "shapeshift-layers 1", "stops": []}', "at least one stop"),
        ('{"format": "shapeshift-layers 1", "mode": "both", "stops": [STOP]}', 'is "both"'),
        ('{"format": "shapeshift-layers 1", "mode": "exclusive", "stops": [{"name": "a", "x": 0,'
         ' "kind": "rgb"}]}', "'file' is missing"),
        ('{"format": "shapeshift-layers 1", "mode": "exclusive", "stops": [STOP, {"name": "b", '
         '"x": 1, "kind": "rgb", "file": "0_a.ply"}]}', "names one file twice"),
        ('{"format": "shapeshift-layers 1", "mode": "exclusive", "stops": [{"name": "a", "x": 0,'
         ' "kind": "rgb", "file": "../0_a.ply"}]}', "the name of a file beside it"),
        ('{"format": "shapeshift-layers 1", "mode": "exclusive", "stops": [{"name": "a", "x": 0,'
         ' "kind": "rgb", "file": "b.ply"}]}', "is not in"),
    ],
)  # fmt: skip
def test_a_list_that_is_wrong_is_refused(tmp_path, text, match):
    write_layer_list([(Stop("a", 0.0), one_splat())], tmp_path)
    stop = '{"name": "a", "x": 0, "kind": "rgb", "file": "0_a.ply"}'
    (tmp_path / LIST).write_text(text.replace("STOP", stop))
    with pytest.raises(BadFile, match=match):
        read_model(tmp_path)


def test_a_list_without_end_is_refused(tmp_path):
    (tmp_path / LIST).write_bytes(b" " * ((1 << 20) + 1))
    with pytest.raises(BadFile, match="bytes; at most 1,048,576 are read"):
        read_model(tmp_path)
