"""Frames to .mp4, .webm, .webp or .gif.  Videos want PyAV, the optional extra `film`."""

import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.files.whole_file import temporary_folder, whole_file
from shapeshift.runtime_models.program import install_words

Done = Callable[[int], None]
PICTURES = (".webp", ".gif")  # Pillow writes them, moving
VIDEOS = {".mp4": ("h264", "av1"), ".webm": ("vp9", "av1")}  # the first is the default
WEBP_QUALITY, WEBP_METHOD = 80, 4
FASTEST_GIF = 50.0  # frames a second: browsers play shorter pauses than 2/100 s slower
# codec: (encoder, options).  One thread each: AV1 and VP9 give the same bytes every time then.
CODECS = {
    "h264": ("libx264", {"crf": "18", "preset": "medium", "threads": "1"}),
    "av1": ("libsvtav1", {"crf": "32", "preset": "8", "svtav1-params": "lp=1"}),
    "vp9": ("libvpx-vp9", {"crf": "32", "b:v": "0", "deadline": "good", "cpu-used": "4",
                           "threads": "1"}),
}  # fmt: skip
LARGEST_SIDE = 8192  # pixels of a video
WEBP_SIDE = 16383
SMALLEST_AV1 = 64  # pixels a side that its encoder takes
BT709 = 1  # FFmpeg's number of the colour space, its primaries and its transfer


def check_video(path: Path, codec: str, size: tuple[int, int], fps: float) -> str:
    """The codec of a file with this ending, "" for pictures of Pillow.  Raises UsageError.

    size: (width, height) of the film, both eyes.
    """
    ending = path.suffix.lower()
    if ending in PICTURES:
        if codec:
            raise UsageError(f"--codec is for .mp4 and .webm; {ending} has one of its own.")
        if ending == ".gif" and fps > FASTEST_GIF:
            raise UsageError(f"--fps is {fps:g}; a .gif shows at most {FASTEST_GIF:g} a second.")
        if max(size) > WEBP_SIDE:
            raise UsageError(f"a {ending} has sides up to {WEBP_SIDE}; choose a smaller --size.")
        return ""
    known = VIDEOS[ending]
    codec = codec or known[0]
    if codec not in known:
        raise UsageError(f"--codec {codec} does not go into {ending}; {' or '.join(known)} does.")
    if max(size) > LARGEST_SIDE:
        raise UsageError(f"a video has sides up to {LARGEST_SIDE}; choose a smaller --size.")
    if codec == "h264" and (size[0] % 2 or size[1] % 2):
        even = f"{size[0] + size[0] % 2}x{size[1] + size[1] % 2}"
        raise UsageError(
            f"--size is {size[0]}x{size[1]}, and H.264 wants even sides; the next is {even}."
        )
    if codec == "av1" and min(size) < SMALLEST_AV1:
        raise UsageError(f"AV1 wants sides of {SMALLEST_AV1} pixels and more; --size is smaller.")
    find_av(path)
    return codec


def find_av(path: Path) -> Any:
    """PyAV.  Raises UsageError where it is not there."""
    try:
        import av
    except ImportError:
        raise UsageError(
            f"{path.name} wants PyAV, which {install_words('film')} installs; a .webp, a .gif or a "
            "folder of pictures as --out goes without."
        ) from None
    return av


def write_video(
    path: Path, frames: Sequence[Path], fps: Fraction, codec: str, done: Done = lambda number: None
) -> None:
    """A video of PNG files, whole or not at all; `done` hears of each frame."""
    if not codec:
        return write_moving_picture(path, frames, fps, done)
    with temporary_folder() as folder:
        held = Path(folder) / f"film{path.suffix.lower()}"  # FFmpeg wants a name, to write twice
        encode(held, frames, fps, codec, done)
        with whole_file(path) as file, held.open("rb") as video:
            shutil.copyfileobj(video, file)


def encode(path: Path, frames: Sequence[Path], fps: Fraction, codec: str, done: Done) -> None:
    """The same into a file that nobody reads before it is whole."""
    os.environ.setdefault("SVT_LOG", "1")  # errors alone, instead of a page on each start
    av = find_av(path)
    encoder, options = CODECS[codec]
    first = read_frame(frames[0])
    mux = {"fflags": "+bitexact"}  # no hour and no number drawn by lot
    if path.suffix == ".mp4":
        mux["movflags"] = "+faststart"
    with av.open(str(path), "w", options=mux) as container:
        stream = container.add_stream(encoder, rate=fps, options=options)
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt = "yuv420p"
        context = stream.codec_context
        context.color_primaries = context.color_trc = context.colorspace = BT709
        for number, frame in enumerate(frames):
            planes = yuv420(read_frame(frame))
            picture = av.VideoFrame(first.shape[1], first.shape[0], "yuv420p")
            for plane, values in zip(picture.planes, planes, strict=True):
                fill(plane, values)
            picture.pts = number
            picture.time_base = 1 / fps
            packets = stream.encode(picture)
            if number == 0:
                leave_realtime()
            container.mux(packets)
            done(number)
        container.mux(stream.encode())


def leave_realtime() -> None:
    """Takes this process' threads back out of the realtime class, with none of its own.

    SVT-AV1 puts them, and whoever calls it, into SCHED_FIFO at 99 where it may (as root, so in most
    containers); everything else on the machine would stand still, children that are started later
    among it.
    """
    tasks = Path("/proc/self/task")
    if not hasattr(os, "sched_setscheduler") or not tasks.is_dir():
        return
    for task in [int(folder.name) for folder in tasks.iterdir()]:
        try:
            if os.sched_getscheduler(task) in (os.SCHED_FIFO, os.SCHED_RR):
                os.sched_setscheduler(task, os.SCHED_OTHER, os.sched_param(0))
        except ProcessLookupError:
            pass  # this thread has ended


def fill(plane: Any, values: np.ndarray) -> None:
    """Bytes (h, w) into a plane of FFmpeg's, whose rows may be longer."""
    rows = np.zeros((values.shape[0], plane.line_size), np.uint8)
    rows[:, : values.shape[1]] = values
    plane.update(rows.tobytes()[: plane.buffer_size].ljust(plane.buffer_size, b"\0"))


def yuv420(rgb: np.ndarray) -> list[np.ndarray]:
    """(H, W, 3) uint8 display sRGB to Y' (H, W), Cb and Cr (H/2, W/2 rounded up) uint8: BT.709,
    16 to 235 and 240, means of 2x2.  Our own, since it gives the same bytes on every machine.
    """
    c = rgb.astype(np.float32) / 255
    y = c @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    b, r = (c[..., 2] - y) / 1.8556, (c[..., 0] - y) / 1.5748
    whole = [219 * y + 16, *(224 * _halved(p) + 128 for p in (b, r))]
    return [np.rint(plane).astype(np.uint8) for plane in whole]


def _halved(plane: np.ndarray) -> np.ndarray:
    """Means of 2x2; an odd last row or column counts twice."""
    height, width = plane.shape
    even = np.pad(plane, ((0, height % 2), (0, width % 2)), mode="edge")
    return even.reshape((height + 1) // 2, 2, (width + 1) // 2, 2).mean((1, 3))


def write_moving_picture(path: Path, frames: Sequence[Path], fps: Fraction, done: Done) -> None:
    """.webp or .gif by Pillow, for ever."""
    from PIL import Image

    def others() -> Iterator[Image.Image]:
        for number, frame in enumerate(frames[1:], 1):
            with Image.open(frame) as image:
                yield image.convert("RGB")
            done(number)

    form = path.suffix.lower()[1:]
    more = {"quality": WEBP_QUALITY, "method": WEBP_METHOD} if form == "webp" else {}
    with Image.open(frames[0]) as image, whole_file(path) as file:
        image.convert("RGB").save(
            file, format=form.upper(), save_all=True, append_images=others(), loop=0,
            duration=durations_ms(len(frames), fps, 10 if form == "gif" else 1), **more,
        )  # fmt: skip
    done(0)


def durations_ms(count: int, fps: Fraction, step_ms: int) -> list[int]:
    """Milliseconds of each frame in whole steps, such that the film as a whole lasts as long."""
    ends = [round(k * 1000 / fps / step_ms) * step_ms for k in range(count + 1)]
    return [b - a for a, b in zip(ends, ends[1:], strict=False)]  # noqa: RUF007


def read_frame(path: Path) -> np.ndarray:
    """(H, W, 3) uint8 of a PNG."""
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))
