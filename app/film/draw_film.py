"""Draws the frames of a film that are not there yet."""

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.commands.outputs import as_steps, values_of, write_png16
from shapeshift.app.document import Document
from shapeshift.app.drawing import is_our_png, make_folder, save_png
from shapeshift.app.errors import UsageError
from shapeshift.app.film.film_plan import FilmPlan
from shapeshift.runtime_models.files.json_fields import control_row, saved_object
from shapeshift.runtime_models.files.whole_file import sweep, write_whole
from shapeshift.scene.pose import View, stereo_pair

if TYPE_CHECKING:
    from shapeshift.renderer.renderer import Renderer


# The frames of a film on disk: found again where they are whole and of the same film.

LEGEND = "frames.json"  # what the frames are of
MOST_BYTES = 64 << 20
BLOCK = 1 << 20
PNG_HEAD = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"  # width and height follow
PNG_END = b"\0\0\0\0IEND\xaeB`\x82"


@dataclass(frozen=True)
class FrameFolder:
    """NNNNN.png of each frame, and a folder beside them for each stream."""

    path: Path
    streams: tuple[str, ...] = ()
    size: tuple[int, int] | None = None  # pixels of a frame; None: any

    def frame(self, number: int) -> Path:
        return self.path / f"{number:05d}.png"

    def stream(self, name: str, number: int) -> Path:
        return self.path / name / f"{number:05d}.png"

    def files(self, number: int) -> list[Path]:
        """What there is of a frame once it is drawn."""
        return [*(self.stream(name, number) for name in self.streams), self.frame(number)]

    def lacking(self, numbers: Sequence[int]) -> list[int]:
        """Those that are still to be drawn.

        Files are whole or not there; a disk that lost its power leaves others, too.
        """
        return [n for n in numbers if not all(is_whole(p, self.size) for p in self.files(n))]

    def begin(self, key: str, facts: dict, overwrite: bool) -> None:
        """Makes it ready for frames of the film with this key ("": of none); those of another go.

        Raises UsageError where something lies there that is not of this film, unless it is
        frames of ours and `overwrite`.
        """
        make_folder(self.path)
        for name in self.streams:
            make_folder(self.path / name)
        legend = self.path / LEGEND
        if not key or saved_object(legend, MOST_BYTES).get("key") != key:
            self._clear(overwrite)
        text = json.dumps({"key": key} | facts, indent=1, ensure_ascii=False) + "\n"
        write_whole(legend, text.encode())

    def _clear(self, overwrite: bool) -> None:
        """Takes away the frames of another film."""
        for folder in (self.path, *(self.path / name for name in self.streams)):
            sweep(folder)  # parts of a run that was killed
        found = [p for p in sorted(self.path.rglob("*")) if p.is_file() and p.name != LEGEND]
        if not found:
            return
        foreign = next((p for p in found if p.suffix != ".png" or not is_our_png(p)), None)
        if foreign is not None:
            raise UsageError(f"{foreign} is no frame of a film; choose another --out.")
        if not overwrite:
            raise UsageError(
                f"{self.path} holds frames of another film (other settings, or another scene); "
                "choose another --out or add --overwrite."
            )
        for path in found:
            path.unlink()

    def write_frame(self, number: int, picture, streams: dict, texts: dict[str, str]) -> None:
        """A frame: (H, W, 3) display sRGB, and uint16 of each stream; the picture comes last."""
        for name, steps in streams.items():
            write_png16(steps, self.stream(name, number), texts)
        save_png(picture, self.frame(number))

    def remove(self) -> None:
        """Its frames, its legend, and the folder where nothing else is in it."""
        for path in [*self.path.glob("[0-9]*.png"), self.path / LEGEND]:
            if path.name == LEGEND or is_our_png(path):
                path.unlink(missing_ok=True)
        if not any(self.path.iterdir()):
            self.path.rmdir()


def is_whole(path: Path, size: tuple[int, int] | None) -> bool:
    """Whether a PNG begins and ends as one does, and has that size."""
    try:
        with path.open("rb") as file:
            head = file.read(len(PNG_HEAD) + 8)
            file.seek(-len(PNG_END), os.SEEK_END)
            whole = head.startswith(PNG_HEAD) and file.read() == PNG_END
    except OSError:
        return False
    found = int.from_bytes(head[-8:-4], "big"), int.from_bytes(head[-4:], "big")
    return whole and size in (None, found)


def film_key(plan: FilmPlan, scene: Path, drawing: dict) -> str:
    """A hash of all that the pixels of a film depend on."""
    digest = hashlib.sha256()
    digest.update(json.dumps(drawing, sort_keys=True).encode())
    for path in scene_files(plan.document, scene):
        stat = path.stat()
        digest.update(os.fsencode(path.name) + f" {stat.st_size}".encode())
        with path.open("rb") as file:
            while block := file.read(BLOCK):
                digest.update(block)
    for frame in range(len(plan.places)):
        digest.update(json.dumps(frame_facts(plan, frame)).encode())
    return digest.hexdigest()


def scene_files(document: Document, scene: Path) -> list[Path]:
    """The files whose change makes another film: of a scene file also the models that it names."""
    named = [scene]
    if document.file is not None:
        named += [document.file.folder / item.model for item in document.file.all_items]
    found = (p.rglob("*") if p.is_dir() else [p] for p in named)
    return sorted({path for paths in found for path in paths if path.is_file()})


def frame_facts(plan: FilmPlan, frame: int) -> dict:
    """A frame in numbers: where it is seen from and what it shows."""
    view = plan.view(frame)
    pose = view.world_from_eye
    return {
        "time": round(float(plan.times[frame]), 6),
        "place": round(float(plan.places[frame]), 6),
        "eye": [round(float(n), 9) for n in pose.position],
        "wxyz": [round(float(n), 9) for n in pose.wxyz],
        "tangents": [round(float(n), 9) for n in view.tangents],
        "x": [control_row(x, 9) for x in plan.controls(frame)],
    }


STREAMS = ("depth", "normal", "coverage")


@dataclass(frozen=True)
class FrameForm:
    """How a frame is drawn."""

    eye_distance: float = 0.0  # metres; above 0 both eyes, side by side
    supersample: int = 1  # pixels a side of the picture that make one of the film's
    streams: tuple[str, ...] = ()
    depth_unit: float = 0.001  # metres a step of the depth stream

    def pixels(self, size: tuple[int, int]) -> tuple[int, int]:
        """Of a frame, where one eye's picture has that size."""
        return size[0] * (2 if self.eye_distance > 0 else 1), size[1]


def draw_frames(
    renderer: "Renderer", plan: FilmPlan, numbers: list[int], folder: FrameFolder, form: FrameForm,
    done: Callable[[int], None] = lambda number: None,
) -> None:  # fmt: skip
    """Those frames of a plan into their files, one by one; `done` hears of each."""
    texts = {"metres_per_step": f"{form.depth_unit:g}"} if "depth" in form.streams else {}
    for number in numbers:
        picture, streams = frame_of(renderer, plan, number, form)
        folder.write_frame(number, picture, streams, texts)
        done(number)


def frame_of(
    renderer: "Renderer", plan: FilmPlan, number: int, form: FrameForm
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(H, W, 3) float32 display sRGB of one frame, and uint16 of each stream."""
    renderer.update(plan.scene(number))
    eyes = eyes_of(plan.view(number), form)
    renderer.draw([_finer(eye, form.supersample) for eye in eyes])
    pictures = [averaged(renderer.resolved(i), form.supersample) for i in range(len(eyes))]
    streams: dict[str, np.ndarray] = {}
    if form.streams:
        surfaces = [renderer.surface(eye) for eye in eyes]
        for name in form.streams:
            values = np.concatenate([values_of(each, name) for each in surfaces], axis=1)
            streams[name] = as_steps(values, name, form.depth_unit)
    return np.concatenate(pictures, axis=1), streams


def eyes_of(view: View, form: FrameForm) -> list[View]:
    return stereo_pair(view, form.eye_distance) if form.eye_distance > 0 else [view]


def _finer(view: View, factor: int) -> View:
    width, height = view.size
    return replace(view, size=(width * factor, height * factor))


def averaged(picture: np.ndarray, factor: int) -> np.ndarray:
    """(H, W, 3) means of blocks of factor x factor pixels, as displayed."""
    if factor == 1:
        return picture
    height, width = picture.shape[0] // factor, picture.shape[1] // factor
    blocks = picture.reshape(height, factor, width, factor, 3)
    return blocks.mean((1, 3), dtype=np.float32)
