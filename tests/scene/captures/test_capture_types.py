"""Captures with values of wrong types, and hostile points: a capture, or one sentence."""

import io
import json
import struct
import zipfile

import numpy as np
import pytest

pytest.importorskip("hypothesis")  # of the fuzzer, whose judge of sentences is used here

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.point_clouds import read_points
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.hostile.fuzz_mutations import SPECIAL_VALUES, places_of
from tests.support.hostile.fuzz_run import check_sentence, watched
from tests.support.scene.captures import CLOUD, whole, write_transforms


def told(folder) -> str:
    """What is said about the capture; "" where it is one."""
    try:
        capture = read_capture(folder)
    except BadFile as refusal:
        check_sentence(str(refusal), folder)
        return str(refusal)
    assert isinstance(capture, Capture) and capture.photos
    assert all(isinstance(s.name + s.palette + s.unit + s.kind, str) for s in capture.stops)
    return ""


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_every_value_of_every_type_in_every_place(tmp_path):
    """Of the numbers of a list, which are read alike, each has a quarter of them in its turn."""
    (first, frame, last), more = whole(tmp_path)
    count = len(list(places_of({"frame": frame} | more)))
    refused = tried = 0
    for place in range(count):
        for turn, value in enumerate(SPECIAL_VALUES, place):
            tree = json.loads(json.dumps({"frame": frame} | more))
            holder, key = list(places_of(tree))[place]
            if isinstance(holder, list) and turn % 4:
                continue
            holder[key] = value
            write_transforms(tmp_path, [first, tree.pop("frame", value), last], **tree)
            tried, refused = tried + 1, refused + bool(told(tmp_path))
    assert count > 60 and refused > 0.7 * tried


OF_FRAMES = {
    "file_path": (7, [], {}, True), "modality": (7, [], {}, True), "split": (7, ["train"], {}, 0),
    "mask_path": (7, ["mask.png"], {}, True),
} | {
    key: (None, "20", [20], {}, True, 10**400, float("inf"), float("nan"))
    for key in ("w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "p2")
}  # fmt: skip


@pytest.mark.parametrize("key", OF_FRAMES)
def test_the_sentence_names_the_frame_and_the_key(tmp_path, key):
    frames, more = whole(tmp_path)
    for value in OF_FRAMES[key]:
        frames[1][key] = value
        write_transforms(tmp_path, frames, **more)
        said = told(tmp_path)
        assert "transforms.json: frame 1" in said and f"'{key}'" in said, (value, said)


WRONG = {
    "up": [7, "up", [0, 1], [[0, 1, 0]], ["a", 0, 1], {}, [0, float("nan"), 1], [0, 10**400, 1]],
    "background": [7, "white", [1, 1], ["1", 1, 1], [2, 0, 0], {}, [None] * 3, [True] * 3],
    "points": [7, [], {}, True],
    "notes": [7, "notes", ["a"], True],
    "modalities": [7, "RGB", {"RGB": 0}, ["RGB", 7], ["RGB", "RGB"], ["", "IR"], [[]], True],
}


@pytest.mark.parametrize("key", WRONG)
def test_the_sentence_names_what_all_frames_share(tmp_path, key):
    frames, more = whole(tmp_path)
    for value in WRONG[key]:
        write_transforms(tmp_path, frames, **more | {key: value})
        assert ("modalit" if key == "modalities" else f"'{key}'") in told(tmp_path), value


@pytest.mark.parametrize("key", ["name", "x", "kind", "palette", "value_range", "unit", "folder"])
@pytest.mark.parametrize("value", [7, [], {}, True], ids=str)
def test_capture_json_beside_colmap(tmp_path, key, value):
    pytest.importorskip("pycolmap")
    from tests.support.scene.captures import colmap_model

    colmap_model(tmp_path, text=False)
    heat = {"name": "Heat", "x": 1, "folder": "thermal", "value_range": [1, 2]}
    stops = [{"name": "RGB", "x": 0, "folder": "rgb"}, heat]
    (tmp_path / "capture.json").write_text(json.dumps({"modalities": stops}))
    assert told(tmp_path) == ""
    heat[key] = value
    (tmp_path / "capture.json").write_text(json.dumps({"modalities": stops}))
    said = told(tmp_path)
    assert "capture.json" in said and f"'{key}'" in said
    for other in (7, "RGB", [7], {"RGB": 0}):
        (tmp_path / "capture.json").write_text(json.dumps({"modalities": other}))
        assert "'modalities'" in told(tmp_path)


# Points


class Runs:
    def __reduce__(self):
        raise AssertionError("pickled, never to be unpickled")


def npy(shape: str, kind: str = "<f4", data: bytes = b"") -> bytes:
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}"
    header = text.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header + data


def zipped(xyz: bytes, how: int = zipfile.ZIP_DEFLATED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", how) as archive:
        archive.writestr("xyz.npy", xyz)
    return out.getvalue()


def bomb() -> bytes:
    """200 MB of zeros; packed where it is needed, since that takes over a second."""
    return zipped(npy("(17476266, 3)", data=bytes(17476266 * 12)))


HOSTILE = {
    "more points than bytes": (zipped(npy("(1000000000000, 3)")), "0 bytes follow"),
    "fewer points than bytes": (zipped(npy("(1, 3)", data=bytes(24))), "24 bytes follow"),
    "fewer than none": (zipped(npy("(-1, -3)", data=bytes(12))), "12 bytes follow"),
    "a shape of more than 64 bits": (zipped(npy(f"({2**70}, 3)")), "0 bytes follow"),
    "pickled": (zipped(npy("(1,)", "|O", b"cos\nsystem\n(S'touch harmed'\ntR.")), "holds object"),
    "a program for a header": (zipped(npy("__import__('os').system('touch harmed')")), "no array"),
    "texts": (zipped(npy("(1, 3)", "<U1", bytes(12))), "plain numbers"),
    "of no width": (zipped(npy("(5, 3)", "|V0")), "plain numbers"),
    "a bomb": (bomb, "of memory"),
    "packed without a limit": (
        zipped(npy("(1, 3)", data=bytes(12)), zipfile.ZIP_BZIP2),
        "not read",
    ),
    "of a later version": (zipped(b"\x93NUMPY\7\0" + bytes(20)), "unknown version"),
    "no npy": (zipped(b"xyz"), "no array"),
    "no zip": (b"xyz", "no zip"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_npz_takes_no_memory_and_runs_nothing(tmp_path, name, monkeypatch):
    data, words = HOSTILE[name]
    data = data() if callable(data) else data
    path = tmp_path / "points.npz"
    path.write_bytes(data)
    monkeypatch.chdir(tmp_path)
    with watched(len(data)), pytest.raises(BadFile, match=words) as refusal:
        read_points(path)
    check_sentence(str(refusal.value), tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["points.npz"]


def test_a_size_that_lies_in_the_zip_bounds_what_is_read(tmp_path):
    """The directory says 140 bytes, the stream holds 100 MB."""
    data = zipped(npy("(1, 3)", data=bytes(100 << 20)))
    stated = struct.pack("<I", 128 + (100 << 20))
    assert data.count(stated) == 2
    path = tmp_path / "points.npz"
    path.write_bytes(data.replace(stated, struct.pack("<I", 140)))
    with watched(0), pytest.raises(BadFile, match="cannot be unpacked"):  # its checksum fails
        read_points(path)


@pytest.mark.parametrize("kind", ["<f4", ">f4", "<f8", "<i2"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_are_those_that_numpy_reads(tmp_path, kind, order):
    path = tmp_path / "points.npz"
    xyz = np.asarray(CLOUD * 100, kind, order=order)
    np.savez(path, xyz=xyz, rgb=np.asarray(np.abs(CLOUD).clip(0, 1), order=order))
    points, colors = read_points(path)
    with np.load(path) as arrays:
        np.testing.assert_array_equal(points, arrays["xyz"].astype(np.float64))
        np.testing.assert_array_equal(colors, arrays["rgb"].astype(np.float32))


def test_a_ply_of_more_points_than_bytes(tmp_path):
    path = tmp_path / "points.ply"
    for form in ("binary_little_endian", "ascii"):
        header = f"ply\nformat {form} 1.0\nelement vertex 999999999999\n"
        header += "".join(f"property float {axis}\n" for axis in "xyz")
        path.write_text(header + "end_header\n1 2 3\n")
        with watched(200), pytest.raises(BadFile, match="promises 999999999999"):
            read_points(path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_ply_colours_as_numbers_of_0_to_1_and_in_big_endian(tmp_path, order):
    names = [*"xyz", "red", "green", "blue"]
    rows = np.zeros(5, [(name, f"{order}f4") for name in names])
    rows["x"], rows["red"], rows["blue"] = np.arange(5), 0.25, 1
    form = {"<": "little", ">": "big"}[order]
    header = f"ply\nformat binary_{form}_endian 1.0\nelement vertex 5\n"
    header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    (tmp_path / "a.ply").write_bytes(header.encode() + rows.tobytes())
    points, colors = read_points(tmp_path / "a.ply")
    np.testing.assert_array_equal(points, [[x, 0, 0] for x in range(5)])
    np.testing.assert_array_equal(colors, np.tile(np.array([0.25, 0, 1], np.float32), (5, 1)))
