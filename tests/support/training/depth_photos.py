"""Depth photos of chance, their loss in float64, and how far off the depth of a model is."""

import numpy as np

from shapeshift.training.evaluation.evaluate import evaluate_model
from shapeshift.training.losses.surface_losses import HOLE
from shapeshift.training.train import Trainer
from tests.support.training.situations import SIZE


def depth_photo(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(2, 4, SIZE[::-1]).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = 0
    return depth


def depth_loss_reference(metres, through, depth) -> float:
    known = depth > 0
    away = np.abs(metres - (1 - through) * depth)[known] / depth[known]
    return float((away + HOLE * through[known]).mean())


def depth_error(trainer: Trainer) -> float:
    """Mean over the modalities, as `eval` tells it of the exported model."""
    scores = evaluate_model(trainer.device, trainer.model(), trainer.capture)
    return float(np.mean([score.depth_error for score in scores.values()]))
