"""Captures that cannot be used are refused in one sentence that says what to do."""

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.point_clouds import read_points
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.captures import CLOUD, save_image, simple, write_transforms


def spoil(change):
    """A table entry: frames and settings in, what is broken in them changed in place."""
    return pytest.param(change, id=change.__name__)


def no_poses(frames, more):
    for f in frames:
        del f["transform_matrix"]
    return "has no pose"


def nan_pose(frames, more):
    frames[1]["transform_matrix"][0][3] = float("nan")
    return r"frame 1 .*NaN"


def singular_pose(frames, more):
    frames[2]["transform_matrix"][0][:3] = [0, 0, 0]
    return "no rotation"


def sheared_pose(frames, more):
    pose = np.array(frames[0]["transform_matrix"])
    pose[:3, 0] *= 1.1
    frames[0]["transform_matrix"] = pose.tolist()
    return "no rotation"


def mirrored_pose(frames, more):
    for row in frames[0]["transform_matrix"]:
        row[0] = -row[0]
    return "1 of 4 poses mirror the world and the others do not"


def ragged_pose(frames, more):
    frames[0]["transform_matrix"] = [[1, 2], [3]]
    return "no matrix"


def small_pose(frames, more):
    frames[0]["transform_matrix"] = [[1, 0], [0, 1]]
    return r"shape \(2, 2\)"


def wrong_size(frames, more):
    more["w"] = 32
    return "16x12 pixels, the capture says 32x12"


def missing_images(frames, more):
    for frame in frames:
        frame["file_path"] = "images/gone.png"
    return r"none of its 4 photos is there.*gone.png"


def nameless_frame(frames, more):
    del frames[1]["file_path"]
    return "names no image"


def empty(frames, more):
    frames.clear()
    return "'frames' is empty"


def no_focal(frames, more):
    del more["fl_x"]
    return "no focal length"


def negative_focal(frames, more):
    more["fl_x"] = -3
    return "above 0"


def nan_focal(frames, more):
    more["fl_x"] = float("nan")
    return "'fl_x' is NaN; a finite number"


def folded_lens(frames, more):
    more["k1"] = -40
    return "folds the photo over itself"


def thin_prism(frames, more):
    more["camera_model"] = "thin_prism_fisheye"
    return "not read from JSON; give the COLMAP model"


def orthophoto(frames, more):
    more["camera_model"] = "ORTHOPHOTO"
    return "rays are side by side; .* photos that the orthophoto was made of"


def part_of_a_panorama(frames, more):
    more["camera_model"] = "EQUIRECTANGULAR"
    del more["fl_x"]
    return "twice as wide as high"


def part_of_a_stereo_panorama(frames, more):
    more["camera_model"] = "OMNIDIRECTIONALSTEREO_L"
    return "twice as wide as high"


def more_than_all_directions(frames, more):
    more["camera_model"], more["fl_x"] = "EQUIRECTANGULAR", 7.0
    return "more than 360 by 180 degrees"


def elsewhere_of_a_panorama(frames, more):
    more["camera_model"], more["cx"] = "EQUIRECTANGULAR", 1e6
    return "shows nothing of a panorama"


def few_distortion_params(frames, more):
    more["distortion_params"] = [0.1, 0.2]
    return "'distortion_params' is .*a list of 6"


def degrees_over_180(frames, more):
    del more["fl_x"]
    more["x_fov"] = 190
    return "degrees between 0 and 180"


def half_a_pixel(frames, more):
    more["w"] = 16.5
    return "not pixels"


def odd_list(frames, more):
    more["train_filenames"] = "images/000.png"
    return "'train_filenames' is"


def list_of_others(frames, more):
    more["train_filenames"] = ["elsewhere.png"]
    return "name none of its frames"


def empty_modality(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0}, {"name": "IR", "x": 1}]
    for f in frames:
        f["modality"] = "RGB"
    return '"IR" has no images'


def unknown_modality(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0}]
    frames[0]["modality"] = "UV"
    return 'of modality "UV"'


def only_tests(frames, more):
    for f in frames:
        f["split"] = "test"
    return "no photos to train on"


def odd_split(frames, more):
    frames[0]["split"] = "holdout"
    return "use train or test"


def stop_outside(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 1.5}]
    return "'x' is 1.5; 0 to 1 is wanted"


def twin_stops(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0}, {"name": "RGB", "x": 1}]
    return "same name"


def odd_kind(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0, "kind": "sonar"}]
    return "'kind' is \"sonar\"; 'rgb' or"


def upside_range(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0, "value_range": [9, 1]}]
    return "value_range"


def newer_version(frames, more):
    more["version"] = 7
    return "version 7"


def no_up(frames, more):
    more["up"] = [0, 0, 0]
    return "'up' must be"


def odd_background(frames, more):
    more["background"] = [0, 0]
    return "'background'"


def missing_points(frames, more):
    more["points"] = "gone.npz"
    return "file of points is missing"


@pytest.mark.parametrize("change", [spoil(c) for c in (
    no_poses, nan_pose, singular_pose, sheared_pose, mirrored_pose, ragged_pose, small_pose,
    wrong_size, missing_images, nameless_frame, empty, no_focal, negative_focal, nan_focal,
    folded_lens, thin_prism, orthophoto, part_of_a_panorama, part_of_a_stereo_panorama,
    more_than_all_directions, elsewhere_of_a_panorama, few_distortion_params,
    degrees_over_180, half_a_pixel, odd_list, list_of_others, empty_modality,
    unknown_modality, only_tests, odd_split, stop_outside, twin_stops, odd_kind, upside_range,
    newer_version, no_up, odd_background, missing_points,
)])  # fmt: skip
def test_refused_in_one_sentence(tmp_path, change):
    frames, more = simple(tmp_path)
    sentence = change(frames, more)
    write_transforms(tmp_path, frames, **more)
    with pytest.raises(BadFile, match=sentence) as caught:
        read_capture(tmp_path)
    assert "\n" not in str(caught.value)


def test_refused_folders_and_files(tmp_path):
    with pytest.raises(BadFile, match="does not exist"):
        read_capture(tmp_path / "nowhere")
    with pytest.raises(BadFile, match="neither photos nor poses"):
        read_capture(tmp_path)
    save_image(tmp_path / "images/a.png")
    with pytest.raises(BadFile, match=r"without poses.*launch.py poses"):
        read_capture(tmp_path)
    with pytest.raises(BadFile, match="is no capture"):
        read_capture(tmp_path / "images/a.png")
    (tmp_path / "transforms.json").write_text('{"frames": [')
    with pytest.raises(BadFile, match="not JSON"):
        read_capture(tmp_path)
    (tmp_path / "transforms.json").write_text("[1]")
    with pytest.raises(BadFile, match=r"holds \[1\]; an object"):
        read_capture(tmp_path)
    (tmp_path / "transforms.json").write_text('{"poses": []}')
    with pytest.raises(BadFile, match="no list 'frames'"):
        read_capture(tmp_path)


def test_refused_points(tmp_path):
    path = tmp_path / "points.npz"
    for arrays, sentence in (
        ({"abc": CLOUD}, "'xyz'"),
        ({"xyz": CLOUD[:, :2]}, r"\(20, 2\)"),
        ({"xyz": CLOUD * np.nan}, "NaN"),
        ({"xyz": CLOUD, "rgb": CLOUD[:3]}, "do not fit"),
    ):
        np.savez(path, **arrays)
        with pytest.raises(BadFile, match=sentence):
            read_points(path)
    path.write_bytes(path.read_bytes()[:50])
    with pytest.raises(BadFile, match="cut off"):
        read_points(path)
