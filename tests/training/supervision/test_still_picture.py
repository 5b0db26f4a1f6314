"""The picture behind a subject that turns: against the tracer's own wall, at each threshold."""

import io

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.photos import LoadedPhoto, load_photos
from shapeshift.training.supervision.still_background import (
    FEWEST,
    LEAST_TOLERANCE,
    STILL,
    cut_out,
    still_picture,
    subject_mask,
    tolerance_of,
)
from tools.synthetic.strangers import KINDS, make_stranger, mask_of

RNG = np.random.default_rng
SIZE = (24, 32)  # rows, columns
VIEW = KINDS["turntable"].views(1, SIZE[::-1])[0]


def before_wall(count: int, covers: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, H, W, 3) photos of a wall of noise, and it; the first `covers` show noise in a block."""
    rng = RNG(0)
    wall = rng.integers(0, 256, (*SIZE, 3), np.uint8)
    photos = np.stack([wall] * count)
    photos[:covers, 8:16, 8:24] = rng.integers(0, 256, (covers, 8, 16, 3), np.uint8)
    return photos, wall


def before_rim(*shown: int, count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """The same with a subject below a rim: below row 8 so many photos show the wall in one row
    after the other, and none in those that follow.
    """
    photos, wall = before_wall(count, 0)
    subject = RNG(2).integers(0, 256, photos.shape, np.uint8)
    for row, some in enumerate((*shown, *[0] * (SIZE[0] - 8 - len(shown)))):
        photos[some:, 8 + row] = subject[some:, 8 + row]
    return photos, wall


@pytest.mark.parametrize("shown, known", [(FEWEST, True), (FEWEST - 1, False)])
def test_what_few_photos_show_is_known_from_the_least_number_on(shown, known):
    photos, wall = before_rim(15, 11, 8, 6, 4, shown)
    found = still_picture(list(photos))
    assert found.tolerance == LEAST_TOLERANCE
    assert found.known[:13].all() and (found.rgb[:13] == wall[:13]).all()
    assert found.known[13].all() if known else not found.known[13].any()
    assert not found.known[14:].any()
    # Of the 16 rows that move; a pixel or two of 512 are alike by chance.
    assert found.hidden == pytest.approx((6 if known else 5) / 16, abs=3 / 512)


@pytest.mark.parametrize(
    "rows, careful, at_all",
    [
        ((12,), True, True),  # of 16 beside it: 0.3 are 4.8
        ((11,), False, True),
        ((9,), False, True),  # more than half are left
        ((8,), False, False),
        ((12, 9, 7, 5, 3), True, True),  # 2 of 5 are few
        ((12, 9, 7, 5, 4, 2), False, False),
    ],
)
def test_of_those_beside_it_most_must_show_it(rows, careful, at_all):
    """The first rule decides whether there is a turntable, the second what is behind it."""
    photos, _ = before_rim(16, *rows)
    found, last = still_picture(list(photos)), 8 + len(rows)
    assert found.known[:last].all()
    assert found.known[last].all() if at_all else not found.known[last].any()
    assert not found.known[last + 1 :].any()
    assert found.hidden == pytest.approx((len(rows) + careful) / 16, abs=3 / 512)


@pytest.mark.parametrize("others, known", [(8, True), (9, False)])
def test_what_photos_have_that_show_no_background_beside_it_is_the_subject(others, known):
    """Sixteen of 22 photos have a colour below the rim that others have, too: a plain table
    that turns is alike in as many photos, wherever its rim is.  STRAY: 8 of 16.
    """
    photos, wall = before_rim(22, 16, count=31)
    photos[22 : 22 + others, 9] = wall[9]
    assert still_picture(list(photos)).known[9].all() == known


def test_a_table_of_two_colours_is_not_its_wall():
    """Alike in half the photos everywhere, which no rule of numbers alone tells from a wall."""
    photos, wall = before_rim(14, 10, 7, 5, 3, count=20)
    plain = photos.copy()
    for i in range(20):
        colors = np.array([(200, 30, 30), (30, 200, 30)], np.uint8)
        plain[i, 8:] = colors[RNG(i).integers(0, 2, SIZE)[8:]]
    photos = np.where(
        np.abs(photos - wall.astype(int)).max(axis=3, keepdims=True) > 0, plain, photos
    )
    found = still_picture(list(photos.astype(np.uint8)))
    assert found.known[:13].mean() > 0.95
    assert not found.known[14:].any()


def test_a_subject_that_is_alike_by_chance_is_not_the_background():
    """Grey from 100 to 160 in equal steps: several photos within any tolerance, none sharply."""
    photos, _ = before_wall(24, 24)
    photos[:, 8:16, 8:24] = np.linspace(100, 160, 24)[:, None, None, None]
    assert not still_picture(list(photos)).known[9:15, 9:23].any()


@pytest.mark.parametrize("to, known", [(28, False), (32, True)])
def test_a_plain_middle_that_never_changes_is_the_subject(to, known):
    """A plain disc on the turntable is alike in all photos, and something that turns is all about
    it; a wall is alike up to the photo's edge.
    """
    photos, _ = before_wall(24, 24)
    photos[:, 2:22, 2:to] = RNG(1).integers(0, 256, (24, 20, to - 2, 3), np.uint8)
    photos[:, 8:16, 8 : to - 6 if to == 28 else 32] = (200, 30, 30)
    assert still_picture(list(photos)).known[12, 14] == known


@pytest.mark.parametrize("sigma", [0.0, 1.0, 3.0])
def test_the_tolerance_is_four_times_the_noise(sigma):
    photos, _ = before_wall(24, 0)  # what hides it adds some
    middle = np.rint(40 + 0.7 * photos)
    noisy = middle + RNG(1).normal(0, sigma, photos.shape)
    pixels = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
    # Rounding adds a twelfth of a step's square; of 4 sigma rare ones are left to the quantile.
    expected = max(LEAST_TOLERANCE, 4 * np.sqrt(sigma**2 + (1 / 12 if sigma else 0)))
    assert tolerance_of(pixels) == pytest.approx(expected, rel=0.07)


@pytest.mark.parametrize("step, shown", [(3, False), (4, True)])
def test_what_differs_by_more_than_the_tolerance_is_the_subject(step, shown):
    photos, wall = before_wall(20, 0)
    still = still_picture(list(photos))
    rgb = np.where(wall < 128, wall + step, wall - step).astype(np.uint8)
    rgb[:4], rgb[-4:], rgb[:, :4], rgb[:, -4:] = wall[:4], wall[-4:], wall[:, :4], wall[:, -4:]
    assert subject_mask(rgb, still)[8:16, 8:24].all() == shown
    assert subject_mask(rgb, still).any() == shown
    assert not subject_mask(wall, still).any()


def test_holes_are_filled_and_specks_left_out():
    photos, wall = before_wall(20, 0)
    still = still_picture(list(photos))
    rgb = wall.copy()
    rgb[6:18, 6:22] = 255 - wall[6:18, 6:22]
    rgb[10:13, 10:14] = wall[10:13, 10:14]
    rgb[2, 2] = 255 - wall[2, 2]
    mask = subject_mask(rgb, still)
    assert mask[7:17, 7:21].all() and not mask[:5].any() and not mask[:, 24:].any()


def test_what_is_cut_keeps_its_colours():
    photos, wall = before_wall(20, 0)
    rgb = wall.copy()
    rgb[6:18, 6:22] = 255 - wall[6:18, 6:22]
    rgba = np.concatenate([rgb, np.full((*SIZE, 1), 255, np.uint8)], axis=2)
    photo = LoadedPhoto(VIEW, "RGB", rgba, None, "a")
    out = cut_out(photo, still_picture(list(photos)))
    assert out.masked and (out.rgba[..., :3] == rgb).all() and (rgba[..., 3] == 255).all()
    assert set(np.unique(out.rgba[..., 3])) == {0, 255}


def test_of_what_is_cut_away_no_shape_is_known_and_of_a_lens_edge_nothing():
    photos, wall = before_wall(20, 0)
    rgb = wall.copy()
    rgb[6:18, 6:22] = 255 - wall[6:18, 6:22]
    rgba = np.concatenate([rgb, np.full((*SIZE, 1), 255, np.uint8)], axis=2)
    weight = np.ones(SIZE, np.float32)
    weight[:, 28:], weight[0, 0] = 0, 1e-6
    depth, normals = np.full(SIZE, 2, np.float32), np.full((*SIZE, 4), 7, np.int8)
    whole = LoadedPhoto(VIEW, "RGB", rgba, weight, "a", depth, False, normals)
    still = still_picture(list(photos))
    out, mask = cut_out(whole, still), subject_mask(rgb, still)
    assert (out.rgba[:, 28:, 3] == 255).all() and (out.rgba[:, :28, 3] == 255 * mask[:, :28]).all()
    assert out.weight is weight
    assert (out.depth == 2 * mask).all() and (out.normals == 7 * mask[..., None]).all()
    assert out.depth.dtype == np.float32 and out.normals.dtype == np.int8
    assert (depth == 2).all() and (normals == 7).all(), "those of the photo stay"


def test_half_the_photos_by_chance_need_not_be_still():
    """Nine in ten are: 18 of 20 are alike there, and nothing hides them; 17 are hidden."""
    for covers, hidden in ((2, False), (3, True)):
        photos, _ = before_wall(20, covers)
        assert round((1 - covers / 20) * 20) / 20 >= STILL or hidden
        assert (still_picture(list(photos)).hidden > 0.5) == hidden


@pytest.fixture(scope="module")
def turntable(tmp_path_factory):
    """(photos, where the tracer meets no solid, where a subject) of a turntable."""
    folder = tmp_path_factory.mktemp("turntable")
    place, _ = make_stranger(folder, "turntable", 2, (160, 120), 32)
    photos = load_photos(read_capture(folder), "train", 1, "auto")
    masks = np.stack([mask_of(photo.view, place, 0) for photo in photos])
    return photos, masks == 0, masks >= 0.5


@pytest.mark.parametrize("camera", ["as traced", "noise", "JPEG"])
def test_it_is_the_wall_that_the_tracer_drew(turntable, camera):
    """A photo in which the tracer meets no solid shows the wall there: known from outside."""
    photos, missed, true = turntable
    pixels, rng = [photo.rgba[..., :3] for photo in photos], RNG(0)
    first = missed.argmax(axis=0)[None, ..., None]
    wall = np.take_along_axis(np.stack(pixels), first, axis=0)[0].astype(int)
    if camera == "noise":
        pixels = [np.clip(p + rng.normal(0, 2, p.shape), 0, 255).astype(np.uint8) for p in pixels]
    if camera == "JPEG":  # of twice the size, as photos are made smaller
        pixels = [as_jpeg(p) for p in pixels]
    found = still_picture(pixels)
    behind = found.known & missed.any(axis=0)
    away = np.abs(found.rgb - wall).max(axis=2)
    # This table is as yellow as its wall: where it hides that in most photos, it may pass for it.
    assert (away[behind] <= found.tolerance + 1).mean() > 0.93
    # What three in ten photos show is found, but where the wall has the subject's colours.
    assert found.known[missed.mean(axis=0) >= 0.3].mean() > 0.95
    masks = np.stack([subject_mask(p, found) for p in pixels])
    overlap = (masks & true).sum(axis=(1, 2)) / (masks | true).sum(axis=(1, 2))
    assert np.median(overlap) > 0.93


def as_jpeg(pixels: np.ndarray) -> np.ndarray:
    file = io.BytesIO()
    Image.fromarray(pixels.repeat(2, axis=0).repeat(2, axis=1)).save(file, "JPEG", quality=92)
    return np.array(Image.open(file).reduce(2))
