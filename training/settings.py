"""Every number that a training run can be asked for; `preset` gives the two starting points."""

from dataclasses import asdict, dataclass, fields, replace
from itertools import pairwise

from shapeshift.runtime_models.model import Stop
from shapeshift.training.between import CURES
from shapeshift.training.heads.networks import OWN, HeadLayout
from shapeshift.training.schedule import balance_of


@dataclass(frozen=True)
class Rates:
    """Adam's learning rates at the start.  Anchors move in voxels, so theirs is in voxels too."""

    offset: float
    scale: float
    rotation: float
    opacity: float
    color: float
    feature: float
    anchor: float
    frame: float  # of logarithms of sizes, and of quaternions
    decay: float  # what is left of every rate at the end of the run, exponentially


# Ten seconds to minutes on a CPU: 5 times the rates that Scaffold-GS uses for 30,000 iterations.
# Twice as much ends 0.9 and 1.2 dB lower on two scenes after 2,000 steps, half as much the same on
# one; long runs end a little finer.
SHORT = Rates(0.02, 0.02, 0.02, 0.01, 0.04, 0.0375, 0.01, 0.02, decay=0.1)
LONG = replace(SHORT, decay=0.03)
LEAST_GAP = 1 / 63  # of x between two stops: nearer ones share units of the encoding
SHORT_RUN = 4000  # iterations
# Paper, section 5.1; it states no decay.  Its anchor rate is in metres: 0.001, here in voxels.
PAPER = Rates(0.001, 0.001, 0.0004, 0.0005, 0.008, 0.0075, 0.01, 0.001, decay=0.1)


def refuse_numbers(settings: object, least: dict[str, float], shares: tuple[str, ...]) -> None:
    """Raises ValueError naming the first number below its least, not finite, or no share."""
    for name, low in least.items():
        value = getattr(settings, name)
        if value is not None and not low <= value < float("inf"):
            raise ValueError(f"{name} is {value}; it has to be at least {low}.")
    for name in shares:
        if not getattr(settings, name) <= 1:
            raise ValueError(f"{name} is {getattr(settings, name)}; it is a share, 0 to 1.")


@dataclass(frozen=True)
class TrainSettings:
    """What is written into a package's provenance and checked when a run is resumed."""

    preset: str = "fast"
    iterations: int | None = 2000  # budget in steps (the same bits every time) ...
    seconds: float | None = None  # ... or in time
    seed: int = 0
    splats_per_anchor: int = 5  # k
    features: int = 16  # F
    hidden: int = 32
    layers: int = 1  # hidden ones of each network
    fixed: str = ""  # heads that do not see x, with commas between: all stops share what they give
    view_dependent: bool = True  # whether colour sees the direction from the eye
    control: int = 16  # d of Psi
    sigma: float = 0.04  # of Psi
    encoding: str = "stops"  # Psi: one unit a stop, half a gap wide | even: `control`, `sigma`
    points: str = "auto"  # first: auto | capture | depth | hull | random | the path of a cloud
    max_anchors: int = 12000  # at the start, as far as there are points, and ever
    max_mb: float | None = None  # the same as megabytes of the package on disk
    own: str = ",".join(OWN)  # what each anchor has beside its features: frame, color
    grow: bool = True  # add and remove anchors between 10 % and 60 % of the run
    grow_every: int = 100  # iterations
    ssim_share: float = 0.2  # of the image loss; eq. 8 read literally says 0.8, which is worse
    opacity_share: float = 0.0  # lambda_alpha of eq. 9; the paper says 0.01
    depth_share: float = 0.3  # of the depth loss, beside the image's, where photos have depth
    scale_share: float = 0.0  # lambda_S of eq. 9; the paper says 1e-9
    downscale: int | None = None  # of the photos; None: until neither side exceeds 640 pixels
    coarse: int = 1  # the sides are divided by this at the start: 1, 2, 4, 8; halved step by step
    coarse_until: float = 0.35  # of the run, from when on the photos have all their pixels
    masks: str = "object"  # object: nothing outside it | valid: unknown outside it | ignore
    background: str = "auto"  # auto: the capture's, else random where photos have alpha | black ...
    rig: str = ""  # offsets of cameras that were found: JSON, a modality -> 16 numbers
    rate_scale: float = 1.0  # times every learning rate
    rise: int = 0  # steps over which the networks' rates rise; after a fall it is 200
    revive: float = 0.05  # lambda of a pull on absent splats: mean max(0.02 - opacity, 0)
    between: str = "none"  # how x between stops is learned: one of CURES
    between_share: float = 0.25  # of the steps, in which it is
    between_pull: float = 1.0  # lambda of the pull of splats
    thermal_smooth: float = 0.0  # lambda of thermal pictures' roughness; ThermalGaussian: 0.6
    balance: str = ""  # steps of a modality beside the others', as RGB=3,Thermal=1

    def __post_init__(self) -> None:
        """Raises ValueError naming the first number that cannot be."""
        least = {
            "iterations": 1, "seconds": 0.1, "seed": 0, "splats_per_anchor": 1, "features": 1,
            "hidden": 1, "control": 2, "max_anchors": 1, "grow_every": 1,
            "downscale": 1, "ssim_share": 0, "opacity_share": 0, "scale_share": 0,
            "depth_share": 0, "rise": 0, "revive": 0,
            "rate_scale": 0, "max_mb": 1e-6, "coarse": 1, "coarse_until": 0, "sigma": 1e-3,
            "between_share": 0, "between_pull": 0, "thermal_smooth": 0,
        }  # fmt: skip
        shares = ("ssim_share", "coarse_until", "between_share")
        refuse_numbers(self, least, shares)
        if self.coarse & (self.coarse - 1):
            raise ValueError(f"coarse is {self.coarse}; it has to be a power of two: 1, 2, 4 or 8.")
        if self.encoding not in ("even", "stops"):
            raise ValueError(f"There is no encoding '{self.encoding}'; use even or stops.")
        if self.between not in CURES:
            raise ValueError(
                f"There is no cure '{self.between}' of what lies between; use {', '.join(CURES)}."
            )
        balance_of(self.balance)
        self.layout()
        if self.iterations is None and self.seconds is None:
            raise ValueError("A run needs an end: give iterations or seconds.")

    def layout(self) -> HeadLayout:
        """The networks that are asked for.  Raises ValueError where there are none such."""
        fixed, own = (
            tuple(name.strip() for name in names.split(",") if name.strip())
            for names in (self.fixed, self.own)
        )
        return HeadLayout(
            self.splats_per_anchor, self.features, self.hidden, self.control,
            self.layers, fixed, self.view_dependent, own,
        )  # fmt: skip

    def for_stops(self, stops: tuple[Stop, ...]) -> "TrainSettings":
        """With the encoding for a capture's stops.

        `stops`: a unit for each place on the slider as far apart as the nearest two stops are.
        What lies between two stops then learns from both, and no unit is left that saw no photo.
        """
        if self.encoding == "even":
            return self
        xs = sorted(stop.x for stop in stops)
        gaps = [b - a for a, b in pairwise(xs)]
        units = round(1 / max(min(gaps, default=1.0), LEAST_GAP)) + 1
        return replace(self, control=units, sigma=0.5 / (units - 1))

    def rates(self, iterations: int) -> Rates:
        """The learning rates of a run of so many iterations."""
        if self.preset == "paper":
            return PAPER
        return SHORT if iterations <= SHORT_RUN else LONG

    def as_dict(self) -> dict:
        return asdict(self)


def preset(name: str) -> TrainSettings:
    """fast: minutes on a CPU.  paper: the numbers of section 5.1."""
    if name == "fast":
        return TrainSettings()
    if name == "paper":
        return replace(
            TrainSettings(), preset="paper", iterations=30000, encoding="even",
            splats_per_anchor=10, max_anchors=100_000, opacity_share=0.01,
            scale_share=1e-9,
        )  # fmt: skip
    raise ValueError(f"There is no preset '{name}'; use fast or paper.")


BUDGET = ("iterations", "seconds")  # what may change when a run is resumed


def adjusted(settings: TrainSettings, asked: dict, said: str = "") -> TrainSettings:
    """The settings with the values that were asked for, by name.

    A budget of one kind takes the place of the other.  said: what stands before a name where it is
    typed, as --.  Raises ValueError, one sentence.
    """
    encoding = asked.keys() & {"control", "sigma"}
    if asked.get("encoding") == "stops" and encoding:
        raise ValueError(
            f"{said}encoding stops sets {said}control and {said}sigma itself; leave them out."
        )
    budget = {"seconds": {"iterations": None}, "iterations": {"seconds": None}}
    given = [name for name in BUDGET if name in asked]
    more = budget[given[0]] if len(given) == 1 else {}
    even = {"encoding": "even"} if encoding else {}
    return replace(settings, **(even | more | asked))


def resumed(before: dict, asked: dict, said: str = "") -> TrainSettings:
    """A checkpoint's settings with another budget.  Raises ValueError for anything else, and for a
    checkpoint of another version.
    """
    if other := sorted(before.keys() ^ {field.name for field in fields(TrainSettings)}):
        raise ValueError(
            f"{said}resume: the checkpoint was written by another version of this program, which "
            f"trains in another way ({other[0]}); train anew without {said}resume."
        )
    other = sorted(n for n in asked if n not in BUDGET and asked[n] != before[n])
    if other:
        raise ValueError(
            f"{said}resume goes on with the settings of the checkpoint, where {other[0]} is "
            f"{before[other[0]]}, not {asked[other[0]]}; leave it out or start anew."
        )
    budget = {name: asked[name] for name in BUDGET if name in asked}
    return adjusted(TrainSettings(**before), budget, said)
