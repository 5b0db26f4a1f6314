"""The case of contexts and scenes that come and go: memory must not grow with them."""

import ctypes
import gc
import os
from itertools import combinations
from pathlib import Path

import numpy as np

from shapeshift.app.stability_cases.case_context import EMPTY, CaseContext
from shapeshift.app.stability_cases.finding import CaseFinding, Result, at_most, clean, not_here
from shapeshift.app.stability_cases.scenes import front, shell, small_model
from shapeshift.scene.scene import Scene, SceneObject

STATUS = Path("/proc/self/statm")
SETTLED = 0.5  # of the rounds: by then libraries are loaded and pools have their size
GROWTH_MB = 0.5  # a round
LEAST_BYTES = 8  # of a splat: its key and its place in the order
SMALL = (96, 64)


def life(case: CaseContext) -> Result:
    """Scenes loaded and dropped; then a context and a renderer made, drawn with, and closed."""
    loads = loaded_and_dropped(case)  # first: the heap that contexts leave behind has holes
    view = front(SMALL)
    scene = Scene((SceneObject("shell", shell(300)), SceneObject("networks", small_model())))
    memory, images = [], []
    for _ in range(case.rounds):
        with case.reopen() as (renderer, _):
            renderer.update(scene)
            renderer.draw([view])
            images.append(np.array(renderer.image(0)))
        del renderer
        gc.collect()
        memory.append(resident_mb())
    case.make_current()
    change = max(float(np.abs(image - images[0]).max()) for image in images)
    findings = [
        clean(*images),
        at_most(
            f"largest difference of {case.rounds} pictures", change, 1e-6,
            "a new context draws what the one before it drew",
        ),
        growth(
            "a context", memory, GROWTH_MB,
            "a context with its programs holds several MB: a leak would show ten times this",
        ),
        growth(
            "a scene loaded and dropped", loads,
            max(GROWTH_MB, case.subject.scene.splat_count * LEAST_BYTES / 1e6),
            "what it holds is 150 bytes a splat and more: this is the least two columns of it",
        ),
    ]  # fmt: skip
    return Result(findings, [case.panel("the last of the pictures", images[-1])])


def loaded_and_dropped(case: CaseContext) -> list[float | None]:
    """MB after each time that the scene came into the renderer and left it."""
    memory, view = [], case.view()
    for _ in range(max(case.rounds // 3, 12)):
        case.draw(case.scene(), view)
        case.draw(EMPTY, view)
        gc.collect()
        memory.append(resident_mb())
    return memory


def growth(what: str, memory: list[float | None], most: float, reason: str) -> CaseFinding:
    """MB a round by which the process grew once it had settled."""
    figure = f"growth of resident memory, MB {what}, {len(memory)} times"
    known = [mb for mb in memory if mb is not None]
    if len(known) < len(memory):
        return not_here(figure, "this system does not say how much memory a process holds")
    settled = known[int(SETTLED * len(known)) :]
    # The median of the slopes of all pairs (Theil and Sen): one late pool does not count as a leak.
    pairs = combinations(enumerate(settled), 2)
    slopes = [(after - before) / (j - i) for (i, before), (j, after) in pairs]
    return at_most(figure, float(np.median(slopes or [0.0])), most, reason)


def resident_mb() -> float | None:
    """MB of this process that lie in memory; None where the system does not tell.

    What has been freed and is merely kept for later goes back first: in a long process holes of
    the heap fill up slowly, which looks like a leak.
    """
    if not STATUS.exists():
        return None
    give_back = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc's
    if give_back is not None:
        give_back(0)
    return int(STATUS.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
