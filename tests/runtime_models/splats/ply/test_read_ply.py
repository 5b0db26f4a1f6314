"""The PLY reader against reading value by value: block edges, types, orders, comments, memory."""

import contextlib
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.files.blocks import BLOCK, WORTH_A_THREAD, block_of
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.read_ply import read_raw_ply
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.splats.ply_files import names_of, random_rows, sh_of, some_splats, write_rows


def check_rows(raw, rows, coefficients):
    """Every number of the raw splats is that of the rows, to the bit."""

    def column(*names):
        return np.array([[row[name] for name in names] for row in rows], np.float32)

    np.testing.assert_array_equal(raw.means, column("x", "y", "z"))
    np.testing.assert_array_equal(raw.scales, column("scale_0", "scale_1", "scale_2"))
    np.testing.assert_array_equal(raw.wxyz, column("rot_0", "rot_1", "rot_2", "rot_3"))
    np.testing.assert_array_equal(raw.opacity, column("opacity")[:, 0])
    want = np.array([sh_of(row, coefficients) for row in rows], np.float32)
    np.testing.assert_array_equal(raw.sh, want)


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
@pytest.mark.parametrize("count", [1, 256, 257, BLOCK - 1, BLOCK, BLOCK + 1])
def test_it_is_reading_value_by_value(tmp_path, count, coefficients):
    rows = random_rows(count, names_of(coefficients), seed=count)
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", rows), Reading())
    check_rows(raw, rows, coefficients)
    assert raw.extra == {} and not raw.antialiased and raw.findings == ()


def test_several_threads_read_the_same(tmp_path):
    rows = random_rows(4 * WORTH_A_THREAD * BLOCK + 1, names_of(1))
    check_rows(read_raw_ply(write_rows(tmp_path / "a.ply", rows), Reading()), rows, 1)


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian", "ascii"])
def test_encodings_orders_types_and_other_columns(tmp_path, encoding):
    names = [*names_of(4), "red", "obj_dc_0", "confidence"]
    kinds = {"red": "uchar", "confidence": "double", "opacity": "double", "f_rest_4": "double"}
    rows = random_rows(BLOCK + 3, names)
    for i, row in enumerate(rows):
        row["red"] = i % 256
    order = np.random.default_rng(1).permutation(len(names))
    rows = [{names[i]: row[names[i]] for i in order} for row in rows]
    path = write_rows(tmp_path / "a.ply", rows, kinds, encoding)
    raw = read_raw_ply(path, Reading())
    check_rows(raw, rows, 4)
    assert set(raw.extra) == {"red", "obj_dc_0", "confidence"}
    for name, kind in (("red", np.uint8), ("obj_dc_0", np.float32), ("confidence", np.float64)):
        assert raw.extra[name].dtype == kind
        np.testing.assert_array_equal(raw.extra[name], np.array([r[name] for r in rows], kind))


def test_doubles_of_places_stay_doubles(tmp_path):
    rows = random_rows(5, names_of(1))
    for row in rows:
        row["x"] = 4_500_000.123456789
    path = write_rows(tmp_path / "a.ply", rows, {"x": "double", "y": "double", "z": "double"})
    raw = read_raw_ply(path, Reading())
    assert raw.means.dtype == np.float64 and (raw.means[:, 0] == 4_500_000.123456789).all()


def test_normals_are_kept_where_one_is_not_zero(tmp_path):
    rows = random_rows(2 * BLOCK, names_of(1))
    rows[BLOCK + 5]["ny"] = 1.0
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", rows), Reading())
    assert list(raw.extra) == ["ny"]
    assert np.flatnonzero(raw.extra["ny"]).tolist() == [BLOCK + 5]


@pytest.mark.parametrize(
    ("comment", "wanted"),
    [("antialiased 1", True), ("antialiased 0", False), ("SplatRenderMode: mip", True),
     ("SplatRenderMode: default", False), ("made by antialiased 1 2", False)],
)  # fmt: skip
def test_comments_say_whether_it_was_trained_antialiased(tmp_path, comment, wanted):
    path = write_rows(tmp_path / "a.ply", random_rows(2, names_of(1)), comments=(comment,))
    assert read_raw_ply(path, Reading()).antialiased is wanted
    assert read_model(path).antialiased is wanted


@pytest.mark.parametrize("comment", ["", "SplatRenderMode: 2dgs"])
def test_two_scales_are_discs(tmp_path, comment):
    rows = random_rows(BLOCK + 1, names_of(1))
    for row in rows:
        if not comment:
            del row["scale_2"]
    path = write_rows(tmp_path / "a.ply", rows, comments=(comment,) if comment else ())
    raw = read_raw_ply(path, Reading())
    thin = np.minimum(raw.scales[:, 0], raw.scales[:, 1]) + np.log(1e-3)
    np.testing.assert_allclose(raw.scales[:, 2], thin, rtol=1e-6)
    (found,) = raw.findings
    assert "2D splats" in found.what and "flat" in found.done and found.count == BLOCK + 1
    plain = read_plain(path)
    np.testing.assert_allclose(plain.scales[:, 2], plain.scales[:, :2].min(1) / 1000, rtol=1e-5)


def test_elements_behind_the_splats_are_passed_over(tmp_path):
    rows = random_rows(3, names_of(1))
    after = "element face 1\nproperty list uchar int vertex_indices"
    path = write_rows(tmp_path / "a.ply", rows, after=after)
    path.write_bytes(path.read_bytes() + b"\3" + bytes(12))
    check_rows(read_raw_ply(path, Reading()), rows, 1)


def test_progress_rises_to_one(tmp_path):
    write_ply(some_splats(2 * block_of(68) + 1, 1), tmp_path / "a.ply")
    told = []
    read_raw_ply(tmp_path / "a.ply", Reading(progress=lambda *word: told.append(word)))
    parts = [part for _, part in told]
    assert {what for what, _ in told} == {"reading a.ply"}
    assert parts == sorted(parts) and parts[-1] == 1 and len(parts) == 3


ASCII = {
    "a word": (lambda d: d.replace(b" 0.0 ", b" five ", 1), "words that are no numbers"),
    "cut in a word": (lambda d: d[:-3], None),  # 0.1234 -> 0.1: nobody can know
    "cut between words": (lambda d: d.rsplit(b" ", 1)[0], "promises 20 splats.*the file holds 19"),
    "cut off": (lambda d: d.rsplit(b"\n", 2)[0], "promises 20 splats.*the file holds 18"),
    "a long word": (lambda d: d + b"\n" + b"1" * 3_000_000, None),  # behind what is read
    "nothing": (lambda d: d[: d.index(b"end_header") + 11], "promises 20 splats"),
}


@pytest.mark.parametrize("how", ASCII)
def test_broken_ascii_is_one_sentence(tmp_path, how):
    path = write_rows(tmp_path / "a.ply", random_rows(20, names_of(1)), encoding="ascii")
    damage, words = ASCII[how]
    path.write_bytes(damage(path.read_bytes()))
    if words is None:
        assert len(read_raw_ply(path, Reading()).means) == 20
        return
    with pytest.raises(BadFile, match=words) as failure:
        read_raw_ply(path, Reading())
    assert "\n" not in str(failure.value)


@pytest.mark.parametrize("cut", range(1, 60))
def test_ascii_of_one_splat_opens_or_is_one_sentence(tmp_path, cut):
    """Cut anywhere, also within a word, and with no last end of line."""
    path = write_rows(tmp_path / "a.ply", random_rows(1, names_of(1)), encoding="ascii")
    data = path.read_bytes()
    assert not data.endswith(b"\n") and len(read_raw_ply(path, Reading()).means) == 1
    path.write_bytes(data[:-cut])
    with contextlib.suppress(BadFile):
        assert len(read_raw_ply(path, Reading()).means) == 1


def test_names_of_columns_are_any(tmp_path):
    """A colon, which a record of numpy has but a buffer of Python may not."""
    rows = [row | {"user:label": 7.0} for row in random_rows(9, names_of(1))]
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", rows), Reading())
    np.testing.assert_array_equal(raw.extra["user:label"], np.full(9, 7, np.float32))


def test_a_word_without_end_is_not_collected(tmp_path):
    path = write_rows(tmp_path / "a.ply", random_rows(2, names_of(1)), encoding="ascii")
    head = path.read_bytes().split(b"end_header\n")[0]
    path.write_bytes(head + b"end_header\n" + b"1" * 5_000_000)
    with pytest.raises(BadFile, match=r"a word of \d+ bytes"):
        read_raw_ply(path, Reading())


def test_a_file_that_shrinks_while_it_is_read_is_one_sentence(tmp_path, monkeypatch):
    path = write_rows(tmp_path / "a.ply", random_rows(3, names_of(1)))
    from shapeshift.runtime_models.splats.ply import read_ply

    header = read_ply.read_header(path)
    monkeypatch.setattr(read_ply, "read_header", lambda _: header)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(BadFile, match="became shorter while it was read"):
        read_raw_ply(path, Reading())


def test_memory_of_opening_is_that_of_the_arrays(tmp_path):
    """The whole way, at most 1.3 times what the model holds (numpy tells tracemalloc)."""
    splats = some_splats(100_000, 16)
    write_ply(replace(splats, scales=splats.scales / 20), tmp_path / "a.ply")  # no wall of fog
    read_model(tmp_path / "a.ply")  # imports
    tracemalloc.start()
    model = read_model(tmp_path / "a.ply")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    names = ("means", "scales", "wxyz", "opacity", "sh", "layer")
    assert peak <= 1.3 * sum(getattr(model, name).nbytes for name in names)
