"""A whole new stop: put in, shaped by a rule, coloured by pictures, measured for what it moved."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.blocks.block_model import one_network
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import HEADS, AnchorModel, BadFile, Model, Splats
from shapeshift.runtime_models.package.refit_encoding import split_columns
from shapeshift.runtime_models.rotation import normalize, product, rotation_matrices
from shapeshift.runtime_models.stops.change_stops import (
    NewUnits,
    add_units,
    insert_stop,
    stored_features,
)
from shapeshift.scene.cameras.framing import default_background, frame_points
from shapeshift.scene.pose import View
from shapeshift.training.evaluation.evaluate import ModelRenderer
from shapeshift.training.heads.gaussians import REACH, SCALE_CLIP
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.styles.stop_trainer import (
    SourceOutputs,
    StopSettings,
    StopTrainer,
    refuse_unusual,
)
from shapeshift.training.styles.style_pictures import StylePictures
from shapeshift.training.styles.style_rules import RULES, Rule, Surroundings
from shapeshift.training.styles.train_stop import PictureRun, dome_views, train_on_pictures

BEHIND = (0.08, 0.08, 0.08)  # display sRGB, of a scene that has no background of its own
DRIFT_VIEWS, DRIFT_SIZE = 8, (320, 240)
MOST_STEPS = 100_000
COLOR_FEATURES = 8  # numbers an anchor for colours by rule: of a file they are some 25 %
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class NewStyle:
    """Which stop is put in, and how it learns."""

    name: str
    source: str  # the stop that it starts from
    after: str | None = None  # the stop that it comes after; None: the last one
    rule: str = ""  # one of RULES; "": shapes stay
    strength: float = 1.0  # 0..1
    seed: int = 0
    steps: int = 400  # towards pictures

    def __post_init__(self) -> None:
        """ValueError, one sentence."""
        if self.rule and self.rule not in RULES:
            raise ValueError(f"shape: there is none '{self.rule}'; there are {', '.join(RULES)}.")
        if not 0 <= self.strength <= 1:
            raise ValueError(f"strength is {self.strength}; it is a share, 0 to 1.")
        if not 1 <= self.steps <= MOST_STEPS:
            raise ValueError(f"steps is {self.steps}; 1 to {MOST_STEPS:,} are wanted.")
        if not self.seed >= 0:
            raise ValueError(f"seed is {self.seed}; it has to be at least 0.")


def refuse_plain(model: Model) -> AnchorModel:
    """The model.  Raises BadFile where it has no networks that could learn."""
    if not isinstance(model, AnchorModel):
        raise BadFile(
            "this scene is plain splats without networks, which cannot learn a stop; a package of "
            "`train` is wanted."
        )
    return one_network(model)


def add_style(
    device,
    model: AnchorModel,
    style: NewStyle,
    pictures: StylePictures | None = None,
    views: Sequence[View] = (),
    inside: np.ndarray | None = None,
    progress: Progress | None = None,
    recolor: Rule | None = None,
) -> AnchorModel:
    """The model with one stop more; all others show what they showed.

    pictures: what colours it, as seen from the views; device: what trains, needed with pictures
    alone.  inside (A,) bool: the anchors that may change.  recolor: a rule for colours beside that
    of the shape, as a preview is.  Raises BadFile, one sentence.
    """
    if pictures is None and recolor is None and not style.rule:
        raise BadFile("a new stop needs a shape or pictures; give one of them.")
    report = progress or (lambda what, done: None)
    made = insert_stop(model, style.name, style.source, style.after)
    rules = [RULES[style.rule]] if style.rule else []
    for rule in [*rules, *([recolor] if recolor else [])]:
        report(f"shape: {style.rule}" if rule is not recolor else "colours", 0.0)
        features = COLOR_FEATURES if rule is recolor else RuleSettings.features
        settings = RuleSettings(features, style.strength)
        made = with_rule(made, style.name, rule, settings, inside)
    if pictures is not None:
        trainer = StopTrainer(device, made, style.name, StopSettings(seed=style.seed), inside)
        run = PictureRun(style.steps, style.strength, default_background(model, BEHIND))
        train_on_pictures(trainer, views, pictures, run, report)
        made = trainer.finished()
    notes = [note for note in as_list(made.provenance.get("styles")) if note != style.name]
    return replace(made, provenance={**made.provenance, "styles": [*notes, style.name]})


def as_list(value: object) -> list:
    return value if isinstance(value, list) else []


def drift_db(device, before: AnchorModel, after: AnchorModel) -> dict[str, float]:
    """Of each stop that both have, PSNR of its pictures after to those before, the worst of 8."""
    behind = default_background(before, BEHIND)
    views = dome_views(before, DRIFT_VIEWS, DRIFT_SIZE)
    one, other = ModelRenderer(device, before), ModelRenderer(device, after)
    places = {stop.name: stop.x for stop in after.stops}
    found = {}
    for stop in before.stops:
        if stop.name not in places:
            continue
        one.set_control(stop.x)
        other.set_control(places[stop.name])
        worst = 0.0
        for view in views:
            error = one.picture(view, behind).astype(np.float64) - other.picture(view, behind)
            worst = max(worst, float((error**2).mean()))
        found[stop.name] = float(-10 * np.log10(max(worst, 1e-20)))
    return found


# What a rule asks for, learned by all five networks at once, by linear algebra alone.
#
# At the stop the outputs of a network have to grow by R = wished - shown (A, outputs), before the
# activation. Old hidden units, copied, explain a part of it, as far as what is to go away is
# theirs; of the rest the principal components become the anchors' new features, and units of +f
# and -f hand them on. Last layers are a least squares fit, weighed by how much of each splat is
# seen.

FAR = 0.97  # of the reach of an activation: its ends are infinitely far
DARK = 0.004  # display sRGB: colours stay so far from 0 and 1
LEAST_WEIGHT = 0.02  # of a splat that is not seen
RIDGE = 1e-4  # of a mean square: what keeps weights small
EYES = 4  # about the scene, from which view-dependent colours are wished


@dataclass(frozen=True)
class RuleSettings:
    features: int = 16  # numbers that each anchor stores for the rule
    strength: float = 1.0  # 0..1 of the way to what the rule says


def with_rule(
    model: AnchorModel,
    stop: str,
    rule: Rule,
    settings: RuleSettings,
    inside: np.ndarray | None = None,
) -> AnchorModel:
    """The model whose stop, put in by `insert_stop`, shows its splats as the rule makes them.

    inside (A,) bool: the anchors that it is for.  Raises BadFile for other networks than those of
    `train`.  A few seconds of a core.
    """
    refuse_unusual(model)
    place = next(each.x for each in model.stops if each.name == stop)
    layout = HeadLayout(model.splats_per_anchor, control=1, fixed=HEADS, view_dependent=False)
    outputs = SourceOutputs(model, stop, layout)
    near = surroundings(model)
    wished = {head: np.zeros((len(model.anchors), outputs.at[head][1])) for head in HEADS}
    for eye in eyes_about(near):
        outputs.look_from(eye)
        shown = evaluate(model, place, eye)
        asked = blended(shown, rule(shown, near), settings.strength)
        base = {h: outputs.rows[:, at : at + width] for h, (at, width) in outputs.at.items()}
        for head, raw in raw_outputs(model, shown, asked, base).items():
            wished[head] += (raw - base[head]) / EYES
    weights = np.clip(np.maximum(shown.opacity, asked.opacity), LEAST_WEIGHT, 1)
    weights = weights.reshape(len(model.anchors), -1)  # (A, k)
    if inside is not None:
        weights = weights * inside[:, None]
    features, units = fitted(model, place, wished, weights, settings.features)
    return add_units(model, stop, features, units, inside)


def surroundings(model: AnchorModel) -> Surroundings:
    """What rules may know of a model."""
    count, k = len(model.anchors), model.splats_per_anchor
    grain = np.full(count, model.networks["offset"].gain / REACH)
    if model.frames is not None:
        grain = grain * np.exp(np.log(model.frames.scales).mean(axis=1))
    centre, radius = frame_points(model.anchors, np.ones(count, np.float32))
    slot = np.tile(np.linspace(0, 1, k) if k > 1 else [0.5], count)
    floor = float(np.percentile(model.anchors[:, 1], 2))
    normal = np.repeat(normals(model), k, axis=0)
    return Surroundings(k, slot, np.repeat(grain, k), normal, centre, radius, floor)


def normals(model: AnchorModel) -> np.ndarray:
    """(A, 3) unit: the axis of each anchor's frame that is shortest; up, without frames."""
    if model.frames is None:
        return np.tile([0.0, 1.0, 0.0], (len(model.anchors), 1))
    axes = rotation_matrices(model.frames.wxyz.astype(np.float64))  # (A, 3, 3) columns
    return axes[np.arange(len(axes)), :, model.frames.scales.argmin(axis=1)]


def eyes_about(near: Surroundings) -> list[np.ndarray]:
    """Places (3,) about the scene, a little above it."""
    turns = 2 * np.pi * np.arange(EYES) / EYES
    aside = np.stack([np.sin(turns), np.full(EYES, 0.5), np.cos(turns)], axis=1)
    return list(near.centre + 2.5 * near.radius * aside)


def blended(shown: Splats, asked: Splats, strength: float) -> Splats:
    """Part of the way from one to the other; turns by the shorter way."""
    if strength == 1:
        return asked
    sign = np.where((shown.wxyz * asked.wxyz).sum(axis=1, keepdims=True) < 0, -1, 1)
    tables = {
        name: (1 - strength) * getattr(shown, name) + strength * getattr(asked, name)
        for name in ("means", "opacity", "color")
    }
    scales = shown.scales ** (1 - strength) * np.maximum(asked.scales, 1e-9) ** strength
    wxyz = normalize((1 - strength) * shown.wxyz + strength * sign * asked.wxyz)
    return Splats(scales=scales, wxyz=wxyz, **tables)


def raw_outputs(
    model: AnchorModel, shown: Splats, asked: Splats, base: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """(A, k * size) of each head: outputs before activation that give the splats asked for, as far
    as activations reach.  What is to stay as it is shown has the outputs of `base`.
    """
    count, k = len(model.anchors), model.splats_per_anchor
    offset = (asked.means - np.repeat(model.anchors, k, axis=0)).astype(np.float64)  # (N, 3)
    scales, wxyz = asked.scales.astype(np.float64), asked.wxyz.astype(np.float64)
    if model.frames is not None:
        sizes = np.repeat(model.frames.scales, k, axis=0)
        axes = np.repeat(rotation_matrices(model.frames.wxyz), k, axis=0)
        offset = np.einsum("nij,ni->nj", axes, offset) / sizes
        scales = scales / sizes
        inverse = np.repeat(model.frames.wxyz, k, axis=0) * [1, -1, -1, -1]
        wxyz = product(inverse, wxyz)
    wxyz = np.where(wxyz[:, :1] < 0, -wxyz, wxyz)  # of two that turn alike, the same everywhere
    gain = {head: model.networks[head].gain for head in ("offset", "scale")}
    color = np.clip(asked.color.astype(np.float64), DARK, 1 - DARK)
    raw = {
        "offset": np.arctanh(np.clip(offset / gain["offset"], -FAR, FAR)),
        "scale": np.clip(np.log(np.maximum(scales / gain["scale"], 1e-9)), *SCALE_CLIP),
        "rotation": wxyz,
        "opacity": np.arctanh(np.clip(asked.opacity.astype(np.float64), -FAR, FAR)),
        "color": np.log(color / (1 - color)),
    }
    stays = {
        "offset": asked.means == shown.means,
        "scale": asked.scales == shown.scales,
        "rotation": rotated_as(shown.wxyz, asked.wxyz)[:, None],
        "opacity": (asked.opacity == shown.opacity) | ((asked.opacity < 0) & (shown.opacity < 0)),
        "color": asked.color == shown.color,
    }
    return {
        head: np.where(
            np.broadcast_to(stays[head], raw[head].shape).reshape(count, -1),
            base[head],
            raw[head].reshape(count, -1),
        )
        for head in HEADS
    }


def rotated_as(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(N,) bool: whether two quaternions (N, 4) are one rotation."""
    return np.abs((normalize(one) * normalize(other)).sum(axis=1)) > 1 - 1e-6


def fitted(
    model: AnchorModel, place: float, wished: dict[str, np.ndarray], weights: np.ndarray, more: int
) -> tuple[np.ndarray, dict[str, NewUnits]]:
    """(A, more) features and each head's units, whose outputs come near to `wished`.

    weights (A, k): how much each splat counts.
    """
    copied = {head: copied_units(model, head, place) for head in HEADS}
    rest = []
    for head in HEADS:
        hidden = hidden_values(copied[head], model.features)
        out = least_squares(hidden, wished[head], weights)
        error = (wished[head] - hidden @ out.T).reshape(*weights.shape, -1)
        error = error * np.sqrt(weights)[..., None] * importance(model, head)
        rest.append(error.reshape(len(hidden), -1))
    features = stored_features(model, principal(np.hstack(rest), more))
    known = np.hstack([model.features, features])
    units = {}
    for head in HEADS:
        old, handed = copied[head], np.zeros((2 * more, known.shape[1]))
        handed[:, model.features.shape[1] :] = np.vstack([np.eye(more), -np.eye(more)])
        wide = np.hstack([old.feature, np.zeros((len(old.feature), more))])
        bias = np.concatenate([old.bias, np.zeros(2 * more)])
        both = NewUnits(np.vstack([wide, handed]), bias, np.zeros((0, 0)))
        out = least_squares(hidden_values(both, known), wished[head], weights)
        units[head] = NewUnits(both.feature, both.bias, out)
    return features, units


def copied_units(model: AnchorModel, head: str, place: float) -> NewUnits:
    """The hidden units that are open at a stop, with what x gives them in their bias, and one that
    is always 1.  Of deep networks and of colours, which are not taken away, that one alone.
    """
    width, mlp = model.features.shape[1], model.networks[head]
    feature, bias = np.zeros((0, width)), np.zeros(0)
    if len(mlp.weights) == 2 and head != "color" and "feature" in mlp.inputs:
        parts = split_columns(model, head)
        feature, bias = parts["feature"], mlp.biases[0].astype(np.float64)
        if "control" in parts:
            bias = bias + parts["control"] @ model.psi(place)[0].astype(np.float64)
        opens = (model.features @ feature.T + bias).max(axis=0) > 0
        feature, bias = feature[opens], bias[opens]
    one = np.zeros((1, width))
    return NewUnits(np.vstack([feature, one]), np.append(bias, 1.0), np.zeros((0, 0)))


def hidden_values(units: NewUnits, features: np.ndarray) -> np.ndarray:
    """(A, M) what units give, by features alone."""
    return np.maximum(features.astype(np.float64) @ units.feature.T + units.bias, 0)


def importance(model: AnchorModel, head: str) -> np.ndarray | float:
    """How much an error of an output counts: of an offset, by the size of the anchor there."""
    if head != "offset" or model.frames is None:
        return 1.0
    scales = model.frames.scales
    grain = np.exp(np.log(scales).mean(axis=1, keepdims=True))
    return (scales / grain)[:, None, :]  # (A, 1, 3)


def least_squares(hidden: np.ndarray, wished: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(outputs, M) weights of hidden values (A, M) that come nearest to wished (A, outputs)."""
    size = wished.shape[1] // weights.shape[1]
    out = np.zeros((wished.shape[1], hidden.shape[1]))
    for splat in range(weights.shape[1]):
        columns = slice(splat * size, (splat + 1) * size)
        weighted = hidden * weights[:, splat : splat + 1]
        square = weighted.T @ hidden
        square += (RIDGE * np.trace(square) / len(square) + 1e-12) * np.eye(len(square))
        out[columns] = np.linalg.solve(square, weighted.T @ wished[:, columns]).T
    return out


def principal(table: np.ndarray, count: int) -> np.ndarray:
    """(A, count) principal components of a table (A, D), each with mean square 1 at most."""
    _, axes = np.linalg.eigh(table.T @ table)
    count_there = min(count, axes.shape[1])
    scores = np.zeros((len(table), count))
    scores[:, :count_there] = table @ axes[:, ::-1][:, :count_there]
    size = np.sqrt((scores**2).mean(axis=0))
    return scores / np.maximum(size, 1e-9)
