"""From where a model's photos were taken: provenance["eyes"], metres in the model's own frame.

What nobody has photographed a model only guesses, so whoever has to choose (an export's harmonics)
keeps what these eyes see, and `change` judges by what they see alone: provenance["looks"] says
beside each eye how it looked.
"""

import numpy as np

from shapeshift.runtime_models.model import Model

EYES, LOOKS = "eyes", "looks"  # of the provenance
LOOK = 8  # numbers of a look: w x y z of world_from_eye; tangents left, right, down, up
MOST_EYES = 64  # twice as many give an export of the demo 0.2 to 0.5 dB more
DIGITS = 4  # of the distance between the farthest two


def eyes_of(model: Model) -> np.ndarray:
    """(E, 3) float64; (0, 3) where the model knows none.  The reader has checked them."""
    return np.array(model.provenance.get(EYES, ()), np.float64).reshape(-1, 3)


def looks_of(model: Model) -> np.ndarray:
    """(E, LOOK) float64 beside the eyes; (0, LOOK) where the model does not know them all."""
    looks = np.array(model.provenance.get(LOOKS, ()), np.float64).reshape(-1, LOOK)
    return looks if len(looks) == len(eyes_of(model)) else np.zeros((0, LOOK))


def spread_eyes(places: np.ndarray, looks: np.ndarray | None = None) -> dict[str, list]:
    """At most MOST_EYES of the places (N, 3) as a package keeps them, far from one another, with
    their looks (N, LOOK) where all are known.

    The first one, then always the one that is farthest from all before (Gonzalez 1985).
    """
    if not len(places):
        return {EYES: []}
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
    kept = {EYES: places[chosen].round(decimals).tolist()}
    if looks is not None and len(looks) == len(places):
        kept[LOOKS] = np.asarray(looks, np.float64)[chosen].round(DIGITS).tolist()
    return kept
