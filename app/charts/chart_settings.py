"""The named settings that a chart prices: shortcuts alone, in pairs, and the paper's Table 3."""

from dataclasses import dataclass, field, fields, replace

from shapeshift.app.charts.comparison import exact
from shapeshift.app.errors import UsageError
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import Background

EXACT = "exact"
# Fields that a drawing does not read: a setting with one of them is left out of its chart.
NOT_READ = {"tiles": ("target",), "quads": ("min_transmittance",)}
TAU_PIXELS = (0.0, 10.0, 20.0)  # tau_lambda of the paper's Table 3; 0 = none
TAU_PLACES = ("", "near", "far")  # tau_dist: 20 and 40 m there, Distances of the scene here


@dataclass(frozen=True)
class Distances:
    """What near and far mean in one scene, metres: `distances_of` of chart_scene measures it."""

    near: float
    far: float


@dataclass(frozen=True)
class Named:
    """One row of a chart: what differs from the exact setting."""

    name: str
    changes: dict = field(default_factory=dict)  # fields of RenderSettings
    eyes: int = 1
    place: str = ""  # of max_distance: "near", "far" or none
    beside_eyes: int = 0  # eyes of the exact frames it is compared with; 0: as many as its own
    quick: bool = False  # also in the chart of a few seconds that a budget measures


def _sorted_every(n: int) -> Named:
    return Named(f"sort every {n}", {"resort_frames": n})


def _table_3() -> tuple[Named, ...]:
    """Largest splat by distance, for one eye and for two; both unlimited is exact itself."""
    rows = []
    for eyes in (1, 2):
        for pixels in TAU_PIXELS:
            for place in TAU_PLACES:
                words = [f"to {pixels:.0f} px"] * (pixels > 0) + [place] * bool(place)
                changes = {"max_pixels": pixels} if pixels else {}
                name = ", ".join(["stereo"] * (eyes == 2) + words)
                quick = eyes == 1 and pixels == 20 and not place
                if words:
                    rows.append(Named(name, changes, eyes, place, quick=quick))
    return tuple(rows)


AFTER_1 = {"resort_frames": 0, "resort_degrees": 1.0}  # degrees
COMBINED = {**AFTER_1, "recolor_degrees": 2.0, "min_pixels": 1.0}
FAINT_AND_SMALL = {"min_alpha": 4 / 255, "min_pixels": 2.0}
SETTINGS = (
    Named(EXACT, quick=True),
    Named("16-bit target", {"target": "auto"}, quick=True),
    Named("rgba16f", {"target": "rgba16f"}),
    Named("rgba8", {"target": "rgba8"}, quick=True),
    Named("16-bit keys", {"key_bits": 16}),
    Named("distance order", {"order": "distance"}),
    *map(_sorted_every, (2, 4, 20)),
    Named("sort after 1\u00b0", AFTER_1),
    Named("sort after 5\u00b0", {"resort_frames": 0, "resort_degrees": 5.0}, quick=True),
    Named("colours after 2\u00b0", {"recolor_degrees": 2.0}),
    Named("colours after 10\u00b0", {"recolor_degrees": 10.0}, quick=True),
    Named("no unseen colours", {"skip_unseen": True}),
    Named("from 1 px", {"min_pixels": 1.0}),
    Named("from 1.5 px", {"min_pixels": 1.5}),
    Named("from 2 px", {"min_pixels": 2.0}, quick=True),
    Named("from 2 px, faded", {"min_pixels": 2.0, "fade": 0.5}),
    Named("to 10 px, faded", {"max_pixels": 10.0, "fade": 0.5}),
    Named("alpha from 2/255", {"min_alpha": 2 / 255}),
    Named("alpha from 4/255", {"min_alpha": 4 / 255}, quick=True),
    Named("no low-pass", {"low_pass": 0.0}),
    Named("stop at 1/2048", {"min_transmittance": 1 / 2048}, quick=True),
    Named("stop at 1/256", {"min_transmittance": 1 / 256}, quick=True),
    Named("stop at 1/64", {"min_transmittance": 1 / 64}),
    Named("75 % scale", {"render_scale": 0.75}, quick=True),
    Named("50 % scale", {"render_scale": 0.5}, quick=True),
    Named("16 bit, colours 2\u00b0, 1 px",
          {"key_bits": 16, "recolor_degrees": 2.0, "min_pixels": 1.0}),
    Named("sort 1\u00b0, colours 2\u00b0", {**AFTER_1, "recolor_degrees": 2.0}),
    Named("sort 1\u00b0, colours 2\u00b0, 1 px", COMBINED),
    Named("2/255, from 1.5 px", {"min_alpha": 2 / 255, "min_pixels": 1.5}),
    Named("4/255, from 2 px", FAINT_AND_SMALL, quick=True),
    Named("4/255, from 2 px, 75 %", {**FAINT_AND_SMALL, "render_scale": 0.75}, quick=True),
    Named("4/255, from 2 px, 50 %", {**FAINT_AND_SMALL, "render_scale": 0.5}, quick=True),
    Named("sort 1\u00b0, colours 2\u00b0, 1 px, 75 %", {**COMBINED, "render_scale": 0.75}),
    Named("sort 1\u00b0, colours 2\u00b0, 1 px, 50 %", {**COMBINED, "render_scale": 0.5}),
    Named("stop 1/2048, sort 1\u00b0, colours 2\u00b0",
          {**AFTER_1, "recolor_degrees": 2.0, "min_transmittance": 1 / 2048}),
    Named("stop 1/256, 2/255, 1.5 px",
          {"min_transmittance": 1 / 256, "min_alpha": 2 / 255, "min_pixels": 1.5}, quick=True),
    *(row for row in _table_3() if row.eyes == 1),
    # Compared with one eye, so that its ratio is what the second eye costs.
    Named("stereo", eyes=2, beside_eyes=1),
    Named("stereo, a sort each", {"stereo_sort": "each"}, eyes=2),
    Named("stereo, colours each", {"stereo_colors": "each"}, eyes=2),
    Named("stereo, shared colours", {"stereo_colors": "shared"}, eyes=2),
    *(row for row in _table_3() if row.eyes == 2),
)  # fmt: skip


def settings_of(drawing: str, quick: bool = False, eyes: int = 0) -> tuple[Named, ...]:
    """The rows of a drawing's chart, "quads" or "tiles"; eyes: only those of 1 or 2, 0 all.

    Rows that change a field which this drawing does not read are left out.
    """
    idle = NOT_READ[drawing]
    rows = [row for row in SETTINGS if not any(name in row.changes for name in idle)]
    if quick:
        rows = [row for row in rows if row.quick]
    return tuple(row for row in rows if eyes in (0, row.eyes))


def named_settings(name: str, drawing: str) -> Named:
    """The row of that name; UsageError says which there are, or that this drawing lacks it."""
    found = {row.name: row for row in SETTINGS}.get(name)
    if found is None:
        words = "; ".join(row.name for row in SETTINGS)
        raise UsageError(f"there is no setting '{name}'; choose one of: {words}.")
    if found not in settings_of(drawing):
        other = next(each for each in NOT_READ if found in settings_of(each))
        words = f"setting '{name}' changes nothing in {drawing}"
        raise UsageError(f"{words}; choose --drawing {other}.")
    return found


def render_settings(
    named: Named, background: Background, drawing: str, distances: Distances
) -> RenderSettings:
    """What to draw a row with.  Shortcuts blend into 16 bits, as the viewer does."""
    plain = exact(RenderSettings(background=background), drawing)
    if not named.changes and not named.place:
        return plain
    limit = {"max_distance": getattr(distances, named.place)} if named.place else {}
    return replace(plain, **{"target": RenderSettings().target, **named.changes, **limit})


def changed_settings(settings: RenderSettings) -> str:
    """What differs from the defaults, for a table: "key_bits=16 min_pixels=1"."""
    plain = RenderSettings()
    names = [f.name for f in fields(plain) if f.name != "background"]
    changed = [n for n in names if getattr(settings, n) != getattr(plain, n)]
    return " ".join(f"{name}={value_text(getattr(settings, name))}" for name in changed)


def value_text(value: object) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)
