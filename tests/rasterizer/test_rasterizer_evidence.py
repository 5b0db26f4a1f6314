"""rasterizer/ evidence against its float64 twin, the whole, other passes, finite differences."""

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.evidence import LARGEST, SILENT, STEPS, Evidence, most_in_a_tile
from shapeshift.rasterizer.project import project
from shapeshift.rasterizer.raster import rasterize, rasterize_backward
from tests.support.renderer.rasterizer_reference import (
    evidence_reference,
    finite_differences,
    project_reference,
    render_reference,
)
from tests.support.renderer.rasterizer_scenes import (
    as_double,
    device,
    off_centre_camera,
    random_splats,
    upload,
)

FORMS = ("cpu", "gpu")
STEP = 1 / STEPS  # pixels
STOP = 1e-5  # of transmittance, as the backward pass has it
SIZES = [(37, 26), (16, 16), (17, 33), (15, 1), (1, 1)]


def shown(splats: list, camera, form: str):
    projected = project(device(), *upload(splats), camera, form=form)
    return projected, bin_tiles(device(), projected, camera.size, form)


def gathered(view, labels: np.ndarray, count: int, form: str, each: int = 1) -> np.ndarray:
    found = Evidence(device(), view[0].record.shape[0], count, each, STOP)
    found.add(*view, labels, form)
    return found.sums()


def random_map(size: tuple[int, int], count: int, seed: int = 0, patch: int = 5) -> np.ndarray:
    """(H, W) uint8: patches of random labels, a tenth of them silent."""
    rng = np.random.default_rng(seed)
    small = rng.integers(0, count, (-(-size[1] // patch), -(-size[0] // patch)))
    small[rng.random(small.shape) < 0.1] = SILENT
    return np.kron(small, np.ones((patch, patch)))[: size[1], : size[0]].astype(np.uint8)


def rounding(tiles, splats: int) -> np.ndarray:
    """(N, 1) pixels: half a step for every tile that a splat lies in."""
    used = device().download(tiles.intersections)[: device().download(tiles.starts)[-1]]
    return np.bincount(used[used >= 0], minlength=splats)[:splats, None] * (STEP / 2)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("count", [1, 3, 16, 17, 60])
def test_every_entry_is_that_of_the_twin(form, size, count):
    splats, camera = random_splats(60, seed=21, scale=0.15), off_centre_camera(size)
    labels = random_map(size, count, patch=1 if count > 16 else 5)
    view = shown(splats, camera, form)
    found = gathered(view, labels, count, form)
    wanted = evidence_reference(*project_reference(*as_double(splats), camera), labels, count)
    # A tile's share is rounded to a step; float32's own error is a thousandth of that.
    assert (np.abs(found - wanted) <= rounding(view[1], 60) + 1e-5).all()


@pytest.mark.parametrize("form", FORMS)
def test_a_part_against_the_whole(form):
    size = (90, 70)
    splats, camera = random_splats(800, seed=8), off_centre_camera(size)
    splats[0][:5], splats[3][5:9] = np.nan, 0  # culled
    labels = random_map(size, 12, patch=9)
    labels[labels == SILENT] = 0
    view = shown(splats, camera, form)
    found = gathered(view, labels, 12, form)
    frame = rasterize(device(), *view, size, form=form)
    # Gradients of the picture's red by each splat's red: of label 3's pixels alone.
    for label in (0, 3):
        grad = np.zeros((3, *size[::-1]), np.float32)
        grad[0] = labels == label
        record = rasterize_backward(
            device(), *view, frame, device().upload(grad), form=form, absolute=False, weight=True
        )
        record = device().download(record)
        slack = rounding(view[1], 800)[:, 0] + 1e-4
        assert (np.abs(found[:, label] - record[:, 6]) <= slack).all()
    # All labels together: the weight of each splat, and with what is left all pixels.
    assert (np.abs(found.sum(1) - record[:, 11]) <= 12 * slack).all()
    left = device().download(frame.transmittance).sum(dtype=np.float64)
    assert abs(found.sum() + left - labels.size) < 12 * rounding(view[1], 800).sum()
    assert abs(found.sum() + left - labels.size) < 0.02 * labels.size  # and not by that alone
    assert not found[:9].any() and found.max() > 1


def test_evidence_is_what_a_splats_colour_does_to_the_pixels_of_a_label():
    size = (24, 20)
    splats, camera = as_double(random_splats(12, seed=3, scale=0.2)), off_centre_camera(size)
    labels = random_map(size, 3)
    found = evidence_reference(*project_reference(*splats, camera), labels, 3)
    for label in range(3):

        def red(color: np.ndarray, label: int = label) -> float:
            image, _ = render_reference((*splats[:4], color), camera)
            return image[0][labels == label].sum()

        slopes = finite_differences(red, splats[4])
        np.testing.assert_allclose(found[:, label], slopes[:, 0], atol=1e-6)


@pytest.mark.parametrize("form", FORMS)
def test_any_order_of_tiles_gives_the_same_table(form):
    size = (70, 50)
    splats, camera = random_splats(500, seed=5, scale=0.2), off_centre_camera(size)
    labels, view = random_map(size, 5), shown(splats, camera, form)
    whole = gathered(view, labels, 5, form)
    grid = view[1].grid
    order = np.random.default_rng(1).permutation(grid[0] * grid[1])
    apart = Evidence(device(), 500, 5, min_transmittance=STOP)
    for tile in order:  # one tile speaks, the others are silent
        alone = np.full_like(labels, SILENT)
        y, x = 16 * (tile // grid[0]), 16 * (tile % grid[0])
        alone[y : y + 16, x : x + 16] = labels[y : y + 16, x : x + 16]
        apart.add(*view, alone, form)
    np.testing.assert_array_equal(apart.sums(), whole)
    for _ in range(3):
        np.testing.assert_array_equal(gathered(view, labels, 5, form), whole)


def test_both_forms_agree_within_a_step_an_intersection():
    size = (120, 90)
    splats, camera = random_splats(3000, seed=6, scale=0.1), off_centre_camera(size)
    labels, view = random_map(size, 16, patch=7), shown(splats, camera, "cpu")
    one, other = (gathered(view, labels, 16, form) for form in FORMS)
    # They stop at the same transmittance, one a block and one a pixel: what is behind is 1e-5.
    assert (np.abs(one - other) <= 2 * rounding(view[1], 3000) + 1e-3).all()


@pytest.mark.parametrize("form", FORMS)
def test_two_labels_merged_have_their_sum(form):
    size = (64, 48)
    splats, camera = random_splats(400, seed=9), off_centre_camera(size)
    labels, view = random_map(size, 4), shown(splats, camera, form)
    apart = gathered(view, labels, 4, form)
    merged = gathered(view, np.where(labels == 3, np.uint8(1), labels), 4, form)
    slack = 3 * rounding(view[1], 400)[:, 0] + 1e-5
    assert (np.abs(merged[:, 1] - apart[:, 1] - apart[:, 3]) <= slack).all()
    assert not merged[:, 3].any()
    np.testing.assert_array_equal(merged[:, [0, 2]], apart[:, [0, 2]])


@pytest.mark.parametrize("form", FORMS)
def test_a_silent_picture_says_nothing_and_renaming_changes_nothing_else(form):
    size = (40, 40)
    splats, camera = random_splats(200, seed=2), off_centre_camera(size)
    view = shown(splats, camera, form)
    assert not gathered(view, np.full(size, SILENT, np.uint8), 255, form).any()
    labels = random_map(size, 3)
    renamed = np.where(labels == 2, np.uint8(254), labels)
    far, near = gathered(view, renamed, 255, form), gathered(view, labels, 3, form)
    np.testing.assert_array_equal(far[:, [0, 1, 254]], near)
    assert not far[:, 2:254].any()


@pytest.mark.parametrize("form", FORMS)
def test_rows_of_several_splats_are_their_sums(form):
    size = (50, 50)
    splats, camera = random_splats(300, seed=4), off_centre_camera(size)
    labels, view = random_map(size, 6), shown(splats, camera, form)
    single = gathered(view, labels, 6, form)
    found = gathered(view, labels, 6, form, each=5)
    np.testing.assert_array_equal(found, single.reshape(60, 5, 6).sum(1))


def test_passes_are_as_many_as_a_tile_needs():
    labels = np.zeros((32, 48), np.uint8)
    labels[:16, :16] = np.arange(256).reshape(16, 16)
    assert most_in_a_tile(labels) == 256
    assert most_in_a_tile(np.tile(np.arange(200, dtype=np.uint8)[:, None] // 16, (1, 50))) == 16
    apart = np.repeat(np.arange(20, dtype=np.uint8), 16)[None].repeat(16, 0)
    assert most_in_a_tile(apart) == 1  # twenty labels, each in its own tile


def test_a_table_that_would_wrap_is_emptied_before(monkeypatch):
    """2^32 steps are four million pixels: of many views, and of one view alone."""
    size = (64, 64)
    splats, camera = random_splats(1, scale=40.0), off_centre_camera(size)
    splats[3][:] = 0.99
    labels, view = np.ones(size, np.uint8), shown(splats, camera, "cpu")
    once = gathered(view, labels, 2, "cpu")
    assert once[0, 1] > 4000  # of 4096 pixels
    views = LARGEST // (STEPS * 4096) + 40
    many = Evidence(device(), 1, 2)
    for _ in range(views):
        many.add(*view, labels, "cpu")
    np.testing.assert_array_equal(many.sums(), views * once)
    # A picture with more pixels than that is counted in larger steps.
    monkeypatch.setattr("shapeshift.rasterizer.evidence.LARGEST", 4096 * STEPS // 4)
    coarse = gathered(view, labels, 2, "cpu")
    np.testing.assert_allclose(coarse, once, atol=16 * 8 / STEPS)
    mixed = Evidence(device(), 1, 2)
    for _ in range(3):
        mixed.add(*view, labels, "cpu")
    np.testing.assert_allclose(mixed.sums(), 3 * once, atol=3 * 16 * 8 / STEPS)


def test_what_does_not_fit_is_refused():
    size = (40, 24)
    splats, camera = random_splats(20), off_centre_camera(size)
    view, good = shown(splats, camera, "cpu"), np.zeros(size[::-1], np.uint8)
    for labels in (good.T, good[:10], good.astype(np.int32)):
        with pytest.raises(ValueError, match="is not of this view"):
            Evidence(device(), 20, 2).add(*view, labels)
    with pytest.raises(ValueError, match="has the label 2, the largest is 1"):
        Evidence(device(), 20, 2).add(*view, good + np.uint8(2))
    with pytest.raises(ValueError, match="20 splats are drawn, not 40"):
        Evidence(device(), 40, 2).add(*view, good)
    for labels in (0, 256):
        with pytest.raises(ValueError, match="1 to 255 are summed"):
            Evidence(device(), 20, labels)
    with pytest.raises(ValueError, match="no whole number of rows of 3"):
        Evidence(device(), 20, 2, each=3)
