"""The case of contexts that come and go: memory must not grow with them."""

import gc
import os
from pathlib import Path

import numpy as np

from app.stability_cases.finding import Result, at_most, clean, not_here
from app.stability_cases.scenes import alone, front, shell
from app.stability_cases.stage import Stage

STATUS = Path("/proc/self/statm")
SETTLED = 0.3  # of the rounds: by then libraries are loaded and pools have their size
GROWTH_MB = 0.5  # a round
SMALL = (96, 64)


def life(stage: Stage) -> Result:
    """A context and a renderer made, drawn with, and closed, over and over."""
    scene, view = alone(shell(300)), front(SMALL)
    memory, images = [], []
    for _ in range(stage.rounds):
        with stage.reopen() as (renderer, _):
            renderer.update(scene)
            renderer.draw([view])
            images.append(np.array(renderer.image(0)))
        del renderer
        gc.collect()
        memory.append(resident_mb())
    change = max(float(np.abs(image - images[0]).max()) for image in images)
    findings = [
        clean(*images),
        at_most(
            f"largest difference of {stage.rounds} pictures", change, 1e-6,
            "a new context draws what the one before it drew",
        ),
        growth(memory),
    ]  # fmt: skip
    return Result(findings, [stage.panel("the last of the pictures", images[-1])])


def growth(memory: list[float | None]) -> object:
    """MB a round by which the process grew once it had settled."""
    figure = f"growth of resident memory, MB a context of {len(memory)}"
    if None in memory:
        return not_here(figure, "this system does not say how much memory a process holds")
    settled = memory[int(SETTLED * len(memory)) :]
    slope = float(np.polyfit(np.arange(len(settled)), settled, 1)[0]) if len(settled) > 1 else 0.0
    return at_most(
        figure, slope, GROWTH_MB,
        "a context with its programs, or an arena with its target, holds several MB: one that "
        "leaked would show ten times this",
    )  # fmt: skip


def resident_mb() -> float | None:
    """MB of this process that lie in memory; None where the system does not tell."""
    if not STATUS.exists():
        return None
    return int(STATUS.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
