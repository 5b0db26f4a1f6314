"""A further stop of a finished model that leaves every other stop as it was, to float rounding; or
one taken out of it.

A new one is two steps, both algebra on the weights.  `insert_stop` gives the stops new places; it
shows what its source shows.  `add_units` puts hidden units beside those of the networks, which
the new stop has alone: their control columns hold -gate at every old stop and 0 at the new one, so
behind ReLU they are off there, whatever they have learned.  The gate is above what any anchor gives
them: no hope but a bound.  Blends of old stops stay shut, too, being weighted means.
"""

from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import most_light
from shapeshift.runtime_models.model import (
    HEADS,
    AnchorModel,
    BadFile,
    Mlp,
    Stop,
)
from shapeshift.runtime_models.package.feature_codes import (
    decode_features,
    encode_features,
    exact_kind,
)
from shapeshift.runtime_models.package.refit_encoding import (
    LEAST_GAP,
    place_stops,
    solve_rows,
    split_columns,
)
from shapeshift.runtime_models.stops.stop_formula import read_formula, sources_of

MOST_STOPS = round(1 / LEAST_GAP) + 1
MARGIN, REST = 1.05, 1.0  # a gate is so many times the largest sum, and so much more
LONGEST_NAME = 60  # letters: it stands on the slider


@dataclass(frozen=True)
class NewUnits:
    """What a stop adds to a network: M hidden units beside the old ones.

    Its outputs, before their activation, are those of the source stop
    + out @ relu(feature @ features + bias).  They see no direction: what a style adds is the same
    from everywhere (with it, strokes differ a tenth more between views, and fit no better).
    """

    feature: np.ndarray  # (M, F + E) weights of all features, old and new
    bias: np.ndarray  # (M,)
    out: np.ndarray  # (k * size, M)


def even_places(names: list[str]) -> dict[str, float]:
    """x of stops that are equally far from each other."""
    return {name: i / max(len(names) - 1, 1) for i, name in enumerate(names)}


def insert_stop(
    model: AnchorModel, name: str, source: str, after: str | None = None, kind: str = "style"
) -> AnchorModel:
    """The model with one more stop, `after` another one or last, that shows what `source` shows.

    All stops get even places.  The new stop has no palette.  Raises BadFile, one sentence.
    """
    names = [stop.name for stop in model.stops]
    refuse_name(name, names)
    for each in (source, names[-1] if after is None else after):
        if each not in names:
            raise BadFile(f"the scene has no stop '{each}'; it has {', '.join(names)}.")
    if len(names) >= MOST_STOPS:
        raise BadFile(
            f"the scene has {len(names)} stops, and a scene has {MOST_STOPS} at most; remove one."
        )
    at = len(names) if after is None else names.index(after) + 1
    order = [*names[:at], name, *names[at:]]
    places, known = even_places(order), {stop.name: stop for stop in model.stops}
    stops = tuple(
        Stop(name, places[n], kind) if n == name else replace(known[n], x=places[n]) for n in order
    )
    return place_stops(model, stops, [source if n == name else n for n in order])


def refuse_name(name: str, taken: list[str]) -> None:
    """BadFile for what cannot be a new stop's name."""
    if (
        not name.strip()
        or name != name.strip()
        or len(name) > LONGEST_NAME
        or not name.isprintable()
    ):
        raise BadFile(
            f"'{name}' cannot be a stop's name; 1 to {LONGEST_NAME} printable letters, without "
            "space at the ends, are wanted."
        )
    if name.casefold() in (each.casefold() for each in taken):
        raise BadFile(f"the scene has a stop '{name}' already; choose another name.")


def add_units(
    model: AnchorModel,
    name: str,
    features: np.ndarray,
    units: dict[str, NewUnits],
    inside: np.ndarray | None = None,
) -> AnchorModel:
    """The model with units that stop `name` has alone, on new `features` (A, E) of its anchors.

    units: by head; E may be 0.  inside (A,) bool: anchors that may change; the others show the
    source stop, exactly: one more feature, 1 there, shuts the units.
    """
    features = stored_features(model, features)
    wide = model.features.shape[1] + features.shape[1]
    outside = None if inside is None or inside.all() else ~inside
    columns = [model.features, features]
    if outside is not None:
        columns.append(outside[:, None].astype(np.float32))
    model = replace(model, features=np.ascontiguousarray(np.hstack(columns)))
    old = [stop.name != name for stop in model.stops]
    shut = solve_rows(model.encoding, model.blend) @ np.array(old, float)  # (d,) 1 at old stops
    more = model.features.shape[1] - wide
    networks = {}
    for head in HEADS:
        mlp = model.networks[head]
        if head not in units:
            unread = wide + more - feature_width(mlp, model)
            networks[head] = with_columns(mlp, "feature", unread, model)
            continue
        networks[head] = widened(mlp, units[head], model, shut, outside)
    return replace(model, networks=networks)


def stored_features(model: AnchorModel, features: np.ndarray) -> np.ndarray:
    """New features as the package stores them beside the old ones, so that both are read again."""
    kind = exact_kind(model.features)
    found = encode_features(features.astype(np.float32), kind)
    return decode_features(found["features"], found.get("feature_range"), "the new stop")


def feature_width(mlp: Mlp, model: AnchorModel) -> int:
    """How many features a network meets now."""
    widths = model.input_widths
    return mlp.width_in - sum(widths[part] for part in mlp.inputs if part != "feature")


def with_columns(mlp: Mlp, part: str, more: int, model: AnchorModel) -> Mlp:
    """The network with `more` inputs at the end of a part, which it ignores."""
    if part not in mlp.inputs:
        return mlp
    widths = model.input_widths | {"feature": feature_width(mlp, model)}
    end = sum(widths[p] for p in mlp.inputs[: mlp.inputs.index(part) + 1])
    first = np.insert(mlp.weights[0], [end] * more, 0, axis=1)
    return replace(mlp, weights=(np.ascontiguousarray(first), *mlp.weights[1:]))


def widened(
    mlp: Mlp, units: NewUnits, model: AnchorModel, shut: np.ndarray, outside: np.ndarray | None
) -> Mlp:
    """The network with the units beside its own; `model` has the features already.

    Later layers hand them on unchanged: what is not negative is so behind another ReLU.
    """
    mlp = with_hidden_layer(mlp)
    for part, width in (("feature", 0), ("control", model.encoding.d)):
        if part not in mlp.inputs:  # a head that does not see x learns of it here
            first = np.hstack([mlp.weights[0], np.zeros((len(mlp.weights[0]), width))])
            mlp = replace(mlp, inputs=(*mlp.inputs, part), weights=(first, *mlp.weights[1:]))
    mlp = with_columns(mlp, "feature", model.features.shape[1] - feature_width(mlp, model), model)
    count = len(units.bias)
    feature, gate = gates(units, model, outside)
    blocks = {
        "feature": feature,
        "control": -np.outer(gate, shut),
        "direction": np.zeros((count, 3)),
        "light": np.zeros((count, model.input_widths["light"])),
    }
    first = np.vstack([mlp.weights[0], np.hstack([blocks[part] for part in mlp.inputs])])
    weights, biases = [first], [np.concatenate([mlp.biases[0], units.bias])]
    for weight, bias in zip(mlp.weights[1:-1], mlp.biases[1:-1], strict=True):
        through = np.zeros((len(weight) + count, weight.shape[1] + count))
        through[: len(weight), : weight.shape[1]] = weight
        through[len(weight) :, weight.shape[1] :] = np.eye(count)
        weights.append(through)
        biases.append(np.concatenate([bias, np.zeros(count)]))
    weights.append(np.hstack([mlp.weights[-1], units.out]))
    biases.append(mlp.biases[-1])
    weights32, biases32 = (
        tuple(np.ascontiguousarray(array, np.float32) for array in arrays)
        for arrays in (weights, biases)
    )
    return replace(mlp, weights=weights32, biases=biases32)


def with_hidden_layer(mlp: Mlp) -> Mlp:
    """A network of one layer as one with a hidden layer: v = relu(v) - relu(-v)."""
    if len(mlp.weights) != 1:
        return mlp
    weight, bias = mlp.weights[0], mlp.biases[0]
    both = np.hstack([np.eye(len(bias)), -np.eye(len(bias))]).astype(np.float32)
    return replace(
        mlp,
        weights=(np.concatenate([weight, -weight]), both),
        biases=(np.concatenate([bias, -bias]), np.zeros_like(bias)),
    )


def gates(
    units: NewUnits, model: AnchorModel, outside: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Weights (M, F') of all features, those that shut the units outside among them, and (M,) gates
    above the largest sum that any anchor gives a unit.
    """
    weights = units.feature.astype(np.float64)
    known = model.features[:, : weights.shape[1]].astype(np.float64)
    sums = known @ weights.T + units.bias  # (A, M)
    if outside is None:
        return weights, above(sums)
    weights = np.hstack([weights, -above(sums[outside])[:, None]])
    return weights, above(sums[~outside])


def above(sums: np.ndarray) -> np.ndarray:
    """(M,) numbers clearly above all sums (A, M), and not below REST."""
    return np.maximum(MARGIN * sums.max(axis=0, initial=0.0) + REST, REST)


# A stop taken out of a model, with all that it alone had: the others show what they showed.


def remove_stop(model: AnchorModel, name: str) -> AnchorModel:
    """The model without a stop; the others get even places.

    Hidden units that no other stop opens go with it, and features that nothing reads any more.
    Raises BadFile, one sentence.
    """
    names = [stop.name for stop in model.stops]
    if name not in names:
        raise BadFile(f"the scene has no stop '{name}'; it has {', '.join(names)}.")
    for stop in model.stops:
        if stop.formula and stop.name != name:
            sources = sources_of(read_formula(stop.formula), model.stops, stop.name)
            if name in (source.name for source in sources.values()):
                raise BadFile(
                    f"'{stop.name}' is by formula of '{name}'; remove '{stop.name}' first."
                )
    if len(names) == 1:
        raise BadFile(f"'{name}' is the only stop of the scene; one has to stay.")
    places = even_places([each for each in names if each != name])
    stay = tuple(replace(stop, x=places[stop.name]) for stop in model.stops if stop.name != name)
    model = place_stops(model, stay, list(places))
    networks = {head: without_shut_units(model, head) for head in HEADS}
    model = replace(model, networks=networks)
    networks = {head: without_unread_control(model, head) for head in HEADS}
    return without_unread_features(replace(model, networks=networks))


def without_unread_control(model: AnchorModel, head: str) -> Mlp:
    """A network without x, where all that was left of its weights is 0: it had none before."""
    mlp = model.networks[head]
    if "control" not in mlp.inputs or len(mlp.inputs) == 1:
        return mlp
    parts = split_columns(model, head)
    if parts.pop("control").any():
        return mlp
    first = np.hstack(list(parts.values())).astype(np.float32)
    return replace(mlp, inputs=tuple(parts), weights=(first, *mlp.weights[1:]))


def without_shut_units(model: AnchorModel, head: str) -> Mlp:
    """A network without hidden units that no anchor, seen from anywhere, opens at any stop.

    What is shut at all stops is shut at every blend of them: a sum's largest value over weighted
    means is at one of their ends.
    """
    mlp = model.networks[head]
    if len(mlp.weights) < 2:
        return mlp
    parts = split_columns(model, head)
    most = mlp.biases[0].astype(np.float64)
    if "feature" in parts:
        most = most + (model.features.astype(np.float64) @ parts["feature"].T).max(axis=0)
    if "direction" in parts:
        most = most + np.linalg.norm(parts["direction"], axis=1)
    if "light" in parts and model.light is not None:
        most = most + np.abs(parts["light"]) @ most_light(model.light).max(axis=0)
    if "control" in parts:
        psi = np.stack([model.encoding.encode(stop.x) for stop in model.stops])
        most = most + (psi.astype(np.float64) @ parts["control"].T).max(axis=0)
    keep, weights, biases = most > 0, list(mlp.weights), list(mlp.biases)
    for layer in range(len(weights) - 1):
        if layer:  # units that only handed on what is gone
            keep = (weights[layer] != 0).any(axis=1) | (biases[layer] > 0)
        if not keep.any():
            keep[0] = True
        weights[layer] = np.ascontiguousarray(weights[layer][keep])
        biases[layer] = np.ascontiguousarray(biases[layer][keep])
        weights[layer + 1] = np.ascontiguousarray(weights[layer + 1][:, keep])
    return replace(mlp, weights=tuple(weights), biases=tuple(biases))


def without_unread_features(model: AnchorModel) -> AnchorModel:
    """The model without features that no network reads; one stays at least."""
    read = np.zeros(model.features.shape[1], bool)
    for head in HEADS:
        if "feature" in model.networks[head].inputs:
            read |= (split_columns(model, head)["feature"] != 0).any(axis=0)
    if not read.any():
        read[0] = True
    if read.all():
        return model
    networks = {}
    for head in HEADS:
        mlp = model.networks[head]
        if "feature" in mlp.inputs:
            parts = split_columns(model, head)
            parts["feature"] = parts["feature"][:, read]
            first = np.hstack([parts[part] for part in mlp.inputs]).astype(np.float32)
            mlp = replace(mlp, weights=(first, *mlp.weights[1:]))
        networks[head] = mlp
    return replace(model, networks=networks, features=np.ascontiguousarray(model.features[:, read]))
