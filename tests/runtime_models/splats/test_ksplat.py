"""ksplat read: levels, sections and buckets against one splat at a time; what lies is refused."""

import struct

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.formats import format_of, read_plain
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading
from shapeshift.runtime_models.splats.read_ksplat import read_raw_ksplat
from tests.support.splats.ksplat_files import HandSection, ksplat


@pytest.fixture
def read(tmp_path):
    def read_bytes(data: bytes) -> RawSplats:
        (tmp_path / "a.ksplat").write_bytes(data)
        return read_raw_ksplat(tmp_path / "a.ksplat", Reading())

    return read_bytes


def section(lengths: list[int], level: int, degree: int = 0, seed: int = 0, **kind) -> HandSection:
    rng = np.random.default_rng(seed)
    if level:
        buckets = [rng.integers(0, 65535, (n, 3)) for n in lengths]
        if sum(lengths) > 1:
            buckets[0][0], buckets[-1][-1] = 0, 65535
    else:
        buckets = [rng.normal(size=(sum(lengths), 3)).astype(np.float32)]
    centers = [tuple(rng.normal(size=3).astype(np.float32) * 30) for _ in lengths]
    return HandSection(buckets, centers, degree, seed=seed, **kind)


def check(raw: RawSplats, splats: list[dict]) -> None:
    assert len(raw.means) == len(splats)
    for i, hand in enumerate(splats):
        for name, want in hand.items():
            got = getattr(raw, name)[i]
            want = np.asarray(want, np.float64)
            if name == "sh":  # a section of a lower degree has zeros behind
                want = np.concatenate([want, np.zeros((len(got) - len(want), 3))])
            np.testing.assert_allclose(got, want, rtol=1e-5, atol=1e-5, err_msg=f"{name} of {i}")


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("lengths", [[1], [4], [4, 4], [4, 4, 3, 1, 2], [3], [2, 0, 1]])
def test_every_splat_is_what_it_is_by_hand(read, level, degree, lengths):
    data, splats = ksplat(level, [section(lengths, level, degree, seed=degree)])
    raw = read(data)
    check(raw, splats)
    assert raw.up == "-Y" and not raw.log_scales and not raw.logits
    assert raw.sh.shape[1] == (degree + 1) ** 2


@pytest.mark.parametrize("level", [0, 1, 2])
def test_several_sections_with_degrees_and_empty_rows_of_their_own(read, level):
    sections = [
        section([4, 4, 1], level, 2, seed=1, spare=3),
        section([2], level, 0, seed=2, block=0.5, steps=20000),
        section([4, 2, 3], level, 1, seed=3, spare=1, block=9.0),
    ]
    data, splats = ksplat(level, sections, least=-0.7, most=2.5)
    assert len(splats) == 20
    check(read(data), splats)


def test_the_sizes_of_a_bucket_around_the_format_s_own(read):
    """255, 256 and 257 splats in buckets of 256, as GaussianSplats3D writes them."""
    for count in (255, 256, 257, 513):
        lengths = [256] * (count // 256) + [count % 256] * (count % 256 > 0)
        made = section(lengths, 1, seed=count, bucket_size=256)
        data, splats = ksplat(1, [made])
        check(read(data), splats)


def test_numbers_that_are_none_are_left_to_the_judge(read):
    made = section([3], 0)
    made.buckets[0][1] = [np.nan, np.inf, -np.inf]
    raw = read(ksplat(0, [made])[0])
    assert np.isnan(raw.means[1, 0]) and np.isinf(raw.means[1, 1:]).all()


@pytest.mark.parametrize("count", [99, 100])
@pytest.mark.parametrize("middle", [0, 1])
def test_a_flat_scene_thrown_to_the_ends_of_its_codes_is_said(read, count, middle):
    """Of z alone both ends and nothing between; of fewer than 100 splats nothing is said."""
    codes = np.random.default_rng(0).integers(1, 65534, (count, 3))
    codes[:, 2] = np.where(np.arange(count) % 3, 65535, 0)
    codes[0, 2] = 30_000 if middle else 0
    made = HandSection([codes], [(0.0, 0.0, 0.0)], bucket_size=count)
    told = [finding.what for finding in read(ksplat(1, [made])[0]).findings]
    said = f"{count} splats lie at the ends of their blocks in z, none between"
    assert told == ([said] if count == 100 and not middle else [])


GOOD = ksplat(1, [section([4, 2], 1)])[0]


def patched(at: int, form: str, *values) -> bytes:
    size = struct.calcsize(form)
    return GOOD[:at] + struct.pack(form, *values) + GOOD[at + size :]


@pytest.mark.parametrize(
    "data, sentence",
    [
        (b"", "has 0 bytes"),
        (GOOD[:4095], "has 4095 bytes"),
        (GOOD[:-1], "the file is cut off"),
        (patched(0, "<B", 1), "version 1.1"),
        (patched(1, "<B", 0), "version 0.0"),
        (patched(4, "<I", 3), "too few for its 3 sections"),
        (patched(4, "<I", 0xFFFFFFFF), "too few for its 4,294,967,295"),
        (patched(16, "<I", 7), "says that it has 7 splats, its sections 6"),
        (patched(16, "<I", 0xFFFFFFFF), "says that it has 4,294,967,295"),
        (patched(16, "<I", 0), "no splats"),
        (patched(20, "<H", 3), "compression level 3"),
        (patched(4096, "<I", 7), "7 splats in room for 6"),
        (patched(4100, "<I", 0xFFFFFFFF), "cut off"),
        (patched(4104, "<I", 0), "its buckets hold 2"),
        (patched(4104, "<I", 0xFFFFFFFF), "its buckets hold"),
        (patched(4108, "<I", 0), "in room for 0"),
        (patched(4108, "<I", 0xFFFFFFFF), "cut off"),
        (patched(4112, "<f", np.nan), "buckets of nan m"),
        (patched(4112, "<f", -5), "buckets of -5 m"),
        (patched(4116, "<H", 8), "8 bytes each"),
        (patched(4120, "<I", 0xFFFFFFFF), "4,294,967,295 steps"),
        (patched(4128, "<I", 0xFFFFFFFF), "in room for 2"),
        (patched(4132, "<I", 0xFFFFFFFF), "cut off"),
        (patched(4136, "<H", 4), "SH degree 4"),
        (patched(5120, "<I", 0), "its buckets hold 4"),
        (patched(5120, "<I", 0xFFFFFFFF), "its buckets hold"),
    ],
)
def test_what_lies_is_refused_with_a_sentence(read, data, sentence):
    with pytest.raises(BadFile, match=sentence) as error:
        read(data)
    assert "a.ksplat" in str(error.value) and "\n" not in str(error.value)


def test_ranges_of_harmonics_that_are_none_are_refused(read):
    for least, most in ((1.0, -1.0), (np.nan, 1.0), (-1.0, np.inf)):
        with pytest.raises(BadFile, match="its harmonics lie from"):
            read(ksplat(2, [section([2], 2, 1)], least, most)[0])


def test_the_fixture_is_four_splats_a_metre_apart(data):
    path = data / "splats_misc/splat-transform_fixtures/splat/minimal.ksplat"
    assert format_of(path).name == ".ksplat"
    plain = read_plain(path)
    want = np.array([[-1, 0, -1], [0, 0, -1], [-1, 0, 0], [0, 0, 0]]) * (1, -1, -1)
    np.testing.assert_array_equal(plain.means, want)
    np.testing.assert_allclose(plain.scales, 0.1, rtol=1e-5)
    np.testing.assert_allclose(plain.opacity, 230 / 255, rtol=1e-5)
