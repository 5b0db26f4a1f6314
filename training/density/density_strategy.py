"""What draws new anchors: one row a strategy, named by --growth."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Strategy:
    """What a splat's pull is.  An anchor grows where the mean over the steps on screen is large."""

    name: str
    pull: int  # PULL of density.cl
    threshold: float  # of the pull, where nobody gives another
    relative: bool = False  # the pull counts in means over all splats that were on screen


STRATEGIES = {
    s.name: s
    for s in (
        # the gradient by the mean on the screen, in half image widths, as 3DGS and Scaffold-GS
        Strategy("gradient", 0, 2e-4),
        # the same with the absolute values of every pixel's part, so that opposite pulls add up
        Strategy("absgrad", 1, 6e-4),
        # the share of the picture's error that lies under the splat, alpha T times the error
        Strategy("error", 2, 1.2, relative=True),
    )
}


def strategy(name: str) -> Strategy:
    """Raises ValueError for a name that is not in the table."""
    if name not in STRATEGIES:
        raise ValueError(f"growth is '{name}'; it has to be one of {', '.join(STRATEGIES)}.")
    return STRATEGIES[name]
