"""Compressed PLY, read and written: against one splat at a time by hand, at every code's ends."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.formats import format_of, read_plain
from shapeshift.runtime_models.splats.operations.merge_pairs import morton_order
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.ply.read_compressed_ply import (
    from_smallest_three,
    harmonics,
    read_raw_compressed_ply,
)
from shapeshift.runtime_models.splats.ply.write_compressed_ply import write_compressed_ply
from tests.support.splat_scenes import random_layers

C0 = 0.28209479177387814
SIZES = (1, 2, 255, 256, 257, 512, 513)


def header_of(count: int, chunks: int, rest: int = 0, colors: bool = True) -> list[str]:
    lines = ["ply", "format binary_little_endian 1.0", f"element chunk {chunks}"]
    for name in ("", "scale_"):
        lines += [f"property float {end}_{name}{axis}" for end in ("min", "max") for axis in "xyz"]
    if colors:
        lines += [f"property float {end}_{axis}" for end in ("min", "max") for axis in "rgb"]
    lines.append(f"element vertex {count}")
    lines += [f"property uint packed_{n}" for n in ("position", "rotation", "scale", "color")]
    if rest:
        lines.append(f"element sh {count}")
        lines += [f"property uchar f_rest_{i}" for i in range(rest)]
    return [*lines, "end_header", ""]


def random_file(path: Path, count: int, rest: int = 0, colors: bool = True, seed: int = 0):
    """Writes random codes, extremes first; returns (ranges, words, rest codes)."""
    rng = np.random.default_rng(seed)
    chunks = math.ceil(count / 256)
    low = rng.normal(size=(chunks, 3, 3)) * 3
    ends = np.stack([low, low + rng.uniform(0, 4, low.shape)], 2)  # chunk, kind, end, axis
    ranges = ends[:, : 2 + colors].reshape(chunks, -1).astype("<f4")
    words = rng.integers(0, 2**32, (count, 4), dtype=np.uint64).astype("<u4")
    words[:2] = [[0] * 4, [2**32 - 1] * 4][: min(2, count)]
    codes = rng.integers(0, 256, (count, rest), dtype=np.uint8)
    codes[:2] = [[0] * rest, [255] * rest][: min(2, count)]
    text = "\n".join(header_of(count, chunks, rest, colors)).encode()
    path.write_bytes(text + ranges.tobytes() + words.tobytes() + codes.tobytes())
    return ranges, words, codes


def splat_by_hand(ranges, words, codes, number: int) -> dict:
    """One splat, its numbers one after the other."""
    row = [float(v) for v in ranges[number // 256]]
    position, rotation, scale, color = (int(w) for w in words[number])

    def between(at: int, shares: list[float]) -> list[float]:
        return [row[at + i] + (row[at + 3 + i] - row[at + i]) * shares[i] for i in range(3)]

    def shares(word: int) -> list[float]:
        return [(word >> 21) / 2047, (word >> 11 & 1023) / 1023, (word & 2047) / 2047]

    small = [((rotation >> s & 1023) / 1023 - 0.5) * math.sqrt(2) for s in (20, 10, 0)]
    wxyz = list(small)
    wxyz.insert(rotation >> 30, math.sqrt(max(0.0, 1 - sum(v * v for v in small))))
    red_green_blue = [(color >> s & 255) / 255 for s in (24, 16, 8)]
    if len(row) == 18:
        red_green_blue = between(12, red_green_blue)
    sh = [[(v - 0.5) / C0 for v in red_green_blue]]
    each = codes.shape[1] // 3
    for k in range(each):
        coefficients = []
        for channel in range(3):
            code = int(codes[number, channel * each + k])
            share = 0.0 if code == 0 else 1.0 if code == 255 else (code + 0.5) / 256
            coefficients.append((share - 0.5) * 8)
        sh.append(coefficients)
    return {
        "means": between(0, shares(position)),
        "scales": between(6, shares(scale)),
        "wxyz": wxyz,
        "opacity": (color & 255) / 255,
        "sh": sh,
    }


@pytest.mark.parametrize("rest", [0, 9, 24, 45])
@pytest.mark.parametrize("count", SIZES)
def test_every_splat_is_what_it_is_by_hand(tmp_path, count, rest):
    for colors in (True, False):
        path = tmp_path / f"any name {colors}.ply"  # known by its element, not by its name
        made = random_file(path, count, rest, colors, seed=count + rest)
        assert format_of(path).name == "compressed PLY"
        raw = read_raw_compressed_ply(path, Reading())
        assert len(raw.means) == count and raw.sh.shape == (count, rest // 3 + 1, 3)
        assert raw.log_scales and not raw.logits and raw.up == "-Y" and not raw.antialiased
        for number in {*range(0, count, 17), 0, 1, 254, 255, 256, count - 1}:
            if number >= count:
                continue
            wanted = splat_by_hand(*made, number)
            for name, value in wanted.items():
                got = getattr(raw, name)[number]
                assert np.allclose(got, value, rtol=2e-6, atol=3e-6), (number, name)


def plain(count: int, seed: int = 0, coefficients: int = 16, **changes) -> PlainSplats:
    layers = random_layers(count, seed, coefficients)
    arrays = {n: getattr(layers, n) for n in ("means", "scales", "wxyz", "opacity", "sh")}
    return PlainSplats(**(arrays | changes))


def sorted_as_written(splats: PlainSplats) -> np.ndarray:
    return morton_order(splats.means * np.array([1, -1, -1], np.float32))  # in the file's axes


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
def test_written_and_read_differs_by_half_a_code_at_most(tmp_path, count, coefficients):
    splats = plain(count, count, coefficients)
    splats.opacity[:3] = (0, 1, 0.5)[: min(3, count)]
    splats.sh[:, 1:].flat[:4] = (-4, 4, -3.99, 3.99)[: min(4, splats.sh[:, 1:].size)]
    path = tmp_path / "splats.ply"
    write_compressed_ply(splats, path)
    got, order = read_plain(path), sorted_as_written(splats)
    assert np.array_equal(np.sort(order), np.arange(count)) and got.format == "compressed PLY"
    assert_within_half_a_code(got, splats, order)


def assert_within_half_a_code(got: PlainSplats, splats: PlainSplats, order: np.ndarray) -> None:
    slack = 3e-6
    for first in range(0, len(order), 256):
        rows = slice(first, first + 256)
        wanted = order[rows]
        extent = np.ptp(splats.means[wanted], axis=0)
        bound = extent / 2 / np.array([2047, 1023, 2047]) + slack
        assert (np.abs(got.means[rows] - splats.means[wanted]) <= bound).all()
        logs = np.log(splats.scales[wanted]).clip(-20, 20)
        bound = np.ptp(logs, axis=0) / 2 / np.array([2047, 1023, 2047]) + slack
        assert (np.abs(np.log(got.scales[rows]) - logs) <= bound).all()
        bound = np.ptp(splats.sh[wanted, 0], axis=0) / 510 + slack
        assert (np.abs(got.sh[rows, 0] - splats.sh[wanted, 0]) <= bound).all()
    assert (np.abs(got.opacity - splats.opacity[order]) <= 1 / 510 + slack).all()
    apart = 1 - np.abs((got.wxyz * splats.wxyz[order]).sum(1))
    # three entries each half a code off, the fourth follows: an angle of 0.004 at most
    assert np.arccos(1 - apart.clip(0, 1)).max() < 0.004
    rest = splats.sh[order, 1:]
    bound = np.where(np.abs(rest) > 4 - 1 / 32, 1 / 32, 1 / 64) + slack
    assert (np.abs(got.sh[:, 1:] - rest) <= bound).all()


def test_values_beyond_what_the_codes_hold_are_cut(tmp_path):
    splats = plain(3, coefficients=4)
    splats.scales[0] = (0, 1e-30, 1e12)
    splats.sh[0, 1], splats.sh[1, 1] = -9, 9
    path = tmp_path / "splats.ply"
    write_compressed_ply(splats, path)
    got, order = read_plain(path), sorted_as_written(splats)
    back = np.argsort(order)
    assert got.sh[back[0], 1] == pytest.approx([-4] * 3) and got.sh[back[1], 1] == pytest.approx(
        [4] * 3
    )
    assert (got.scales[back[0], :2] <= 2.1e-9).all() and got.scales[back[0], 2] > 4e8


def test_splats_that_are_all_the_same_come_back_exactly(tmp_path):
    one = plain(1)
    same = PlainSplats(**{n: np.repeat(getattr(one, n), 300, axis=0)
                          for n in ("means", "scales", "wxyz", "opacity", "sh")})  # fmt: skip
    path = tmp_path / "splats.ply"
    write_compressed_ply(same, path)
    got = read_plain(path)
    assert np.abs(got.means - same.means).max() < 1e-6
    assert np.allclose(got.scales, same.scales, rtol=1e-6)
    assert np.abs(got.sh[:, 0] - same.sh[:, 0]).max() < 1e-6


def test_the_origin_comes_back_and_the_mark_of_antialiased_scenes(tmp_path):
    splats = plain(600, antialiased=True, origin=(1000.0, -50.0, 2000.0))
    path = tmp_path / "splats.ply"
    write_compressed_ply(splats, path)
    raw = read_raw_compressed_ply(path, Reading())
    assert raw.antialiased
    middle = np.array([1000.0, 50.0, -2000.0])  # in the file's axes: y and z turned
    assert np.abs(raw.means.mean(0) - middle).max() < 0.2
    where = raw.means.astype(np.float64) * (1, -1, -1) - splats.origin
    wanted = splats.means[sorted_as_written(splats)]
    assert np.abs(where - wanted).max() < 0.01


def test_one_splat_a_kilometre_out_does_not_coarsen_the_others(tmp_path):
    splats = plain(5000)
    splats.means[0] = (1000, 0, 0)
    path = tmp_path / "splats.ply"
    write_compressed_ply(splats, path)
    error = np.abs(read_plain(path).means - splats.means[sorted_as_written(splats)]).max(1)
    assert np.quantile(error, 0.94) < 2e-3  # of all but the chunk of that splat


def test_the_order_is_a_permutation_that_brings_neighbours_together():
    rng = np.random.default_rng(0)
    for points in (rng.normal(size=(4096, 3)), np.zeros((7, 3)), rng.normal(size=(1, 3)) * 1e30,
                   np.zeros((0, 3)), np.full((300, 3), 5.0), rng.normal(size=(900, 3)) * (1, 0, 1),
                   rng.normal(size=(500, 3)).astype(np.float32) * 1e30):  # fmt: skip
        order = morton_order(points)
        assert np.array_equal(np.sort(order), np.arange(len(points)))
    assert np.array_equal(morton_order(np.zeros((9, 3))), np.arange(9))  # equal ones stay
    points = rng.uniform(size=(4096, 3))
    extents = [np.ptp(points[order][i : i + 256], axis=0).mean()
               for order in [morton_order(points)] for i in range(0, 4096, 256)]  # fmt: skip
    assert np.mean(extents) < 0.6  # of 1; at random 0.99, cubes of the same number 0.4


def broken(path: Path, change) -> Path:
    path.write_bytes(change(path.read_bytes()))
    return path


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"element chunk 2", b"element chunk 1", "1 chunks, 257 splats need 2"),
        (b"element chunk 2", b"element chunk 9", "chunks|cut off"),
        (b"element vertex 257", b"element vertex 99999999", "cut off"),
        (b"element vertex 257", b"element vertex 0", "no splats"),
        (b"element sh 257", b"element sh 256", "harmonics of 256"),
        (b"uint packed_scale", b"float packed_scale", "no packed_scale"),
        (b"packed_rotation", b"packed_rotatiom", "no packed_rotation"),
        (b"float min_x", b"uint min_x", "no min_x"),
        (b"uchar f_rest_3", b"char f_rest_3", "no f_rest_3"),
        (b"property uchar f_rest_8\n", b"", "9, 24 or 45"),
        (b"f_rest_8", b"f_rest_9", "9, 24 or 45"),
        (b"element vertex", b"element vertices", "vertex"),
        (b"binary_little_endian", b"ascii", "ASCII"),
        (b"property uchar f_rest_0", b"property list uchar int f_rest_0", "f_rest|sh"),
    ],
)
def test_what_cannot_be_read_is_one_sentence(tmp_path, old, new, words):
    path = tmp_path / "splats.ply"
    random_file(path, 257, rest=9)
    with pytest.raises(BadFile, match=words) as caught:
        read_raw_compressed_ply(broken(path, lambda data: data.replace(old, new, 1)), Reading())
    assert "\n" not in str(caught.value)


def test_a_file_cut_anywhere_is_refused(tmp_path):
    path = tmp_path / "splats.ply"
    random_file(path, 257, rest=9)
    whole = path.read_bytes()
    for length in [3, 40, 400, 800, 900, 1000, 1200, 5000, len(whole) - 2313, len(whole) - 1]:
        path.write_bytes(whole[:length])
        with pytest.raises(BadFile):
            read_raw_compressed_ply(path, Reading())


def test_ranges_of_nan_drop_their_chunk_alone(tmp_path):
    path = tmp_path / "splats.ply"
    ranges, _, _ = random_file(path, 600)
    data = bytearray(path.read_bytes())
    start = data.index(b"end_header\n") + 11
    struct.pack_into("<f", data, start + ranges.shape[1] * 4, math.nan)  # min_x of chunk 1
    path.write_bytes(data)
    got = read_plain(path)
    assert len(got.means) == 600 - 256 and got.dropped == 256


def test_the_real_biker_and_guitar(data):
    folder = data / "splats_playcanvas"
    for name, count in (("biker", 152_746), ("guitar", 90_854)):
        got = read_plain(folder / f"{name}.compressed.ply")
        assert got.means.shape == (count, 3) and got.sh.shape == (count, 1, 3)
        assert got.dropped == 0 and got.format == "compressed PLY"
        height, width, depth = np.ptp(got.means, axis=0)[[1, 0, 2]]
        assert height > max(width, depth)  # both stand upright


def test_every_code_of_a_harmonic_is_the_middle_of_its_bin_to_the_bit():
    share = (np.arange(256) + 0.5) / 256
    share[[0, 255]] = 0, 1
    codes = np.arange(256, dtype=np.uint8)
    every = np.tile(codes, 90)[: 256 * 90].reshape(-1, 3, 15)
    wanted = ((share - 0.5) * 8).astype(np.float32)[every].transpose(0, 2, 1)
    assert np.array_equal(harmonics(every), wanted)
    assert harmonics(every[:, :, :0]).shape == (len(every), 0, 3)


@pytest.mark.parametrize("largest", [0, 1, 2, 3])
def test_the_entry_left_out_of_a_quaternion_goes_to_its_place(largest):
    small = np.random.default_rng(0).uniform(-0.5, 0.5, (100, 3)).astype(np.float32)
    out = np.empty((100, 4), np.float32)
    from_smallest_three(list(small.T), np.full(100, largest, np.uint32), out)
    assert np.array_equal(np.delete(out, largest, axis=1), small)
    assert np.array_equal(out[:, largest], np.sqrt(1 - (small * small).sum(1)))
