"""One file of plain splats: how it is asked for, as it is written, and as the program takes it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shapeshift.runtime_models.files.memory import Account, Memory, unlimited
from shapeshift.runtime_models.files.part_cache import PartCache
from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.shapes import check
from shapeshift.runtime_models.splat_motion import SplatMotion

RAW_SHAPES = {"means": "N 3", "scales": "N 3", "wxyz": "N 4", "opacity": "N", "sh": "N M 3"}
COEFFICIENTS = (1, 4, 9, 16)  # of SH degrees 0 to 3
ARRAYS = ("means", "scales", "wxyz", "opacity", "sh")  # of RawSplats and PlainSplats
AXES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
COLMAP_UP = "-Y"  # x right, y down, z forward: as 3DGS writes its files


@dataclass(frozen=True)
class LeafReading:
    """That a scene in levels of detail is read leaf by leaf, as it is looked at."""

    budget: int  # splats that are drawn at most; 0: as many as suit the machine
    cache: PartCache  # of decoded files, of all scenes of one opening


@dataclass(frozen=True)
class Reading:
    """How a file or folder is to be read; every reader takes it."""

    mode: str = ""  # how layers add up: cumulative | exclusive; "" = what the files suggest
    up: str = ""  # the file's axis that points up, one of AXES; "" = what its format says
    flip: bool = False  # half a turn about z after that: upside down
    strict: bool = False  # refuse what would be repaired
    allow_huge: bool = False  # open files that would lay thousands of splats over every pixel
    most_splats: int = 0  # no more than these, neighbours are merged; 0 = all
    progress: Callable[[str, float], None] | None = None  # (what is being done, part done 0..1)
    memory_gb: float = 0.0  # that files may take while they are read; 0 = as memory.py has it
    leaves: LeafReading | None = None  # None: one level of detail for all of a scene
    memory: Memory | Account | None = None  # what they have taken; None: nothing is open yet
    outer: Path | None = None  # of what was unpacked: the file on disk, beside which facts lie

    def begun(self) -> "Reading":
        """The same with an account, for all files of one opening."""
        return self if self.memory else replace(self, memory=Memory(self.memory_gb))

    def within(self, path: Path, size: int | None = None) -> "Reading":
        """The same for one file, of `size` bytes where it lies in memory.

        `memory` is an Account then, which its readers charge before they take any.  What is read
        out of a file that has its account already counts for that one.
        """
        memory = self.begun().memory
        assert memory is not None
        return replace(self, memory=memory.of(path, size))

    @property
    def account(self) -> Account:
        """The one of the file that is being read, as `within` has opened it."""
        assert isinstance(self.memory, Account), "readers are given a reading of their file"
        return self.memory

    def report(self, what: str, part: float) -> None:
        if self.progress:
            self.progress(what, part)


@dataclass
class RawSplats:
    """A file's splats as they are written, in its axes and its coding: not judged, not turned.

    The arrays are the reader's own: a check of them may change them in place.
    """

    means: np.ndarray  # (N, 3) float32, or float64 where the file holds that
    scales: np.ndarray  # (N, 3) float32, natural logarithms of one sigma, or metres
    wxyz: np.ndarray  # (N, 4) float32, of any length
    opacity: np.ndarray  # (N,) float32, logits, or 0..1
    sh: np.ndarray  # (N, M, 3) float32, M = 1, 4, 9 or 16
    file: str  # for messages
    format: str  # "3DGS PLY", "spz v3", ...
    log_scales: bool = True
    logits: bool = True
    up: str = COLMAP_UP  # the axis that points up by the format's convention
    front: bool = False  # +Z is the front, as glTF has it: half a turn about +Y from ours
    axes: str = ""  # which they are, and why, where the format alone does not tell
    antialiased: bool = False
    usual: bool = False  # its coding has no number that activate.py would find
    labels: np.ndarray | None = None  # (N,) int32
    extra: dict[str, np.ndarray] = field(default_factory=dict)  # (N,) other columns, as filed
    findings: tuple[Finding, ...] = ()  # what the reader itself saw
    memory: Account = field(default_factory=unlimited)  # that its arrays are charged to

    def with_arrays(self, arrays: Sequence[np.ndarray], **more: Any) -> "RawSplats":
        """The same with other arrays, in the order of ARRAYS."""
        changes: dict[str, Any] = dict(zip(ARRAYS, arrays, strict=True))
        return replace(self, **changes, **more)

    @property
    def bytes_a_splat(self) -> int:
        """Of the arrays that every format has."""
        return 32 + self.means.itemsize * 3 + 12 * self.sh.shape[1]


def fourth_degree(count: int, left_out: float, whole: float, file: str) -> Finding:
    """That SH degree 4 is not drawn; what it has, and all that varies with direction, squared."""
    share = 100 * left_out / whole if whole > 0 else 0.0
    what = f"{count} coefficients of SH degree 4 a splat"
    done = f"left out, degree 3 is drawn: {share:.2g} % of what varies with direction goes"
    return Finding(what, 0, done, file=file, repaired=False)


def empty_splats(
    count: int, coefficients: int, memory: Account, exact: bool = False
) -> dict[str, Any]:
    """The arrays of RawSplats for `count` splats, charged and not filled in yet.

    exact: places are float64.  Raises BadFile.
    """
    place = np.dtype(np.float64 if exact else np.float32)
    memory.charge(count * (3 * place.itemsize + 32 + 12 * coefficients), f"{count:,} splats")
    return {
        "means": np.empty((count, 3), place),
        "scales": np.empty((count, 3), np.float32),
        "wxyz": np.empty((count, 4), np.float32),
        "opacity": np.empty(count, np.float32),
        "sh": np.empty((count, coefficients, 3), np.float32),
    }


@dataclass(frozen=True)
class PlainSplats:
    """One file's splats in our axes and units; SplatLayers joins several."""

    means: np.ndarray  # (N, 3) float32 metres, from `origin`
    scales: np.ndarray  # (N, 3) metres, one sigma
    wxyz: np.ndarray  # (N, 4) unit
    opacity: np.ndarray  # (N,) 0..1
    sh: np.ndarray  # (N, M, 3)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)  # float64 metres, our axes
    antialiased: bool = False
    labels: np.ndarray | None = None  # (N,) int32
    extra: dict[str, np.ndarray] = field(default_factory=dict)  # (N,) each
    findings: tuple[Finding, ...] = ()
    format: str = "3DGS PLY"
    axes: str = ""  # as of RawSplats
    motion: SplatMotion | None = None  # None: they do not move
    memory: Account = field(default_factory=unlimited, compare=False)  # as of RawSplats

    @classmethod
    def from_raw(
        cls, means: ArrayLike, scales: ArrayLike, wxyz: ArrayLike, opacity: ArrayLike, sh: ArrayLike
    ) -> "PlainSplats":
        """Splats of parameters as 3DGS and gsplat train them (Kerbl et al. 2023).

        means (N, 3) metres, with +Y up as everything here; scales (N, 3) natural logarithms of one
        sigma; wxyz (N, 4) of any length above 0; opacity (N,) or (N, 1) logits; sh (N, M, 3), M =
        1, 4, 9 or 16: what gsplat has as sh0 and shN, one after the other.  Everything is copied.
        Raises ValueError.

            splats = ss.PlainSplats.from_raw(means, scales, quats, opacities, sh)
        """
        given = {"means": means, "scales": scales, "wxyz": wxyz, "opacity": opacity, "sh": sh}
        raw = {name: np.array(numbers, np.float32) for name, numbers in given.items()}
        if raw["opacity"].ndim == 2 and raw["opacity"].shape[1] == 1:
            raw["opacity"] = raw["opacity"][:, 0]
        check(**{name: (array, RAW_SHAPES[name]) for name, array in raw.items()})
        if raw["sh"].shape[1] not in COEFFICIENTS:
            raise ValueError(f"sh has shape {raw['sh'].shape}, expected (N, 1, 4, 9 or 16, 3)")
        with np.errstate(over="ignore"):
            sigma = np.exp(raw["scales"])
            alpha = np.float32(1) / (1 + np.exp(-raw["opacity"]))
            length = np.linalg.norm(raw["wxyz"], axis=1)
        odd = ~(np.isfinite(sigma).all(axis=1) & np.isfinite(length) & (length > 0))
        if odd.any():
            row = int(np.flatnonzero(odd)[0])
            raise ValueError(
                f"row {row} is no splat: scales {raw['scales'][row].tolist()}, wxyz "
                f"{raw['wxyz'][row].tolist()}."
            )
        turns = raw["wxyz"] / length[:, None]
        return cls(raw["means"], sigma, turns, alpha, raw["sh"], format="raw parameters")

    @property
    def dropped(self) -> int:
        """Rows of the file that are not here."""
        return sum(f.count for f in self.findings if f.done == "dropped")
