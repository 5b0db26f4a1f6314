"""launch.py poses: photos without poses, or a video, to a capture that `train` reads.

python3 launch.py poses photos --out room && python3 launch.py train room --out room.shift
"""

import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from shapeshift.app.command_line import EXPERT, POSITIONAL
from shapeshift.app.paths import full
from shapeshift.app.terminal import print_json, print_text, say
from shapeshift.runtime_models.program import program

if TYPE_CHECKING:
    from shapeshift.decomposition.poses.find_poses import Length, PoseSettings
    from shapeshift.decomposition.poses.write_posed import PoseReport

FRAMES = "frames"  # of a video, below --out, as long as the search is not done
FRAMES_OF = "frames.txt"  # beside it: of which video, and how many were asked for
OURS = {"images", "masks", "sparse", "poses.json", "capture.json", "poses.work", FRAMES, FRAMES_OF}
MOST_NAMED = 10  # photos in a sentence


@dataclass(frozen=True)
class Options:
    """Find where photos were taken from: structure from motion, upright, into a COLMAP folder."""

    photos: Annotated[Path, POSITIONAL]
    """A folder of photos, or a video.  Photos of heat (docs/capture.md, "What a photo shows") get
    the poses of those of light that were taken with them: by name, number or time of exposure."""
    out: Path
    """The folder that gets images/, sparse/0, poses.json and, of several modalities,
    capture.json."""
    masks: Path | None = None
    """A folder of masks, NAME.jpg.png or NAME.png, as large as the photos; white counts.  Default:
    no masks."""
    every: int = 1
    """Take every n-th photo of each folder."""
    frames: int = 120
    """Frames to take out of a video, the sharpest ones."""
    metres: str = ""
    """A known length, LENGTH:PHOTO:X,Y:X,Y with two pixels of a photo, for example
    0.24:IMG_1.jpg:120,300:410,310.  Default: the scale is arbitrary."""
    pairs: Literal["auto", "all", "neighbours"] = "auto"
    """Which photos are compared.  auto: all with all up to 120 photos, beyond that and in videos
    each with its neighbours by name."""
    undistort: bool = False
    """Write straight photos for other programs; ours reads bent ones as they are."""
    side: Annotated[int, EXPERT] = 1600
    """Longest side, pixels, on which features are looked for."""
    json: bool = False
    """Print poses.json instead of sentences."""
    overwrite: bool = False
    """Replace the capture, or the unfinished search, that --out holds."""


def run(options: Options) -> int:
    from shapeshift.app.errors import UsageError
    from shapeshift.app.progress import progress_bar
    from shapeshift.decomposition.poses.find_poses import WORK, find_poses
    from shapeshift.decomposition.poses.photo_list import list_photos
    from shapeshift.decomposition.poses.video_frames import VIDEOS
    from shapeshift.runtime_models.files.whole_file import discard_folder

    settings = settings_of(options)
    if not options.every >= 1:
        raise UsageError(f"--every is {options.every}; give 1 or more.")
    if not options.frames >= 3:
        raise UsageError(f"--frames is {options.frames}; give 3 or more.")
    refuse_target(options)
    with progress_bar() as bar:
        task = bar.add_task("photos", total=None)

        def progress(what: str, done: int, of: int) -> None:
            bar.update(task, description=what, completed=done, total=of)

        video = options.photos.suffix.lower() in VIDEOS
        folder = frames_of(options, progress) if video else options.photos
        photos = list_photos(folder, options.every)
        for sentence in photos.sentences:
            say(sentence)
        try:
            report = find_poses(photos, options.out, settings, progress)
        except KeyboardInterrupt:
            say(f"{full(options.out / WORK)} keeps what is done; the same command goes on there.")
            raise
    if video:
        discard_folder(options.out / FRAMES)
        (options.out / FRAMES_OF).unlink(missing_ok=True)
    if options.json:
        from dataclasses import asdict

        print_json(asdict(report))
        return 0
    for sentence in sentences(report, options):
        print_text(sentence)
    return 0


def settings_of(options: Options) -> "PoseSettings":
    """Raises UsageError."""
    from shapeshift.app.errors import as_typed
    from shapeshift.decomposition.poses.find_poses import NEIGHBOURS, PoseSettings
    from shapeshift.decomposition.poses.video_frames import VIDEOS

    video = options.photos.suffix.lower() in VIDEOS
    near = {"all": 0, "neighbours": NEIGHBOURS, "auto": NEIGHBOURS if video else None}
    try:
        return PoseSettings(
            masks=options.masks, neighbours=near[options.pairs], side=options.side,
            length=parse_length(options.metres), straight=options.undistort,
        )  # fmt: skip
    except ValueError as error:
        raise as_typed(error, PoseSettings, {"length": "metres"}) from None


def parse_length(text: str) -> "Length | None":
    """Of --metres.  Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.decomposition.poses.find_poses import Length

    if not text:
        return None
    number = r"(\d+(?:\.\d*)?)"
    form = rf"{number}:(.+):{number},{number}:{number},{number}"
    match = re.fullmatch(form, text)
    if match is None or not float(match[1]) > 0:
        raise UsageError(
            f"--metres is {text[:80]!r}; give LENGTH:PHOTO:X,Y:X,Y, for example "
            "0.24:IMG_1.jpg:120,300:410,310."
        )
    x0, y0, x1, y1 = map(float, match.groups()[2:])
    return Length(float(match[1]), match[2], ((x0, y0), (x1, y1)))


def refuse_target(options: Options) -> None:
    """What --out holds must be an unfinished search, nothing, or given up.  Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.decomposition.poses.find_poses import WORK
    from shapeshift.runtime_models.files.whole_file import sweep

    out, photos = options.out, options.photos
    if out.resolve() in (photos.resolve(), *photos.resolve().parents):
        raise UsageError(f"--out is {out}, which holds the photos; name another folder.")
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out is {out}, which is a file; name a folder.")
    if not out.is_dir():
        return
    sweep(out)  # parts of a run that was killed
    there = {path.name for path in out.iterdir()}
    strange = sorted(there - OURS)
    if strange:
        raise UsageError(f"--out is {out}, which holds {strange[0]}; name an empty or new folder.")
    if options.overwrite:
        for name in there:
            path = out / name
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
    elif there and not there & {WORK, FRAMES, FRAMES_OF}:  # else a search that is not done
        raise UsageError(f"{out} holds a capture; name another --out or add --overwrite.")


def frames_of(options: Options, progress) -> Path:
    """The folder of the video's frames; what a run before took out is used again.

    Raises UsageError where that run was of another video.
    """
    from shapeshift.app.errors import UsageError
    from shapeshift.decomposition.poses.video_frames import take_frames
    from shapeshift.runtime_models.files.hashes import hash_file
    from shapeshift.runtime_models.files.whole_file import make_folders, whole_folder, write_whole

    folder, note = options.out / FRAMES, options.out / FRAMES_OF
    wanted = f"{hash_file(options.photos)} {options.frames}".encode()
    if folder.is_dir() and not (note.is_file() and note.read_bytes() == wanted):
        raise UsageError(
            f"--out is {options.out}, which has frames of another video or --frames; give those "
            "again, or --overwrite to begin anew."
        )
    if not folder.is_dir():
        make_folders(options.out.parent, options.out.name)
        write_whole(note, wanted)
        with whole_folder(folder) as part:
            take_frames(options.photos, part, options.frames, progress)
    return folder


def sentences(report: "PoseReport", options: Options) -> list[str]:
    said = [
        f"{full(options.out)}: {report.placed} of {report.photos} photos placed, "
        f"{report.points:,} points, {report.error_px:.2f} px mean error"
        + (f", {report.paired} thermal photos with them." if report.paired else ".")
    ]
    if report.left_out:
        said.append(f"Left out, no place found: {named(report.left_out)}.")
    if report.few_points:
        few = [f"{name} ({count})" for name, count in sorted(report.few_points.items())]
        said.append(f"Placed by few points, look at these first: {named(few)}.")
    others = report.attempts[-1]["others"] if report.attempts else []
    if others:
        said.append(
            f"Other photos hang together in {len(others)} parts that do not join these: "
            f"{', '.join(map(str, others))} photos.  More photos between them would."
        )
    said.append(f"Up: {report.up}.  Scale: {report.scale}.")
    if report.paired:
        said.append("The thermal camera's place is a guess: train with --calibrate.")
    said.append(f"next: {program()} train {full(options.out)} --out scene.shift")
    return said


def named(names: list[str]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
