"""spz read: every code of every version against one splat at a time; what lies is refused."""

import gzip
import struct
import tracemalloc
import zlib

import numpy as np
import pytest

from shapeshift.rasterizer.device import NoDevice
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.formats import format_of, read_plain, read_raw
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading
from shapeshift.runtime_models.splats.spz.read_spz import read_spz_bytes
from shapeshift.runtime_models.splats.spz.spz_axes import axes_extension
from shapeshift.runtime_models.splats.spz.spz_file import is_spz
from shapeshift.scene.pose import View, look_at
from tests.support.splat_scenes import alone, psnr_db
from tests.support.splats.lint_scenes import invalid_rows
from tests.support.splats.spz_files import legacy, modern, random_streams, splat_by_hand

BIKER = View(look_at((0.5, 1.2, -3), (0, 1.0, 0)), (-0.25, 0.25, -0.4, 0.4), 0.05, 50, (160, 256))


def read(data: bytes) -> RawSplats:
    """What the axes are, where the file does not say it, is another test: test_spz_axes.py."""
    return read_spz_bytes(data, "a.spz", Reading(), "RUB")


def file_of(version: int, count: int, degree: int, streams: list[bytes], **kind) -> bytes:
    if version == 4:
        return modern(count, degree, streams, **kind)
    return legacy(count, version, degree, streams, **kind)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("version", [1, 2, 3, 4])
@pytest.mark.parametrize("count", [1, 257])
def test_every_splat_is_what_it_is_by_hand(version, degree, count):
    streams = random_streams(count, version, degree, seed=degree)
    raw = read(file_of(version, count, degree, streams))
    assert raw.sh.shape == (count, (degree + 1) ** 2, 3)
    assert raw.format == f"spz v{version}" and raw.up == "+Y" and not raw.antialiased
    assert raw.log_scales and not raw.logits and raw.findings == ()
    for i in range(count):
        hand = splat_by_hand(streams, i, version, degree, 12)
        for name, want in hand.items():
            got = getattr(raw, name)[i]
            np.testing.assert_allclose(got.ravel(), np.ravel(want), rtol=0, atol=2e-6, err_msg=name)


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_what_is_said_to_be_usual_is_so_of_any_codes(version):
    """A reader that says so is believed: of no code, sensible or not, comes an odd number."""
    width, count = (9, 1, 3, 3, 4 if version >= 3 else 3, 45), 600
    rng = np.random.default_rng(0)
    for fill in (0, 255, 127, 128, None):
        codes = (
            rng.integers(0, 256, (count, sum(width)), np.uint8)
            if fill is None
            else np.full((count, sum(width)), fill, np.uint8)
        )
        parts = np.split(codes, np.cumsum(width)[:-1], axis=1)
        if version == 1:
            parts[0] = parts[0][:, :6]
        streams = [np.ascontiguousarray(part).tobytes() for part in parts]
        for bits in (0, 30):
            raw = read(file_of(version, count, 3, streams, bits=bits))
            assert raw.usual == (version > 1)
            raw.usual = False
            odd = invalid_rows(raw)
            assert len(odd) == 0 or version == 1, (fill, bits)
            lengths = np.linalg.norm(raw.wxyz, axis=1)
            assert (lengths > 0.99).all() and (lengths < 2).all()


@pytest.mark.parametrize("bits", [0, 1, 12, 23, 24, 30])
def test_places_are_exact_at_both_ends_of_the_code(bits):
    codes = [-(1 << 23), -1, 0, 1, (1 << 23) - 1, 0x123456, -0x123456, 255, 256]
    places = b"".join(code.to_bytes(3, "little", signed=True) for code in codes)
    streams = [places, *random_streams(3, 2, 0)[1:]]
    want = np.reshape(codes, (3, 3)) / 2.0**bits
    for data in (legacy(3, 2, 0, streams, bits=bits), modern(3, 0, [*streams[:4], bytes(12), b""],
                                                             bits=bits)):  # fmt: skip
        np.testing.assert_array_equal(read(data).means, want.astype(np.float32))


def test_a_raw_file_is_the_compressed_one():
    streams = random_streams(100, 2, 1)
    plain, packed = (read(legacy(100, 2, 1, streams, raw=raw)) for raw in (True, False))
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(packed, name))


@pytest.mark.parametrize("version", [3, 4])
def test_degree_four_is_drawn_up_to_degree_three(version):
    streams = random_streams(5, version, 4)
    raw = read(file_of(version, 5, 4, streams))
    assert raw.sh.shape == (5, 16, 3)
    assert "degree 4" in raw.findings[0].what and raw.findings[0].count == 0
    np.testing.assert_allclose(
        raw.sh[2].ravel(), splat_by_hand(streams, 2, version, 4, 12)["sh"], atol=2e-6
    )


@pytest.mark.parametrize("version", [3, 4])
def test_an_unknown_extension_is_told(version):
    streams = random_streams(4, version, 0)
    unknown = struct.pack("<II", 0x00010002, 3) + b"abc"
    data = file_of(version, 4, 0, streams, flags=3, extensions=unknown + axes_extension("RDF"))
    raw = read(data)
    assert raw.up == "-Y" and raw.antialiased
    assert [f.done for f in raw.findings] == ["not looked at"]


def test_extensions_that_lie_about_their_length_end_there():
    lie = struct.pack("<II", 0xADBE0003, 1 << 31) + b"abcd"
    assert read(modern(4, 0, random_streams(4, 4, 0), flags=2, extensions=lie)).up == "+Y"


def header(version=3, count=4, degree=0, bits=12, magic=b"NGSP") -> bytes:
    return struct.pack("<4sIIBBBB", magic, version, count, degree, bits, 0, 0)


@pytest.mark.parametrize("said, body", [(1, 2), (1, 3), (2, 3)])
@pytest.mark.parametrize("degree", [0, 3])
def test_a_body_of_another_version_than_the_header_s_is_refused(said, body, degree):
    """The format's own writer makes such: version 1 over the body of version 2."""
    streams = random_streams(50, body, degree)
    with pytest.raises(BadFile, match=f"says version {said} .* version {body} take"):
        read(legacy(50, said, degree, streams))
    assert len(read(legacy(50, body, degree, streams)).means) == 50


UNKNOWN, AXES = struct.pack("<II", 7, 5) + b"abcde", axes_extension("RDF")


@pytest.mark.parametrize("records", [AXES, UNKNOWN, UNKNOWN + AXES, AXES + bytes(21)])
@pytest.mark.parametrize("count", [1, 2, 4, 7, 50, 70_000])  # the last takes several pieces
def test_a_body_of_another_version_with_extensions_behind_it_is_refused(count, records):
    """Whole records lie where the other version's splats end, and none where its own do."""
    for body in (1, 2, 3):
        sizes = (6 if body == 1 else 9, 1, 3, 3, 4 if body == 3 else 3)
        streams = [np.random.default_rng(0).bytes(size * count) for size in sizes]
        for said in (1, 2, 3):
            data = legacy(count, said, 0, streams, flags=2, extensions=records, raw=True)
            if said == body:
                raw = read(data)
                assert len(raw.means) == count and (raw.up == "-Y") == (AXES in records)
                continue
            with pytest.raises(BadFile, match=f"(version {body} take|cut off)"):
                read(data)


def test_extensions_that_end_in_what_is_none_are_read_as_far_as_they_are_whole():
    data = legacy(50, 2, 0, random_streams(50, 2, 0), flags=2, extensions=AXES + b"\xff" * 99)
    assert read(data).up == "-Y"


@pytest.mark.parametrize("more", [1, 49, 51, 149, 151, 100_000])
def test_what_follows_the_splats_is_passed_over(more):
    data = legacy(50, 1, 0, random_streams(50, 1, 0), extensions=bytes(more))
    assert len(read(data).means) == 50


BODY = b"".join(random_streams(4, 3, 0))
WHOLE = modern(4, 0, random_streams(4, 4, 0))


@pytest.mark.parametrize(
    "data, sentence",
    [
        (b"ply\n", "begins neither"),
        (b"", "begins neither"),
        (gzip.compress(b"hello, this is a long enough text"), "does not begin with NGSP"),
        (gzip.compress(header())[:-8], "cut off"),
        (gzip.compress(header(version=0) + BODY), "version 0"),
        (gzip.compress(header(version=4) + BODY), "version 4 inside gzip"),
        (header(version=5) + bytes(16), "version 5"),
        (gzip.compress(header(count=0)), "no splats"),
        (gzip.compress(header(count=5) + BODY), "cut off"),
        (gzip.compress(header(count=1 << 31) + BODY), "of memory"),
        (gzip.compress(header(degree=5) + BODY), "SH degree 5"),
        (gzip.compress(header(bits=31) + BODY), "31 fractional bits"),
        (b"\x1f\x8b" + b"\xff" * 40, "gzip stream is broken"),
        (WHOLE[:20], "cut off in its header"),
        (WHOLE[:60], "5 streams and their table"),
        (WHOLE[:-1], "said to be"),
        (WHOLE[:15] + b"\x06" + WHOLE[16:], "6 streams"),
        (WHOLE[:16] + b"\x08" + WHOLE[17:], "table at byte 8"),
        (WHOLE[:40] + struct.pack("<Q", 99) + WHOLE[48:], "become 99"),
        (WHOLE[:112] + b"\0" + WHOLE[113:], "is broken"),
    ],
    ids=lambda value: value if isinstance(value, str) else "file",  # gzip's bytes tell the time
)  # fmt: skip
def test_what_lies_is_refused_with_a_sentence(data, sentence):
    with pytest.raises(BadFile, match=sentence) as error:
        read(data)
    assert "a.spz" in str(error.value) and "\n" not in str(error.value)


def test_a_stream_that_becomes_more_or_less_than_its_table_says_is_refused():
    import zstandard

    for size in (35, 37):  # of 36
        packed = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(size))
        first = struct.unpack_from("<Q", WHOLE, 32)[0]
        data = WHOLE[:32] + struct.pack("<Q", len(packed)) + WHOLE[40:112]
        with pytest.raises(BadFile, match="stream 0 becomes"):
            read(data + packed + WHOLE[112 + first :])


def test_a_bomb_is_not_unpacked():
    """A gigabyte of zeros behind a header of four splats, and a header that asks for it."""
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    zeros = bytes(1 << 24)
    for count in (4, 50_000_000):
        packer = zlib.compressobj(9, zlib.DEFLATED, 31)
        data = packer.compress(header(count=count) + BODY)
        data += b"".join(packer.compress(zeros) for _ in range(16)) + packer.flush()
        tracemalloc.start()
        if count == 4:
            assert len(read(data).means) == 4
        else:
            with pytest.raises(BadFile, match="of memory"):
                read(data)
        assert tracemalloc.get_traced_memory()[1] < 4e6
        tracemalloc.stop()


def test_it_is_known_by_its_content(tmp_path):
    (tmp_path / "noname").write_bytes(WHOLE)
    assert format_of(tmp_path / "noname").name == "spz"
    assert (
        is_spz(gzip.compress(header())) and not is_spz(gzip.compress(b"text")) and not is_spz(b"")
    )
    assert not is_spz(b"\x1f\x8b\x08 nothing of the kind")


@pytest.mark.parametrize("name", ["raw", "v2", "v3", "v4"])
def test_the_fixtures_are_four_splats_a_metre_apart(data, name):
    folder = data / "splats_misc/splat-transform_fixtures/splat"
    raw = read_raw(folder / f"minimal-{name}.spz", Reading())
    assert raw.means.shape == (4, 3) and raw.sh.shape == (4, 1, 3)
    np.testing.assert_array_equal(np.abs(raw.means) % 1, 0)
    np.testing.assert_allclose(np.exp(raw.scales), 0.1, atol=0.002)
    np.testing.assert_allclose(raw.opacity, 0.9, atol=0.003)


def test_the_biker_is_the_same_splats_as_its_compressed_ply(data):
    """Both come out upright: the one is stored y up, the other y down."""
    spz, ply = (
        read_plain(data / "splats_playcanvas" / name)
        for name in ("biker.spz", "biker.compressed.ply")
    )
    assert len(spz.means) == len(ply.means)
    for a, b in ((spz.means.mean(0), ply.means.mean(0)), (spz.means.std(0), ply.means.std(0))):
        np.testing.assert_allclose(a, b, atol=2e-3)
    assert np.ptp(spz.means[:, 1]) > 1.5  # somebody who stands
    head, feet = spz.means[:, 1] > 1.6, spz.means[:, 1] < 0.2
    skin = 0.5 + 0.28209 * np.median(spz.sh[head, 0], axis=0)
    assert head.sum() > 1000 and feet.sum() > 1000 and skin[0] > skin[2]


def test_the_biker_s_picture_is_that_of_its_compressed_ply(data):
    try:
        with Renderer(None) as renderer:
            pictures = []
            for name in ("biker.spz", "biker.compressed.ply"):
                renderer.update(alone(read_model(data / "splats_playcanvas" / name)))
                renderer.draw([BIKER])
                pictures.append(renderer.image().copy())
    except NoDevice as reason:
        pytest.skip(str(reason))
    assert pictures[0][..., 3].mean() > 0.1  # he is in the picture
    assert psnr_db(*pictures) > 50
