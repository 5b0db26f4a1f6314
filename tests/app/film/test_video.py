"""film into videos and moving pictures: what FFmpeg and Pillow read back of them."""

import importlib.util
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.film.write_video import durations_ms, encode, yuv420
from shapeshift.scene.film.film_path import exact_fps
from tests.support.three_stops import three_stop_package

SIZE = (40, 30)
TINY = ("--size", "40x30", "--context", "none", "--fps", "6", "--seconds", "1")
STYLE = ("--style-path", "RGB@0 Opened@1s")
with_av = pytest.mark.skipif(importlib.util.find_spec("av") is None, reason="PyAV is not here")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return three_stop_package(tmp_path_factory.mktemp("scene") / "three.shift")


def film(*arguments) -> int:
    return cli.main(["film", *map(str, arguments)])


def refused(capsys, *arguments) -> str:
    """The sentence with which the command refuses."""
    assert film(*arguments) == 2
    said = capsys.readouterr().err.strip()
    assert len(said.splitlines()) == 1, said
    return said


@with_av
@pytest.mark.parametrize(
    ("name", "codec", "found"),
    [("a.mp4", "", "h264"), ("a.webm", "", "vp9"), ("b.webm", "av1", "av1"),
     ("a.MP4", "av1", "av1")],
)  # fmt: skip
def test_a_video_holds_every_frame(scene, tmp_path, name, codec, found):
    """Read back by FFmpeg: so many frames, that rate, and as like as 30 dB (crf 18 and 32 of noise
    in 64 x 64 pixels; a real film has 34 to 35).
    """
    import av

    out = tmp_path / name
    more = ("--codec", codec) if codec else ()
    size = ("--size", "64x64")
    assert film(scene, *TINY, *size, *STYLE, *more, "--out", out, "--keep-frames") == 0
    frames = sorted((tmp_path / f"{out.stem}.frames").glob("0*.png"))
    with av.open(str(out)) as video:
        stream = video.streams.video[0]
        assert found in stream.codec_context.name
        assert stream.average_rate == 6
        assert stream.codec_context.colorspace == 1  # BT.709, as the numbers are
        shown = [frame.to_ndarray(format="rgb24") for frame in video.decode(video=0)]
    assert len(shown) == len(frames) == 6
    errors = [
        np.mean((np.asarray(Image.open(path), float) - image) ** 2)
        for path, image in zip(frames, shown, strict=True)
    ]
    assert 10 * np.log10(255**2 / np.mean(errors)) > 30


@with_av
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are listed by Linux")
def test_av1_leaves_no_thread_in_the_realtime_class(tmp_path):
    """SVT-AV1 asks for SCHED_FIFO where it may: as root, which is where this can fail."""
    paths = [tmp_path / f"{k}.png" for k in range(3)]
    for k, path in enumerate(paths):
        Image.fromarray(np.full((64, 64, 3), 80 * k, np.uint8)).save(path)
    seen = []

    def look(_: int) -> None:
        tasks = [int(task.name) for task in Path("/proc/self/task").iterdir()]
        seen.append({os.sched_getscheduler(task) for task in tasks})

    encode(tmp_path / "a.mp4", paths, exact_fps(6), "av1", look)
    # threads of other libraries may be in a class below: Mesa compiles shaders in SCHED_BATCH
    assert len(seen) == 3
    assert not set.union(*seen) - {os.SCHED_OTHER, os.SCHED_BATCH, os.SCHED_IDLE}
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


@with_av
@pytest.mark.parametrize("name", ["a.webm"])
def test_the_container_is_the_same_to_the_byte(scene, tmp_path, name):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        assert film(scene, *TINY, "--size", "64x64", "--out", tmp_path / folder / name) == 0
    assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


@pytest.mark.parametrize("name", ["a.webp", "a.gif"])
def test_moving_pictures_go_without_pyav(scene, tmp_path, name, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)  # what an import finds where it is not installed
    assert film(scene, *TINY, *STYLE, "--out", tmp_path / name) == 0
    with Image.open(tmp_path / name) as image:
        assert image.n_frames == 6 and image.size == SIZE and image.info["loop"] == 0
        lasts = []
        for k in range(6):
            image.seek(k)
            image.load()
            lasts.append(image.info["duration"])
    assert sum(lasts) == 1000
    assert not (tmp_path / "a.frames").exists()


def test_without_pyav_a_video_is_refused_before_anything_is_drawn(
    scene, tmp_path, monkeypatch, capsys
):
    monkeypatch.setitem(sys.modules, "av", None)
    said = refused(capsys, scene, *TINY, "--out", tmp_path / "a.mp4")
    assert "launch.py extras film`" in said and ".webp" in said
    assert not list(tmp_path.iterdir())


@with_av
@pytest.mark.parametrize(
    ("size", "stereo", "even"),
    [("41x30", 0, "42x30"), ("40x31", 0, "40x32"), ("41x31", 0, "42x32"), ("41x31", 0.1, "82x32")],
)
def test_odd_sides_for_h264_are_refused_with_the_next_even(
    scene, tmp_path, capsys, size, stereo, even
):
    options = ("--size", size, "--stereo", stereo, "--out", tmp_path / "a.mp4")
    assert even in refused(capsys, scene, *TINY, *options)


@with_av
def test_odd_sides_are_no_fault_elsewhere(scene, tmp_path):
    import av

    assert film(scene, *TINY, "--size", "41x31", "--out", tmp_path / "a.webm") == 0
    with av.open(str(tmp_path / "a.webm")) as video:
        assert {(f.width, f.height) for f in video.decode(video=0)} == {(41, 31)}


def test_colours_of_a_video_are_those_of_bt709():
    """White, black and the primaries by the tables of the recommendation, to a level."""
    rgb = np.array([[[255, 255, 255], [0, 0, 0]], [[255, 0, 0], [0, 0, 255]]], np.uint8)
    y, cb, cr = yuv420(np.repeat(np.repeat(rgb, 2, 0), 2, 1))
    assert y[::2, ::2].tolist() == [[235, 16], [63, 32]]
    assert cb.tolist() == [[128, 128], [102, 240]]
    assert cr.tolist() == [[128, 128], [240, 118]]
    assert [p.shape for p in yuv420(np.zeros((5, 7, 3), np.uint8))] == [(5, 7), (3, 4), (3, 4)]


@pytest.mark.parametrize("step", [1, 10])
@pytest.mark.parametrize("fps", [6, 24, 29.97, 50])
def test_frames_last_as_long_as_the_film(fps, step):
    lasts = durations_ms(300, exact_fps(fps), step)
    assert abs(sum(lasts) - 300_000 / float(exact_fps(fps))) <= step / 2
    assert max(lasts) - min(lasts) <= step
