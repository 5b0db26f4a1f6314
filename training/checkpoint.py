"""The file beside the output from which an interrupted run goes on, and what that run was of."""

import json
import zipfile
from collections.abc import Mapping
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.runtime_models.files.hashes import ABSENT, hash_file
from shapeshift.runtime_models.files.whole_file import whole_file
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture, Photo

SEAL = "seal"  # in the notes: a hash of all else in the file
CONTENTS = "contents"  # in the notes: what the photos were, see contents_of
SAME = 1e-4  # of a number of a camera: other machines round otherwise


def checkpoint_path(out: Path) -> Path:
    """Where the checkpoint of a package `out` lies."""
    return out.with_name(out.name + ".checkpoint.npz")


def write_checkpoint(path: Path, state: Mapping[str, np.ndarray], notes: dict) -> None:
    """All arrays and notes in one file, never half-written."""
    text = json.dumps(notes)
    with whole_file(path) as file:
        sealed = json.dumps({SEAL: seal_of(state, text), "notes": text})
        arrays: dict[str, Any] = {**state, "notes": np.array(sealed)}
        np.savez(file, **arrays)


def seal_of(state: Mapping[str, np.ndarray], text: str) -> str:
    digest = blake2b(text.encode(), digest_size=16)
    for name, values in sorted(state.items()):
        array = np.ascontiguousarray(values)
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.data)
    return digest.hexdigest()


def read_checkpoint(path: Path) -> tuple[dict[str, np.ndarray], dict]:
    """(arrays, notes) of what write_checkpoint wrote, and nothing else.  Raises BadFile."""
    if not path.exists():
        raise BadFile(f"{path}: no checkpoint to resume from; train once without --resume.")
    try:
        with np.load(path, allow_pickle=False) as file:
            state = {name: file[name] for name in file.files}
        sealed = json.loads(str(state.pop("notes")))
        text, seal = sealed["notes"], sealed[SEAL]
    except (ValueError, KeyError, TypeError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise BadFile(
            f"{path}: not a readable checkpoint of this version ({error}); delete it, and train "
            "anew without --resume."
        ) from error
    if seal_of(state, text) != seal:
        raise BadFile(
            f"{path}: it holds other numbers than a run wrote; delete it, and train anew without "
            "--resume."
        )
    return state, json.loads(text)


def contents_of(capture: Capture) -> dict[str, list]:
    """Photo -> [hash of its files, then the numbers of its camera]: what a run is of."""
    hash_once = cache(hash_file)  # bands and faces of a panorama share one
    return {
        name_in(capture, photo): [
            " ".join(map(hash_once, files_of(photo))),
            *(float(f"{number:.7g}") for number in camera_of(photo)),
        ]
        for photo in capture.photos
    }  # fmt: skip


def name_in(capture: Capture, photo: Photo) -> str:
    name = photo.name.removeprefix(str(capture.folder)).lstrip("/\\").replace("\\", "/")
    return f"{name} ({photo.modality})"


def files_of(photo: Photo) -> list[Path]:
    return [p for p in (photo.path, photo.mask, photo.depth, photo.normals) if p is not None]


def camera_of(photo: Photo) -> tuple[float, ...]:
    """Its place (3) metres, its rotation up to a sign (4), its tangents (4), its pixels (2)."""
    pose = photo.view.world_from_eye
    turned = np.asarray(pose.wxyz) * np.sign(pose.wxyz[int(np.argmax(np.abs(pose.wxyz)))])
    return (*pose.position, *turned, *photo.view.tangents, *photo.view.size)


def refuse_other_capture(capture: Capture, before: dict[str, list]) -> None:
    """Raises BadFile where a run of `before` would go on with other photos."""
    now = contents_of(capture)
    both = [name for name in now if name in before]
    doubts = [
        *(
            f"{name} is another picture"
            for name in both
            if before[name][0] not in (now[name][0], ABSENT)
        ),
        *(f"{name} stands elsewhere" for name in both if moved(now[name], before[name])),
        *(f"{name} is new" for name in now if name not in before),
        *(f"{name} is not there" for name in before if name not in now),
    ]
    if doubts:
        more = f" and {len(doubts) - 1:,} more" if len(doubts) > 1 else ""
        raise BadFile(
            f"the checkpoint is of another capture than {capture.folder} ({doubts[0]}{more}); give "
            "the one that the run began with, or train anew without --resume."
        )


def moved(now: list, before: list) -> bool:
    return not np.allclose(now[1:], before[1:], rtol=SAME, atol=SAME)
