"""PLY of points: shown as round splats of their colour and spacing, and said to be points."""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.formats import format_of
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.read_points_ply import (
    SIGMA,
    knn_distance,
    nearest_distances,
    read_raw_points_ply,
)

C0 = 0.28209479177387814
TYPES = {"f4": "float", "f8": "double", "u1": "uchar", "u2": "ushort", "i4": "int"}


def write_points(path: Path, columns: dict[str, np.ndarray], encoding="binary_little_endian"):
    """A PLY with these columns; the type of each is its array's."""
    count = len(next(iter(columns.values())))
    order = ">" if "big" in encoding else "<"
    row = np.dtype([(name, order + array.dtype.str[1:]) for name, array in columns.items()])
    table = np.empty(count, row)
    for name, array in columns.items():
        table[name] = array
    lines = ["ply", f"format {encoding} 1.0", "comment made for a test", f"element vertex {count}"]
    lines += [f"property {TYPES[a.dtype.str[1:]]} {name}" for name, a in columns.items()]
    data = "\n".join([*lines, "end_header", ""]).encode()
    if encoding == "ascii":
        text = "\n".join(" ".join(repr(v) for v in record.tolist()) for record in table)
        path.write_bytes(data + text.encode() + b"\n")
    else:
        path.write_bytes(data + table.tobytes())
    return path


def cloud(count: int, seed: int = 0, kind="f4") -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(count, 3)).astype(kind)
    colors = rng.integers(0, 256, (count, 3), dtype=np.uint8)
    return dict(zip("xyz", places.T, strict=True)) | dict(
        zip(("red", "green", "blue"), colors.T, strict=True)
    )


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian", "ascii"])
@pytest.mark.parametrize("count", [1, 2, 3, 4, 257, 3000])
def test_points_with_colours(tmp_path, encoding, count):
    columns = cloud(count, count)
    path = write_points(tmp_path / "points.ply", columns, encoding)
    assert format_of(path).name == "PLY of points"
    raw = read_raw_points_ply(path, Reading())
    places = np.stack([columns[axis] for axis in "xyz"], 1)
    assert np.array_equal(raw.means, places) and not raw.log_scales and not raw.logits
    wanted = np.stack([columns[name] for name in ("red", "green", "blue")], 1) / 255
    assert np.abs(raw.sh[:, 0] * C0 + 0.5 - wanted).max() < 1e-6
    assert (raw.opacity == 1).all() and (raw.wxyz == (1, 0, 0, 0)).all()
    assert np.allclose(raw.scales, (SIGMA * knn_distance(places))[:, None], rtol=1e-6)
    layers = read_model(path)
    assert layers.splat_count == count
    assert np.allclose(layers.means, places * (1, -1, -1), atol=1e-6)  # COLMAP's axes, turned
    [found] = layers.findings
    for word in ("point cloud", "opacity", "scale_0", "rot_3", "f_dc_2", f"{count:,} points"):
        assert word in found.what + found.done


def test_strict_shows_splats_only(tmp_path):
    path = write_points(tmp_path / "points.ply", cloud(9))
    with pytest.raises(BadFile, match=r"point cloud, no splats: it has no opacity.*--strict"):
        read_model(path, Reading(strict=True))


@pytest.mark.parametrize(
    ("names", "kind", "most"),
    [(("diffuse_red", "diffuse_green", "diffuse_blue"), "u1", 255), (("r", "g", "b"), "f4", 1),
     (("red", "green", "blue"), "u2", 65535), (("red", "green", "blue"), "f8", 1)],
)  # fmt: skip
def test_colours_under_other_names_and_types(tmp_path, names, kind, most):
    columns = {axis: cloud(50)[axis] for axis in "xyz"}
    shares = np.random.default_rng(0).uniform(size=(3, 50))
    columns |= {
        name: (share * most).astype(kind) for name, share in zip(names, shares, strict=True)
    }
    raw = read_raw_points_ply(write_points(tmp_path / "points.ply", columns), Reading())
    assert np.abs(raw.sh[:, 0] * C0 + 0.5 - shares.T).max() < 1 / 250
    assert raw.extra == {}


def test_without_colours_points_are_gray_and_other_columns_are_kept(tmp_path):
    columns = {axis: cloud(50)[axis] for axis in "xyz"}
    columns |= {name: np.ones(50, "f4") for name in ("nx", "ny", "nz")}
    columns |= {"label": np.arange(50, dtype="i4"), "curvature": np.linspace(0, 1, 50)}
    path = write_points(tmp_path / "points.ply", columns)
    raw = read_raw_points_ply(path, Reading())
    assert raw.sh * C0 + 0.5 == pytest.approx(0.7)
    assert list(raw.extra) == ["label", "curvature"]
    assert np.array_equal(read_model(path).labels, np.arange(50))


def test_far_points_keep_their_double_precision(tmp_path):
    columns = {axis: cloud(300, kind="f8")[axis] + 5e6 for axis in "xyz"}
    raw = read_raw_points_ply(write_points(tmp_path / "points.ply", columns), Reading())
    assert raw.means.dtype == np.float64
    assert np.array_equal(raw.means[:, 0], columns["x"])
    near = knn_distance(raw.means - 5e6)
    assert np.allclose(raw.scales[:, 0], SIGMA * near, rtol=1e-4)


def test_points_that_are_no_numbers_go_and_leave_the_size_of_the_others(tmp_path):
    columns = cloud(200)
    columns["x"][[0, 7]] = np.nan, np.inf
    path = write_points(tmp_path / "points.ply", columns)
    layers = read_model(path)
    assert layers.splat_count == 198 and np.isfinite(layers.scales).all()


def test_splats_that_lack_one_column_are_no_points(tmp_path):
    columns = cloud(5) | {f"scale_{i}": np.zeros(5, "f4") for i in range(3)}
    path = write_points(tmp_path / "splats.ply", columns)
    assert format_of(path).name == "3DGS PLY"
    with pytest.raises(BadFile, match="has no opacity"):
        read_model(path)


def test_a_mesh_is_shown_by_its_corners(tmp_path):
    path = write_points(tmp_path / "mesh.ply", cloud(40))
    data = path.read_bytes().replace(
        b"end_header", b"element face 1\nproperty list uchar int vertex_indices\nend_header"
    )
    path.write_bytes(data + b"\x03" + bytes(12))
    assert read_model(path).splat_count == 40


def test_points_cut_off(tmp_path):
    for encoding in ("binary_little_endian", "ascii"):
        path = write_points(tmp_path / "points.ply", cloud(100), encoding)
        whole = path.read_bytes()
        for length in (20, 60, 150, len(whole) // 2, len(whole) - 30):
            path.write_bytes(whole[:length])
            with pytest.raises(BadFile):
                read_model(path)


def by_hand(points: np.ndarray) -> np.ndarray:
    distances = np.linalg.norm(points[:, None] - points[None], axis=-1)
    distances.sort(axis=1)
    return distances[:, 1:4].mean(axis=1)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 20, 1500])
def test_distances_are_near_those_of_all_pairs(count):
    rng = np.random.default_rng(count)
    ball = rng.normal(size=(count, 3))
    sphere = ball / np.linalg.norm(ball, axis=1, keepdims=True)
    for points in (ball, sphere, ball * (1, 1, 0), ball * 1e12, ball.round(1)):
        ratio = nearest_distances(points) / np.maximum(by_hand(points), 1e-9)
        exact = by_hand(points) > 1e-9
        assert (ratio[exact] > 1 - 1e-9).all()
        assert np.median(ratio[exact]) < 1.03 and np.quantile(ratio[exact], 0.95) < 1.6


def test_spacing_where_there_is_none():
    assert np.array_equal(knn_distance(np.zeros((1, 3))), [0.01])
    assert np.array_equal(knn_distance(np.zeros((5, 3))), [0.01] * 5)
    assert np.array_equal(knn_distance(np.full((5, 3), np.nan)), [0.01] * 5)
    assert knn_distance(np.zeros((0, 3))).shape == (0,)
    line = np.arange(100.0)[:, None] * (1, 0, 0)
    line[0] = -1000  # a stray
    assert knn_distance(line)[50] == pytest.approx(4 / 3) and knn_distance(line)[
        0
    ] == pytest.approx(16 / 3)
    assert (knn_distance(line) > 0).all()
