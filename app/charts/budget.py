"""The budget: of measured settings, the one that keeps a frame time and a likeness at once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Protocol

from shapeshift.app.errors import UsageError
from shapeshift.renderer.settings import RenderSettings

EXACT = "exact"  # name of the row that leaves nothing out
FLOOR_DB = 35.0  # where a difference begins to be seen side by side


@dataclass(frozen=True)
class FrameBudget:
    """What a user wants kept: milliseconds a frame, dB to the exact picture."""

    target_ms: float
    floor_db: float = FLOOR_DB


def read_budget(target_ms: float | None, floor_db: float | None) -> FrameBudget | None:
    """The budget of --target-ms and --floor-db, None without them; UsageError in one sentence."""
    for name, value in (("--target-ms", target_ms), ("--floor-db", floor_db)):
        if value is not None and not 0 < value < inf:
            raise UsageError(f"{name} is {value}, expected a number above 0.")
    if target_ms is None:
        if floor_db is not None:
            raise UsageError("--floor-db bounds what --target-ms may choose; give both.")
        return None
    return FrameBudget(target_ms, FLOOR_DB if floor_db is None else floor_db)


class MeasuredSetting(Protocol):
    """One measured setting; rows of a stored chart and of the window's quick chart alike."""

    @property
    def name(self) -> str: ...
    @property
    def settings(self) -> RenderSettings: ...
    @property
    def ms(self) -> float: ...
    @property
    def db(self) -> float: ...


@dataclass(frozen=True)
class Choice:
    """What a budget came to."""

    settings: RenderSettings
    name: str  # of the row
    ms: float  # a frame
    db: float  # PSNR against the exact picture, worst that was measured
    sentence: str  # what was chosen and what it costs
    reached: bool  # whether ms is at or below the target


def choose(rows: Sequence[MeasuredSetting], target_ms: float, floor_db: float) -> Choice:
    """The most alike of the rows that reach the target; none does: the fastest above the floor.

    Rows whose ms or db is NaN are never chosen.  Without a row above the floor it is the exact
    one, which is alike by definition.  ValueError where no row is named "exact".
    """
    exact = next((row for row in rows if row.name == EXACT), None)
    if exact is None:
        raise ValueError(f"a budget chooses from rows with one named '{EXACT}'; there is none.")
    kept = [row for row in rows if row.db >= floor_db and 0 < row.ms] or [exact]
    reaching = [row for row in kept if row.ms <= target_ms]
    if reaching:
        # The exact picture is the best there is, however slow compared with the others.
        best = max(reaching, key=lambda row: (row.name == EXACT, row.db, -row.ms))
    else:
        best = min(kept, key=lambda row: (row.ms, -row.db))
    sentence = _sentence(best, exact, target_ms, floor_db, bool(reaching))
    return Choice(best.settings, best.name, best.ms, best.db, sentence, bool(reaching))


def _sentence(
    best: MeasuredSetting, exact: MeasuredSetting, target_ms: float, floor_db: float, reached: bool
) -> str:
    """One line: what was chosen, what it costs in dB and in ms, whether it is enough."""
    if best is exact:
        what = f"exact: {best.ms:.1f} ms a frame, nothing is left out"
    else:
        what = (
            f"{best.name}: {best.ms:.1f} ms a frame where exact takes {exact.ms:.1f} ms, "
            f"{best.db:.1f} dB against the exact picture"
        )
    if reached:
        return f"{what}."
    return (
        f"Nothing at {floor_db:.0f} dB or better reaches {target_ms:.1f} ms; "
        f"the fastest of them is {what}."
    )


def least_scale(rows: Sequence[MeasuredSetting], floor_db: float) -> float:
    """The smallest render_scale that was measured at the floor or better with nothing else changed.

    How far dynamic resolution may go down; 1 where no scale is good enough.
    """
    plain = RenderSettings()
    alone = []  # render_scale of the rows that differ in nothing else
    for row in rows:
        whole = replace(
            row.settings, render_scale=1.0, target=plain.target, background=plain.background
        )
        if whole == plain and row.db >= floor_db:
            alone.append(row.settings.render_scale)
    return min(alone, default=1.0)
