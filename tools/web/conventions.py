"""web/conventions.js: what the page shares with Python, written from the constants here.

`python3 tools/web/write_conventions.py` writes it; a test compares.
"""

import json

from shapeshift.rasterizer.reference import MAX_ALPHA
from shapeshift.renderer.colors.palette import LUMINANCE
from shapeshift.renderer.gl.target import MOST_UNIT
from shapeshift.renderer.reference.reference import JACOBIAN_MARGIN
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.web import limits
from shapeshift.scene.control import SHIFT_S, SNAP, Sweep

HEAD = """// conventions: shared with Python, written by tools/web/write_conventions.py from
// the constants there; change it there.
"""
LIMITS = ("WIDTH", "BATCH_ROWS", "BLOCK_VEC4S", "MOST_ANCHORS", "MOST_SPLATS", "MOST_BYTES",
          "MOST_WEIGHTS")  # fmt: skip


def shared_constants() -> dict[str, tuple[object, str]]:
    """name -> (value, what it is)."""
    settings, sweep = RenderSettings(), Sweep(())
    return {
        **{name: (getattr(limits, name), "runtime_models/web/limits.py") for name in LIMITS},
        "MIN_ALPHA": (settings.min_alpha, "a pixel's alpha below this is not drawn"),
        "MAX_ALPHA": (MAX_ALPHA, "one splat never hides everything behind it"),
        "LOW_PASS": (settings.low_pass, "px^2 added to the screen covariance"),
        "MOST_UNIT": (MOST_UNIT, "brighter colours are blended in half floats"),
        "JACOBIAN_MARGIN": (JACOBIAN_MARGIN, "times the largest tangents of a view"),
        "LUMINANCE": (LUMINANCE.tolist(), "Rec. 709, on display values"),
        "SNAP": (SNAP, "of the slider: nearer than this to a stop is on the stop"),
        "SHIFT_S": (SHIFT_S, "from any stop to any other, when somebody asks for it"),
        "LEG_S": (sweep.leg_s, "playing, from one stop to the next"),
        "REST_S": (sweep.rest_s, "playing, at each stop"),
        "RESORT_DEGREES": (1.0, "a view that turns farther is sorted anew"),
        "RESORT_PART": (0.01, "of the scene's radius: so is one that moves farther"),
    }


def conventions_text() -> str:
    """The whole module."""
    lines = (
        f"export const {name} = {json.dumps(value)};  // {what}"
        for name, (value, what) in shared_constants().items()
    )
    return HEAD + "\n".join(lines) + "\n"
