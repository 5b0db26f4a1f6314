"""What the overlay consists of: ImGui's triangles, and in which tiles of the window they changed.

A tile is TILE by TILE pixels; counted from the upper left.
"""

import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from imgui_bundle import imgui

from shapeshift.renderer.gl.layered import PixelBox

TILE = 16  # pixels: half a button
CORNER = np.dtype([("place", "2f4"), ("uv", "2f4"), ("color", "u4")])
INDEX = np.dtype(f"u{imgui.INDEX_SIZE}")
assert CORNER.itemsize == imgui.VERTEX_SIZE


@dataclass(frozen=True)
class DrawList:
    """The triangles of one of ImGui's windows, in the order in which they are drawn.  Two are equal
    where they look the same.
    """

    vertices: bytes  # of CORNER
    indices: bytes  # of INDEX
    commands: tuple[tuple[tuple[float, ...], int, int], ...]  # clip in logical pixels (left, top,
    #                                                   right, bottom), texture, count of triangles
    scale: tuple[float, float]  # pixels a logical pixel

    @cached_property
    def clips(self) -> np.ndarray:
        """(C, 4) logical pixels."""
        return np.array([clip for clip, _, _ in self.commands], np.float32).reshape(-1, 4)

    @cached_property
    def corners(self) -> np.ndarray:
        """(T, 3) indices of vertices."""
        return np.frombuffer(self.indices, INDEX).reshape(-1, 3)

    @cached_property
    def of_command(self) -> np.ndarray:
        """(T,) which command draws it."""
        counts = [count for _, _, count in self.commands]
        return np.repeat(np.arange(len(counts)), counts)

    @cached_property
    def records(self) -> np.ndarray:
        """(T, words) uint32: all that a triangle looks like."""
        corners = np.frombuffer(self.vertices, np.uint32).reshape(-1, CORNER.itemsize // 4)
        looks = corners[self.corners].reshape(len(self.corners), -1)
        textures = np.array([[texture] for _, texture, _ in self.commands], np.uint32)
        commands = np.concatenate([self.clips.view(np.uint32), textures.reshape(-1, 1)], axis=1)
        return np.concatenate([looks, commands[self.of_command]], axis=1)

    @cached_property
    def boxes(self) -> np.ndarray:
        """(T, 4) pixels: left, top, right, bottom of what is seen of each; right below left where
        nothing is.
        """
        x, y = np.frombuffer(self.vertices, np.float32).reshape(-1, CORNER.itemsize // 4)[:, :2].T
        left, top, right, low = self.clips[self.of_command].T
        a, b, c = self.corners.T
        boxes = np.empty((len(a), 4), np.float32)
        for values, first, last, at in ((x, left, right, 0), (y, top, low, 1)):
            i, j, k = values[a], values[b], values[c]
            np.maximum(np.minimum(np.minimum(i, j), k), first, out=boxes[:, at])
            np.minimum(np.maximum(np.maximum(i, j), k), last, out=boxes[:, at + 2])
        unseen = (boxes[:, 0] > boxes[:, 2]) | (boxes[:, 1] > boxes[:, 3])
        boxes[unseen, 2] = boxes[unseen, 0] - 1
        return boxes * np.tile(np.array(self.scale, np.float32), 2)

    def tiles(self, size: tuple[int, int]) -> np.ndarray:
        """(rows, columns) bool: those of a window of that size that it meets."""
        if size not in self._tiles:
            self._tiles[size] = tiles_of(self.boxes, size)
        return self._tiles[size]

    @cached_property
    def _tiles(self) -> dict[tuple[int, int], np.ndarray]:
        return {}


def read_lists(data: imgui.ImDrawData, before: tuple[DrawList, ...]) -> tuple[DrawList, ...]:
    """A copy of what ImGui wants to be drawn; lists that are as before are those of before."""
    scale = (data.framebuffer_scale.x, data.framebuffer_scale.y)
    lists: list[DrawList] = []
    for i, each in enumerate(data.cmd_lists):
        vertices, indices = each.vtx_buffer, each.idx_buffer
        commands = tuple(
            (tuple(one.clip_rect), one.get_tex_id(), one.elem_count // 3) for one in each.cmd_buffer
        )
        triangles = sum(count for _, _, count in commands)
        new = DrawList(
            ctypes.string_at(vertices.data_address(), vertices.size() * CORNER.itemsize),
            ctypes.string_at(indices.data_address(), 3 * triangles * INDEX.itemsize),
            commands,
            scale,
        )
        same = i < len(before) and before[i] == new
        lists.append(before[i] if same else new)
    return tuple(lists)


def changed_boxes(before: tuple[DrawList, ...], after: tuple[DrawList, ...]) -> np.ndarray:
    """(N, 4) pixels: of triangles that are not in both, or not at their turn in it."""
    found = [np.zeros((0, 4), np.float32)]
    for i in range(max(len(before), len(after))):
        old, new = (lists[i] if i < len(lists) else None for lists in (before, after))
        if old is None or new is None:
            found += [each.boxes for each in (old, new) if each is not None]
        elif old is not new and old != new:
            found += _differing(old, new)
    return np.concatenate(found)


def _differing(old: DrawList, new: DrawList) -> list[np.ndarray]:
    """Boxes of what differs between two lists: their triangles in turn where both have as many,
    else all between the first and the last that differ.
    """
    if old.scale != new.scale:
        return [old.boxes, new.boxes]
    a, b = old.records, new.records
    if len(a) == len(b):
        other = (a != b).any(axis=1)
        return [old.boxes[other], new.boxes[other]]
    shared = min(len(a), len(b))
    head = _alike(a[:shared], b[:shared])
    tail = _alike(a[head:][::-1][: shared - head], b[head:][::-1][: shared - head])
    return [old.boxes[head : len(a) - tail], new.boxes[head : len(b) - tail]]


def _alike(a: np.ndarray, b: np.ndarray) -> int:
    """How many rows are the same before the first that is not."""
    other = (a != b).any(axis=1)
    return int(other.argmax()) if other.any() else len(a)


def tiles_of(boxes: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(rows, columns) bool: the tiles of a window of `size` pixels that the boxes meet."""
    columns, rows = (-(-side // TILE) for side in size)
    seen = (boxes[:, 0] <= boxes[:, 2]) & (boxes[:, 2] >= 0) & (boxes[:, 3] >= 0)
    seen &= (boxes[:, 0] < size[0]) & (boxes[:, 1] < size[1])
    most = np.array([*size, *size], np.float32) - 1
    left, top, right, low = (np.clip(boxes[seen], 0, most) // TILE).astype(np.int64).T
    wide, right, low = columns + 1, right + 1, low + 1
    found = np.zeros((rows + 1) * wide, np.int64)  # each box counted in at one corner, then out
    for row, column, sign in ((top, left, 1), (top, right, -1), (low, left, -1), (low, right, 1)):
        found += sign * np.bincount(row * wide + column, minlength=len(found))
    counts = found.reshape(rows + 1, wide).cumsum(axis=0).cumsum(axis=1)
    return counts[:rows, :columns] > 0


def boxes_of(tiles: np.ndarray, size: tuple[int, int]) -> list[PixelBox]:
    """Boxes that cover these tiles and no others, none of them twice."""
    if not tiles.any():
        return []
    edges = np.diff(tiles.astype(np.int8), axis=1, prepend=0, append=0)
    rows: list[list[int]] = [[] for _ in range(len(tiles) + 1)]  # where runs begin, and beyond each
    for row, column in zip(*(each.tolist() for each in np.nonzero(edges)), strict=True):
        rows[row].append(column)
    open_boxes: dict[tuple[int, int], int] = {}  # first column, the one beyond -> first row
    found: list[tuple[int, int, int, int]] = []  # in tiles
    for row, columns in enumerate(rows):
        runs = list(zip(columns[::2], columns[1::2], strict=True))
        for run in [run for run in open_boxes if run not in runs]:
            found.append((run[0], open_boxes.pop(run), run[1], row))
        for run in runs:
            open_boxes.setdefault(run, row)
    width, height = size
    return [
        (left * TILE, top * TILE, min(right * TILE, width), min(low * TILE, height))
        for left, top, right, low in found
    ]
