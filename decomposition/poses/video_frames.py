"""The sharpest frames of a video, spread over its length, as photos (PyAV, optional)."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from shapeshift.runtime_models.gate.gate import ask
from shapeshift.runtime_models.model import BadFile

VIDEOS = {".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi"}


def take_frames(
    video: Path, folder: Path, count: int, progress: Callable[[str, int, int], None]
) -> int:
    """Writes at most `count` frames into `folder`, the sharpest of equal parts of the video.

    Gives how many.  Read behind the gate, video_run.py.  Raises BadFile where it is no video that
    can be read, or PyAV is missing.
    """
    if find_spec("av") is None:
        raise BadFile(
            f"{video} is a video, and PyAV, which reads them, is not installed; install the extra "
            "'film', or give a folder of photos."
        )
    if not video.is_file():
        raise BadFile(f"{video} does not exist; give a folder of photos, or a video.")
    return ask(
        "video", video, [str(video.absolute()), str(folder.absolute()), count],
        hear=lambda said: progress("sharpest frames", said["done"], said["of"]),
    )  # fmt: skip
