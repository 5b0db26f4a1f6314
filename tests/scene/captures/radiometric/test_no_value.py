"""Pixels that hold no value are unknown, whatever stands there and however a file says so."""

import json

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.photo import numbers_of
from shapeshift.scene.captures.radiometric.no_value import filled, resized_numbers
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.value_ranges import untold_no_data
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.photo_store.open_photos import PhotoRoom, open_photos
from shapeshift.training.photos import read
from tests.support.scene.gaps import (
    FORMS,
    SIZE,
    border,
    warm,
    write_heat,
    write_numbers,
    write_tiff,
)


def capture_with(folder, ending, value, tag, said, gone=None, count=3):
    """`count` photos with a border of `value`; the third has none."""
    gone = border() if gone is None else gone
    photos = [
        write_numbers(folder / f"{i}", np.where(gone & (i != 2), value, warm(i)), ending, tag)
        for i in range(count)
    ]
    return read_capture(write_heat(folder, photos, **said))


@pytest.mark.parametrize("form", FORMS)
def test_every_form_says_the_same(tmp_path, form):
    """The reading of clean photos of the same numbers is the oracle; bytes may be one apart where
    the range is another."""
    capture = capture_with(tmp_path, *FORMS[form])
    stop, gone = capture.stops[0], border()
    low, high = stop.value_range or (0, 65535)
    if ".u16" not in FORMS[form][0] and form != "transparent grey":
        assert 10 < low < 20 and 99 < high < 110  # of 20 to 99 and a margin
    assert all(photo.may_lack_values for photo in capture.photos[:2])
    for number, photo in enumerate(capture.photos):
        loaded, wanted = read(photo, 1, "auto"), (warm(number) - low) / (high - low) * 255
        kept = np.ones_like(gone) if number == 2 else ~gone
        np.testing.assert_allclose(loaded.rgba[kept, 0], wanted[kept], atol=0.51)
        assert (loaded.rgba[..., 3] == 255).all() and not loaded.masked
        assert loaded.unknown == (~kept).sum()
        weight = np.ones(gone.shape) if loaded.weight is None else loaded.weight
        np.testing.assert_array_equal(weight, kept.astype(np.float32))
        np.testing.assert_array_equal(np.isnan(numbers_of(photo)), ~kept)
    write_capture(capture)
    again = read_capture(tmp_path)
    assert [p.no_value for p in again.photos] == [p.no_value for p in capture.photos]


@pytest.mark.parametrize("factor", [1, 2, 3, 5])
def test_what_stands_there_changes_no_bit(tmp_path, factor):
    """Of 2 pixels of border, divided by 3 and 5, pixels are partly known."""
    found = []
    for value in (-9999.0, 0.0, 57.5, 1e6, 3.4e38):
        folder = tmp_path / f"{value:g}"
        folder.mkdir()
        capture = capture_with(folder, ".tif", value, repr(value), {})
        photos = [read(photo, factor, "auto") for photo in capture.photos]
        found.append((capture.stops, [(p.rgba.tobytes(), p.weight, p.unknown) for p in photos]))
    for stops, photos in found:
        assert stops == found[0][0]
        for (rgba, weight, unknown), first in zip(photos, found[0][1], strict=True):
            assert rgba == first[0] and unknown == first[2]
            np.testing.assert_array_equal(weight, first[1])


def test_a_pixel_is_the_mean_of_what_is_known_in_it_and_unknown_below_half(tmp_path):
    """Of 2x2 pixels 0 to 4 are known; the mean in floats is the oracle."""
    values = np.full(SIZE[::-1], 20, np.float32)
    values[:2, :10] = [[20, 100] * 5, [60, 80] * 5]
    for lacking, (row, column) in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)], 1):
        for block in range(lacking, 5):
            values[row, 2 * block + column] = np.nan
    path = write_numbers(tmp_path / "0", values, ".tif", None)
    capture = read_capture(write_heat(tmp_path, [path], value_range=[0, 255]))
    loaded = read(capture.photos[0], 2, "auto")
    assert loaded.weight[0, :5].tolist() == [1, 1, 1, 0, 0]
    np.testing.assert_allclose(loaded.rgba[0, :3, 0], [65, 80, 90], atol=1)
    assert loaded.unknown == 2 and (loaded.weight[1:] == 1).all()
    # What is unknown has the colour of what lies around it, far below what stands in the file.
    assert 20 <= loaded.rgba[0, 3, 0] <= 90


@pytest.mark.parametrize("one_of_many", [False, True])
@pytest.mark.parametrize("factor", [1, 2])
def test_what_is_unknown_bends_with_the_lens(tmp_path, factor, one_of_many):
    """A mask file of the same pixels is the oracle: it has always gone through the lens."""
    gone = np.zeros(SIZE[::-1], bool)
    gone[5:17, 4:12] = gone[2:6, 20:30] = True
    path = write_numbers(tmp_path / "0", np.where(gone, -9999, warm(0)), ".tif", "-9999")
    clean = write_numbers(tmp_path / "1", warm(0), ".tif", None)
    mask = tmp_path / "mask.png"
    Image.fromarray(np.where(gone, 0, 255).astype(np.uint8)).save(mask)
    folder = write_heat(tmp_path, [path, clean], counts=[0, 110])
    data = json.loads((folder / "transforms.json").read_text())
    data |= {"k1": 0.2, "k2": 0.05}
    data["frames"][1] |= {"mask_path": "mask.png", "mask_means": "valid"}
    (folder / "transforms.json").write_text(json.dumps(data))
    ours, masked = read_capture(folder).photos
    ours, masked = (read(p, factor, "auto", one_of_many) for p in (ours, masked))
    np.testing.assert_array_equal(ours.weight, (masked.weight >= 128 / 255).astype(np.float32))
    whole = masked.weight == 1
    assert whole.sum() > 30 and ours.unknown > 20
    np.testing.assert_array_equal(ours.rgba[whole], masked.rgba[whole])


def test_no_value_is_not_outside_of_the_object(tmp_path):
    """An object's mask and a border without values: alpha says where nothing is, weight where
    nothing is known."""
    path = write_numbers(tmp_path / "0", np.where(border(), np.nan, warm(0)), ".tif", None)
    mask = np.zeros(SIZE[::-1], np.uint8)
    mask[:, 8:20] = 255
    Image.fromarray(mask).save(tmp_path / "mask.png")
    folder = write_heat(tmp_path, [path])
    data = json.loads((folder / "transforms.json").read_text())
    data["frames"][0] |= {"mask_path": "mask.png", "mask_means": "object"}
    (folder / "transforms.json").write_text(json.dumps(data))
    photo = read_capture(folder).photos[0]
    for masks in ("auto", "object", "valid", "ignore"):
        loaded = read(photo, 1, masks)
        inside, outside = ~border() & (mask > 0), ~border() & (mask == 0)
        assert (loaded.weight[border()] == 0).all() and (loaded.rgba[border(), 3] == 255).all()
        assert (loaded.weight[inside] == 1).all() and (loaded.rgba[inside, 3] == 255).all()
        is_object = masks in ("auto", "object")
        assert (loaded.rgba[outside, 3] == (0 if is_object else 255)).all()
        assert (loaded.weight[outside] == (0 if masks == "valid" else 1)).all()
        assert loaded.masked == is_object and loaded.unknown == border().sum()


def test_colours_of_several_bands_lack_a_value_where_all_of_them_do(tmp_path):
    colors = np.random.default_rng(0).integers(1, 255, (*SIZE[::-1], 3)).astype(np.uint8)
    colors[border()] = 0
    colors[12, 16] = (0, 7, 9)  # one band at that number is a colour
    write_tiff(tmp_path / "0.tif", colors, "0")
    folder = write_heat(tmp_path, [tmp_path / "0.tif"], kind="rgb", name="RGB", x=0)
    loaded = read(read_capture(folder).photos[0], 1, "auto")
    np.testing.assert_array_equal(loaded.weight == 0, border())
    np.testing.assert_array_equal(loaded.rgba[~border(), :3], colors[~border()])
    write_tiff(tmp_path / "0.tif", colors, None)  # without the tag black is a colour
    loaded = read(read_capture(folder).photos[0], 1, "auto")
    assert loaded.weight is None and loaded.unknown == 0


def test_photos_without_any_value_are_left_out_and_a_modality_of_them_is_refused(tmp_path):
    values = [np.full(SIZE[::-1], np.nan, np.float32) if i == 1 else warm(i) for i in range(5)]
    values[3][0, 0] = np.inf
    photos = [write_numbers(tmp_path / f"{i}", v, ".tif", None) for i, v in enumerate(values)]
    capture = read_capture(write_heat(tmp_path, photos))
    for room in (PhotoRoom(), PhotoRoom(most=5000, folder=tmp_path / "kept")):
        opened = open_photos(capture, 1, "auto", room)
        assert (opened.store is None) == (room.most is None)
        assert sorted(p.name[-5] for p in (*opened.train, *opened.test)) == ["0", "2", "3", "4"]
        first, second = opened.warnings()[:2]
        assert first.startswith("Thermal: 0.033 % of the pixels, in 1 photos, have no value")
        assert second == (
            f"Thermal: no pixel of 1 photo has a value, for example of {photos[1]}; left out."
        )
        again = open_photos(capture, 1, "auto", room)  # of a store: as it lies there
        assert again.warnings()[:2] == [first, second]
        opened.close(), again.close()
    for path in photos:
        write_numbers(path.with_suffix(""), values[1], ".tif", None)
    with pytest.raises(BadFile, match="no pixel of it has a value, nor of the 5 photos") as refused:
        read_capture(tmp_path)
    assert "\n" not in str(refused.value)
    capture = read_capture(write_heat(tmp_path, photos, counts=[0, 100]))
    with pytest.raises(BadFile, match="no pixel of the photos of 'Thermal' has a value"):
        open_photos(capture, 1, "auto")


@pytest.mark.parametrize(
    "said",
    [
        {"no_data": "x"}, {"no_data": [1, None]}, {"no_data": {}}, {"no_data": True},
        {"valid_range": 5}, {"valid_range": [3, 3]}, {"valid_range": [3, float("nan")]},
    ],
)  # fmt: skip
def test_what_is_said_wrong_is_refused_in_one_sentence(tmp_path, said):
    path = write_numbers(tmp_path / "0", warm(0), ".tif", None)
    with pytest.raises(BadFile, match=next(iter(said))) as refused:
        read_capture(write_heat(tmp_path, [path], **said))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("tag", ["", "x", "none", "1e999", "-nan", "\0", "1 " * 50, "é"])
def test_a_tag_that_names_no_number_changes_nothing(tmp_path, tag):
    values = warm(0) + 0.5
    write_tiff(tmp_path / "0.tif", values, tag)
    photo = read_capture(write_heat(tmp_path, [tmp_path / "0.tif"])).photos[0]
    np.testing.assert_array_equal(numbers_of(photo), values)
    assert read(photo, 1, "auto").weight is None


def test_filled_has_no_value_that_is_not_around():
    rng = np.random.default_rng(0)
    for size in ((1, 1), (1, 7), (5, 1), (9, 16), (17, 33)):
        values = rng.uniform(2, 3, (*size, 2)).astype(np.float32)
        for share in (0.0, 0.5, 0.9, 1.0):
            unknown = rng.random(size) < share
            poisoned = np.where(unknown[..., None], np.float32(1e9), values)
            found = filled(poisoned, unknown)
            np.testing.assert_array_equal(found[~unknown], values[~unknown])
            if not unknown.all():
                low, high = values[~unknown].min(axis=0), values[~unknown].max(axis=0)
                assert ((found >= low - 1e-5) & (found <= high + 1e-5)).all()
            else:
                assert not found.any()


def test_numbers_in_another_size_lose_no_neighbour():
    """A photo without a value in one corner is elsewhere what the whole one is."""
    values = warm(0)
    gone = np.where(np.indices(values.shape).sum(axis=0) < 6, np.float32(np.nan), values)
    ours, whole = resized_numbers(gone, (64, 48)), resized_numbers(values, (64, 48))
    lacking = np.isnan(ours)
    assert 4 * np.isnan(gone).sum() * 0.8 < lacking.sum() < 4 * np.isnan(gone).sum() * 1.2
    far = np.indices(ours.shape).sum(axis=0) > 15
    np.testing.assert_array_equal(ours[far], whole[far])
    assert 20 <= np.nanmin(ours) and np.nanmax(ours) < 100


@pytest.mark.parametrize(
    "end, count, asked",
    [(-9999, 10, True), (-9999, 9, False), (65535, 300, True), (0, 10, False), (-61, 10, True),
     (-59, 10, False), (180, 10, True), (178, 10, False)],
)  # fmt: skip
def test_a_number_far_from_all_others_is_asked_about(end, count, asked):
    """The others are 20 to 99: what is 79 and less away from them may be one of them."""
    values = np.concatenate([np.linspace(20, 99, 5000), np.full(count, end)]).astype(np.float32)
    said = untold_no_data("Heat", values)
    assert len(said) == asked
    if asked:
        assert f"say 'no_data': {end:g} of" in said[0] and "(20 to 99)" in said[0]
    assert not untold_no_data("Heat", np.full(50, end)) and not untold_no_data("Heat", values[:50])
