"""What no stop of an anchor model shows, taken out of it: anchors, splats of all anchors, units."""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import most_light
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.model import HEADS, SIZE_PER_SPLAT, AnchorModel, Mlp

LEAST_ALPHA = 1 / 255  # of the drawing rule: what is fainter everywhere is not drawn
CONTROLS = 1025  # control values at which a hidden unit is looked at: 64 a width of Psi's Gaussians
SLACK = 1e-4  # of a unit's largest sum; it counts as silent below minus this


@dataclass(frozen=True)
class Removed:
    """What `compact` took away."""

    anchors: int
    slots: int  # of k
    units: int  # of the first hidden layers of all five networks
    splats: int


def visible_slots(model: AnchorModel, xs: list[float] | None = None) -> np.ndarray:
    """(A, k) bool: splats that are not absent at some control value, by default at some stop."""
    evaluator = Evaluator(model)
    out = np.zeros((len(model.anchors), model.splats_per_anchor), bool)
    for x in [stop.x for stop in model.stops] if xs is None else xs:
        out |= evaluator.geometry(x)[3].reshape(out.shape) >= LEAST_ALPHA
    return out


def drop_unused(model: AnchorModel, alive: np.ndarray | None = None) -> tuple[AnchorModel, Removed]:
    """The model without anchors and slots that have no living splat, and without silent units.

    alive: (A, k) bool, by default what some stop shows: every picture at a stop stays as it was.
    Of an anchor that stays, all slots stay that some other anchor needs, since networks give the
    splats of an anchor together.  A model that shows nothing keeps one anchor and one slot.
    """
    alive = visible_slots(model) if alive is None else alive.copy()
    if not alive.any():
        alive[0, 0] = True
    anchors: np.ndarray = np.asarray(alive.any(axis=1))
    slots: np.ndarray = np.asarray(alive.any(axis=0))
    smaller = replace(
        model.with_anchors(anchors),
        networks={n: without_slots(model.networks[n], slots, SIZE_PER_SPLAT[n]) for n in HEADS},
        splats_per_anchor=int(slots.sum()),
    )
    networks = {name: without_silent_units(mlp, smaller) for name, mlp in smaller.networks.items()}
    units = sum(
        len(smaller.networks[n].biases[0]) - len(networks[n].biases[0])
        for n in HEADS
        if len(networks[n].weights) > 1
    )
    smaller = without_unseen_light(replace(smaller, networks=networks))
    return smaller, Removed(
        int((~anchors).sum()), int((~slots).sum()), units, model.splat_count - smaller.splat_count
    )


def without_unseen_light(model: AnchorModel) -> AnchorModel:
    """The model without light by direction where no unit of the colour network looks at it."""
    color = model.networks["color"]
    if model.light is None:
        return model
    at = np.repeat(color.inputs, [model.input_widths[part] for part in color.inputs]) == "light"
    first = color.weights[0]
    if first[:, at].any():
        return model
    weights = np.ascontiguousarray(first[:, ~at]), *color.weights[1:]
    inputs = tuple(part for part in color.inputs if part != "light")
    networks = model.networks | {"color": replace(color, weights=weights, inputs=inputs)}
    return replace(model, networks=networks, light=None)


def without_slots(mlp: Mlp, keep: np.ndarray, size: int) -> Mlp:
    """The network that gives the `size` numbers of some of its k splats alone."""
    rows = np.repeat(keep, size)
    return replace(
        mlp,
        weights=(*mlp.weights[:-1], np.ascontiguousarray(mlp.weights[-1][rows])),
        biases=(*mlp.biases[:-1], np.ascontiguousarray(mlp.biases[-1][rows])),
    )


def without_silent_units(mlp: Mlp, model: AnchorModel) -> Mlp:
    """The network without units of its first hidden layer that no anchor ever wakes.

    Their largest sum is bounded part by part: features over all anchors, Psi over all controls, the
    direction by its length, light by its coefficients; so whatever the eye and x are, the network
    gives what it gave.
    """
    if len(mlp.weights) < 2:
        return mlp
    part_of = np.repeat(mlp.inputs, [model.input_widths[part] for part in mlp.inputs])
    first = mlp.weights[0].astype(np.float64)
    most, size = mlp.biases[0].astype(np.float64), np.abs(mlp.biases[0]).astype(np.float64)
    inputs = {
        "feature": model.features.astype(np.float64),
        "control": psi_everywhere(model),
    }
    for part, values in inputs.items():
        if part in mlp.inputs:
            sums = values @ first[:, part_of == part].T
            most, size = most + sums.max(axis=0), size + np.abs(sums).max(axis=0)
    length = np.linalg.norm(first[:, part_of == "direction"], axis=1)
    if "light" in mlp.inputs and model.light is not None:
        length += np.abs(first[:, part_of == "light"]) @ most_light(model.light).max(axis=0)
    keep = most + length > -SLACK * (size + length)
    if not keep.any():
        keep[0] = True
    return replace(
        mlp,
        weights=(
            np.ascontiguousarray(mlp.weights[0][keep]),
            np.ascontiguousarray(mlp.weights[1][:, keep]),
            *mlp.weights[2:],
        ),
        biases=(np.ascontiguousarray(mlp.biases[0][keep]), *mlp.biases[1:]),
    )


def psi_everywhere(model: AnchorModel) -> np.ndarray:
    """(n, d) float64 Psi of numbers from 0 to 1 and of the stops: no blend of stops exceeds both
    of its own in any weighted sum.
    """
    xs = np.append(np.linspace(0, 1, CONTROLS), [stop.x for stop in model.stops])
    return model.encoding.encode(xs[:, None]).astype(np.float64)
