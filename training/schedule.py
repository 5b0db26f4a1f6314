"""Which photo comes at which step, over which background, and how far the run has come.

Everything about a step follows from the seed and its number, so a resumed run needs no memory.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.photos import BLACK, LoadedPhoto

MOST_TURNS = 100  # of a modality in a round


@dataclass(frozen=True)
class Schedule:
    photos: dict[str, list[LoadedPhoto]]  # training photos of every modality, none empty
    seed: int
    background: tuple[float, float, float] | None  # None: a random one where photos show it
    turns: tuple[int, ...] = ()  # indices of modalities, over and over; none: each in its turn

    def photo(self, iteration: int) -> LoadedPhoto:
        """Modalities take turns; each goes through all of its photos in a new order every time."""
        names = list(self.photos)
        turns = self.turns or tuple(range(len(names)))
        again, at = divmod(iteration, len(turns))
        which = turns[at]
        turn = again * turns.count(which) + turns[:at].count(which)
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


def balance_of(text: str) -> dict[str, int]:
    """Turns by modality out of "RGB=3,Thermal=1"; nothing: none.  Raises ValueError."""
    found = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, _, turns = part.rpartition("=")
        if not (name.strip() and turns.strip().isdecimal() and 1 <= int(turns) <= MOST_TURNS):
            raise ValueError(
                f"balance has '{part}'; it is NAME=TURNS, for example RGB=3,Thermal=1, with 1 to "
                f"{MOST_TURNS} turns."
            )
        found[name.strip()] = int(turns)
    return found


def turns_of(balance: dict[str, int], names: list[str]) -> tuple[int, ...]:
    """A round in which every modality has its turns, spread evenly; 1 where nothing is said.

    Raises BadFile where there is no modality of a name.
    """
    if len(names) < 2 or not balance:  # a capture of one modality out of several has no balance
        return ()
    for name in balance:
        if name not in names:
            raise BadFile(f"balance names '{name}'; the modalities are {', '.join(names)}.")
    shares = np.array([balance.get(name, 1) for name in names])
    given, order = np.zeros(len(names)), []
    for slot in range(int(shares.sum())):
        due = shares * (slot + 1) / shares.sum() - given
        order.append(int(np.argmax(due)))
        given[order[-1]] += 1
    return tuple(order)


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
