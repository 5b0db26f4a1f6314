"""What is told of a file as a whole: its coding, how full it is, how far it spreads."""

import numpy as np
import pytest

from shapeshift.runtime_models.lint import lint_whole
from shapeshift.runtime_models.lint.lint import judge
from shapeshift.runtime_models.lint.lint_whole import (
    LARGEST_SCENE,
    MOST_LAYERS,
    TELLING,
    fill_ratio,
    sample_of,
)
from shapeshift.runtime_models.model import BadFile, SplatLayers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.formats import read_plain, read_raw
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, RawSplats, Reading
from tests.support.splats.lint_scenes import cloud, copied, ours

FIXTURES = (
    ("anatomy_leg_ml3dgs", "layer*.ply", 3),
    ("splats_marcelpadilla", "*/*.splat", 11),
    ("splats_misc", "**/minimal*", 6),
    ("splats_playcanvas", "*.ply", 3),
    ("splats_playcanvas", "*.spz", 1),
    ("splats_playcanvas", "playcanvas-logo", 1),
    ("splats_playcanvas/playbot", "[1-6]_0", 6),
)


def uncoded(raw: RawSplats, scales: bool, opacity: bool) -> RawSplats:
    """The same as a program writes it that forgets the logarithm or the logit."""
    wrong = copied(raw)
    if scales:
        wrong.scales[:] = np.exp(raw.scales)
    if opacity:
        wrong.opacity[:] = 1 / (1 + np.exp(-raw.opacity))
    return wrong


def fill_of(plain: PlainSplats | SplatLayers) -> float:
    return fill_ratio(sample_of(plain.means, plain.scales, plain.opacity))


@pytest.mark.parametrize("scales, opacity", [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("count", [TELLING - 1, TELLING, 2000, 40_000])
def test_metres_and_light_in_the_place_of_logarithms_and_logits(count, scales, opacity):
    right = cloud(count, 0.02)
    right.opacity[:4] = [-6, 6, -5, 5]
    wrong = uncoded(right, scales, opacity)
    plain = judge(copied(wrong), Reading())
    want = judge(right, Reading())
    told = " ".join(f.what for f in plain.findings)
    # a hundred splats fill nothing, however large they are: nothing is told of the scales
    assert ("no logarithms" in told) == (scales and count >= 2000), told
    assert ("no logits" in told) == (opacity and count >= TELLING), told
    assert all(f.count == count and f.repaired for f in plain.findings)
    if count >= 2000:
        np.testing.assert_allclose(plain.scales, want.scales, rtol=3e-6)
        np.testing.assert_allclose(plain.opacity, want.opacity, rtol=3e-6, atol=1e-7)
        with pytest.raises(BadFile, match="--strict"):
            judge(wrong, Reading(strict=True))


@pytest.mark.parametrize("extent, sigma", [(3.0, 0.02), (100.0, 0.3), (3000.0, 20.0), (5e5, 900.0)])
def test_good_scenes_of_any_unit_are_left_alone(extent, sigma):
    """In millimetres or of a city: no scale is below 1, yet they are logarithms."""
    raw = cloud(20_000, sigma, extent)
    if sigma > 1:
        raw.scales.clip(0, None, out=raw.scales)
    before = copied(raw)
    plain = judge(raw, Reading(strict=True))
    assert plain.findings == ()
    np.testing.assert_allclose(plain.scales, np.exp(before.scales), rtol=3e-7)


def test_opacities_of_one_kind_are_logits_as_the_format_says():
    for logits in (np.full(500, 0.9), np.linspace(0.31, 0.95, 500), np.linspace(0, 0.89, 500)):
        raw = cloud(500, 0.02)
        raw.opacity[:] = logits
        assert judge(raw, Reading(strict=True)).findings == ()


@pytest.mark.parametrize("name, number", [("opacity", 1.5), ("opacity", -0.1), ("scales", -0.1)])
def test_one_number_beside_the_sample_says_that_the_coding_is_right(name, number):
    wrong = uncoded(cloud(40_000, 0.02), True, True)
    getattr(wrong, name)[12_345] = number  # every third row is looked at: this one is
    getattr(wrong, name)[12_346] = number
    what = {"opacity": "logits", "scales": "logarithms"}[name]
    plain = judge(wrong, Reading(allow_huge=True))
    assert not any(f"no {what}" in f.what for f in plain.findings)


def by_hand(raw: RawSplats) -> float:
    """The fill ratio one splat at a time."""
    sigma = np.exp(raw.scales.astype(float))
    seen = 1 / (1 + np.exp(-raw.opacity.astype(float))) >= 1 / 255
    low, high = np.percentile(raw.means.astype(float), (1, 99), axis=0)
    sides = sorted(high - low + 2 * np.median([sorted(s)[2] for s in sigma]))
    total = 0.0
    for s, visible in zip(sigma, seen, strict=True):
        _, middle, longest = sorted(s)
        if visible:
            total += min(np.pi * middle * longest / (sides[1] * sides[2]), 1.0)
    return total


@pytest.mark.parametrize("count", [1, 2, 100, 3000])
@pytest.mark.parametrize("sigma", [1e-4, 0.02, 1.0, 50.0])
def test_the_fill_ratio_is_the_sum_of_areas(count, sigma):
    raw = cloud(count, sigma)
    want = by_hand(raw)
    np.testing.assert_allclose(fill_of(ours(raw)), want, rtol=1e-5)


def test_a_part_of_a_large_file_tells_the_whole():
    raw = cloud(100_001, 0.02)
    np.testing.assert_allclose(fill_of(ours(raw)), by_hand(raw), rtol=0.05)


@pytest.mark.parametrize("limit_is_above", [True, False])
def test_the_gate_is_at_its_limit(monkeypatch, limit_is_above):
    raw = cloud(3000, 0.02)
    raw.scales[:], raw.opacity[:] = np.log(100.0), 3  # each covers the scene
    ratio = fill_of(ours(raw))
    assert MOST_LAYERS < ratio < 3000
    if limit_is_above:
        monkeypatch.setattr(lint_whole, "MOST_LAYERS", ratio)
        assert len(judge(raw, Reading(strict=True)).means) == 3000
        return
    monkeypatch.setattr(lint_whole, "MOST_LAYERS", np.nextafter(ratio, 0))
    with pytest.raises(BadFile, match=r"a.ply: 2,\d+ splats would lie over every pixel.*--allow"):
        judge(copied(raw), Reading())
    assert len(judge(raw, Reading(allow_huge=True, strict=True)).means) == 3000


def test_splats_that_nobody_sees_fill_nothing():
    raw = cloud(5000, 0.02)
    raw.scales[:], raw.opacity[:] = np.log(100.0), -30
    assert fill_of(ours(raw)) == 0
    assert len(judge(raw, Reading(strict=True)).means) == 5000


def test_outliers_do_no_harm():
    """As MCMC leaves them: a core of 3 m, a few splats 20,000 km away."""
    raw = cloud(20_000, 0.02)
    core = fill_of(ours(raw))
    raw.means[::200] *= 2e7 / 1.5
    plain = judge(raw, Reading(strict=True))
    assert plain.findings == () and plain.origin == (0, 0, 0) and len(plain.means) == 20_000
    np.testing.assert_allclose(fill_of(plain), core, rtol=0.1)


@pytest.mark.parametrize("part, refused", [(0.5, False), (1.5, True), (1e10, True)])
def test_positions_that_are_no_places_are_refused(part, refused):
    raw = cloud(500, 0.02)
    raw.means[:] = np.random.default_rng(0).choice([-0.5, 0.5], (500, 3)) * LARGEST_SCENE * part
    if not refused:
        assert len(judge(raw, Reading()).means) == 500
        return
    with pytest.raises(BadFile, match=r"a.ply: its positions spread over .* export it again"):
        judge(raw, Reading())


@pytest.mark.parametrize("folder, pattern, count", FIXTURES)
def test_no_real_file_is_found_fault_with(data, folder, pattern, count):
    files = sorted((data / folder).glob(pattern))
    assert len(files) == count
    for path in files:
        model = read_model(path, Reading(strict=True))
        told = [found for found in model.findings if "axes in use" not in found.what]
        assert told == [], path  # an .spz that does not name its axes is told of, and no more
        assert model.origin == (0, 0, 0)
        assert fill_of(model) < 20, path


@pytest.mark.parametrize("scales, opacity", [(True, False), (False, True), (True, True)])
def test_real_files_written_without_their_coding_are_told(data, scales, opacity):
    for path in sorted((data / "anatomy_leg_ml3dgs").glob("layer*.ply")):
        wrong = uncoded(read_raw(path, Reading()), scales, opacity)
        plain, want = judge(wrong, Reading()), read_plain(path)
        assert len(plain.findings) == scales + opacity
        np.testing.assert_allclose(plain.scales, want.scales, rtol=1e-6)
        np.testing.assert_allclose(plain.opacity, want.opacity, rtol=1e-5, atol=1e-6)


def test_real_files_whose_metres_are_not_read_as_such_are_not_drawn(data):
    """Scales by a factor too large, logarithms none the less: the gate is what stands before it."""
    raw = read_raw(data / "anatomy_leg_ml3dgs" / "layer0.ply", Reading())
    raw.scales += np.float32(np.log(1000))
    with pytest.raises(BadFile, match="splats would lie over every pixel"):
        judge(raw, Reading())
