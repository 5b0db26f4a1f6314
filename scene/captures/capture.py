"""Posed photos of one place in several modalities: what training reads."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import Stop
from shapeshift.scene.cameras.upright import Up
from shapeshift.scene.captures.colmap_tables import PANORAMA, ColmapCamera
from shapeshift.scene.captures.radiometric.no_value import SAID_NOTHING, NoValue
from shapeshift.scene.pose import View

LEFT_HANDED = "left_handed"  # in the notes: the file's world is, and its x was turned round
MASKS = ("object", "valid")  # what masks mean: nothing is outside; what is outside is unknown
ORIGIN = "origin"  # in the notes: metres, our axes, that were taken off all places


@dataclass(frozen=True)
class Photo:
    view: View  # world frame of the program (+Y up), size of the photo as training sees it
    path: Path
    modality: str  # a Stop's name
    mask: Path | None = None  # white where the photo counts
    split: str = "train"  # train | test
    depth: Path | None = None  # metres along the view, of the same field of view
    depth_unit: float = 0.001  # metres a step, where the depth photo holds integers
    normals: Path | None = None  # directions of what it shows, of the same field of view
    normal_axes: str = "opengl"  # that they are in; or opencv
    counts: tuple[float, float] | None = None  # numbers of a grey photo that stand for 0 and 1
    lens: ColmapCamera | None = None  # of the file, where it bends lines: the view is without it
    mask_means: str = "object"  # one of MASKS; "" while a reader has not settled it
    float_depth_unit: float = 1.0  # metres of 1, where the depth photo holds floats
    band: int = 0  # which of several that its file holds, counted from 1; 0: it holds one
    mode: str = ""  # what its pixels are, as PIL names it ("RGB", "L", "I;16"); "": not looked at
    no_value: NoValue = SAID_NOTHING  # which of its numbers are none, beside what its file says
    may_lack_values: bool = (
        False  # whether a pixel may have none: its header or its capture says so
    )

    @property
    def file_size(self) -> tuple[int, int]:
        """Width and height of the image file, pixels."""
        return self.view.size if self.lens is None else self.lens.size

    @property
    def name(self) -> str:
        """Its file; of bands also which, of a panorama's faces where they look: they share one."""
        path = f"{self.path} (band {self.band})" if self.band else str(self.path)
        if self.lens is None or self.lens.model != PANORAMA:
            return path
        right, up = self.lens.params[4:6]
        return f"{path} ({right:g} degrees right, {up:g} up)"


@dataclass(frozen=True)
class FoundFiles:
    """One row of what a capture found: files of one kind that met one fate."""

    kind: str  # photos, masks, models ...
    found: int  # that are there
    used: int  # all of them, or none
    left_out: int  # all that are there, or that should be
    why: str = ""
    example: str = ""  # the first that is left out


@dataclass(frozen=True)
class Capture:
    folder: Path
    stops: tuple[Stop, ...]
    photos: tuple[Photo, ...]
    points: np.ndarray | None = None  # (P, 3) metres, world frame
    point_colors: np.ndarray | None = None  # (P, 3) 0..1
    background: tuple[float, float, float] | None = None  # what lies behind; None = black
    notes: dict = field(default_factory=dict)
    doubts: tuple[str, ...] = ()  # what a person should know of its files, a sentence each
    formulas: tuple[Stop, ...] = ()  # stops of values by formula of its stops', without photos
    files: tuple[FoundFiles, ...] = ()  # found, used, left out and why
    metres: str = ""  # who says how long a metre is in it; "": nobody
    ups: tuple[Up, ...] = ()  # what was taken to point up, then what photos and points say

    def of(self, modality: str, split: str) -> list[Photo]:
        return [p for p in self.photos if p.modality == modality and p.split == split]

    @property
    def origin(self) -> tuple[float, float, float]:
        """Metres, our axes: where its zero lies in the file's world; zeros nearly always."""
        return self.notes.get(ORIGIN, (0.0, 0.0, 0.0))
