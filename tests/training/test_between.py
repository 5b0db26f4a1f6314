"""Between the stops: the measure of midpoints, each cure's gradients, and what it does to a run."""

import csv
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tests.support.training.fit_scenes as fit_scenes
from shapeshift.app import cli
from shapeshift.rasterizer.reference import finite_differences
from shapeshift.runtime_models.model import BadFile, ControlEncoding, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.pose import Pose, View, perspective
from shapeshift.training.between import Between, Way, add, alike, blended, shared, straight_pull
from shapeshift.training.checkpoint import read_checkpoint, write_checkpoint
from shapeshift.training.evaluation.evaluate import Painter
from shapeshift.training.evaluation.midpoints import Frequencies, between, draw_in_training, draw_of
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.reference import decode_reference
from shapeshift.training.settings import TrainSettings
from shapeshift.training.step import Step
from shapeshift.training.train import Trainer
from tests.support.training.situations import LAYOUT, VOXEL, situation
from tests.support.training.training_runs import bits, run

ROOT = Path(__file__).resolve().parents[2]
STOPS = (Stop("A", 0.0), Stop("C", 1.0), Stop("B", 0.4))
SETTINGS = TrainSettings(encoding="even", iterations=200, grow=False, max_anchors=500)
LAYOUTS = {
    "as usual": LAYOUT,
    "2 layers": replace(LAYOUT, layers=2),
    "scale fixed": replace(LAYOUT, fixed=("scale",)),
}


@pytest.fixture(scope="module")
def rig(tmp_path_factory) -> Capture:
    """A capture of one shape whose two modalities were photographed from the same places."""
    return fit_scenes.make_shapes(tmp_path_factory.mktemp("rig"), "shared", rig=True)


def a_view(x: float = 0.0, wxyz: tuple = (1.0, 0, 0, 0), size: tuple = (8, 6)) -> View:
    pose = Pose(np.array([x, 0.0, 3.0]), np.array(wxyz))
    return View(pose, perspective(0.8, size), 0.05, 100.0, size)


def a_photo(seed: int, view: View, weight: np.ndarray | None = None) -> LoadedPhoto:
    rgba = np.random.default_rng(seed).integers(0, 256, (*view.size[::-1], 4)).astype(np.uint8)
    return LoadedPhoto(view, "A", rgba, weight, f"{seed}.png")


# The measure.


def figures(picture, steps: int = 10):
    """Of pictures made by x alone, with both ends' coverage 1."""
    return between(lambda view, x: picture(x), [a_view()], 0.2, 0.7, steps)


def ends() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    first, last = np.random.default_rng(1).random((2, 6, 8, 3))
    return first, last, np.ones((6, 8))


def test_a_blend_is_without_fault():
    first, last, cover = ends()
    found = figures(lambda x: ((0.7 - x) / 0.5 * first + (x - 0.2) / 0.5 * last, cover))
    assert (found.low, found.high) == (0.2, 0.7) and found.blend_db > 99
    assert found.flash < 1e-12 and found.emptied == 0
    assert found.apart == pytest.approx(np.abs(first - last).mean())
    assert (found.jump, found.around) == (pytest.approx(1), pytest.approx(1))


def test_a_jump_in_the_middle_is_as_many_even_steps_as_there_are():
    first, last, cover = ends()
    found = figures(lambda x: (first if x < 0.43 else last, cover))
    assert found.flash == 0 and found.around == pytest.approx(1)
    assert found.jump == pytest.approx(10)


def test_a_flash_and_a_hole_are_told():
    first, last, cover = ends()
    middle = np.full_like(first, 2.0)
    found = figures(lambda x: (middle, 0.25 * cover) if 0.44 < x < 0.46 else (
        (first if x < 0.44 else last), cover))  # fmt: skip
    assert found.flash == pytest.approx((2 - np.maximum(first, last)).mean())
    assert found.emptied == pytest.approx(0.75) and found.around > 2


def test_stops_that_are_alike_divide_by_no_zero():
    first, _, cover = ends()
    found = figures(lambda x: (first, cover))
    assert found.apart == 0 and found.jump == 0 and found.around == 0 and found.blend_db == 100


def test_a_broken_picture_never_makes_a_good_figure():
    first, _, cover = ends()
    found = figures(lambda x: (first * (np.nan if 0.3 < x < 0.4 else 1), cover))
    assert not found.flash < 1 and not found.blend_db > 0 and not found.around < 9


def test_a_package_shows_what_training_showed(device, rig):
    trainer = run(Trainer(device, rig, replace(SETTINGS, iterations=60)))
    view = trainer.held_out[0].view
    behind = (1.0, 1.0, 1.0)
    draws = draw_in_training(trainer, behind), draw_of(Painter(device, trainer.model()), behind)
    for x in (0.0, 0.37, 1.0):
        (image, cover), (again, cover_again) = (draw(view, x) for draw in draws)
        assert image.shape == (48, 48, 3) and cover.shape == (48, 48)
        assert np.abs(image - again).max() < 0.01 and np.abs(image - again).mean() < 1e-4
        assert np.abs(cover - cover_again).mean() < 1e-4


# Where a step looks.


def test_ways_follow_from_seed_and_step_and_lie_between_neighbours():
    cure = Between("pictures", 0.25, 3, STOPS, {})
    again = Between("pictures", 0.25, 3, STOPS, {})
    ways = [cure.way(i, "A") for i in range(2000)]
    assert ways == [again.way(i, "C") for i in range(2000)]
    taken = [way for way in ways if way is not None]
    assert 0.22 < len(taken) / len(ways) < 0.28
    assert {(w.low.name, w.high.name) for w in taken} == {("A", "B"), ("B", "C")}
    assert all(w.low.x < w.high.x and 0 < w.share < 1 for w in taken)
    assert ways != [Between("pictures", 0.25, 4, STOPS, {}).way(i, "A") for i in range(2000)]


def test_shapes_leave_the_photos_own_stop_towards_its_neighbours():
    """As often as its colours have a part in the blend: 1 - share, a third of a way on average."""
    cure = Between("shapes", 0.5, 3, STOPS, {})
    for name, neighbours in (("A", {"B"}), ("B", {"A", "C"}), ("C", {"B"})):
        taken = [way for i in range(4000) if (way := cure.way(i, name)) is not None]
        assert 0.47 < len(taken) / 4000 < 0.53
        assert {way.low.name for way in taken} == {name}
        assert {way.high.name for way in taken} == neighbours
        assert np.mean([way.share for way in taken]) == pytest.approx(1 / 3, abs=0.02)
    psi = ControlEncoding(3, 0.5, 0.25)
    rows = Way(STOPS[2], STOPS[1], 0.25, 0.0).psi_of_heads(psi)
    wanted = 0.75 * psi.encode(0.4) + 0.25 * psi.encode(1.0)
    np.testing.assert_allclose(rows[:4], np.tile(wanted, (4, 1)), atol=1e-7)
    assert rows[4].tolist() == psi.encode(0.4).tolist()


@pytest.mark.parametrize(
    "cure", [Between("none", 1.0, 0, STOPS, {}), Between("splats", 0.0, 0, STOPS, {}),
             Between("photos", 1.0, 0, STOPS[:1], {"A": []})]
)  # fmt: skip
def test_who_asks_for_nothing_looks_at_stops_alone(cure):
    assert cure.middle is None and all(cure.way(i, "A") is None for i in range(50))


def test_photos_are_paired_by_place_turn_lens_and_size():
    here = a_photo(0, a_view())
    turned = Pose(np.array([0.0, 0, 3]), np.array([-1.0, 0, 0, 0]))  # the same turn
    same = a_photo(1, replace(a_view(), world_from_eye=turned))
    elsewhere = a_photo(2, a_view(0.5))
    aside = a_photo(3, a_view(wxyz=(np.cos(0.01), 0, np.sin(0.01), 0)))
    larger = a_photo(4, a_view(size=(16, 12)))
    wider = a_photo(5, replace(a_view(), tangents=(-0.6, 0.6, -0.4, 0.4)))
    assert shared([here, elsewhere], [aside, larger, same, wider]) == [(here, same)]
    assert not alike(here.view, aside.view) and alike(here.view, same.view)
    assert shared([], [here]) == [] == shared([here], [])
    left = np.zeros((6, 8), np.float32)
    left[:, :4] = 1
    masked = replace(here, weight=left), replace(same, weight=1 - left)
    assert shared([masked[0]], [masked[1]]) == []  # nothing counts in both


def test_a_capture_without_shared_places_is_refused(device, tmp_path):
    apart = fit_scenes.make_shapes(tmp_path, "shared", views=3, tests=1)
    with pytest.raises(BadFile, match=r"same place.*--between shapes"):
        Trainer(device, apart, replace(SETTINGS, between="photos"))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 1.0])
def test_a_blended_photo_lies_over_every_background_as_the_blend_of_both(share):
    a, b = a_photo(6, a_view()), a_photo(7, a_view())
    both = blended(a, b, share)
    for background in ((0.0, 0.0, 0.0), (1.0, 0.3, 0.7)):
        wanted = (1 - share) * a.over(background) + share * b.over(background)
        assert np.abs(both.over(background) - wanted).max() < 1.1 / 255
    assert both.weight is None and both.depth is None
    weight = np.linspace(0, 1, 48, dtype=np.float32).reshape(6, 8)
    assert (blended(a, replace(b, weight=weight), share).weight == weight).all()
    lower = blended(replace(a, weight=weight), replace(b, weight=1 - weight), share).weight
    assert (lower == np.minimum(weight, 1 - weight)).all()


# The pull of splats.


def a_step(device, layout, parameters: dict) -> Step:
    return Step(
        device, layout, VOXEL, Adam(device, parameters, {n: np.ones(1) for n in parameters})
    )


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_pull_is_the_gradient_of_its_term(device, name):
    layout = LAYOUTS[name]
    parameters, _, _, _ = situation(2, layout)
    step = a_step(device, layout, parameters)
    way, encoding, eye = Way(STOPS[0], STOPS[2], 0.3, 0.0), Frequencies(4), np.array([0.3, 1, 3])

    def splats(changed: dict, psi: np.ndarray) -> tuple:
        return decode_reference(layout, parameters | changed, psi, eye, VOXEL)

    ends = [encoding.encode(stop.x).astype(np.float64) for stop in (way.low, way.high)]
    low, high = (splats({}, psi) for psi in ends)
    there = 0.7 * ends[0] + 0.3 * ends[1]

    def term(changed: dict) -> float:
        total = 0.0
        for i, (a, b, value) in enumerate(zip(low, high, splats(changed, there), strict=True)):
            unit = VOXEL if i < 2 else 1  # means and scales
            total += (((value - 0.7 * a - 0.3 * b) / unit) ** 2).sum()
        return 2.5 * total / len(low[3])

    found = straight_pull(step, way, encoding, eye, VOXEL, 2.5)
    assert set(found) == {"weights", "features"}
    for name, grad in found.items():
        values = parameters[name].astype(np.float64)
        wanted = finite_differences(lambda v, name=name: term({name: v}), values)
        if name == "weights":
            wanted = layout.pack(layout.unpack(wanted))
        difference = np.abs(device.download(grad) - wanted).max() / np.abs(wanted).max()
        assert difference < 1e-5, (name, difference)


def test_no_pull_at_a_stop(device):
    parameters, _, _, _ = situation(0)
    step = a_step(device, LAYOUT, parameters)
    for share in (0.0, 1.0):
        way = Way(STOPS[0], STOPS[1], share, 0.0)
        for grad in straight_pull(step, way, Frequencies(4), np.zeros(3), VOXEL, 1.0).values():
            assert np.abs(device.download(grad)).max() < 1e-5


@pytest.mark.parametrize("count", [1, 63, 64, 65, 1000])
def test_gradients_are_added_in_place(device, count):
    mine, more = np.random.default_rng(count).normal(size=(2, count)).astype(np.float32)
    grads = {"weights": device.upload(mine), "anchors": device.upload(mine)}
    add(device, grads, {"weights": device.upload(more)})
    assert (device.download(grads["weights"]) == mine + more).all()
    assert (device.download(grads["anchors"]) == mine).all()


# Runs.


@pytest.fixture(scope="module")
def judged(device, rig):
    """A run's figures between the stops, as blends of them and with x encoded as it is, and dB at
    the stops, by its changed settings.
    """
    kept = {}

    def judge(**changed: object):
        key = tuple(changed.items())
        if key not in kept:
            psi = changed.pop("psi", None)
            trainer = Trainer(device, rig, replace(SETTINGS, **changed))
            trainer.encoding = psi or trainer.encoding
            run(trainer)
            views = [p.view for p in trainer.held_out if p.modality == "RGB"]
            draws = [
                draw_in_training(trainer, trainer.schedule.background, direct)
                for direct in (False, True)
            ]
            figures = [between(draw, views, 0, 1, 20) for draw in draws]
            kept[key] = *figures, trainer.held_out_psnr(4)
        return kept[key]

    return judge


@pytest.mark.parametrize(
    ("changed", "gain_db"),
    [
        ({"between": "photos"}, 3), ({"between": "pictures"}, 3), ({"between": "shapes"}, -0.5),
        ({"between": "splats", "between_pull": 1.0}, 2),
    ],
)  # fmt: skip
def test_every_cure_brings_midpoints_nearer_to_the_blend(judged, changed, gain_db):
    """Gains of two seeds are 3.4 and 4.4, 3.9 and 5.1, 0.2 and 1.9, 4.6 and -0.1 dB.

    Two modalities of one shape leave `shapes` little to do: it must not harm.  Its overshoot was
    1.01 times that without it, its gain 0.3 dB.
    """
    harm, (plain, _, at_stops) = 1.1 if gain_db < 0 else 1.0, judged()
    cured, _, cured_at_stops = judged(**changed)
    assert cured.blend_db > plain.blend_db + gain_db
    assert cured.flash < harm * plain.flash and cured.jump < 1.1 * plain.jump
    for name, psnr in cured_at_stops.items():
        assert psnr > at_stops[name] - 1.5, name


def test_a_blend_of_stops_needs_no_cure_of_a_narrow_encoding(judged):
    """What no photo has taught is not asked: 29.4 dB and 1.3 even steps instead of 23.1 and 6.0."""
    blended, direct, _ = judged()
    assert blended.blend_db > direct.blend_db + 4 and blended.flash < 0.3 * direct.flash
    assert blended.jump < 1.6 and direct.jump > 3


def test_frequencies_fail_where_gaussians_hold(judged):
    """The paper's comparison: x goes into the encoding as it is."""
    _, plain, _ = judged()
    _, wild, _ = judged(psi=Frequencies(16))
    assert wild.flash > 2 * plain.flash and wild.jump > 1.5 * plain.jump
    assert wild.blend_db < plain.blend_db - 2


@pytest.mark.parametrize(
    ("xs", "units", "sigma"),
    [((0, 1), 2, 0.5), ((0, 0.5, 1), 3, 0.25), ((1, 0, 0.3), 4, 1 / 6), ((0.5,), 2, 0.5),
     ((0, 0.001, 1), 64, 0.5 / 63)],
)  # fmt: skip
def test_an_encoding_for_the_stops_has_a_unit_for_each(xs, units, sigma):
    stops = tuple(Stop(str(x), x) for x in xs)
    fitted = replace(SETTINGS, encoding="stops").for_stops(stops)
    assert (fitted.control, fitted.sigma) == (units, pytest.approx(sigma))
    assert fitted.for_stops(stops) == fitted and SETTINGS.for_stops(stops) is SETTINGS


@pytest.mark.parametrize("cure", ["photos", "pictures", "splats"])
def test_the_same_seed_gives_the_same_bits_resumed_or_not(device, rig, tmp_path, cure):
    encoding = "stops" if cure == "splats" else "even"
    settings = replace(SETTINGS, iterations=40, between=cure, between_share=0.5, encoding=encoding)
    whole = run(Trainer(device, rig, settings))
    part = run(Trainer(device, rig, settings), steps=17)
    write_checkpoint(tmp_path / "c.npz", *part.checkpoint())
    resumed = run(Trainer(device, rig, settings, read_checkpoint(tmp_path / "c.npz")))
    assert bits(resumed) == bits(whole)
    assert bits(whole) != bits(run(Trainer(device, rig, replace(settings, between="none"))))


def test_growing_and_coarse_photos_go_with_it(device, rig):
    settings = replace(
        SETTINGS, grow=True, grow_every=20, coarse=4, between="photos", between_share=0.5
    )
    trainer = run(Trainer(device, rig, settings))
    assert trainer.anchors_count > 300 and min(trainer.held_out_psnr(4).values()) > 21


@pytest.mark.parametrize(
    "wrong", [{"between": "blend"}, {"between_share": 1.5}, {"between_share": -0.1},
              {"between_pull": float("nan")}, {"encoding": "wide"}, {"sigma": 0.0},
              {"thermal_smooth": -1}]
)  # fmt: skip
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong)).split("_")[0]):
        replace(SETTINGS, **wrong)


def test_the_command_takes_them_and_refuses_what_the_capture_has_not(device, rig, tmp_path, capsys):
    def train(capture: Capture, *words: str) -> int:
        fixed = ["--iterations", "30", "--max-anchors", "300", "--out", str(tmp_path / "a.shift")]
        return cli.main(["train", str(capture.folder), *fixed, *words])

    assert train(rig, "--encoding", "stops", "--between", "photos", "--balance", "RGB=2") == 0
    model = read_model(tmp_path / "a.shift")
    assert (model.encoding.d, model.encoding.sigma, model.encoding.spacing) == (2, 0.5, 1)
    settings = model.provenance["settings"]
    assert (settings["between"], settings["balance"]) == ("photos", "RGB=2")
    assert train(rig, "--sigma", "0.1") == 0  # an encoding of one's own is even
    model = read_model(tmp_path / "a.shift")
    assert (model.encoding.d, model.encoding.sigma) == (16, 0.1)
    apart = fit_scenes.make_shapes(tmp_path / "apart", "shared", views=3, tests=1)
    for words, told in (
        (("--between", "photos"), "use --between shapes or pictures"),
        (("--balance", "Heat=2"), "balance names 'Heat'; the modalities are RGB, Thermal."),
        (("--balance", "Heat"), "it is NAME=TURNS"),
        (("--encoding", "stops", "--sigma", "0.1"), "sets --control and --sigma itself"),
    ):
        assert train(apart, *words) == 2
        assert told in capsys.readouterr().err


def test_the_program_of_the_table_at_a_tiny_size(rig, tmp_path):
    program = [sys.executable, ROOT / "tools/training/between.py", rig.folder]
    program += ["--iterations", "120", "--max-anchors", "300", "--steps", "10", "--views", "2"]
    program += ["--ways", "stops", "frequencies", "--out", tmp_path / "rows.csv"]
    subprocess.run(program, check=True, timeout=120, cwd=tmp_path)
    command, machine, *lines = (tmp_path / "rows.csv").read_text().splitlines()
    assert command.startswith("# python3 tools/training/between.py") and "PoCL" in machine
    rows = list(csv.DictReader(lines))
    where = ["RGB", "Thermal", "mean", "RGB to Thermal"]
    assert [(row["way"], row["where"]) for row in rows] == [
        (way, place) for way in ("stops", "frequencies") for place in where
    ]
    for row in rows:
        assert bool(row["psnr_db"]) != bool(row["flash"])
    assert float(rows[3]["jump"]) < float(rows[7]["jump"]) and rows[3]["sweep"]
