"""A whole new stop: put in, shaped by a rule, coloured by pictures, measured for what it moved."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.blocks.block_model import one_network
from shapeshift.runtime_models.model import AnchorModel, BadFile, Model
from shapeshift.runtime_models.stops.insert_stop import insert_stop
from shapeshift.scene.cameras.framing import default_background
from shapeshift.scene.pose import View
from shapeshift.training.evaluation.evaluate import ModelRenderer
from shapeshift.training.styles.fit_rule import RuleSettings, with_rule
from shapeshift.training.styles.stop_trainer import StopSettings, StopTrainer
from shapeshift.training.styles.style_pictures import StylePictures
from shapeshift.training.styles.style_rules import RULES, Rule
from shapeshift.training.styles.style_views import dome_views
from shapeshift.training.styles.train_stop import PictureRun, train_on_pictures

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
