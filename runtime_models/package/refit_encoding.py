"""The control encoding of a finished package, written anew: the same at every stop, even between.

The first layer of a network meets Psi(x) linearly, W Psi(x), so for another encoding Psi' columns
W' = W K can be solved for such that W' Psi'(x) is W Psi(x_s) at every stop x_s: nothing is trained.
Programs that know of blends draw the same between the stops as before (their blends are of what
stands at the stops).  Those that encode x itself no longer meet units there that no photo taught.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from shapeshift.runtime_models.blocks.block_model import one_network
from shapeshift.runtime_models.model import (
    AnchorModel,
    BadFile,
    ControlEncoding,
    Finding,
    Stop,
)
from shapeshift.runtime_models.program import program
from shapeshift.runtime_models.stop_weights import StopBlend

LEAST_GAP = 1 / 63  # of x between two stops; nearer ones would need more units than are allowed
GRID = 401  # places of x between which the new encoding follows the blend of the stops
MOST_CONDITION = 1e4  # of Psi at the stops: float32 keeps 3 digits of what it then tells apart
UNTAUGHT = 2.0  # sigmas from the nearest stop; there a unit is below 0.14, and saw no photo


def untaught_units(model: AnchorModel) -> int:
    """How many units of the encoding stand at no stop: only what lies between meets them."""
    if model.between_stops != "blend" or len(model.stops) < 2:
        return 0
    units = np.arange(model.encoding.d) * model.encoding.spacing
    away = np.abs(units[:, None] - [stop.x for stop in model.stops]).min(axis=1)
    between = units < 1 + 1e-6  # what lies beyond is met by no x
    return int((between & (away > UNTAUGHT * model.encoding.sigma)).sum())


def encoding_findings(model: AnchorModel, file: str) -> tuple[Finding, ...]:
    """What is worth knowing of a package's encoding, and what mends it."""
    units = untaught_units(model)
    if not units:
        return ()
    what = (
        f"{units} of the {model.encoding.d} units of its control encoding stand at no stop, so no "
        "photo has taught what they do"
    )
    done = (
        "blends of its stops are shown instead; for programs that know of none "
        f"`{program()} export {file} --encoding stops --out NEW.shift` writes it anew, the same "
        "at every stop"
    )
    return (Finding(what, 0, done, file=file, repaired=False),)


def encoding_for(xs: list[float]) -> ControlEncoding:
    """A unit for each place on the slider as far apart as the nearest two stops, half as wide."""
    gap = min((b - a for a, b in pairwise(sorted(xs))), default=1.0)
    units = round(1 / max(gap, LEAST_GAP)) + 1
    return ControlEncoding(units, 1 / (units - 1), 0.5 / (units - 1))


def refit_encoding(model: AnchorModel) -> AnchorModel:
    """The model with an encoding for its stops; at each of them every network gives what it gave,
    but for the rounding of float32.

    Raises BadFile where x between the stops is not a blend of them, or two stops are too near.
    """
    return place_stops(model, model.stops, [stop.name for stop in model.stops])


def place_stops(model: AnchorModel, stops: tuple[Stop, ...], shown: list[str]) -> AnchorModel:
    """The model with these stops instead of its own: each shows what its stop `shown` showed.

    Of the pace, what is between two stops that stay is kept.  Raises BadFile as refit_encoding.
    """
    model = one_network(model)
    if model.between_stops != "blend":
        raise BadFile("the networks of this scene know what lies between its stops; leave them so.")
    encoding = encoding_for([stop.x for stop in stops])
    place = {stop.name: stop.x for stop in model.stops}
    was = np.stack([model.encoding.encode(place[name]) for name in shown]).astype(np.float64)
    rows = solve_rows(encoding, StopBlend(stops))  # (d', S)
    networks = {}
    for name, mlp in model.networks.items():
        if "control" not in mlp.inputs:
            networks[name] = mlp
            continue
        parts = split_columns(model, name)
        parts["control"] = parts["control"] @ was.T @ rows.T  # (hidden, S) (S, d')
        first = np.hstack([parts[part] for part in mlp.inputs]).astype(np.float32)
        networks[name] = replace(mlp, weights=(first, *mlp.weights[1:]))
    names = {stop.name for stop in stops}
    pace = tuple(pace for pace in model.pace if {pace.start, pace.end} <= names)
    return replace(model, networks=networks, encoding=encoding, stops=stops, pace=pace)


def solve_rows(encoding: ControlEncoding, blend: StopBlend) -> np.ndarray:
    """(d, S) K, such that Psi(x) K are the weights of the stops: at the stops exactly, between them
    as nearly as the units can (least squares under equality constraints, by their KKT system).
    """
    even = StopBlend(blend.stops)
    xs = np.array([stop.x for stop in blend.stops])
    grid = np.linspace(xs.min(), xs.max(), GRID)
    psi, wanted = encoding.encode(grid[:, None]).astype(np.float64), even.weights(grid)
    exact = encoding.encode(xs[:, None]).astype(np.float64)
    if np.linalg.cond(exact) > MOST_CONDITION:
        raise BadFile("two stops of this scene lie so near each other that no encoding tells them "
                      "apart; move one of them.")  # fmt: skip
    d, stops = encoding.d, len(xs)
    weight = 1e-6 * np.eye(d)  # what no stop and no place between them asks for stays small
    system = np.block([[psi.T @ psi / GRID + weight, exact.T], [exact, np.zeros((stops, stops))]])
    right = np.concatenate([psi.T @ wanted / GRID, np.eye(stops)])
    return np.linalg.solve(system, right)[:d]


def split_columns(model: AnchorModel, name: str) -> dict[str, np.ndarray]:
    """The columns of a network's first layer, float64, by the input that they meet."""
    mlp = model.networks[name]
    ends = np.cumsum([model.input_widths[part] for part in mlp.inputs])
    columns = np.split(mlp.weights[0].astype(np.float64), ends[:-1], axis=1)
    return dict(zip(mlp.inputs, columns, strict=True))
