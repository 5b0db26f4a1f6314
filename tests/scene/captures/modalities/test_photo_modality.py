"""Which modality a photo is of: words, letters, keys and folders, at their thresholds."""

import json
from pathlib import Path

import pytest

from shapeshift.app.opening import contents_of
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_names import is_heat_maker, is_thermal_name, sort_of_name
from shapeshift.scene.captures.modalities.frame_modalities import light_first
from shapeshift.scene.captures.modalities.photo_modality import modalities_of, splits_of
from shapeshift.scene.captures.modalities.two_sorts import roles_of
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.strangers.modality import SITUATIONS, colmap_of, frames_of, heat, light
from tests.support.scene.strangers.situations import Shot, write_colmap
from tests.support.scene.strangers.values import band_folders

HERE = Path("capture")


@pytest.mark.parametrize("name", [
    "thermal", "THERMAL_01", "thermalCam", "IRcam", "leftIR", "ir-2", "0001_ir", "IR0001", "lwir",
    "LWIRcam", "flir", "IRX_0001", "heat", "images_thermal", "thermal_left", "infrared", "tir",
    "thermography", "thermo", "Thermogramm", "DJI_0001_THRM",
])  # fmt: skip
def test_words_of_heat(name):
    assert is_thermal_name(name) and sort_of_name(name) == "thermal"


@pytest.mark.parametrize("name", [
    "firefly", "stair", "air", "chair", "first", "wheat", "thermos", "thermostat", "thermometer",
    "geothermal_plant", "NIR", "near_infrared", "near-infrared", "a3ir9f", "Irene", "theatre",
    "rgb_thermal", "RGB-T", "cheat", "DIR_1", "",
])  # fmt: skip
def test_words_that_only_look_like_heat(name):
    assert sort_of_name(name) == ""


@pytest.mark.parametrize(
    "name", ["rgb", "left_RGB", "visible", "colour", "rgbCam", "wide", "VIS_1"]
)
def test_words_of_light(name):
    assert sort_of_name(name) == "rgb"


def stops_of(names: list[str], **more) -> dict[str, int]:
    stops, of = modalities_of(names, HERE, **more)
    return {stop.name: of.count(stop.name) for stop in stops}


@pytest.mark.parametrize("names,found", [
    # One pair may be two letters of an alphabet; two pairs are a drone's.
    (["a_T.png", "a_V.png", "b.png"], {"RGB": 3}),
    (["a_T.png", "a_V.png", "b_T.png", "b_V.png"], {"RGB": 2, "Thermal": 2}),
    ([f"chair_{letter}.png" for letter in "abcdefghijklmnopqrstuvwxyz"], {"RGB": 26}),
    ([f"{letter}.png" for letter in "STUVWXYZ"], {"RGB": 8}),
    (["1_T.png", "1.png", "2_T.png", "2.png"], {"RGB": 2, "Thermal": 2}),
    (["DJI_20260504120000_0001_T.JPG", "DSC1.JPG"], {"RGB": 1, "Thermal": 1}),
    (["DJI_0001_T.JPG", "DSC1.JPG"], {"RGB": 1, "Thermal": 1}),
    (["DJI_0001_TX.JPG", "DSC1.JPG"], {"RGB": 2}),
    (["IMG_T1.png", "IMG_V1.png"], {"RGB": 2}),
    (["T/1.png", "T/2.png", "W/1.png", "Z/1.png"], {"RGB": 2, "Thermal": 2}),
    (["FLIR0001.jpg", "FLIR0002.jpg"], {"RGB": 2}),  # what all say tells none from another
    (["thermal_bath_1.png", "thermal_bath_2.png"], {"RGB": 2}),
    (["thermal_survey/rgb/1.png", "thermal_survey/lwir/1.png"], {"rgb": 1, "lwir": 1}),
    (["thermal/left/1.png", "thermal/right/1.png"], {"thermal": 2}),
    (["C:\\scan\\rgb\\1.png", "C:\\scan\\ir\\1.png"], {"rgb": 1, "ir": 1}),
    (["/data/a/rgb/1.png", "/data/a/ir/1.png"], {"rgb": 1, "ir": 1}),
    (["left\\1.png", "right\\1.png"], {"left": 1, "right": 1}),
    (["rgb/a/1.png", "thermal/a/1.png", "opened/1.png"], {"rgb": 1, "thermal": 1, "opened": 1}),
    (["garage/1.png", "thermal/1.png"], {"garage": 1, "thermal": 1}),
    (["closed/1.png", "opened/1.png", "ir/1.png"], {"closed": 1, "opened": 1, "ir": 1}),
    (["train/1.png", "test/2.png"], {"RGB": 2}),
    (["skin/1.png", "bone/1.png", "muscle/1.png"], {"bone": 1, "muscle": 1, "skin": 1}),
    (["rig1/cam1/1.png", "rig1/cam2/1.png"], {"rig1": 2}),
    (["1.png"], {"RGB": 1}),
])  # fmt: skip
def test_stops_in_their_order_by_names(names, found):
    assert list(stops_of(names).items()) == list(found.items())


def test_visible_light_is_first_and_a_lone_folder_beside_heat_is_that():
    stops, _ = modalities_of(["thermal/1.png", "garage/1.png"], HERE)
    assert [(s.name, s.x, s.kind) for s in stops] == [
        ("garage", 0, "rgb"), ("thermal", 1, "thermal")]  # fmt: skip


@pytest.mark.parametrize("key,values,split", [
    ("is_thermal", (True, False), True), ("thermal", (1, 0), True),
    ("is_ir", ("true", "no"), True), ("isThermal", (1.0, 0.0), True),
    ("sensor", ("LWIR", "RGB"), True), ("spectrum", ("ir", 3), True),
    ("thermal_index", (1, 0), False), ("colmap_im_id", (1, 0), False),
    ("is_thermal", ([1], {}), False), ("is_thermal", (2, 7), False),
    ("camera_model", ("IR", "OPENCV"), False),
])  # fmt: skip
def test_keys_of_frames(key, values, split):
    frames = [{key: value} for value in values]
    found = stops_of(["1.png", "2.png"], keys=frames, folders_are_stops=False)
    assert found == ({"RGB": 1, "Thermal": 1} if split else {"RGB": 2})


def test_frames_that_all_say_heat_are_a_stop_of_heat():
    assert stops_of(["1.png"], keys=[{"is_thermal": True}], folders_are_stops=False) == {
        "Thermal": 1
    }


@pytest.mark.parametrize("names,keys,words", [
    (["rgb/1.png", "thermal/1.png"], [{"is_thermal": True}, {"is_thermal": True}],
     "its frame says heat and its folder says visible light"),
    (["a/1.png", "thermal/1_rgb.png", "a/2.png"], [{}, {}, {}],
     "its folder says heat and its name says visible light"),
    (["rgb/thermal/1.png", "rgb/1.png", "x/1.png"], [{}, {}, {}], "its folders say both"),
    (["images/1.png", "images_thermal/1.png"], [{"is_thermal": False}] * 2,
     "its frame says visible light and its folder says heat"),
])  # fmt: skip
def test_contradictions_are_refused_with_a_line(names, keys, words):
    with pytest.raises(BadFile, match=words) as refused:
        modalities_of(names, HERE, keys, False)
    assert "\n" not in str(refused.value) and "capture.json" in str(refused.value)


def test_splits_of_folders():
    assert splits_of(["rgb/train/1.png", "rgb/test/2.png", "3.png"]) == ["train", "test", "train"]
    assert splits_of(["test/1.png", "other/2.png"]) == ["", ""]
    assert splits_of(["a\\Train\\1.png", "a\\val\\2.png"]) == ["train", "test"]


LAYOUTS = {s.name: s for s in SITUATIONS if s.expected.startswith("refused")}
MORE = {
    "numbers of another camera": colmap_of(
        light("{:04}.png"), [Shot(f"{i:04}.png", "I;16", (16, 12), 2) for i in range(9, 14)]),
    "grey of another size in frames": frames_of(
        light("images/{:04}.png"),
        [Shot(f"images/{i:04}.png", "L", (12, 10)) for i in range(9, 13)]),
    "names the wrong way round": colmap_of(
        light("rgb/{}.png", mode="I;16"), heat("thermal/{}.png")),
    "a key against a folder": frames_of(
        light("images/rgb/{}.png", keys=(("is_thermal", 1),)), heat("images/thermal/{}.png")),
    "many folders": colmap_of(
        *(light(f"{p}/rgb/{{}}.png", 1) + heat(f"{p}/thermal/{{}}.png", 1)
          for p in ("attic", "garage", "closed", "opened", "x"))),
}  # fmt: skip


@pytest.mark.parametrize("name", [*LAYOUTS, *MORE])
def test_the_line_of_a_refusal_settles_it(tmp_path, name):
    """As it is printed, saved as capture.json: the capture is read, with all of its photos."""
    make = LAYOUTS[name].make if name in LAYOUTS else MORE[name]
    folder = make(tmp_path / "in")
    with pytest.raises(BadFile) as refused:
        read_capture(folder)
    said = str(refused.value)
    line, _ = json.JSONDecoder().raw_decode(said[said.index('{"modalities"') :])
    (folder / "capture.json").write_text(json.dumps(line))
    capture = read_capture(folder)
    assert [stop.kind for stop in capture.stops] == ["rgb", "thermal"]
    assert len({p.path for p in capture.photos}) == sum(1 for _ in folder.rglob("*.png"))


def test_few_grey_photos_and_sizes_are_no_reason(tmp_path):
    """Two of one channel, of another size, with a camera of their own; three are a camera."""
    grey = [Shot(f"g{i}.png", "L", (12, 10), 2) for i in range(3)]
    write_colmap(tmp_path / "two", light("{}.png") + grey[:2])
    assert len(read_capture(tmp_path / "two").stops) == 1
    write_colmap(tmp_path / "three", light("{}.png") + grey)
    with pytest.raises(BadFile, match="3 of one channel"):
        read_capture(tmp_path / "three")
    own = [Shot(f"g{i}.png", "L" if i % 2 else "RGB", (16, 12), 2 + i) for i in range(8)]
    write_colmap(tmp_path / "each", own)  # a camera a photo is no camera of grey ones
    assert len(read_capture(tmp_path / "each").stops) == 1


@pytest.mark.parametrize("name", ["two series of names", "Parrot with other numbers"])
def test_the_line_of_two_series_makes_two_stops(tmp_path, name):
    folder = next(s for s in SITUATIONS if s.name == name).make(tmp_path / "in")
    (said,) = (doubt for doubt in read_capture(folder).doubts if "two series" in doubt)
    line, _ = json.JSONDecoder().raw_decode(said[said.index('{"modalities"') :])
    (folder / "capture.json").write_text(json.dumps(line))
    capture = read_capture(folder)
    assert [stop.kind for stop in capture.stops] == ["rgb", "thermal"]
    assert {p.path.name[0] for p in capture.of("Thermal", "train")} <= {"b", "T"}
    assert not any("two series" in doubt for doubt in capture.doubts)


@pytest.mark.parametrize("names", [
    ["P0310001", "T0310001"],  # one pair may be by chance
    ["P0310001", "P0310002", "T0320001", "T0320002"], ["P1", "T1", "P2", "T2"],
    ["FLIR0001", "FLIR0002"], ["FLIR0001_photo", "FLIR0002_photo"], ["IMG01V", "IMG01T"] * 2,
    ["HM2024", "V2024"] * 2, ["T0310001x", "P0310001x"] * 2,
])  # fmt: skip
def test_series_need_two_numbers_of_both(names):
    assert roles_of(names) == [""] * len(names)


def test_series_are_told_with_what_has_no_partner():
    names = ["P031001", "p031002", "T031001", "t031002", "T031009", "IMG_1"]
    assert roles_of(names) == ["rgb"] * 2 + ["thermal"] * 3 + [""]


@pytest.mark.parametrize("name, found", [
    ("TH", True), ("th_left", True), ("Seek", True), ("tau2", True), ("seekCam", True),
    ("H20T", True), ("fluke_seek", True), ("hide_and_seek", False), ("thing", False), ("t", False),
    ("temp", False), ("vue", False), ("vue_pro", True), ("", False), ("left", False),
])  # fmt: skip
def test_makers_of_heat(name, found):
    assert is_heat_maker(name) is found and sort_of_name(name) == ""


def test_what_a_stop_holds_is_said(tmp_path):
    left, right = light("rig1/rgb_left/{}.png", 3), light("rig1/rgb_right/{}.png", 2)
    folder = write_colmap(tmp_path, [*left, *right, *heat("rig1/thermal/{}.png")])
    assert contents_of(read_capture(folder)) == [
        "RGB: 5 photos, 3 of 16x12 pixels in images/rig1/rgb_left, 2 of 16x12 pixels in "
        "images/rig1/rgb_right; for example images/rig1/rgb_left/0.png",
        "thermal: 4 photos of 12x10 pixels in images/rig1/thermal; for example "
        "images/rig1/thermal/0.png",
    ]


def test_an_index_is_said_with_its_formula(tmp_path):
    said = contents_of(read_capture(band_folders(tmp_path)))
    assert said[2:] == ["NDVI: by formula, (nir - red) / (nir + red)"]
    assert [sentence.partition(":")[0] for sentence in said] == ["Red", "NIR", "NDVI"]


def test_many_folders_of_a_stop_are_counted(tmp_path):
    shots = [shot for i in range(6) for shot in light(f"cam{i}/{{}}.png", 1)]
    said = contents_of(read_capture(write_colmap(tmp_path, shots + heat("ir/{}.png"))))
    assert said[0].startswith("RGB: 6 photos, 1 of") and "2 in 2 more folders" in said[0]


@pytest.mark.parametrize("name", [
    "boson_left", "lepton", "Wärme", "thermique", "红外", "热成像_1", "赤外線", "열화상",
    "тепловизор", "infrarrojo",
])  # fmt: skip
def test_words_of_heat_in_other_languages_and_of_cameras(name):
    assert sort_of_name(name) == "thermal"


@pytest.mark.parametrize("name", [
    "heat_pump", "heatPump", "Heat Exchanger 2", "thermal_bath", "thermal-springs", "heater",
    "fire_station", "airport", "近红外", "nahinfrarot",
])  # fmt: skip
def test_things_that_have_to_do_with_heat_are_none(name):
    assert sort_of_name(name) == ""


@pytest.mark.parametrize("key,hot,cold", [
    ("sensor_id", "flir_0", "rgb_0"), ("camera_id", "thermal", "rgb"), ("cam", "ir", "color"),
    ("lens", "thermal", "wide"), ("wavelength", "LWIR", "visible"), ("label", "thermal", "rgb"),
    ("device", "FLIR Boson", "GoPro"), ("is_rgb", False, True), ("isVisible", 0, 1),
])  # fmt: skip
def test_keys_that_name_a_camera(key, hot, cold):
    names = [f"images/{i}.png" for i in range(4)]
    keys = [{key: hot}, {key: cold}, {key: hot}, {key: cold}]
    _, of = modalities_of(names, HERE, keys, False)
    assert of == ["Thermal", "RGB", "Thermal", "RGB"]


@pytest.mark.parametrize("key,value", [
    ("file_path", "thermal.png"), ("mask_path", "ir.png"), ("rgb", True), ("visible", False),
    ("camera_model", "OPENCV"), ("label", "heat pump"), ("note", "thermal"),
])  # fmt: skip
def test_keys_that_say_nothing_of_heat(key, value):
    _, of = modalities_of(["a.png", "b.png"], HERE, [{key: value}, {}], False)
    assert of == ["RGB", "RGB"]


@pytest.mark.parametrize("names,found", [
    (["set/rgb/1.png", "set/t/1.png"], {"rgb": 1, "Thermal": 1}),
    (["a/t/1.png", "a/u/1.png"], {"a": 2}),  # letters of an alphabet
    (["DJI_0001_R.JPG", "DJI_0002.JPG"], {"RGB": 1, "Thermal": 1}),  # a Zenmuse XT2's
    (["DJI_0001_R.JPG", "DJI_0002_R.JPG"], {"RGB": 2}),
    (["DJI_0001_RAW.JPG", "DJI_0002.JPG"], {"RGB": 2}),
    (["DJI_0001_R.TIF", "DJI_0001_G.TIF", "DJI_0002.JPG"], {"RGB": 3}),  # bands
    (["DJI_0001_R.JPG", "DJI_0001_L.JPG"], {"RGB": 2}),
    (["a/rgb/1.png", "a/s/1.png", "a/t/1.png"], {"a": 3}),
    (["flir/visible/1.png", "flir/thermal/1.png", "left/1.png"], {"RGB": 2, "flir": 1}),
    (["FLIR/1.png", "FLIR/rgb/1.png", "left/1.png"], {"RGB": 2, "FLIR": 1}),
])  # fmt: skip
def test_letters_of_heat_without_a_pair(names, found):
    assert stops_of(names) == found


@pytest.mark.parametrize("said,found", [
    (["thermal", "rgb"], ["rgb", "thermal"]),
    (["rgb", "thermal"], ["rgb", "thermal"]),
    (["opened", "closed"], ["opened", "closed"]),  # as they come
    (["opened", "rgb", "thermal"], ["opened", "rgb", "thermal"]),
    (["opened", "thermal", "rgb", "closed"], ["rgb", "thermal", "opened", "closed"]),
])  # fmt: skip
def test_named_modalities_have_light_first(said, found):
    assert light_first([*said, *said]) == found
