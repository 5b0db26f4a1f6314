"""Every number of a run that trains plain 3DGS splats: the yardstick of the anchor model."""

from dataclasses import asdict, dataclass, replace

from shapeshift.training.settings import WEIGHT, Background, Masks, check_numbers

SHORTEST_RUN, SHORT_RUN = 400, 1000  # iterations at most


@dataclass(frozen=True)
class PlainRates:
    """Adam's learning rates at the start.  Those of places are shares of the extent, as in 3DGS."""

    means: float  # of the extent, see plain.py
    scales: float  # of the logarithm
    wxyz: float
    opacity: float  # of the logit
    base: float  # first coefficient of the harmonics
    rest: float  # the others; 3DGS: a twentieth of the first
    decay: float  # what is left of every rate at the end of the run, exponentially


# Short runs want faster rates than the 30,000 iterations of 3DGS, as the anchor model's do: 6 times
# its places', 8 times its scales' and 20 times its colours'; the shortest twice that, which loses
# 0.5 to 1.2 dB after 500 iterations and 0.4 to 2 after 800 (docs/bench/ideas.md).
SHORTEST = PlainRates(0.002, 0.08, 0.02, 0.1, 0.1, 0.005, decay=0.1)
SHORT = PlainRates(0.001, 0.04, 0.01, 0.05, 0.05, 0.0025, decay=0.1)
LONG = replace(SHORT, decay=0.03)


@dataclass(frozen=True)
class PlainSettings:
    """One run, of one modality.  What TrainSettings has too is meant as there."""

    iterations: int | None = 2000
    seconds: float | None = None
    seed: int = 0
    sh_degree: int = 3
    """With --model splats: degree of the spherical harmonics of the colours, 0 to 3."""
    voxel: float | None = None
    """Metres between the first splats.  Default: by the points and `splats`."""
    points: str = "auto"
    splats: int = 10000
    """Most splats to start with, where voxel does not say."""
    max_splats: int = 60000  # what an anchor model draws at most by default
    """With --model splats: most splats that growing may reach, for each modality."""
    grow: bool = True
    grow_every: int | None = None  # iterations; None: a tenth of the run, 20 to 100 (3DGS: 100)
    grow_threshold: float = 2e-4  # screen gradient in half image widths, as 3DGS
    prune_opacity: float = 0.005  # a splat below it goes, as 3DGS
    reset_every: int = 3000  # iterations until opacities are set back, as 3DGS
    depth_share: float = 0.3
    normal_share: float = 0.1
    downscale: int | None = None
    masks: Masks = "auto"
    background: Background = "auto"

    def __post_init__(self) -> None:
        """Raises ValueError naming the first number that cannot be."""
        least = {
            "iterations": 1, "seconds": 0.1, "seed": 0, "sh_degree": 0, "voxel": 1e-6, "splats": 1,
            "max_splats": 1, "grow_every": 1, "reset_every": 1, "downscale": 1, "depth_share": 0,
            "normal_share": 0,
        }  # fmt: skip
        check_numbers(self, least, {"depth_share": WEIGHT, "normal_share": WEIGHT})
        if not self.sh_degree <= 3:
            raise ValueError(f"sh_degree is {self.sh_degree}; harmonics go up to degree 3.")
        if self.iterations is None and self.seconds is None:
            raise ValueError("A run needs an end: give iterations or seconds.")

    def interval(self, iterations: int) -> int:
        """Iterations between changes of the splats in a run of so many."""
        return self.grow_every or min(max(iterations // 10, 20), 100)

    def rates(self, iterations: int) -> PlainRates:
        """The learning rates of a run of so many iterations."""
        if iterations <= SHORTEST_RUN:
            return SHORTEST
        return SHORT if iterations <= SHORT_RUN else LONG

    def as_dict(self) -> dict:
        return asdict(self)
