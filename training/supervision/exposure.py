"""How bright each photo is compared with the others of its modality, found while the model learns.

A camera that chooses exposure and white balance by itself shows the same thing in other colours in
each photo.  A photo is taken to be the model's picture times a gain a channel; targets are photos
over their gains.  The gains' median over a modality is 1, so that the model has the middle of them;
middle and spread are medians, so that single dark photos, or wrong poses, change no other photo.

A model that is not trained to the end, or cannot show everything, leaves gains of a few percent
where there are none.  NOISE of them is taken for that, and with it a share of all gains (Wiener's
filter): where photos do not differ by more, nothing is changed.  A model that does not show the
photos yet, such as the fog that a run from random points begins with, says nothing of them.

Gains that follow where the cameras stand, another in each channel, are no camera's doing: they are
what a model of normal maps that is not sharp yet lacks at the sides that a view shows.
"""

import numpy as np

from shapeshift.training.evaluation.metrics import psnr
from shapeshift.training.heads.networks import KERNELS
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.schedule import LIGHT_FROM

# Photos are looked at from this share of the run on, before which the model shows too little, or
# after so many visits of each if that is earlier: in long runs colours that depend on the view
# learn the brightness of single photos instead.
FROM, VISITS = 0.25, 2.5
NOISE = 0.04  # standard deviation of the gains' logarithms; docs/bench/exposure.csv
LIKE = 0.8  # squared correlation of drawings and photos, median; docs/bench/exposure.csv
# Of exposures with some white balance 0.93 of the gains' variance is common to the channels, of
# channels that know nothing of each other a third.  A quadric of the camera's place foretells 0.80
# of the variance in normal maps, below 0.4 of chance gains.  docs/bench/README.md, "Brightness".
COMMON, BY_PLACE = 0.6, 0.4
OUTLIER = 2.0  # standard deviations, beyond which a gain tells no more of the others
FEWEST = 6  # known photos of a modality, and half of them: then a mean means something
NORMAL = 1.4826  # standard deviations a median deviation, of a normal spread
MOST = 4.0  # times brighter or darker; beyond it is no exposure
SATURATED = 254 / 255  # as in kernels/exposure.cl
Gain = tuple[float, float, float]  # of red, green and blue
NONE: Gain = (1.0, 1.0, 1.0)


class Exposures:
    """The gains of a run's photos."""

    def __init__(
        self, device, photos: dict[str, list[LoadedPhoto]], one_exposure: bool = False
    ) -> None:
        """one_exposure: the photos are known to have it, and none is looked at."""
        self.device, self.one_exposure = device, one_exposure
        self.kernel = device.program(KERNELS / "exposure.cl")["exposure_rows"]
        names = [(photo.modality, photo.name) for each in photos.values() for photo in each]
        self.row = {name: row for row, name in enumerate(names)}
        self.rows = {m: [self.row[m, p.name] for p in each] for m, each in photos.items()}
        views = [photo.view for each in photos.values() for photo in each]
        self.eyes = np.array([v.world_from_eye.position for v in views], np.float64).reshape(-1, 3)
        self.log_gain = np.full((len(names), 3), np.nan)  # NaN: not looked at yet
        self.correlation = np.full(len(names), np.nan)  # squared correlation with what was drawn
        self.begin = FROM  # share of the run from which on photos are looked at
        self.begin_step = VISITS * len(names)  # or this step, if it comes first
        self.nothing = device.zeros(1)
        self.light_stands = False  # the run goes on from a scene whose light was learned before

    def update(self, photo: LoadedPhoto, image, rgba) -> None:
        """Learn from what is drawn (3, H, W) of a photo, and its bytes; both on the device."""
        width, height = photo.view.size
        masked, weight = int(photo.weight is not None), self.nothing
        if masked:
            weight = self.device.upload(np.ascontiguousarray(photo.weight, np.float32))
        rows = self.device.empty(6 * 3 * height)
        self.device.launch(
            self.kernel, 3 * height, 1, width, height, masked, image, rgba, weight, rows
        )
        sums = self.device.download(rows).reshape(6, 3, height).sum(axis=2, dtype=np.float64)
        row = self.row[photo.modality, photo.name]
        self.log_gain[row] = log_gain(product=sums[4], square=sums[3])
        self.correlation[row] = correlation(*sums)

    def has_begun(self, fraction: float, step: int) -> bool:
        """Whether photos are looked at, at this share of the run and after so many steps."""
        if self.one_exposure:
            return False
        return fraction >= self.begin or step >= self.begin_step

    def reset(self, fraction: float, step: int) -> None:
        """The picture was lost here: begin anew, as late as from the start."""
        self.log_gain[:], self.correlation[:] = np.nan, np.nan
        self.begin = fraction + FROM
        self.begin_step = step + VISITS * len(self.row)

    def known(self, modality: str) -> np.ndarray | None:
        """(n, 3) logarithms of the gains of a modality's photos that were looked at.

        None while they are too few, or the model shows too little of its photos.
        """
        logs, like = (of[self.rows[modality]] for of in (self.log_gain, self.correlation))
        seen = np.asarray(np.isfinite(logs).all(axis=1))
        enough = seen.sum() >= max(FEWEST, len(seen) / 2) and np.median(like[seen]) >= LIKE
        return logs[seen] if enough else None

    def seen_from(self, modality: str) -> np.ndarray:
        """(n, 3) metres: the places of the cameras of the photos in `known`."""
        rows = np.array(self.rows[modality])
        return self.eyes[rows[np.isfinite(self.log_gain[rows]).all(axis=1)]]

    def spread(self, modality: str) -> float:
        """Of the logarithms of a modality's gains, by their median deviation, as a standard one.

        0 while nothing is known of them, or where gains follow the cameras' places and have little
        in common.
        """
        known = self.known(modality)
        if known is None:
            return 0.0
        away = known - np.median(known, axis=0)
        each = NORMAL * np.median(np.abs(away), axis=0)
        spread = float(np.sqrt((each**2).mean()))
        if not spread > NOISE:  # nothing is evened out; no need to ask why
            return spread
        usual = np.clip(away, -OUTLIER * each, OUTLIER * each)
        alike = common(usual) >= COMMON
        return spread if alike or by_place(usual, self.seen_from(modality)) <= BY_PLACE else 0.0

    def alike(self, modality: str) -> bool:
        """Whether the photos of a modality are known to have one exposure.

        Else light by direction would learn the brightness of each photo, as no two are taken from
        one place.  Fewer than FEWEST never tell, and count as alike.
        """
        if self.one_exposure or len(self.rows[modality]) < FEWEST:
            return True
        return self.known(modality) is not None and self.spread(modality) <= NOISE

    def light_rests(self, modality: str, fraction: float) -> bool:
        """Whether light by direction learns nothing from a photo of a modality, at this share of
        the run.  Where it stands already, it rests only once exposures are known to differ.
        """
        if self.light_stands:
            return self.known(modality) is not None and not self.alike(modality)
        return fraction < LIGHT_FROM or not self.alike(modality)

    def gain(self, photo: LoadedPhoto) -> Gain:
        """What the photo's colours are times the model's; NONE where all photos are alike."""
        own = self.log_gain[self.row[photo.modality, photo.name]]
        spread = self.spread(photo.modality)
        if not (spread > NOISE and np.isfinite(own).all()):
            return NONE
        middle = np.nanmedian(self.log_gain[self.rows[photo.modality]], axis=0)
        share = 1 - (NOISE / spread) ** 2
        return tuple(np.exp(share * (own - middle)).tolist())

    def warnings(self) -> list[str]:
        """A sentence for each modality whose photos were evened out."""
        return [
            f"{name}: its photos differ in brightness by {100 * spread:.0f} % (one standard "
            "deviation); that was evened out.  Held-out photos keep theirs: eval also scores them "
            "with their colours fitted."
            for name in self.rows
            if (spread := self.spread(name)) > NOISE
        ]

    def state(self) -> dict[str, np.ndarray]:
        known = {"log_gain": self.log_gain.copy(), "correlation": self.correlation.copy()}
        known["begin"] = np.array([self.begin, self.begin_step])
        return {f"exposure.{n}": array for n, array in known.items()}

    def load(self, state: dict[str, np.ndarray]) -> None:
        """Of `state`; a checkpoint that has none, or that of other photos, leaves them unknown."""
        kept = state.get("exposure.log_gain")
        if kept is not None and kept.shape == self.log_gain.shape:
            self.log_gain = kept.copy()
            self.begin, self.begin_step = map(float, state["exposure.begin"])
            self.correlation = state["exposure.correlation"].copy()


def common(values: np.ndarray) -> float:
    """The share of the variance of values (N, c) that their means over c have; no variance: 1."""
    variance = values.var(axis=0).mean()
    return float(values.mean(axis=1).var() / variance) if variance > 0 else 1.0


def by_place(values: np.ndarray, eyes: np.ndarray) -> float:
    """The share, at most 1, of the variance of values (N, c) that places (N, 3) foretell.

    By least squares of 1, the coordinates and the square of the distance from the middle, which
    holds the square of the distance from any point; each row foretold by all others.
    """
    away = eyes - eyes.mean(axis=0)
    terms = np.column_stack([away, (away**2).sum(axis=1)])
    terms = terms - terms.mean(axis=0)
    terms /= np.maximum(np.abs(terms).max(axis=0), 1e-12)
    basis, sizes, _ = np.linalg.svd(np.column_stack([np.ones(len(eyes)), terms]), False)
    basis = basis[:, sizes > 1e-6 * sizes[0]]
    left = values - basis @ (basis.T @ values)
    left /= np.maximum(1 - (basis**2).sum(axis=1, keepdims=True), 1e-6)  # without the row itself
    variance = ((values - values.mean(axis=0)) ** 2).sum()
    return float(1 - (left**2).sum() / variance) if variance > 0 else 0.0


def log_gain(product: np.ndarray, square: np.ndarray) -> np.ndarray:
    """Logarithm of the gains of sums of drawn * photo and drawn^2; where nothing is drawn, 0."""
    known = (square > 0) & (product > 0)
    ratio = np.where(known, product, 1) / np.where(known, square, 1)
    return np.log(np.clip(ratio, 1 / MOST, MOST))


def correlation(count, drawn, photo, drawn2, product, photo2) -> float:
    """Squared correlation, with its sign, by sums over pixels, each (3,) a channel.

    0 where either has no contrast.
    """
    each = np.maximum(count, 1e-9)
    ours, own = ((b - a * a / each).sum() for a, b in ((drawn, drawn2), (photo, photo2)))
    both = (product - drawn * photo / each).sum()
    return float(both * abs(both) / (ours * own)) if min(ours, own) > 1e-6 * count.sum() else 0.0


def fitted_psnr(image: np.ndarray, photo: LoadedPhoto, wanted: np.ndarray) -> float:
    """dB of the right half of a picture (H, W, 3), its colours fitted on the left half.

    wanted: the photo over the background.  What a held-out photo's own exposure costs is not the
    model's fault; the half on which it is fitted is not scored.
    """
    middle = image.shape[1] // 2
    if not middle:
        return psnr(image, wanted, photo.weight)
    weight = np.ones(image.shape[:2]) if photo.weight is None else photo.weight
    counts = weight * (photo.rgba[..., 3] / 255) * (wanted < SATURATED).all(axis=2)
    left = np.clip(image[:, :middle], 0, 1).astype(np.float64)
    product = np.einsum("yx,yxc,yxc->c", counts[:, :middle], left, wanted[:, :middle])
    square = np.einsum("yx,yxc,yxc->c", counts[:, :middle], left, left)
    fitted = np.clip(image[:, middle:], 0, 1) * np.exp(log_gain(product, square))
    right = None if photo.weight is None else photo.weight[:, middle:]
    if right is not None and not right.any():
        return psnr(image, wanted, photo.weight)
    return psnr(fitted, wanted[:, middle:], right)
