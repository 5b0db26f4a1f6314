"""When colours run again, for which anchors (settings.recolor_degrees and skip_unseen) and for how
many eyes (settings.stereo_colors)."""

import math
from dataclasses import dataclass

import numpy as np

from shapeshift.renderer.layout import JACOBIAN_MARGIN
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.colors.color_bounds import color_slope
from shapeshift.runtime_models.evaluate import follows_eye
from shapeshift.runtime_models.model import Model, ScaffoldModel, SplatLayers
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, Tint


def color_key(model: Model, x: float, eye: np.ndarray) -> tuple:
    """What the colours of a model depend on: equal keys, equal colours.  x: or a number of it.

    Of a model that follows the eye, its opacities, scales and rotations as well.
    """
    if follows_eye(model):
        return None, tuple(eye)
    if isinstance(model, SplatLayers):
        return None, tuple(eye) if model.sh.shape[1] > 1 else None
    inputs = model.networks["color"].inputs
    return (x if "control" in inputs else None, tuple(eye) if "direction" in inputs else None)


@dataclass
class ColorCache:
    """What an object's colours were last computed for."""

    centre: np.ndarray  # (3,) object frame metres: what the eye moves around
    key: tuple | None = None  # color_key; None: never, or spoilt
    anchors: np.ndarray | None = None  # (A,) bool: those that have it; None: all
    reach: np.ndarray | None = None  # (A,) metres around each anchor with all of its splats
    reach_key: tuple | float | None = None  # control value and least alpha of that
    tint: Tint | None = None  # that lies over them now
    untinted: tuple = ()  # rows under it, their colours and their heat without it

    @property
    def is_done(self) -> bool:
        """Whether all have colours that follow neither x nor the eye."""
        return self.key == (None, None) and self.anchors is None

    def is_stale(self, key: tuple, degrees: float, nearer: bool = False) -> bool:
        """Whether x changed, or the eye moved by more than so many degrees around the centre.

        nearer: or by as much of its distance towards the centre or away.
        """
        if self.key is None or key[0] != self.key[0]:
            return True
        if key[1] == self.key[1]:
            return False
        if not degrees > 0 or _angle(self.key[1], key[1], self.centre) > math.radians(degrees):
            return True
        before, now = (np.linalg.norm(np.array(eye) - self.centre) for eye in (self.key[1], key[1]))
        return nearer and not abs(math.log(now / before)) <= math.radians(degrees)

    def mark_colored(self, key: tuple, wanted: np.ndarray | None, stale: bool) -> bool:
        """Notes that the wanted anchors get their colours; False: none of them needs any."""
        if stale:
            self.key, self.anchors = key, wanted
        elif wanted is None or not wanted.any():
            return False
        else:
            self.anchors |= wanted
        return True


def forget_colors(sets: list[ColorCache]) -> None:
    """They are to be computed again, whatever the eye does."""
    for colored in sets:
        colored.key = None


def centre_of(model: Model) -> np.ndarray:
    """(3,) metres: the middle of a model's anchors or splats, (0, 0, 0) where it has none."""
    places = model.means if isinstance(model, SplatLayers) else model.anchors
    with np.errstate(invalid="ignore"):
        return places.mean(axis=0, dtype=np.float64) if len(places) else np.zeros(3)


def _angle(before: tuple, now: tuple, centre: np.ndarray) -> float:
    """Radians between the directions from the centre to two eyes; pi where there is none."""
    a, b = np.array(before) - centre, np.array(now) - centre
    length = np.linalg.norm(a) * np.linalg.norm(b)
    return math.acos(np.clip(a @ b / length, -1, 1)) if 0 < length < math.inf else math.pi


def reach_of(
    anchors: np.ndarray, mean_opacity: np.ndarray, covariance: np.ndarray, k: float
) -> np.ndarray:
    """(A,) metres from each anchor within which all of its splats lie, k sigmas of them included.

    mean_opacity (N, 4) and covariance (N, 6 or more: xx xy xz yy yz zz) of the anchors' splats,
    side by side; splats that are absent (opacity not above 0) reach nowhere.
    """
    per_anchor = mean_opacity.reshape(len(anchors), -1, 4)  # (A, k, 4)
    away = np.linalg.norm(per_anchor[..., :3] - anchors[:, None], axis=2)
    # The trace is at least the largest eigenvalue.
    sigma = np.sqrt(covariance[:, [0, 3, 5]].sum(axis=1)).reshape(away.shape)
    whole = np.where(per_anchor[..., 3] > 0, away + k * sigma, 0)
    return np.nan_to_num(whole.max(axis=1, initial=0), nan=np.inf)


def reach_of_scaffold(model: ScaffoldModel, min_alpha: float) -> np.ndarray:
    """(A,) metres: the same for every eye.  Offsets are stored; scales are a part of the anchor's.

    Opacity is at most 1, so that k sigmas are where the most opaque splat fades below min_alpha.
    """
    away = np.linalg.norm(model.offsets, axis=2).max(axis=1, initial=0)
    k = math.sqrt(2 * math.log(1 / min_alpha))
    return away + np.float32(k) * np.linalg.norm(model.scales, axis=1)


def visible_anchors(
    anchors: np.ndarray,
    reach: np.ndarray,
    world_from_object: np.ndarray,
    views: list[View],
    settings: RenderSettings,
) -> np.ndarray:
    """(A,) bool: anchors of which a splat may show in a view; never False where one does.

    All, where more than half are seen: to pick rows takes as long as to colour twice as many.
    The ellipse of a splat of radius 1 reaches hypot(1, tangent) aside, where the Jacobian holds the
    tangent within JACOBIAN_MARGIN times the widest.
    """
    seen = np.zeros(len(anchors), bool)
    k = math.sqrt(2 * math.log(1 / settings.min_alpha))
    blur = k * math.sqrt(settings.low_pass)  # pixels
    for view in views:
        eye_from_object = (view.eye_from_world() @ world_from_object).astype(np.float32)
        x, y, z = eye_from_object[:3, :3] @ anchors.T + eye_from_object[:3, 3:]  # rows: unit stride
        depth = -z
        left, right, down, up = view.tangents
        blur_x = blur * (right - left) / view.size[0]  # as a tangent
        blur_y = blur * (up - down) / view.size[1]
        deepest = np.maximum(depth + reach, 0)
        inside = depth + reach > view.near
        aside_x, aside_y = (math.hypot(1, JACOBIAN_MARGIN * t) for t in view.widest_tangents())
        for across, tangent, stretch, blurred in (
            (x, right, aside_x, blur_x), (-x, -left, aside_x, blur_x),
            (y, up, aside_y, blur_y), (-y, -down, aside_y, blur_y),
        ):  # fmt: skip
            room = stretch * reach + blurred * deepest
            inside &= across - tangent * depth <= room
        seen |= inside
    return seen | (np.count_nonzero(seen) > len(seen) // 2)


# Whether the views of a frame get colours of their own: settings.stereo_colors.

# Shared colours are reckoned to be this good or better, dB.  Measured on captures with harmonics
# and on networks they were 5 to 14 dB better over the pixels that are covered (docs/vr.md); the 8
# bits of a headset's pictures cost 58.9 dB.
SHARED_DB = 55.0
SAME_PLACE_M = 1e-4  # views nearer to each other are one eye's, whose insets have its place
NEAREST = 1.0  # percent of the splats: how far these are is how near the object is
SAMPLE = 4096  # splats or anchors that tell


@dataclass(frozen=True)
class EyeColors:
    """What of a model tells how much two eyes differ in its colours."""

    places: np.ndarray  # (n, 3) metres, object frame: a sample of its splats or anchors
    slope: float  # color_slope; infinite where more than colours follows the eye

    @staticmethod
    def of(model: Model) -> "EyeColors":
        places = model.means[model.opacity > 0] if isinstance(model, SplatLayers) else model.anchors
        step = max(-(-len(places) // SAMPLE), 1)
        slope = math.inf if isinstance(model, ScaffoldModel) else color_slope(model)
        return EyeColors(np.array(places[::step], np.float64), slope)

    def shared_db(self, eyes: np.ndarray) -> float:
        """PSNR, dB, that colours for the middle of the eyes (E, 3), object frame, have at least.

        A splat d away is seen from the middle at an angle of apart / d from an eye's own.
        """
        middle = eyes.mean(axis=0)
        apart = float(np.linalg.norm(eyes - middle, axis=1).max())
        if not (apart > 0 and self.slope > 0 and len(self.places)):
            return math.inf
        away = np.percentile(np.linalg.norm(self.places - middle, axis=1), NEAREST)
        return 20 * math.log10(max(away / (self.slope * apart), 1e-30))


def shared_is_enough(scene: Scene, looks: list[EyeColors], views: list[View]) -> bool:
    """Whether nobody sees that colours are those of the middle of the eyes; a look an object."""
    eyes_world = np.array([view.world_from_eye.position for view in views])
    for obj, look in zip(scene.objects, looks, strict=True):
        if obj.seen:
            object_from_world = np.linalg.inv(obj.world_from_object.matrix())
            eyes = eyes_world @ object_from_world[:3, :3].T + object_from_world[:3, 3]
            if not look.shared_db(eyes) >= SHARED_DB:
                return False
    return True


def eyes_among(views: list[View]) -> list[int]:
    """Of each view the number of its eye: those from one place, a wide view and an inset in it,
    see the same colours.
    """
    places = np.array([view.world_from_eye.position for view in views])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    alike = apart <= SAME_PLACE_M
    first = np.argmax(alike, axis=1)  # of each view, the first one from its place
    return [int(np.flatnonzero(np.unique(first) == each)[0]) for each in first]


def by_eye(views: list[View], own: bool, most: int) -> tuple[list[int], list[list[View]]]:
    """Which set of colours each view has, and the views of each set: own: one an eye, where these
    are no more than `most`; else one for all.
    """
    eyes = eyes_among(views) if own else [0] * len(views)
    if max(eyes) >= most:
        eyes = [0] * len(views)
    groups: list[list[View]] = [[] for _ in range(max(eyes) + 1)]
    for eye, view in zip(eyes, views, strict=True):
        groups[eye].append(view)
    return eyes, groups


def drawn_together(scene: Scene, views: int, own_colors: bool) -> list[slice]:
    """Which views of a frame are decoded and drawn at once: all of them, but one by one where each
    eye is to see its own splats of a model whose shape follows the eye.
    """
    follows = any(obj.seen and follows_eye(obj.model) for obj in scene.objects)
    if own_colors and follows:
        return [slice(i, i + 1) for i in range(views)]
    return [slice(0, views)]
