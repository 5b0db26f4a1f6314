"""What is written is what was read: bits, bounds in ULPs, ends of the codes, origins, columns."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.files.blocks import BLOCK
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_half_turn
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.ply_file import read_header
from shapeshift.runtime_models.splats.ply.read_ply import read_raw_ply
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.splats.ply_files import (
    names_of,
    random_rows,
    read_table,
    some_splats,
    write_rows,
)


def ulps(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How many float32 lie between two numbers."""
    steps = [np.asarray(x, np.float32).view(np.int32).astype(np.int64) for x in (a, b)]
    ordered = [np.where(s < 0, -(2**31) - s, s) for s in steps]
    return np.abs(ordered[0] - ordered[1])


def sigmoid(logits: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-logits.astype(np.float64)))


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
@pytest.mark.parametrize("count", [1, BLOCK - 1, BLOCK, BLOCK + 1])
def test_a_file_read_and_written_is_the_same_file(tmp_path, count, coefficients):
    rows = random_rows(count, [*names_of(coefficients), "obj_dc_0"], seed=count)
    for row in rows:  # a quaternion's length is not kept
        length = sum(row[f"rot_{i}"] ** 2 for i in range(4)) ** 0.5
        row.update({f"rot_{i}": float(np.float32(row[f"rot_{i}"] / length)) for i in range(4)})
    first = write_rows(tmp_path / "a.ply", rows)
    write_ply(read_plain(first), tmp_path / "b.ply")
    a, b = (read_table(tmp_path / name, ()) for name in ("a.ply", "b.ply"))
    assert a.dtype.names == b.dtype.names and len(a) == len(b)
    for name in a.dtype.names:
        if name.startswith("rot_"):
            np.testing.assert_allclose(a[name], b[name], atol=1.2e-7)
        elif name == "opacity":
            np.testing.assert_allclose(sigmoid(a[name]), sigmoid(b[name]), rtol=3e-7)
        elif name.startswith("scale_"):
            np.testing.assert_allclose(a[name], b[name], rtol=1.2e-7, atol=2e-7)
        else:
            np.testing.assert_array_equal(a[name], b[name])  # to the bit


def test_a_real_file_within_a_few_ulps(data, tmp_path):
    first = data / "anatomy_leg_ml3dgs" / "layer0.ply"
    write_ply(read_plain(first), tmp_path / "b.ply")
    a, b = read_table(first, ()), read_table(tmp_path / "b.ply", ())
    assert a.dtype == b.dtype
    for name in a.dtype.names:
        if name.startswith("rot_"):
            length = np.sqrt(sum(np.square(a[f"rot_{i}"].astype(float)) for i in range(4)))
            np.testing.assert_allclose(a[name] / length, b[name], atol=1.2e-7)
        elif name == "opacity":  # as 0..1, where float32 is what the program keeps
            np.testing.assert_allclose(sigmoid(a[name]), sigmoid(b[name]), rtol=3e-7)
        else:
            assert ulps(a[name], b[name]).max() <= 1, name
    names = [n for n in a.dtype.names if n[:2] in ("f_", "x", "y", "z", "nx", "ny", "nz")]
    for name in names:
        np.testing.assert_array_equal(a[name], b[name])


def test_the_ends_of_the_codes_come_back(tmp_path):
    splats = some_splats(4, 1)
    splats.opacity[:] = [0, 1, 1e-30, 1 - 2**-24]
    splats.scales[0], splats.scales[1] = 0, [0, 1e-30, 1e30]
    write_ply(splats, tmp_path / "a.ply")
    table = read_table(tmp_path / "a.ply", ())
    assert table["opacity"][:2].tolist() == [-np.inf, np.inf]
    back = read_raw_ply(tmp_path / "a.ply", Reading())
    np.testing.assert_allclose(np.exp(back.scales.astype(float)), splats.scales, rtol=1e-5)
    opacity = 1 / (1 + np.exp(-back.opacity.astype(float)))
    np.testing.assert_allclose(opacity, splats.opacity, rtol=1e-5)
    assert (np.exp(back.scales[0]) == 0).all()


def test_an_origin_is_put_back_as_doubles(tmp_path):
    splats = replace(some_splats(5, 1), origin=(4_500_000.25, -17.5, 3e6))
    write_ply(splats, tmp_path / "a.ply")
    table = read_table(tmp_path / "a.ply", ())
    assert table["x"].dtype == np.float64
    want = (splats.means + np.array(splats.origin)) * [1, -1, -1]  # the file's axes
    got = np.stack([table[axis] for axis in "xyz"], 1)
    np.testing.assert_array_equal(got, want)
    back = read_plain(tmp_path / "a.ply")
    whole = back.means.astype(float) + back.origin
    np.testing.assert_allclose(whole, want * [1, -1, -1], atol=0.5)  # float32 at 4.5e6


def test_labels_extra_columns_and_antialiasing_come_back(tmp_path):
    extra = {
        "obj_dc_0": np.arange(5, dtype=np.float32),
        "confidence": np.linspace(0, 1, 5),
        "red": np.arange(5, dtype=np.uint8),
        "big": np.array([2**40, 1, 2, 3, 4]),
        "a name": np.ones(5, bool),
        "opacity": np.full(5, 7, np.int16),  # would hide the splats' own
    }
    labels = np.array([0, 3, 1, 2, 2], np.int32)
    splats = replace(some_splats(5, 4), extra=extra, labels=labels, antialiased=True)
    write_ply(splats, tmp_path / "a.ply")
    assert "antialiased 1" in read_header(tmp_path / "a.ply").comments
    back = read_raw_ply(tmp_path / "a.ply", Reading())
    assert back.antialiased
    assert set(back.extra) == {"label", "obj_dc_0", "confidence", "red", "big", "a_name",
                               "opacity_"}  # fmt: skip
    np.testing.assert_array_equal(back.extra["label"], labels)
    for name in ("obj_dc_0", "confidence", "red", "big"):
        np.testing.assert_array_equal(back.extra[name], extra[name])
    np.testing.assert_allclose(read_plain(tmp_path / "a.ply").opacity, splats.opacity, rtol=1e-5)
    np.testing.assert_array_equal(read_plain(tmp_path / "a.ply").labels, labels)


def test_normals_come_back(tmp_path):
    normals = {name: np.arange(3, dtype=np.float32) + i for i, name in enumerate(("nx", "nz"))}
    write_ply(replace(some_splats(3, 1), extra=normals), tmp_path / "a.ply")
    back = read_raw_ply(tmp_path / "a.ply", Reading()).extra
    assert set(back) == {"nx", "nz"} and back["nz"].tolist() == [1, 2, 3]


def test_the_splats_given_are_not_changed(tmp_path):
    splats, same = some_splats(BLOCK + 1, 16), some_splats(BLOCK + 1, 16)
    write_ply(splats, tmp_path / "a.ply")
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        np.testing.assert_array_equal(getattr(splats, name), getattr(same, name))
    np.testing.assert_array_equal(rotate_half_turn(rotate_half_turn(splats)).sh, same.sh)


@pytest.mark.parametrize("data_of", [bytes, bytearray, memoryview, lambda b: iter([b[:3], b[3:]])])
def test_a_file_may_be_written_in_parts(tmp_path, data_of):
    write_whole(tmp_path / "a", data_of(b"some bytes"))
    assert (tmp_path / "a").read_bytes() == b"some bytes"


def test_what_fails_halfway_leaves_what_was_there(tmp_path):
    (tmp_path / "a").write_bytes(b"old")

    def parts():
        yield b"new"
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        write_whole(tmp_path / "a", parts())
    assert [p.name for p in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a").read_bytes() == b"old"
