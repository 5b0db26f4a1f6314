"""A streamed SOG leaf by leaf and level by level: what is to be drawn is decoded, nothing else."""

from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.json_fields import shown
from shapeshift.runtime_models.files.memory import Account, unlimited
from shapeshift.runtime_models.leaf_levels import LeafLevels, LeafSplats, Throttle, unpaced
from shapeshift.runtime_models.lint.lint_rows import repair_rows
from shapeshift.runtime_models.lint.lint_whole import (
    refuse_boundless,
    refuse_filling,
    sample_of,
)
from shapeshift.runtime_models.model import BadFile, Finding, SplatLayers, Stop
from shapeshift.runtime_models.splats.layers.read_layers import check_mode, widened
from shapeshift.runtime_models.splats.operations.activate import activate, origin_of, recentred
from shapeshift.runtime_models.splats.operations.rotate_splats import ours_from_file
from shapeshift.runtime_models.splats.plain_splats import ARRAYS, COLMAP_UP, RawSplats, Reading
from shapeshift.runtime_models.splats.sog.read_sog import (
    PICTURES,
    Sog,
    open_sog,
    raw_splats,
    read_palette,
)
from shapeshift.runtime_models.splats.sog.read_streamed import (
    TREE,
    Streamed,
    folder_of,
    read_tree,
)
from shapeshift.runtime_models.splats.sog.sog_files import META

# A SOG kept as the bytes of its pictures, 17 a splat: any of its rows become splats when asked.

CHANNELS = {"means": 3, "scales": 3, "quats": 4, "sh0": 4, "shN": 2}  # of the pixels


class SogChunk:
    """Decoded pictures of one SOG; `size` bytes of them are charged until `release`."""

    def __init__(self, path: Path, memory: Account, pace: Throttle = unpaced) -> None:
        """pace is called after each picture, with its splats.  Raises BadFile."""
        sog = open_sog(path, memory)
        self._sog, self._memory = sog, memory
        self.count = sog.count
        self._palette = read_palette(sog) if sog.names("shN") else None
        self._pixels: dict[tuple[str, int], np.ndarray] = {}
        for part in PICTURES:
            for number in range(len(sog.names(part))):
                if part == "shN" and number == 0:  # the palette
                    continue
                pixels = sog.pixels(part, number)
                columns = [pixels[:, channel] for channel in range(CHANNELS[part])]
                self._pixels[part, number] = np.stack(columns, axis=1)  # a slice: 4 times slower
                del pixels, columns
                memory.release(sog.files.held)
                sog.files.held = 0
                pace(sog.count)
        kept = [*self._pixels.values()] + ([] if self._palette is None else [self._palette])
        self.size = sum(array.nbytes for array in kept)  # bytes
        memory.charge(self.size, f"{sog.count:,} splats")

    def release(self) -> None:
        """Gives back what is charged."""
        self._memory.release(self.size)

    def rows(self, rows: np.ndarray) -> RawSplats:
        """The splats of these rows (n,), in their order, as read_raw_sog gives them."""
        pixels = {key: kept[rows] for key, kept in self._pixels.items()}
        return raw_splats(SogRows(self._sog, len(rows), pixels, self._palette))


class SogRows(Sog):
    """Some rows of a SOG as one of their own."""

    def __init__(
        self, sog: Sog, count: int, pixels: dict[tuple[str, int], np.ndarray],
        palette: np.ndarray | None,
    ) -> None:  # fmt: skip
        files = copy(sog.files)
        files.memory, files.held = unlimited(), 0  # few rows, and for a moment
        super().__init__(files, sog.meta, sog.version, count, known=sog.known, named=sog.named)
        self._kept, self._palette = pixels, palette

    def pixels(self, part: str, number: int = 0) -> np.ndarray:
        return self._kept[part, number]

    def palette(self) -> np.ndarray:
        return super().palette() if self._palette is None else self._palette


AT_ONCE = 1 << 16  # splats that are converted together: some 100 bytes each for a moment
FARTHEST = 1e12  # metres of a box; as of a scene


class StreamedLeaves:
    """The leaves of one folder, a LeafSource: its parts are the folder's files."""

    def __init__(self, streamed: Streamed, reading: Reading) -> None:
        """Raises BadFile."""
        assert reading.leaves is not None
        nodes = [leaf for leaf in streamed.leaves if any(run.count for run in leaf[1].values())]
        self.budget = reading.leaves.budget
        self.problem = ""
        self.cache, self._reading = reading.leaves.cache, reading
        self._ours = ours_from_file(reading.up or COLMAP_UP, reading.flip)
        self._origin, self._antialiased, self._format = (0.0, 0.0, 0.0), False, "SOG"
        files = [*streamed.files]
        environment = streamed.environment
        if environment is not None:
            files.append(environment)
        self._files, self._folder = files, streamed.folder
        self._broken = np.zeros(len(files), bool)
        self._at_hand = (-1, self._broken)  # version of the cache, what of the files it had
        self._key = (str(streamed.folder.resolve()),)
        count, kinds = len(nodes) + (environment is not None), len(streamed.levels)
        shape = (count, kinds)
        self.part, self._first = np.zeros(shape, np.int32), np.zeros(shape, np.int64)
        counts = np.zeros(shape, np.int64)
        for leaf, (_, runs) in enumerate(nodes):
            for level, run in runs.items():
                self.part[leaf, level] = run.file
                self._first[leaf, level], counts[leaf, level] = run.first, run.count
        if environment is not None:
            self.part[-1] = len(files) - 1
            counts[-1, 0] = self._chunk(len(files) - 1).count
        low, high = boxes_of([node for node, _ in nodes])
        if environment is not None:
            low = np.concatenate([low, np.full((1, 3), -FARTHEST)])
            high = np.concatenate([high, np.full((1, 3), FARTHEST)])
        corners = np.stack([low @ self._ours.T, high @ self._ours.T])
        errors = errors_of([node for node, _ in nodes], counts)
        self.levels = LeafLevels(corners.min(axis=0), corners.max(axis=0), counts, errors)
        self.coefficients = 1
        self.coarse_leaf = np.zeros(0, np.int32)

    def coarse_model(self) -> SplatLayers:
        """The coarsest level of every leaf as a scene of one stop.  Raises BadFile."""
        leaves = np.arange(len(self.part))
        coarsest = self.levels.coarsest
        parts, findings = [], []
        for run in self._runs(leaves, coarsest):
            found, splats = self._judged(self._raw(*run), *run[1:])
            findings += found
            parts.append(splats)
        self.coefficients = max(part.sh.shape[1] for part in parts)
        joined = [
            np.concatenate([np.asarray(getattr(part, name)) for part in parts])
            for name in ("means", "scales", "wxyz", "opacity")
        ]
        sh = np.concatenate([widened(part.sh, self.coefficients) for part in parts])
        leaf = np.concatenate([np.repeat(part.leaves, part.counts) for part in parts])
        name = self._folder.resolve().name
        if not len(sh):
            raise BadFile(f"{name}: not one splat of its coarsest levels can be drawn.")
        means, scales, wxyz, opacity = joined
        sample = sample_of(means, scales, opacity)
        refuse_boundless(name, sample)
        if not self._reading.allow_huge:
            refuse_filling(name, sample)
        self._origin, found = origin_of(sample, means.dtype, name)
        findings += found
        shift = np.array(self._origin)
        if shift.any():
            low, high = self.levels.low - shift, self.levels.high - shift
            self.levels = replace(self.levels, low=low, high=high)
            means = recentred(means, self._origin)
        self.coarse_leaf = leaf.astype(np.int32)
        counts = [int(n) for n in self.levels.counts.sum(axis=0)]
        last = int(coarsest.max())
        provenance = {
            "format": self._format, "files": self._file_names(), "level": last,
            "level_splats": counts, "leaves": len(leaves),
        }  # fmt: skip
        return SplatLayers(
            means, scales, wxyz, opacity, sh, np.zeros(len(sh), np.int32),
            (Stop(name, 0.0, "layer"),), provenance=provenance, origin=self._origin,
            antialiased=self._antialiased, findings=tuple(findings), leaves=self,
        )  # fmt: skip

    def _file_names(self) -> list[str]:
        """All files that belong to the scene, from its folder."""
        every = [self._folder / TREE]
        for path in self._files:
            every += filter(Path.is_file, path.parent.iterdir()) if path.name == META else [path]
        return [path.relative_to(self._folder).as_posix() for path in every]

    def at_hand(self) -> np.ndarray:
        if self._at_hand[0] != (version := self.cache.version):  # a frame asks, a city has 30,000
            there = [(*self._key, n) in self.cache for n in range(len(self._files))]
            self._at_hand = version, np.array(there)
        return self._at_hand[1]

    def share_memory(self, taken: int) -> None:
        self.cache.lend(taken)

    def broken(self) -> np.ndarray:
        return self._broken

    def load(self, part: int, pace: Throttle = unpaced) -> None:
        self._chunk(part, pace)

    def read(self, leaves: np.ndarray, levels: np.ndarray) -> Iterator[LeafSplats]:
        # A few leaves each of many files are judged together: a call takes 0.2 ms.
        waiting: list[tuple[RawSplats, np.ndarray, np.ndarray]] = []
        for file, some, at in self._runs(leaves, levels):
            raw = self._raw(file, some, at)
            raw.sh = self._harmonics(raw)
            size = sum(len(each.means) for each, _, _ in waiting) + len(raw.means)
            if waiting and (size > AT_ONCE or coding_of(raw) != coding_of(waiting[0][0])):
                yield self._judged(*joined(waiting))[1]
                waiting.clear()
            waiting.append((raw, some, at))
        if waiting:
            yield self._judged(*joined(waiting))[1]

    def _runs(
        self, leaves: np.ndarray, levels: np.ndarray
    ) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """(file, its leaves, their levels), file by file, AT_ONCE splats or a leaf at a time."""
        files, counts = self.part[leaves, levels], self.levels.counts[leaves, levels]
        for file in np.unique(files):
            mine = np.flatnonzero(files == file)
            block = (np.cumsum(counts[mine]) - counts[mine]) // AT_ONCE
            for rows in np.split(mine, np.flatnonzero(np.diff(block)) + 1):
                yield int(file), leaves[rows], levels[rows]

    def _chunk(self, file: int, pace: Throttle = unpaced) -> SogChunk:
        """A file's pictures.  Raises BadFile, then and ever after."""
        path = self._files[file]

        def decode() -> SogChunk:
            return SogChunk(path, self._reading.account, pace)

        try:
            return self.cache.get((*self._key, file), decode)
        except (BadFile, OSError) as error:
            self._broken[file] = True
            where = path.relative_to(self._folder).as_posix()
            self.problem = f"{self._folder.resolve().name}: {where} cannot be read: {error}"
            raise BadFile(self.problem) from None

    def _raw(self, file: int, leaves: np.ndarray, levels: np.ndarray) -> RawSplats:
        """Splats of some leaves of one file, as filed; `extra` has the number of each one's leaf.

        Raises BadFile.
        """
        chunk = self._chunk(file)
        counts, first = self.levels.counts[leaves, levels], self._first[leaves, levels]
        beyond = first + counts > chunk.count
        if beyond.any():
            self._broken[file] = True
            where = self._files[file].relative_to(self._folder).as_posix()
            self.problem = (
                f"{self._folder.resolve().name}: {where} has {chunk.count:,} splats, {TREE} names "
                f"row {int((first + counts).max()):,}; copy the whole folder or export it again."
            )
            raise BadFile(self.problem)
        within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        raw = chunk.rows(np.repeat(first, counts) + within)
        self._antialiased, self._format = raw.antialiased, raw.format
        raw.extra = {"leaf": np.repeat(np.arange(len(leaves)), counts)}
        return raw

    def _judged(
        self, raw: RawSplats, leaves: np.ndarray, levels: np.ndarray
    ) -> tuple[list[Finding], LeafSplats]:
        """The same in our axes and units, as `judge` makes them."""
        odd, filed = activate(raw, self._ours)
        findings = [*raw.findings, *repair_rows(raw, odd, filed)]
        kept = np.bincount(raw.extra["leaf"], minlength=len(leaves))
        return findings, LeafSplats(
            leaves, levels, kept, recentred(raw.means, self._origin), raw.scales, raw.wxyz,
            raw.opacity, self._harmonics(raw),
        )  # fmt: skip

    def _harmonics(self, raw: RawSplats) -> np.ndarray:
        """(n, M, 3) of the coarsest level's M; before that is known as many as the file has."""
        known = len(self.coarse_leaf) > 0
        return widened(raw.sh, self.coefficients) if known else raw.sh


def coding_of(raw: RawSplats) -> tuple:
    """What splats have in common that are judged together."""
    return raw.log_scales, raw.logits, raw.antialiased, raw.sh.shape[1]


def joined(
    parts: list[tuple[RawSplats, np.ndarray, np.ndarray]],
) -> tuple[RawSplats, np.ndarray, np.ndarray]:
    """Splats, leaves and levels of several files of one coding as if of one."""
    if len(parts) == 1:
        return parts[0]
    raws, leaves, levels = zip(*parts, strict=True)
    first = np.cumsum([0, *map(len, leaves)])
    leaf = [raw.extra["leaf"] + start for raw, start in zip(raws, first[:-1], strict=True)]
    arrays = [np.concatenate([getattr(raw, name) for raw in raws]) for name in ARRAYS]
    extra = {"leaf": np.concatenate(leaf)}
    return (
        raws[0].with_arrays(arrays, extra=extra), np.concatenate(leaves), np.concatenate(levels)
    )  # fmt: skip


def open_leaves(path: Path, reading: Reading) -> SplatLayers:
    """The coarsest levels of a streamed SOG, whose `leaves` give all others.  Raises BadFile."""
    check_mode(reading.mode)
    reading = reading.within(folder_of(path))
    return StreamedLeaves(read_tree(path, reading.account), reading).coarse_model()


def boxes_of(nodes: list[dict]) -> tuple[np.ndarray, np.ndarray]:
    """(L, 3) and (L, 3) metres in the file.  Raises BadFile."""
    ends = np.zeros((len(nodes), 2, 3))
    for i, node in enumerate(nodes):
        bound = node.get("bound")
        for k, name in enumerate(("min", "max")):
            end = bound.get(name) if isinstance(bound, dict) else None
            if not (isinstance(end, list) and len(end) == 3 and all(map(is_number, end))):
                raise BadFile(
                    f"{TREE} holds a leaf whose bound has the {name} {shown(end)}, expected three "
                    "numbers; export it again."
                )
            ends[i, k] = end
    low, high = ends[:, 0], ends[:, 1]
    wrong = ~((np.abs(ends) <= FARTHEST).all(axis=(1, 2)) & (low <= high).all(axis=1))
    if wrong.any():
        bound = nodes[int(np.argmax(wrong))]["bound"]
        raise BadFile(f"{TREE} holds a leaf whose bound is {shown(bound)}; export it again.")
    return low, high


def errors_of(nodes: list[dict], counts: np.ndarray) -> np.ndarray:
    """(L, K): what the tree states, or where a leaf states none, how many fewer splats it has, as
    PlayCanvas's engine has it.  Raises BadFile.
    """
    most = counts.max(axis=1, keepdims=True)
    errors = np.where(counts > 0, np.log(most / np.maximum(counts, 1)), 0.0)
    for i, node in enumerate(nodes):
        stated = node.get("errors")
        if stated is None:
            continue
        levels = counts.shape[1]
        if not (isinstance(stated, list) and len(stated) <= levels and all(map(is_number, stated))):
            raise BadFile(f"{TREE} holds a leaf with the errors {shown(stated)}; export it again.")
        if not all(0 <= error <= FARTHEST for error in stated):
            raise BadFile(f"{TREE} holds a leaf with the errors {shown(stated)}; export it again.")
        errors[i, : len(stated)] = stated
        errors[i, len(stated) :] = max(stated, default=0.0)
    return errors


def is_number(value: object) -> bool:
    return type(value) in (int, float)
