"""What a search for poses found."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class PoseReport:
    """What was found; poses.json holds the same."""

    photos: int
    placed: int
    left_out: list[str]
    few_points: dict[str, int]  # photos with a pose that hangs on few points, and how many
    points: int
    error_px: float  # mean reprojection error
    attempts: list[dict]
    scale: str  # where metres come from
    up: str  # where upright comes from
    paired: int = 0  # photos of a second camera that got the poses of those they were taken with
    others: list[str] = field(default_factory=list)  # pictures that are masks, depth ... by name
