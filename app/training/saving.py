"""What a training run leaves on disk, also where memory, disk or a photo end it: see train.py."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.errors import UsageError
from shapeshift.app.paths import full
from shapeshift.app.terminal import say
from shapeshift.runtime_models.files.memory import MOST_GB
from shapeshift.runtime_models.model import BadFile

if TYPE_CHECKING:
    from shapeshift.training.photo_store.open_photos import PhotoRoom
    from shapeshift.training.train import Trainer

LESS = "fewer --max-anchors, or a larger --downscale, need less"


def check_writable(out: Path) -> None:
    """Raises UsageError where nothing can be written: before the training, not after it."""
    from shapeshift.training.checkpoint import checkpoint_path

    checkpoint = checkpoint_path(out)
    if checkpoint.is_dir():
        raise UsageError(f"--out {out}: {checkpoint} is a folder; move it away.")
    there = next(folder for folder in out.absolute().parents if folder.exists())
    try:
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise UsageError(
            f"--out {out}: nothing can be written into {there} ({error.strerror}); name another "
            "place."
        ) from None


def memory_errors() -> tuple[type[Exception], ...]:
    """What says that memory is full: the device's or this process's."""
    import pyopencl

    from shapeshift.rasterizer.device import NoMemory

    return NoMemory, pyopencl.MemoryError, MemoryError


@contextmanager
def memory_for_training() -> Iterator[None]:
    """Raises UsageError where what is needed at the beginning is too much."""
    try:
        yield
    except memory_errors():
        raise UsageError(f"there is not enough memory to begin; {LESS}.") from None


def room_of(out: Path | None, megabytes: float | None, said: str = "--photo-mb") -> "PhotoRoom":
    """Where the photos may lie; megabytes: --photo-mb.  out: None where no package is written, then
    they lie in the user's cache.  Raises UsageError that begins with `said`.
    """
    from shapeshift.training.photo_store.open_photos import PhotoRoom

    if megabytes is not None and not 0 < megabytes <= MOST_GB * 1000:
        raise UsageError(
            f"{said} is {megabytes:.12g}, expected MB above 0, at most {MOST_GB * 1000:,}; leave "
            "it out for half of the memory that files may take."
        )
    most = None if megabytes is None else int(megabytes * 1e6)
    return PhotoRoom(most, None if out is None else photos_path(out))


@contextmanager
def saved_when_it_fails(trainer: "Trainer", out: Path, checkpoint: Path) -> Iterator[None]:
    """Writes what there is when memory ends, or a photo that is read late cannot be read.

    Raises UsageError or BadFile that says so.
    """
    done = False
    try:
        yield
        done = True
    except BadFile as why:
        if not trainer.iteration:
            raise
        trainer.forget_photo(str(why))
        save(trainer, out, checkpoint)
        raise BadFile(
            f"{why}  The scene as it was after {trainer.iteration} steps is in {full(out)}; when "
            "the photo is mended, --resume goes on."
        ) from None
    except memory_errors():
        save(trainer, out, checkpoint)
        raise UsageError(
            f"memory was full after {trainer.iteration} steps, with {trainer.anchors_count:,} "
            f"anchors; the scene as it was then is in {full(out)}.  To train on, {LESS}."
        ) from None
    finally:
        if not done:
            trainer.photos.close(keep=True)


def save(trainer: "Trainer", out: Path, checkpoint: Path) -> None:
    """The package first, then the checkpoint; neither is ever half-written.

    Raises UsageError where that cannot be; then both lie in a folder of the system's for temporary
    files, if there is room.
    """
    from shapeshift.runtime_models.package.write_package import write_package
    from shapeshift.training.checkpoint import write_checkpoint

    if trainer.restore_last_good():
        say("the picture was lost in the last steps; what is kept is the last good state")
    model, state = trainer.model(), trainer.checkpoint()
    try:
        write_package(model, out, trainer.storage)
        write_checkpoint(checkpoint, *state)
        save_cameras(trainer, out)
    except OSError as error:
        why = f"{out}: could not be written ({error.strerror or error})"
    else:
        return
    try:
        elsewhere = Path(tempfile.mkdtemp(prefix="shapeshift-"))
        write_package(model, elsewhere / out.name, trainer.storage)
        write_checkpoint(elsewhere / checkpoint.name, *state)
        save_cameras(trainer, elsewhere / out.name)
    except OSError:
        raise UsageError(f"{why}, nor anywhere else; {resume_hint(checkpoint)}.") from None
    raise UsageError(f"{why}; the scene and its checkpoint are in {elsewhere} instead.")


def photos_path(out: Path) -> Path:
    """Where the photos of a run that writes `out` are kept if they do not fit into memory."""
    return out.with_name(out.name + ".photos")


def cameras_path(out: Path) -> Path:
    """Where the refined cameras of a package `out` lie."""
    return out.with_name(out.name + ".cameras.json")


def save_cameras(trainer: "Trainer", out: Path) -> None:
    """Beside the package, the training photos' cameras, where the run has refined them."""
    from shapeshift.scene.cameras.camera_list import CameraList
    from shapeshift.scene.cameras.write_cameras import write_cameras
    from shapeshift.training.evaluation.evaluate import name_in

    if photos := trainer.poses.photos:
        names = tuple(name_in(trainer.capture, photo) for photo in photos)
        views = tuple(map(trainer.poses.view, photos))
        write_cameras(CameraList(views, names, "ours"), cameras_path(out), "ours")


def resume_hint(checkpoint: Path) -> str:
    """What a run that could not be saved can go on from, in words."""
    from shapeshift.training.checkpoint import read_checkpoint

    try:
        notes = read_checkpoint(checkpoint)[1]
    except BadFile:
        return "make room and train again"
    return f"make room, and --resume goes on from step {notes['iteration']}"


def save_checkpoint(trainer: "Trainer", checkpoint: Path) -> str:
    """Writes the checkpoint; in words why not, where the disk is full: training goes on."""
    from shapeshift.training.checkpoint import write_checkpoint

    try:
        write_checkpoint(checkpoint, *trainer.checkpoint())
    except OSError as error:
        return (
            f"{checkpoint}: could not be written ({error.strerror or error}); training goes on, "
            "make room before it ends"
        )
    return ""
