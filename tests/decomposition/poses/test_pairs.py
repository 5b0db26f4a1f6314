"""Photos of heat find those of light that were taken with them: name, number, time; the writing."""

import json

import pytest
from PIL import Image

from shapeshift.decomposition.poses.photo_list import list_photos
from shapeshift.decomposition.poses.write_posed import modalities_said
from shapeshift.runtime_models.model import BadFile
from tests.support.scene.strangers.situations import Shot, write_photos

SMALL = (12, 10)


def listed(root, light: list[str], heat: list[str], mode="RGB") -> dict[str, str]:
    """Name of a photo of heat -> of light."""
    write_photos(root, [Shot(name) for name in light] + [Shot(n, mode, SMALL) for n in heat])
    photos = list_photos(root)
    assert {photo.name for photo in photos.photos} == set(light), "heat is not searched"
    return {photo.name: name for photo, name in photos.paired.items()}


@pytest.mark.parametrize("light,heat", [
    ("rgb/{}.png", "thermal/{}.png"), ("hall/rgb/{}.png", "hall/thermal/{}.png"),
    ("visible/DJI_2026050412000{0}_000{0}_V.png", "thermal/DJI_2026050412000{0}_000{0}_T.png"),
    ("DJI_2026050412000{0}_000{0}_W.png", "DJI_2026050412000{0}_000{0}_T.png"),
    ("MAX_000{}.png", "IRX_000{}.png"), ("{}.png", "{}_thermal.png"), ("{}.png", "IR/{}.png"),
    ("{}_rgb.png", "{}_ir.png"), ("{}.jpg", "{}_T.png"),
    ("P031000{}.png", "T031000{}.png"), ("FLIR000{}_photo.png", "FLIR000{}.png"),
    ("HM2024050412000{}_visual.png", "HM2024050412000{}.png"), ("IMG000{}V.png", "IMG000{}T.png"),
    ("YUN_000{}.png", "IR_000{}.png"), ("2024-0{}.png", "seek/2024-0{}_thermal.png"),
    # Ten seconds apart: no pair, though the numbers are the same.
    ("DJI_2026050412000{0}_000{0}_W.png", "DJI_2026050412001{0}_000{0}_T.png"),
])  # fmt: skip
def test_pairs_by_name(tmp_path, light, heat):
    names = [light.format(i) for i in range(4)], [heat.format(i) for i in range(4)]
    if "12001" in heat:
        with pytest.raises(BadFile, match="of the same name, number or time of exposure"):
            listed(tmp_path, *names)
    else:
        assert listed(tmp_path, *names) == dict(zip(names[1], names[0], strict=True))


def test_times_in_names_may_differ_by_two_seconds_where_numbers_agree(tmp_path):
    light = [f"DJI_202605041200{i}0_000{i}_W.png" for i in range(3)]
    heat = [f"DJI_202605041200{i}2_000{i}_T.png" for i in range(3)]
    assert listed(tmp_path, light, heat) == dict(zip(heat, light, strict=True))


def test_flights_with_the_same_numbers_stay_apart_and_the_zoom_is_no_partner(tmp_path):
    form = "{}/DJI_000{}_{}.png"
    light = [form.format(f, i, c) for f in ("100MEDIA", "101MEDIA") for i in (1, 2) for c in "ZW"]
    heat = [form.format(f, i, "T") for f in ("100MEDIA", "101MEDIA") for i in (1, 2)]
    found = listed(tmp_path, light, heat)
    assert found == {name: name.replace("_T", "_W") for name in heat}


def test_wide_and_zoom_of_one_size_are_two_cameras(tmp_path):
    light = [f"DJI_000{i}_{c}.png" for i in range(3) for c in "WZ"]
    listed(tmp_path, light, [f"DJI_000{i}_T.png" for i in range(3)])
    assert sorted(map(sorted, list_photos(tmp_path).groups)) == [
        [f"DJI_000{i}_{c}.png" for i in range(3)] for c in "WZ"]  # fmt: skip


def with_time(path, at: str, fraction: str | None = None, size=(16, 12)) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0x9003] = at
    if fraction is not None:
        exif.get_ifd(0x8769)[0x9291] = fraction
    Image.effect_noise(size, 60).convert("RGB").save(path, exif=exif)


def test_pairs_by_time_of_exposure(tmp_path):
    """Numbers of two cameras that were not started together; the nearest within a second."""
    for i in range(4):
        with_time(tmp_path / f"rgb/A{i + 7}.jpg", f"2026:05:04 12:00:{2 * i:02}", "20")
        with_time(tmp_path / f"ir/B{i}.jpg", f"2026:05:04 12:00:{2 * i:02}", "70", SMALL)
    found = {p.name: name for p, name in list_photos(tmp_path).paired.items()}
    assert found == {f"ir/B{i}.jpg": f"rgb/A{i + 7}.jpg" for i in range(4)}
    with_time(tmp_path / "ir/B0.jpg", "2026:05:04 11:59:59", "199", SMALL)  # 1.001 s
    with pytest.raises(BadFile, match=r"1 thermal photos, for example ir/B0\.jpg"):
        list_photos(tmp_path)
    for broken in ("", "0000:00:00 00:00:00", "yesterday"):
        with_time(tmp_path / "ir/B0.jpg", broken, "x", SMALL)
        with pytest.raises(BadFile, match="1 thermal photos"):
            list_photos(tmp_path)


def test_heat_alone_is_searched_and_tiffs_of_heat_are_taken(tmp_path):
    write_photos(tmp_path / "alone", [Shot(f"thermal/{i}.png") for i in range(3)])
    assert len(list_photos(tmp_path / "alone").photos) == 3
    tiffs = [f"ir/{i}.tif" for i in range(3)]
    assert len(listed(tmp_path / "b", [f"rgb/{i}.png" for i in range(3)], tiffs, "F")) == 3
    write_photos(tmp_path / "b", [Shot("ir/0.jpg"), Shot("rgb/1.tif"), Shot("rgb/x.tif")])
    photos = list_photos(tmp_path / "b")
    assert sorted(p.name for p in photos.paired) == ["ir/0.jpg", "ir/1.tif", "ir/2.tif"]
    assert len(photos.photos) == 3, "TIFFs of light are not taken"


def test_two_sorts_without_a_word_are_refused_before_the_search_and_settled(tmp_path):
    shots = [Shot(f"cam0/{i}.png") for i in range(3)]
    write_photos(tmp_path, shots + [Shot(f"cam1/{i}.png", "L", SMALL) for i in range(3)])
    photos = list_photos(tmp_path)  # two folders are two stops, as ever
    assert [stop.name for stop in photos.stops] == ["cam0", "cam1"]
    (tmp_path / "rig").mkdir()
    for name in ("cam0", "cam1"):
        (tmp_path / name).rename(tmp_path / "rig" / name)
    with pytest.raises(BadFile, match="photos of two sorts would be one stop, rig") as refused:
        list_photos(tmp_path)
    said = str(refused.value)
    line, _ = json.JSONDecoder().raw_decode(said[said.index('{"modalities"') :])
    (tmp_path / "capture.json").write_text(json.dumps(line))
    photos = list_photos(tmp_path)
    assert [stop.kind for stop in photos.stops] == ["rgb", "thermal"]
    assert [p.name for p in photos.paired] == [f"rig/cam1/{i}.png" for i in range(3)]
    placed = {photo.name for photo in photos.photos}
    assert modalities_said(photos, placed, tmp_path) == [
        {"name": "rig", "x": 0.0, "kind": "rgb", "folder": "rig/cam0"},
        {
            "name": "Thermal",
            "x": 1.0,
            "kind": "thermal",
            "palette": "ironbow",
            "folder": "rig/cam1",
        },
    ]


def test_what_is_written_names_only_photos_that_were_placed(tmp_path):
    light = [f"DJI_000{i}_W.png" for i in range(4)]
    listed(tmp_path, light, [name.replace("_W", "_T") for name in light], "L")
    photos = list_photos(tmp_path)
    said = modalities_said(photos, set(light[1:]), tmp_path)
    assert said == [
        {"name": "RGB", "x": 0.0, "kind": "rgb", "photos": "DJI_*_W.*"},
        {
            "name": "Thermal",
            "x": 1.0,
            "kind": "thermal",
            "palette": "ironbow",
            "photos": "DJI_*_T.*",
        },
    ]
    (tmp_path / "one").mkdir()
    write_photos(tmp_path / "one", [Shot(f"{i}.png") for i in range(3)])
    one = list_photos(tmp_path / "one")
    assert modalities_said(one, {p.name for p in one.photos}, tmp_path / "one") == []
