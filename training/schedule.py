"""Which photo comes at which step, over which background, and how far the run has come.

Everything about a step follows from the seed and its number, so a resumed run needs no memory.
"""

from dataclasses import dataclass

import numpy as np

from training.photos import BLACK, LoadedPhoto

NAMED_BACKGROUNDS = {"black": BLACK, "white": (1.0, 1.0, 1.0), "gray": (0.5, 0.5, 0.5)}


@dataclass(frozen=True)
class Schedule:
    photos: dict[str, list[LoadedPhoto]]  # training photos of every modality, none empty
    seed: int
    background: tuple[float, float, float] | None  # None: a random one where photos show it

    def photo(self, iteration: int) -> LoadedPhoto:
        """Modalities take turns; each goes through all of its photos in a new order every time."""
        names = list(self.photos)
        turn, which = divmod(iteration, len(names))
        photos = self.photos[names[which]]
        epoch, place = divmod(turn, len(photos))
        order = np.random.default_rng([self.seed, 1, which, epoch]).permutation(len(photos))
        return photos[order[place]]

    def background_of(self, iteration: int, photo: LoadedPhoto) -> tuple[float, float, float]:
        if self.background is not None:
            return self.background
        if not photo.see_through:
            return BLACK
        return tuple(np.random.default_rng([self.seed, 2, iteration]).random(3).tolist())


def choose_background(
    setting: str, capture_background: tuple | None
) -> tuple[float, float, float] | None:
    """The fixed background of a run; None = random where photos show it."""
    if setting == "auto":
        return capture_background
    if setting == "random":
        return None
    if setting not in NAMED_BACKGROUNDS:
        raise ValueError(
            f"There is no background '{setting}'; use auto, random, {', '.join(NAMED_BACKGROUNDS)}."
        )
    return NAMED_BACKGROUNDS[setting]


@dataclass(frozen=True)
class Budget:
    """How long to train: steps, seconds, or whichever ends first."""

    iterations: int | None
    seconds: float | None

    def fraction(self, iteration: int, elapsed: float) -> float:
        """0 at the start, 1 or more at the end; learning rates and growing follow it."""
        steps = iteration / max(self.iterations, 1) if self.iterations is not None else 0.0
        time = elapsed / max(self.seconds, 1e-9) if self.seconds is not None else 0.0
        return max(steps, time)
