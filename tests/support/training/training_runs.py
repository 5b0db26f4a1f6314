"""How tests make a training run, and the bits that it left."""

from shapeshift.training.run import Run
from shapeshift.training.train import Trainer


def run(trainer: Run, steps: int | None = None) -> Run:
    """Train to the end of the budget, or for so many steps."""
    for now in trainer.steps():
        if steps is not None and now.iteration >= steps:
            break
    return trainer


def bits(trainer: Trainer) -> list[bytes]:
    """Everything from which a run goes on, the optimiser's moments included."""
    state, _ = trainer.checkpoint()
    return [name.encode() + state[name].tobytes() for name in sorted(state)]
