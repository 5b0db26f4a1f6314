"""Splats of models in levels of detail, put into the arena as views and a budget want them.

The file to read first in streaming/.  Of each frame: sight (which leaves are in the picture), seen
(in how many pixels), choose (at which level), and the pages of what changes.
"""

import logging
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from shapeshift.rasterizer.device import Device, NoDevice, open_device
from shapeshift.rasterizer.pages import PAGE
from shapeshift.renderer.drawing import Drawing
from shapeshift.renderer.limits import arena_rows
from shapeshift.renderer.settings import StreamStats
from shapeshift.renderer.streaming.changing import NONE, Fades, comes_finer, patient, swapped
from shapeshift.renderer.streaming.choose import (
    BESIDE,
    NOT_DRAWN,
    base_of,
    choose_nodes,
    is_crowded,
    joined,
    joined_trees,
    steps_of,
    upwards,
)
from shapeshift.renderer.streaming.fetch import PIXELS, Fetcher, Sources
from shapeshift.renderer.streaming.in_sight import (
    CoarseLook,
    LeafSight,
    Weights,
    bytes_of,
    sight_of,
    views_ahead,
)
from shapeshift.renderer.streaming.pages import (
    ROOM,
    PageTable,
    Uploader,
    pages_needed,
)
from shapeshift.runtime_models.leaf_levels import LeafSource
from shapeshift.runtime_models.model import BadFile, Model, SplatLayers
from shapeshift.runtime_models.program import program
from shapeshift.runtime_models.splats.parents import NodeTree, with_parents
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene

CHANGED = 0.02  # of the budget: what a frame in motion may upload, in splats
EACH = 8  # frames, one in so many looks ahead
AMPLE = 0.88  # of the pages: where no more are needed, the whole budget is tried again
SPARE = 0.125  # more pages for fades where there are parents: nodes of 48 splats leave none free
SPLATS_A_UNIT = 500_000  # a compute unit of the processor: budget "auto"
LEAST_AUTO, MOST_AUTO = 1_000_000, 4_000_000


def has_leaves(model: Model) -> bool:
    return isinstance(model, SplatLayers) and model.leaves is not None


def pages_of_all(sources: Sequence[LeafSource]) -> int:
    """Pages for every level of every leaf, once for all copies."""
    once = {id(source): source for source in sources}.values()
    return sum(int(pages_needed(source.levels.counts).sum()) for source in once)


class Stream:
    """The leaves of all objects of a scene that have any."""

    def __init__(self, drawing: Drawing, models: Sequence[Model], budget: int = 0) -> None:
        """Makes room in the drawing.  budget: instead of the models' own; 0: theirs.

        Raises BadFile where other objects leave nothing of the budget.
        """
        self._drawing = drawing
        self.objects = [i for i, model in enumerate(models) if has_leaves(model)]
        mine = [models[i] for i in self.objects]
        self._models: list[SplatLayers] = [m for m in mine if isinstance(m, SplatLayers)]
        self._sources: list[LeafSource] = [m.leaves for m in self._models if m.leaves is not None]
        self.budget = budget or max(source.budget for source in self._sources) or auto_budget()
        fixed = sum(map(arena_rows, models))
        self.left = self.budget - fixed  # splats, for leaves
        self._fitting = 1.0  # of them, in the pages
        if not self.left > 0:
            raise BadFile(
                f"objects without levels of detail have {fixed:,} splats and the budget is "
                f"{self.budget:,}; give a larger --budget, or make levels of them, "
                f"`{program()} lod`."
            )
        nodes, self.tree = self._nodes()
        made = {id(source): steps_of(source.levels) for source in self._sources}
        self._steps = joined([made[id(source)] for source in self._sources])
        self._from = Sources(self._sources)
        self.first, self._object = self._from.first, self._from.object
        self._every_count = every_count(self._sources)  # (L, K) splats
        self._is_leaf = np.ones(len(self._object), bool) if self.tree is None else (
            self.tree.height == 0
        )  # fmt: skip
        finest = np.concatenate([source.levels.finest_counts for source in self._sources])
        self._finest = np.where(self._is_leaf, finest, 0)
        self._pages = pages_for(self._finest, self.left)  # at rest
        pages = self._pages + (int(SPARE * self._pages) if self.tree else 0)
        coefficients = max(source.coefficients for source in self._sources)
        stored = min(pages, pages_of_all(self._sources))
        drawing.allocate_pages(list(models), pages, coefficients, stored)
        self.follows_eye = coefficients > 1  # then its colours are decoded a frame
        self.table = PageTable(pages, int(self.first[-1]))
        self.fades = Fades(drawing, self.table)
        self._uploader = Uploader(drawing, self.table, self.objects, nodes, self.first)
        self.weights = Weights(int(self.first[-1]), self._look())
        self._fetcher = Fetcher()
        self._last: tuple = ()  # the views and poses that all is there for
        self._views: tuple[Sequence[View], Sequence[View]] = ((), ())  # of the last two frames
        self._poses = np.zeros((0, 4, 4))
        self._shown: list[bool] = []
        self._frame = self._decoded = 0  # frames; parts that were at hand in the last
        self._held = np.zeros(int(self.first[-1]), bool)  # nodes in the picture of the last frame
        self.stats = StreamStats(self.budget, 0, 0, int(self._finest.sum()), 0, False, "")
        self.reads = True  # what is wanted and not at hand
        self.converges = True  # each frame gets all that it wants, and forgets the one before

    def _nodes(self) -> tuple[list[SplatLayers], NodeTree | None]:
        """The models, with parents where leaves may crowd the budget: the sources have them then,
        and what the models' splats are of.
        """
        least = sum(int(base_of(source.levels).sum()) for source in self._sources)
        if not is_crowded(least, self.left):
            return self._models, None
        once = {id(model.leaves): model for model in self._models}
        made = {number: with_parents(model) for number, model in once.items()}
        pairs = [made[id(source)] for source in self._sources]
        nodes = [model for model, _ in pairs]
        self._sources = [model.leaves for model in nodes if model.leaves is not None]
        return nodes, joined_trees([tree for _, tree in pairs])

    def _look(self) -> CoarseLook | None:
        try:
            device: Device = open_device()
        except NoDevice as reason:
            logging.getLogger("renderer").warning(f"What is hidden counts as seen: {reason}")
            return None
        return CoarseLook(device, self._models, self.first)

    def follow(self, scene: Scene, poses: np.ndarray, views: Sequence[View]) -> list[int]:
        """Puts in what these views want; the objects whose splats have changed.

        poses: (O, 4, 4) world_from_object of all objects of the scene.

        Raises BadFile where a part cannot be read, and all were to be there.
        """
        poses = poses[self.objects]
        shown = [scene.objects[i].seen for i in self.objects]
        now = (*map(key_of, views), bytes_of(poses), *shown, self.converges)
        if now == self._last and not self.stats.pending:
            self.stats = self._stats(0, False, self.stats.in_sight)
            return []
        moving = not self.converges and now[: len(views)] != self._last[: len(views)]
        taken = self._drawing.trim()
        self._from.share_memory(taken)
        self._views = (self._views[1], views)
        self._poses, self._shown = poses, shown
        sight = self.find_sight(poses, shown, views)
        weight = self.weights.of(sight, views, poses, shown, fresh=self.converges)
        self._fetcher.tick(moving, 0 if self.weights.looked else PIXELS)  # one or the other
        wanted, worth = self._choose(weight, sight)
        changed, moved = self._change(wanted, worth, self._held_nodes(sight))
        self._last = now
        splats = int(self.table.splats[changed].sum())
        pending = bool((wanted != self.table.level).any() or self.fades.leaves.any())
        self.stats = self._stats(splats, pending, int(self._finest[sight.held].sum()))
        return sorted({self.objects[i] for i in np.unique(self._object[moved])})

    @property
    def placed(self) -> np.ndarray:
        """Pages that were filled for the last frame."""
        return self._uploader.placed

    def edit(self, objects: Sequence[int]) -> None:
        """Objects whose splats are not as they were read: they share no pages."""
        self._uploader.edited = np.isin(self.objects, objects)

    def _choose(self, weight: np.ndarray, sight: LeafSight) -> tuple[np.ndarray, np.ndarray]:
        """Levels of all leaves that fit the budget and the pages, and what each is worth."""
        beside = sight.wide & (weight <= 0) & (not self.converges)
        held = None if self.converges else self.table.level
        part = 1.0 if self.converges else self._fitting
        while True:
            pixels = np.where(beside, BESIDE, weight)
            level, worth = choose_nodes(self._steps, self.tree, pixels, int(part * self.left), held)
            level = np.where(beside & (level >= 0), self._steps.coarsest, level)
            if not self.converges:
                level = self._from.finest_of(level, self._from.whole(), self._steps.coarsest)
            needed = int(pages_needed(self._counts(level)).sum())
            if needed <= self._pages:
                self._fitting = part if needed > AMPLE * self._pages else 1.0
                return level, worth
            part *= 0.9

    def _counts(self, level: np.ndarray) -> np.ndarray:
        """(L,) splats of all leaves at these levels."""
        rows = np.arange(len(level))
        return np.where(level >= 0, self._every_count[rows, np.maximum(level, 0)], 0)

    def _stats(self, changed: int, pending: bool, in_sight: int) -> StreamStats:
        shown = int(self.table.splats.sum())
        return StreamStats(
            self.budget, shown, in_sight, self.stats.whole, changed, pending, self._from.problem
        )

    def find_sight(self, poses: np.ndarray, shown: list[bool], views: Sequence[View]) -> LeafSight:
        """Of all leaves, one object after the other."""
        each: list[LeafSight] = []
        for source, run in groupby(zip(self._sources, poses, strict=True), lambda pair: pair[0]):
            each.append(sight_of(source.levels, np.array([pose for _, pose in run]), views))
        held, wide, cover, distance = (
            np.concatenate([getattr(one, name) for one in each])
            for name in ("held", "wide", "cover", "distance")
        )
        there = np.array(shown)[self._object] & self._is_leaf
        return LeafSight(held & there, wide & there, cover, distance)

    def _held_nodes(self, sight: LeafSight) -> np.ndarray:
        """(N,) bool: in this picture and in the last one: what comes or goes there is seen to."""
        now = sight.held
        if self.tree is not None:
            now = now | upwards(self.tree, np.logical_or, now)
        stayed, self._held = now & self._held, now
        return stayed

    def _change(
        self, wanted: np.ndarray, worth: np.ndarray, stayed: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Brings the arena nearer to the wanted levels; the leaves with other levels, and all that
        have other pages.  stayed: (N,) bool, nodes whose place was in the last picture, too.
        """
        table, fades = self.table, self.fades
        over = [fades.end(np.flatnonzero(fades.leaves))] if self.converges else []
        level = wanted = patient(self.tree, wanted, table.level, fades.leaves)
        before = table.level.copy()
        gone = np.flatnonzero((wanted == NOT_DRAWN) & (table.level != NOT_DRAWN))
        out, into = NONE, NONE
        if not self.converges and self._drawing.weighs_pages:
            out, into = swapped(self.tree, wanted, table.level)
            stayed = stayed & ~fades.leaves
            out = np.union1d(out, gone[stayed[gone]])
            into = np.union1d(into, np.flatnonzero(stayed & (table.level == NOT_DRAWN)))
        table.retire(out)
        over.append(fades.end(np.setdiff1d(gone, out)))
        over.append(fades.advance())
        pages = [table.free(np.setdiff1d(gone, out))]
        due = np.flatnonzero(wanted != table.level)
        if not self.converges:
            at_hand = self._from.at_hand()
            if self.reads:
                missing = self._missing(wanted, worth, at_hand)
                self._fetcher.want([*missing, *self._ahead(at_hand)])
            self._decoded = sum(int(np.count_nonzero(there)) for there in at_hand)
            level = self._from.finest_of(wanted, at_hand, self._steps.coarsest)
            now = table.level
            level = np.where((now != NOT_DRAWN) & (level != wanted) & (level > now), now, level)
            level = np.where(fades.leaves, now, level)  # one change after the other
            due, level = self._first_of(np.flatnonzero(level != now), level, worth)
        fading = self._fading(due, level)
        if fading is None:
            pages.append(table.release(out))
            fading = out = into = NONE
        table.retire(fading)
        pages.append(table.free(np.setdiff1d(due, fading)))
        self._drawing.clear_pages(np.concatenate(pages))
        self._upload(due, level[due])
        both = np.concatenate([fading, out, np.intersect1d(due, into)])
        fades.begin(both, comes_finer(self.tree, table.level, before)[both])
        changed = np.concatenate([gone, due])
        return changed, np.concatenate([changed, *over])

    def _fading(self, due: np.ndarray, level: np.ndarray) -> np.ndarray | None:
        """Which of the leaves due (n,) keep old pages for some frames; None: there is no room."""
        needed = pages_needed(self._counts(level)[due]).sum()
        if self.converges or not self._drawing.weighs_pages or not needed <= self.table.room:
            return None
        return due[self.table.level[due] != NOT_DRAWN]

    def _upload(self, leaves: np.ndarray, levels: np.ndarray) -> None:
        self._uploader.upload(leaves, levels)
        if not self.follows_eye:
            self._drawing.shade_pages(self.placed)

    def _missing(
        self, wanted: np.ndarray, worth: np.ndarray, at_hand: Sequence[np.ndarray]
    ) -> list[tuple[LeafSource, int]]:
        """Parts that are wanted and not at hand, what is worth most first."""
        coming = (wanted >= 0) & (wanted != self.table.level) & (wanted != self._steps.coarsest)
        leaves = np.flatnonzero(coming)
        return self._from.missing(leaves, wanted[leaves], worth[leaves], at_hand)

    def _ahead(self, at_hand: Sequence[np.ndarray]) -> list[tuple[LeafSource, int]]:
        """Parts that the eye will want if it goes on as it does, and that are not at hand."""
        self._frame += 1
        if self._frame % EACH:
            return []
        views = views_ahead(*self._views)
        if not views:
            return []
        sight = self.find_sight(self._poses, self._shown, views)
        weight = np.where(sight.held, self.weights.guessed(sight), 0.0)
        wanted, worth = choose_nodes(self._steps, self.tree, weight, self.left)
        return self._missing(wanted, worth, at_hand)

    @property
    def due(self) -> bool:
        """Whether another frame of the same views would show more."""
        if not self.stats.pending:
            return False
        decoded = sum(int(np.count_nonzero(there)) for there in self._from.at_hand())
        fades = bool(self.fades.leaves.any())
        return fades or self.stats.changed > 0 or decoded != self._decoded

    def _first_of(
        self, due: np.ndarray, level: np.ndarray, worth: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What of the changes this frame makes, and all levels after it.

        What comes into sight comes at its coarsest at least, and what has to go for it goes; finer
        ones, best first, until CHANGED of the budget is uploaded.  Never more than the budget.
        """
        table, base = self.table, self._steps.base
        counts, there, now = self._counts(level), table.splats, table.level
        new = due[now[due] == NOT_DRAWN]
        downs = due[level[due] > now[due]]
        downs = np.setdiff1d(downs, new)
        downs = downs[np.argsort(worth[downs], kind="stable")]
        room = int(CHANGED * self.budget / (4 if self.weights.looked else 1))
        freed = np.cumsum(there[downs] - counts[downs])
        total = int(there.sum())
        needed = total + int(base[new].sum()) - self.left
        number = int(np.searchsorted(freed, needed)) + 1 if needed > 0 else 0
        fit = int(np.searchsorted(np.cumsum(counts[downs]), room, side="right"))
        number = max(number, fit, 1)  # one at least, or a small budget would be stuck
        downs = downs[:number]
        total -= int((there[downs] - counts[downs]).sum())
        new = new[np.argsort(-worth[new], kind="stable")]
        new = new[: int(np.searchsorted(total + np.cumsum(base[new]), self.left, side="right"))]
        total += int(base[new].sum())
        finer = due[(now[due] != NOT_DRAWN) & (level[due] < now[due])]
        ups = np.union1d(new[level[new] != self._steps.coarsest[new]], finer)
        ups = ups[np.argsort(-worth[ups], kind="stable")]
        more = counts[ups] - np.where(now[ups] == NOT_DRAWN, base[ups], there[ups])
        left = max(room - int(counts[downs].sum()), 0)
        taken = np.cumsum(counts[ups]) <= left
        taken[:1] = True  # or a large leaf would never come
        ups = ups[taken & (total + np.cumsum(more) <= self.left)]
        after = now.copy()
        after[new] = self._steps.coarsest[new]
        after[downs], after[ups] = level[downs], level[ups]
        return np.unique(np.concatenate([new, downs, ups])), after

    def close(self) -> None:
        self._fetcher.close()


def key_of(view: View) -> tuple:
    """What of a view says which leaves it wants."""
    pose = view.world_from_eye
    return (*pose.position, *pose.wxyz, *view.tangents, *view.size, view.near)


def auto_budget() -> int:
    """What suits the processor, or a GPU."""
    try:
        device = open_device()
    except NoDevice:
        return LEAST_AUTO
    if device.kind == "gpu":
        return MOST_AUTO
    return int(min(max(SPLATS_A_UNIT * device.units, LEAST_AUTO), MOST_AUTO))


def every_count(sources: Sequence[LeafSource]) -> np.ndarray:
    """(L, K) splats of all leaves of several sources; K of the one that has most."""
    most = max(source.levels.counts.shape[1] for source in sources)
    counts = [source.levels.counts for source in sources]
    return np.concatenate([np.pad(c, ((0, 0), (0, most - c.shape[1]))) for c in counts])


def pages_for(finest: np.ndarray, budget: int) -> int:
    """Pages for so many splats: one of each leaf is not full, but no more than ROOM allows."""
    splats = min(int(finest.sum()), budget)
    full = splats // PAGE + min(len(finest), budget) + 1
    return min(full, int(ROOM * budget) // PAGE + 1)
