"""Seeded scenes with numbers that break programs: NaN, Inf, denormals, 1e38, exact thresholds.

The bar (test_poison.py): such a scene renders cleanly, or is refused in one precise sentence.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from shapeshift.app.stability_cases.scenes import small_model
from shapeshift.renderer import layout
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.model import AnchorModel, SplatLayers, Stop
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import IDENTITY, Scene, SceneObject
from shapeshift.scene.selectors.selector import Box, HalfSpace, Lens, Painted, Sphere
from tests.support.splat_scenes import FIELDS, only

SIZE = (40, 28)  # pixels: three tiles by two, none of them whole at the border
NEAR = 0.5  # metres; the eye is at z = 3, so depth is exactly 3 - z
EYE = 3.0
REACH = 4.0  # metres: the distance limit, met exactly by z = -1
# Metres.  A covariance is float32: 1e-7 of 300^2 is 0.01 m^2, as much as the other axes have here.
WILD_SCALE = 300.0
WILD_PLACE = 4000.0  # with them a sigma passes layout.HALF_MAX pixels
KINDS = (
    "row", "row", "row", "row", "row", "row", "rows", "rows", "network", "network", "bias",
    "pose", "view", "settings", "x", "background", "selector",
)  # fmt: skip


def beside(value: float) -> list[float]:
    """A threshold and the floats just below and above it."""
    exact = np.float32(value)
    ends = np.array([-np.inf, np.inf], np.float32)
    return [float(exact), *(float(np.nextafter(exact, end)) for end in ends)]


ENDS = [np.nan, np.inf, -np.inf, 0.0, -0.0, 1e38, -1e38, 3.4e38, -3.4e38]
TINY = [1e-45, -1e-45, 1e-40, 1.17549435e-38, 1e-30, 1e-20]
EXACT = [
    number
    for threshold in (
        1 / 255, 0.99, 1.0, NEAR, EYE - NEAR, EYE - REACH, REACH, layout.HALF_MAX, 65504.0, 65520.0,
        65535.0, 65536.0, 2.0**24, 1e18, 1e19, 1e30, 2.0**63, 512.0,
    )
    for number in beside(threshold)
]  # fmt: skip
VALUES = ENDS + TINY + EXACT


@dataclass
class Poisoned:
    """What one seed makes.  `doubtful`: rows of the first object that may be drawn or not."""

    told: str
    objects: list[SceneObject]
    views: list[View]
    settings: RenderSettings
    doubtful: list[np.ndarray]  # sets of rows that come or go together
    exact: bool = True  # whether the oracle can say what the picture is

    @property
    def scene(self) -> Scene:
        return Scene(tuple(self.objects))


def make(seed: int) -> Poisoned:
    """The scene of a seed.  Raises ValueError where a constructor refuses what it is given."""
    rng = np.random.default_rng(seed)
    kind = KINDS[rng.integers(len(KINDS))]
    view = View(Pose(np.array([0, 0, EYE]), IDENTITY.wxyz), (-0.5, 0.5, -0.4, 0.4), NEAR, 50, SIZE)
    layers = cloud(rng)
    start = Poisoned(kind, [SceneObject("cloud", layers)], [view], settings_of(rng), [])
    makers = {
        "row": spoil_rows, "rows": spoil_rows, "network": spoil_network, "bias": spoil_bias,
        "pose": spoil_pose, "view": spoil_view, "settings": spoil_settings, "x": spoil_x,
        "background": spoil_background, "selector": spoil_selector,
    }  # fmt: skip
    made = makers[kind](start, rng)
    if rng.random() < 0.2 and kind != "view":
        made.views = [eye_of(view, side, rng.random() < 0.5) for side in (-0.03, 0.03)]
    if not plain(made.settings):
        made.exact = False
    return made


def plain(settings: RenderSettings) -> bool:
    """Whether the first frame is what the oracle draws, to float rounding."""
    whole = settings.render_scale == 1 and not settings.debug and settings.min_transmittance < 1e-3
    return whole and settings.target not in ("rgba8", "rgba16") and settings.key_bits == 32


def walk(made: Poisoned) -> list[list[View]]:
    """The views of three frames: as made, after a turn of 40 degrees, and back again."""
    half = np.radians(20)
    turn = np.array([np.cos(half), 0, np.sin(half), 0])
    aside = [replace(v, world_from_eye=Pose(v.world_from_eye.position, turn)) for v in made.views]
    return [made.views, aside, made.views]


def eye_of(view: View, side: float, leaning: bool) -> View:
    """The eye `side` metres to the right, its lens leaning outwards as in a headset or not."""
    left, right, down, up = view.tangents
    outwards = 0.15 * np.sign(side) if leaning else 0.0
    return replace(
        view,
        world_from_eye=Pose(np.array([side, 0, EYE]), IDENTITY.wxyz),
        tangents=(left + outwards, right + outwards, down, up),
    )


def cloud(rng: np.random.Generator) -> SplatLayers:
    """1 to 40 plain splats in front of the eye."""
    count = int(rng.choice([1, 2, 7, 8, 9, 40]))
    coefficients = int(rng.choice([1, 4]))
    wxyz = rng.normal(size=(count, 4))
    arrays = (
        rng.normal(size=(count, 3)) * 0.5,
        np.exp(rng.normal(size=(count, 3)) * 0.5 - 2.2),
        wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True),
        rng.uniform(0.2, 1, count),
        rng.normal(size=(count, coefficients, 3)) * 0.4,
    )
    layers = SplatLayers(
        *(a.astype(np.float32) for a in arrays), np.zeros(count, np.int32), (Stop("only", 0.0),)
    )
    return replace(layers, antialiased=bool(rng.random() < 0.25))


def settings_of(rng: np.random.Generator) -> RenderSettings:
    """Exact settings mostly; sometimes a limit that splats meet exactly."""
    if rng.random() < 0.6:
        return RenderSettings()
    choice = {
        "max_distance": [REACH, np.inf, EYE], "max_pixels": [3.0, np.inf, layout.HALF_MAX],
        "min_pixels": [0.0, 1.0], "fade": [0.0, 0.3, 1.0], "key_bits": [16, 32],
        "order": ["depth", "distance"], "low_pass": [0.3, 0.0],
        "min_alpha": [1 / 255, *beside(1 / 255)], "resort_frames": [1, 0, 3],
        "resort_degrees": [0.0, 180.0], "stereo_sort": ["shared", "each"],
        "stereo_colors": ["auto", "each", "shared"],
        "recolor_degrees": [0.0, 30.0], "skip_unseen": [False, True],
        "target": ["auto", "rgba16f", "rgba32f", "rgba8", "rgba16"],
        "render_scale": [1.0, 1.0, 0.5, 2.0],
        "min_transmittance": [1e-4, 1e-6, 0.1],
        "debug": [""] * 8 + ["culls", "birdseye", "overdraw", "depth", "object"],
    }  # fmt: skip
    return RenderSettings(**{n: v[rng.integers(len(v))] for n, v in choice.items()})


def value_for(rng: np.random.Generator) -> float:
    pool = (ENDS, TINY, EXACT)[rng.choice(3, p=(0.4, 0.2, 0.4))]
    return pool[rng.integers(len(pool))]


def spoil_rows(made: Poisoned, rng: np.random.Generator) -> Poisoned:
    """One to three splats get bad numbers, behind the door of SplatLayers or through it."""
    model = made.objects[0].model
    rows = rng.choice(model.splat_count, min(model.splat_count, int(rng.integers(1, 4))), False)
    for row in rows:
        name = FIELDS[rng.integers(len(FIELDS))]
        flat = getattr(model, name)[row : row + 1].reshape(-1)  # a view
        value = value_for(rng)
        at = int(rng.integers(len(flat)))
        where = slice(None) if rng.random() < 0.3 else slice(at, at + 1)
        flat[where] = value
        made.told += f"; {name}[{row}] {where.start}:{where.stop} = {value!r}"
    if rng.random() < 0.05:
        model = SplatLayers(*(getattr(model, n) for n in FIELDS), model.layer, model.stops)
    made.objects = [SceneObject("cloud", model)]
    made.doubtful = [np.array([row]) for row in rows]
    return made


def spoil_network(made: Poisoned, rng: np.random.Generator) -> Poisoned:
    """A number of the anchors, the features, or anywhere in a network."""
    model = small_model(int(rng.integers(1, 12)), 3, int(rng.integers(99)))
    value = value_for(rng)
    arrays = {"anchors": model.anchors, "features": model.features}
    for head, mlp in model.networks.items():
        for i, (weight, bias) in enumerate(zip(mlp.weights, mlp.biases, strict=True)):
            arrays |= {f"{head}.weight{i}": weight, f"{head}.bias{i}": bias}
    name = list(arrays)[rng.integers(len(arrays))]
    array = arrays[name].reshape(-1)
    some = rng.integers(len(array), size=int(rng.choice([1, 3, len(array)])))
    array[some] = value
    made.told += f"; {len(some)} of {name} = {value!r}"
    made.objects = [SceneObject("model", model, x=float(rng.choice([0, 0.3, 1])))]
    made.exact = False  # a NaN inside may become 0 in one ReLU and stay NaN in another
    return made


def spoil_bias(made: Poisoned, rng: np.random.Generator) -> Poisoned:
    """Outputs of one splat of every anchor: the rest must stay as it is."""
    model = small_model(6, 3, int(rng.integers(99)))
    head = list(model.networks)[rng.integers(5)]
    bias = model.networks[head].biases[-1].reshape(3, -1)
    value = float(rng.choice([np.nan, np.inf, -np.inf]))
    bias[1, rng.integers(bias.shape[1])] = value
    made.told += f"; bias of {head} = {value!r}"
    made.objects = [SceneObject("model", model)]
    made.doubtful = [np.arange(model.splat_count)[1::3]]
    return made


def spoil_pose(made: Poisoned, rng: np.random.Generator) -> Poisoned:
    """A number of where an object stands; another object stands well."""
    position, wxyz = np.zeros(3), np.array([1.0, 0, 0, 0])
    value = value_for(rng)
    target = (position, wxyz)[rng.integers(2)]
    target[rng.integers(len(target)) if rng.random() < 0.7 else slice(None)] = value
    made.told += f"; pose {position} {wxyz}"
    bad = replace(made.objects[0], world_from_object=Pose(position, wxyz))
    made.objects = [bad, SceneObject("good", cloud(rng))]
    made.exact = False
    return made


def spoil_view(made: Poisoned, rng: np.random.Generator) -> Poisoned:
    """A number of an eye: where it is, its lens, its depth range, its size."""
    view, value = made.views[0], value_for(rng)
    what = ("position", "wxyz", "tangents", "near", "far", "size")[rng.integers(6)]
    made.told += f"; view {what} = {value!r}"
    made.exact = False
    if what in ("position", "wxyz"):
        array = np.array(getattr(view.world_from_eye, what), np.float64)
        array[rng.integers(len(array)) if rng.random() < 0.7 else slice(None)] = value
        made.views = [replace(view, world_from_eye=replace(view.world_from_eye, **{what: array}))]
    elif what == "tangents":
        tangents = list(view.tangents)
        tangents[rng.integers(4)] = value
        made.views = [replace(view, tangents=tuple(tangents))]
    elif what == "size":
        made.views = [replace(view, size=(value if abs(value) < 300 else -value, SIZE[1]))]
    else:
        made.views = [replace(view, **{what: value})]
    return made


def spoil_settings(made: Poisoned, rng: np.random.Generator) -> Poisoned:
    names = (
        "min_alpha", "low_pass", "max_pixels", "max_distance", "min_pixels", "fade",
        "render_scale", "resort_frames", "resort_degrees", "recolor_degrees", "key_bits", "order",
        "min_transmittance",
    )  # fmt: skip
    name, value = names[rng.integers(len(names))], value_for(rng)
    made.told += f"; {name} = {value!r}"
    made.settings = RenderSettings(**{name: value})
    made.exact = False
    return made


def spoil_x(made: Poisoned, rng: np.random.Generator) -> Poisoned:
    value = value_for(rng)
    made.told += f"; x = {value!r}"
    model = small_model(5, 3) if rng.random() < 0.5 else made.objects[0].model
    made.objects = [SceneObject("cloud", model, x=value)]
    made.exact = False
    return made


def spoil_selector(made: Poisoned, rng: np.random.Generator) -> Poisoned:
    """A number of one of the regions that have an x of their own."""
    model = small_model(6, 3) if rng.random() < 0.5 else made.objects[0].model
    count = len(model.anchors) if isinstance(model, AnchorModel) else model.splat_count
    fields = {
        Sphere: {"centre": [0.1, 0, 0], "radius": [0.4]},
        Box: {"centre": [0, 0.1, 0], "half": [0.5, 0.4, 0.3], "wxyz": [1, 0, 0, 0]},
        HalfSpace: {"point": [0, 0, 0], "normal": [0, 1, 1]},
        Lens: {"position": [0, 0, 3], "wxyz": [1, 0, 0, 0], "half_angle": [0.2]},
        Painted: {"weight": [0.5] * count},
    }
    kinds = list(fields)
    kind = kinds[rng.integers(len(kinds))]
    numbers = {name: np.array(row, np.float64) for name, row in fields[kind].items()}
    numbers |= {"x": np.array([0.7])} | ({} if kind is Painted else {"border": np.array([0.1])})
    name = list(numbers)[rng.integers(len(numbers))]
    value = value_for(rng)
    if len(numbers[name]):
        numbers[name][rng.integers(len(numbers[name])) if rng.random() < 0.7 else slice(None)] = (
            value
        )
    made.told += f"; {kind.__name__} {name} = {value!r}"
    single = {"radius", "half_angle", "x", "border"}
    with np.errstate(over="ignore"):
        made_of = {n: float(row[0]) if n in single else row for n, row in numbers.items()}
        bad = kind(**made_of)
    whole = Sphere(centre=(0.2, 0, 0), radius=0.3, x=0.2, border=0.1)
    selectors = (whole, bad) if rng.random() < 0.5 else (bad,)
    made.objects = [SceneObject("cloud", model, selectors=selectors)]
    return made


def spoil_background(made: Poisoned, rng: np.random.Generator) -> Poisoned:
    value = value_for(rng)
    made.told += f"; background {value!r}"
    made.settings = RenderSettings(background=(0.1, value, 0.3))
    made.exact = False
    return made


def without(made: Poisoned, rows: np.ndarray) -> Scene:
    """The scene with rows of its first object left out."""
    model = made.objects[0].model
    keep = np.setdiff1d(np.arange(model.splat_count), rows)
    if isinstance(model, SplatLayers):
        left = only(model, keep)
        return Scene((replace(made.objects[0], model=left), *made.objects[1:]))
    return Scene((replace(made.objects[0], model=without_outputs(model)), *made.objects[1:]))


def without_outputs(model: AnchorModel) -> AnchorModel:
    """The model whose second splat of every anchor has opacity -1: absent by rule."""
    networks = {}
    for name, mlp in model.networks.items():
        bias = mlp.biases[-1].copy().reshape(3, -1)
        bias[1] = np.where(np.isfinite(bias[1]), bias[1], 0)
        if name == "opacity":
            bias[1] = -1e3
        networks[name] = replace(mlp, biases=(*mlp.biases[:-1], bias.reshape(-1)))
    return replace(model, networks=networks)


def possible(made: Poisoned) -> list[Scene]:
    """Every scene that may be seen: each doubtful set there, or not."""
    found = []
    for count in range(len(made.doubtful) + 1):
        for sets in combinations(made.doubtful, count):
            rows = np.concatenate([np.zeros(0, int), *sets])
            found.append(without(made, rows) if len(rows) else made.scene)
    return found


def wild(made: Poisoned) -> bool:
    """Whether a doubtful splat is so long or far that float32 keeps no shape of it."""
    model = made.objects[0].model
    if not isinstance(model, SplatLayers):
        return False
    rows = np.concatenate([np.zeros(0, int), *made.doubtful])
    long, far = np.abs(model.scales[rows]) > WILD_SCALE, np.abs(model.means[rows]) > WILD_PLACE
    return bool(long.any() or far.any())


def steep(made: Poisoned) -> bool:
    """Whether an opacity is far above 1: alpha then falls from 0.99 to nothing within a pixel."""
    model = made.objects[0].model
    return isinstance(model, SplatLayers) and bool((model.opacity > 2).any())
