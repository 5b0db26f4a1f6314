"""The engine's settings, by sweeps of figures in tests/scene/world/test_physics_figures.py."""

from types import ModuleType
from typing import Any

from shapeshift.runtime_models.model import BadFile, Finding

MOST_SPEED = 40.0  # m/s: whatever is faster is slowed to it
LENGTH_UNIT = 0.1  # metres: what objects to be held measure; scales the engine's tolerances
SOLVER_ITERATIONS = 8  # a substep; with the default of 4 a stack of 1 : 100 sinks
# Hz and damping ratio of contacts: the default of 30 Hz lets objects rest 12 mm deep.
CONTACT, STATIC_CONTACT = (240.0, 10.0), (480.0, 10.0)
PREDICTION = 0.02  # metres: contacts are foreseen this far; with 2 mm, 12 mm go in at 5 m/s
# m/s and metres: where nothing is faster, contacts are foreseen only so far.  Pieces of one body of
# which several may touch soon let it rock for ever.
SLOW, SLOW_PREDICTION = 0.5, 0.002
# m/s: above, a step has twice and four times its substeps, so that nothing passes a thin plate.
BRISK, FAST = 7.0, 14.0


def engine() -> ModuleType:
    """The engine, or one sentence (BadFile) where it is not installed or does not load."""
    try:
        import rapier3d
    except ImportError as why:
        raise BadFile(
            f"nothing can move or be touched: the package rapier3d does not load ({why}); install "
            "it with: python -m pip install -r requirements.txt."
        ) from why
    return rapier3d


def new_world(gravity_m_s2: float) -> Any:
    """An empty world of the engine in which small, light, stiff objects keep apart."""
    from rapier3d import PhysicsWorld, SpringCoefficients

    world = PhysicsWorld(gravity=(0.0, -gravity_m_s2, 0.0))
    rules = world.integration_parameters
    rules.num_solver_iterations = SOLVER_ITERATIONS
    rules.length_unit = LENGTH_UNIT
    rules.normalized_prediction_distance = PREDICTION / LENGTH_UNIT
    rules.normalized_max_linear_velocity = MOST_SPEED / LENGTH_UNIT
    rules.contact_softness = SpringCoefficients(*CONTACT)
    rules.static_contact_softness = SpringCoefficients(*STATIC_CONTACT)
    return world


def prediction(speeds: dict[int, tuple[float, float, float]]) -> float:
    """How far contacts are foreseen in a step, in units of LENGTH_UNIT."""
    slow = all(x * x + y * y + z * z <= SLOW**2 for x, y, z in speeds.values())
    return (SLOW_PREDICTION if slow else PREDICTION) / LENGTH_UNIT


def stopped_bodies(world: Any, handles: dict[int, Any]) -> list[Finding]:
    """The engine stops a body whose numbers are no longer finite where it last was."""
    lost = world.quarantine.bodies
    return [
        Finding(f"body {number} was thrown out of all numbers", 1, "stopped where it last was")
        for number, handle in (handles.items() if lost else ())
        if handle in lost
    ]


def more_substeps(speeds: dict[int, tuple[float, float, float]], pressed: bool) -> int:
    """1, 2 or 4 times as many: what the fastest body moves in one must stay near PREDICTION.

    pressed: a hand holds something at a mesh; a light cup that flips there gets 2 mm in with 1.
    """
    fastest = max((x * x + y * y + z * z for x, y, z in speeds.values()), default=0.0)
    return 4 if fastest > FAST**2 else 2 if fastest > BRISK**2 or pressed else 1
