"""A stop taken out of a model, with all that it alone had: the others show what they showed."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.colors.light_harmonics import most_light
from shapeshift.runtime_models.model import HEADS, AnchorModel, BadFile, Mlp
from shapeshift.runtime_models.package.refit_encoding import place_stops, split_columns
from shapeshift.runtime_models.stops.insert_stop import even_places
from shapeshift.runtime_models.stops.stop_formula import read_formula, sources_of


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
