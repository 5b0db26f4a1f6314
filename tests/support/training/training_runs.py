"""How tests make a training run, and the bits that it left."""

from pathlib import Path
from typing import TypeVar

from shapeshift.training.checkpoint import read_checkpoint, write_checkpoint
from shapeshift.training.run import Run
from shapeshift.training.train import Trainer

Kind = TypeVar("Kind", bound=Run)


def run(trainer: Kind, steps: int | None = None) -> Kind:
    """Train to the end of the budget, or for so many steps."""
    for now in trainer.steps():
        if steps is not None and now.iteration >= steps:
            break
    return trainer


def run_keeping(
    trainer: Kind, folder: Path, *steps: int, most: int | None = None
) -> tuple[Kind, list]:
    """Train to the end of the budget; and the checkpoints that were written after those steps.

    A run that was ended there has the same: what writing it changed, the end's bits would show.
    most: splats or anchors that it never has more of.
    """
    kept = []
    for now in trainer.steps():
        assert most is None or now.anchors <= most
        if now.iteration in steps:
            path = folder / f"{now.iteration}.npz"
            write_checkpoint(path, *trainer.checkpoint())
            kept.append(read_checkpoint(path))
    assert len(kept) == len(steps)
    return trainer, kept


def bits(trainer: Trainer) -> list[bytes]:
    """Everything from which a run goes on, the optimiser's moments included."""
    state, _ = trainer.checkpoint()
    return [name.encode() + state[name].tobytes() for name in sorted(state)]
