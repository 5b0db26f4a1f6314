"""From where a model's photos were taken: provenance["eyes"], metres in the model's own frame.

What nobody has photographed a model only guesses, so whoever has to choose (an export's harmonics)
keeps what these eyes see.
"""

import numpy as np

from shapeshift.runtime_models.model import Model

EYES = "eyes"  # of the provenance
MOST_EYES = 64  # twice as many give an export of the demo 0.2 to 0.5 dB more
DIGITS = 4  # of the distance between the farthest two


def eyes_of(model: Model) -> np.ndarray:
    """(E, 3) float64; (0, 3) where the model knows none.  The reader has checked them."""
    return np.array(model.provenance.get(EYES, ()), np.float64).reshape(-1, 3)


def spread_eyes(places: np.ndarray) -> list[list[float]]:
    """At most MOST_EYES of the places (N, 3) as a package keeps them, far from one another.

    The first one, then always the one that is farthest from all before (Gonzalez 1985).
    """
    if not len(places):
        return []
    places = np.asarray(places, np.float64)
    away, chosen = np.full(len(places), np.inf), [0]
    while True:
        away = np.minimum(away, np.linalg.norm(places - places[chosen[-1]], axis=1))
        farthest = int(away.argmax())
        if len(chosen) == MOST_EYES or not away[farthest] > 0:
            break
        chosen.append(farthest)
    extent = float(np.ptp(places, axis=0).max())
    decimals = DIGITS - int(np.ceil(np.log10(extent))) if extent > 0 else DIGITS
    return places[chosen].round(decimals).tolist()
