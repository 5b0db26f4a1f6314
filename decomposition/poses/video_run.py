"""The sharpest frames of a video by PyAV, behind the gate."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.runtime_models.files.whole_file import whole_file
from shapeshift.runtime_models.gate.refusal import Unreadable

LOOK_SIDE = 480  # pixels of the longer side on which sharpness is measured
QUALITY = 95  # of the JPEG
LOOKS_A_FRAME = 12  # frames looked at for each that is kept, at most: decoding is what takes long
# What FFmpeg may take a file for: videos, and none of its lists that name further files.
FORMATS = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg"


def take_frames(name: str, into: str, count: int, hear: Callable[..., None]) -> int:
    """Writes at most `count` frames into a folder, the sharpest of equal parts of the video.

    Gives how many.  Raises Unreadable.
    """
    import av

    video = Path(name)
    try:
        with opened(av, video) as container:
            stream = next(iter(container.streams.video), None)
            if stream is None:
                raise Unreadable("holds no pictures; give a video")
            stream.thread_type = "AUTO"
            second = stream.time_base
            times = [float(p.pts * second) for p in container.demux(stream)
                     if p.pts is not None and second is not None]  # fmt: skip
        if len(times) < 2:
            raise Unreadable(f"holds {len(times)} frames; a video of a walk is wanted")
        return write_sharpest(av, video, Path(into), count, sorted(times), hear)
    except (av.FFmpegError, OSError) as error:  # pyright: ignore[reportPrivateImportUsage]
        raise Unreadable(f"no video that can be read ({error})") from None


def opened(av, video: Path):
    return av.open(str(video), options={"format_whitelist": FORMATS})


def write_sharpest(
    av, video: Path, folder: Path, count: int, times: list[float], hear: Callable[..., None]
) -> int:  # fmt: skip
    count = min(count, len(times))
    part_of = np.minimum(np.arange(len(times)) * count // len(times), count - 1)
    every = max(len(times) // (count * LOOKS_A_FRAME), 1)
    best: tuple[float, Any] | None = None
    part = written = 0

    def write() -> None:
        nonlocal written
        if best is not None:
            with whole_file(folder / f"{written:05d}.jpg") as file:
                best[1].to_image().save(file, "JPEG", quality=QUALITY)
            written += 1

    with opened(av, video) as container:
        container.streams.video[0].thread_type = "AUTO"
        for i, frame in enumerate(container.decode(video=0)):
            here = int(part_of[min(i, len(times) - 1)])
            if here != part:
                write()
                hear(done=written, of=count)
                best, part = None, here
            if i % every and best is not None:
                continue
            sharp = sharpness(frame)
            if best is None or sharp > best[0]:
                best = sharp, frame
    write()
    return written


def sharpness(frame) -> float:
    """Variance of the Laplacian of the grey picture, made small; blur takes it away."""
    scale = LOOK_SIDE / max(frame.width, frame.height)
    size = (max(round(frame.width * scale), 3), max(round(frame.height * scale), 3))
    grey = frame.reformat(*size, format="gray").to_ndarray().astype(np.float32)
    grey = grey[:, : size[0]]
    inner = grey[1:-1, 1:-1]
    around = grey[:-2, 1:-1] + grey[2:, 1:-1] + grey[1:-1, :-2] + grey[1:-1, 2:]
    return float((around - 4 * inner).var())
