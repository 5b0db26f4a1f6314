"""A stop by formula of other stops' values in a finished model, all others as they were.

What a splat shows at the new stop is the formula of what it shows at the others, in the mean of the
eyes that the photos were taken from.  It is not learned but kept: a feature a splat holds its
value, and one hidden unit a splat, open at the new stop alone, hands it to the colour network,
whose other units are shut there.  So every drawing shows it as it shows any stop.  Splats blend
values, and a formula of blended values is another number than the blend of its values
(docs/thermal.md): what is measured is the formula of the stops' pictures, pixel by pixel
(app/inspection/draw_values.py).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import most_light
from shapeshift.runtime_models.evaluate import Evaluator, directions
from shapeshift.runtime_models.eyes import eyes_of
from shapeshift.runtime_models.model import HEADS, AnchorModel, BadFile, Mlp, Stop
from shapeshift.runtime_models.package.feature_codes import exact_kind
from shapeshift.runtime_models.package.refit_encoding import (
    place_stops,
    solve_rows,
    split_columns,
)
from shapeshift.runtime_models.stops.change_stops import (
    NewUnits,
    above,
    insert_stop,
    stored_features,
    widened,
    with_columns,
    with_hidden_layer,
)
from shapeshift.runtime_models.stops.stop_formula import read_formula, sources_of

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709, as of a picture of values
MOST_EYES = 8
UNKNOWN = -1.0  # the feature of a splat without a value, which is then absent; else 0 to 1
GONE = 40.0  # that the opacity network's last sum loses there: any activation is at its least
NEAR_END = 1e-4  # of 0..1: as near an activation that never reaches its ends comes to them
PERCENTILES, MARGIN = (0.5, 99.5), 0.05  # of the values, where nobody says a range


def with_formula_stop(model: AnchorModel, stop: Stop, after: str | None = None) -> AnchorModel:
    """The model with one more stop, `after` another one or last; all get even places.

    stop: its name, formula, palette, unit and range; None: the range of its values.  It has the
    shapes of the first stop in its formula.  Raises BadFile, one sentence.
    """
    try:
        sources = sources_of(read_formula(stop.formula), model.stops, stop.name)
    except ValueError as error:
        raise BadFile(str(error)) from None
    first = next(iter(sources.values()))
    made = insert_stop(model, stop.name, first.name, after, "values")
    return _filled(made, stop)


def with_placed_formulas(model: AnchorModel, stops: Sequence[Stop]) -> AnchorModel:
    """The model of photographed stops with stops by formula at the x that they say.

    Raises BadFile, one sentence.
    """
    for stop in stops:
        if not 0 <= stop.x <= 1 or any(abs(stop.x - other.x) < 1e-9 for other in model.stops):
            raise BadFile(f"the stop '{stop.name}' lies at x = {stop.x:g}, where another one is.")
        try:
            sources = sources_of(read_formula(stop.formula), model.stops, stop.name)
        except ValueError as error:
            raise BadFile(str(error)) from None
        first = next(iter(sources.values()))
        order = tuple(sorted((*model.stops, stop), key=lambda each: each.x))
        shown = [first.name if each is stop else each.name for each in order]
        model = _filled(place_stops(model, order, shown), stop)
    return model


def _filled(model: AnchorModel, stop: Stop) -> AnchorModel:
    """The model, which has the stop with what its source shows, with the formula's values there."""
    values = splat_values(model, stop)
    if not np.isfinite(values).any():
        raise BadFile(f"the formula '{stop.formula}' has no value anywhere in this scene.")
    low, high = stop.value_range or usual_range(values)
    share = np.clip((values - low) / (high - low), 0, 1)
    made = with_values(model, stop.name, share)
    stops = tuple(
        replace(stop, x=each.x, value_range=(low, high), palette=stop.palette or "viridis")
        if each.name == stop.name
        else each
        for each in made.stops
    )
    return replace(made, stops=stops)


def splat_values(model: AnchorModel, stop: Stop) -> np.ndarray:
    """(N,) float64 the formula of each splat's values; NaN where one is absent at one of its stops,
    and where the formula has none.
    """
    formula, evaluator = read_formula(stop.formula), Evaluator(model)
    eyes = eyes_of(model)
    if not len(eyes):  # from all around
        middle = model.anchors.mean(axis=0)
        radius = float(np.linalg.norm(model.anchors - middle, axis=1).max()) or 1.0
        eyes = middle + 3 * radius * np.vstack([np.eye(3), -np.eye(3)])
    eyes = eyes[:: -(-len(eyes) // MOST_EYES)]
    known = {}
    for name, source in sources_of(formula, model.stops, stop.name).items():
        assert source.value_range is not None  # sources_of has seen to it
        low, high = source.value_range
        shown = np.zeros(model.splat_count)
        for eye in eyes:
            along = directions(model.anchors, eye)
            shown += np.clip(evaluator.color_along(source.x, along) @ LUMINANCE, 0, 1)
        there = evaluator.geometry(source.x)[3] > 0
        known[name] = np.where(there, low + (high - low) * shown / len(eyes), np.nan)
    return formula.value(known)


def usual_range(values: np.ndarray) -> tuple[float, float]:
    """Of values (N,), rounded outwards to three digits of it."""
    low, high = np.percentile(values[np.isfinite(values)], PERCENTILES)
    more = MARGIN * (high - low) or 0.5
    digits = 2 - math.floor(math.log10(high - low + 2 * more))
    step = 10.0**-digits
    ends = math.floor((low - more) / step) * step, math.ceil((high + more) / step) * step
    return round(ends[0], digits), round(ends[1], digits)


def with_values(model: AnchorModel, name: str, share: np.ndarray) -> AnchorModel:
    """The model whose splats show grey shares (N,) 0..1 at the stop `name`, from every side; those
    that are NaN are absent there.  Other stops show what they showed.
    """
    k, old = model.splats_per_anchor, model.features.shape[1]
    mlp = with_hidden_layer(model.networks["color"])
    wanted = before_head(mlp, np.clip(np.nan_to_num(share), 0, 1))
    known = np.isfinite(share)
    low, high = float(wanted[known].min()), float(wanted[known].max())
    feature = np.where(known, (wanted - low) / ((high - low) or 1.0), UNKNOWN)
    feature = feature.reshape(-1, k).astype(np.float32)
    columns = [stored_features(model, feature)]
    if exact_kind(model.features) == "uint8":  # a byte holds 255 steps, a second one the rest
        columns.append(stored_features(model, feature - columns[0]))
    features = np.hstack([model.features, *columns])
    model = replace(model, features=np.ascontiguousarray(features))
    read = np.hstack([np.zeros((k, old)), *[np.eye(k)] * len(columns)])  # (k, F') its own splat's
    rows = solve_rows(model.encoding, model.blend)  # (d, S)
    own = np.array([stop.name == name for stop in model.stops], float)
    shut = rows @ (1 - own)  # (d,) 1 at all other stops
    more = features.shape[1] - old
    networks = {h: with_columns(model.networks[h], "feature", more, model) for h in HEADS}
    color = with_hidden_layer(networks["color"])
    color = shut_at(replace(model, networks=networks | {"color": color}), color, rows @ own)
    # One unit is 1 at the new stop and takes off what the shut network gives there; k hold values.
    units = NewUnits(
        np.vstack([np.zeros((1, features.shape[1])), read]),
        np.array([1.0, *[0.0] * k]),
        np.hstack(
            [(low - constant_of(color))[:, None], (high - low) * np.eye(k).repeat(3, axis=0)]
        ),
    )
    networks["color"] = widened(color, units, model, shut, None)
    if not known.all():
        # From halfway to UNKNOWN on: what is stored of a value may lie a rounding below 0.
        opacity = NewUnits(-read, np.full(k, UNKNOWN / 2), -2 * GONE * np.eye(k))
        networks["opacity"] = widened(networks["opacity"], opacity, model, shut, None)
    return replace(model, networks=networks)


def before_head(mlp: Mlp, colors: np.ndarray) -> np.ndarray:
    """(N,) what the network's last layer has to give for colours (N,) 0..1, by its activation."""
    held = np.clip(colors, NEAR_END, 1 - NEAR_END)
    inverse: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "none": lambda y: y,
        "sigmoid": lambda y: np.log(y) - np.log1p(-y),
        "tanh": np.arctanh,
        "exp": np.log,
        "softplus": lambda y: np.log(np.expm1(y)),
    }
    wanted = inverse[mlp.head]((colors if mlp.head == "none" else held) / mlp.gain)
    return wanted if mlp.clip is None else np.clip(wanted, *mlp.clip)


def shut_at(model: AnchorModel, mlp: Mlp, own: np.ndarray) -> Mlp:
    """The colour network, all of whose hidden units are shut at one stop, whatever looks at it.

    own: (d,) 1 at that stop and 0 at the others, times Psi.
    """
    parts = split_columns(model, "color")
    most = mlp.biases[0].astype(np.float64)
    sums = model.features.astype(np.float64) @ parts["feature"].T if "feature" in parts else 0.0
    psi = model.encoding.encode(np.array([[stop.x] for stop in model.stops]))
    if "control" in parts:
        most = most + (psi.astype(np.float64) @ parts["control"].T).max(axis=0)
    if "direction" in parts:
        most = most + np.linalg.norm(parts["direction"], axis=1)
    if "light" in parts and model.light is not None:
        sums = sums + most_light(model.light) @ np.abs(parts["light"]).T
    gate = above(np.atleast_2d(sums + most))
    if "control" not in mlp.inputs:
        first = np.hstack([mlp.weights[0], -np.outer(gate, own)])
        return replace(
            mlp, inputs=(*mlp.inputs, "control"),
            weights=(np.ascontiguousarray(first, np.float32), *mlp.weights[1:]),
        )  # fmt: skip
    parts["control"] = parts["control"] - np.outer(gate, own)
    first = np.hstack([parts[part] for part in mlp.inputs]).astype(np.float32)
    return replace(mlp, weights=(np.ascontiguousarray(first), *mlp.weights[1:]))


def constant_of(mlp: Mlp) -> np.ndarray:
    """(outputs,) float64 what the last layer gives while all units of the first one are shut."""
    hidden = np.zeros(mlp.weights[0].shape[0])
    for weight, bias in zip(mlp.weights[1:-1], mlp.biases[1:-1], strict=True):
        hidden = np.maximum(weight.astype(np.float64) @ hidden + bias, 0)
    return mlp.weights[-1].astype(np.float64) @ hidden + mlp.biases[-1]
