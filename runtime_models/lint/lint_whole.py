"""What is wrong with a file as a whole: its coding is another one, it would fill every pixel."""

from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.splats.plain_splats import RawSplats

SAMPLE = 1 << 14  # that are looked at: percentiles of more are the same
TELLING = 100  # splats; fewer tell nothing about the file
BOX = (1, 99)  # percentiles of the positions between which the scene lies
MOST_LAYERS = 2000.0  # splats over every pixel; real files have 2 to 18 (docs/formats.md)
TOO_MANY = 100.0  # splats over every pixel that make a doubtful coding the wrong one
LARGEST_SCENE = 1e12  # metres; squares of distances in it are far from the end of float32
MIN_ALPHA = 1 / 255  # fainter splats are not drawn


@dataclass(frozen=True)
class Sample:
    """Evenly spaced splats of a scene, in our units and float64."""

    sigma: np.ndarray  # (S, 3) metres
    seen: np.ndarray  # (S,) bool: what is not fainter than anything that is drawn
    low: np.ndarray  # (3,) metres: the box in which nearly all of the scene lies
    high: np.ndarray  # (3,)
    part: float  # of all splats that are in the sample, above 0


def sample_of(means: np.ndarray, sigma: np.ndarray, opacity: np.ndarray) -> Sample:
    """A sample of finite splats: means (N, 3) and sigma (N, 3) metres, opacity (N,) 0..1; N > 0."""
    rows = spaced(len(means))
    means = means[rows].astype(np.float64)
    low, high = np.percentile(means, BOX, axis=0)
    seen = opacity[rows] >= MIN_ALPHA
    return Sample(sigma[rows].astype(np.float64), seen, low, high, len(seen) / len(opacity))


def spaced(count: int) -> slice:
    return slice(None, None, max(-(-count // SAMPLE), 1))


def read_coding(raw: RawSplats) -> list[Finding]:
    """Changes raw.log_scales and raw.logits where the numbers are none; what was found.

    Opacities that are no logits: all lie within 0..1 and reach both ends of it, which logits (0.5
    to 0.73 of the light) never have reason to.  Scales that are metres: none is below 0 (the
    logarithm of a metre), as logarithms they would fill the scene, as metres they do not.  A file
    in millimetres has no scale below 0 either, but fills nothing.
    """
    few = slice(0, SAMPLE)
    found: list[Finding] = []
    doubt_opacity = raw.logits and not outside(raw.opacity[few], 0, 1)
    doubt_scales = raw.log_scales and not outside(raw.scales[few], 0, np.inf)
    if not (doubt_opacity or doubt_scales):  # nearly every file
        return found
    means, scales, opacity = filed_sample(raw)
    if len(means) < TELLING:
        return found
    ends = opacity.min() < 0.3 and opacity.max() > 0.9
    if doubt_opacity and ends and not outside(raw.opacity, 0, 1):
        raw.logits = False
        what = f"all {len(raw.means):,} opacities lie within 0..1: they are no logits"
        found.append(Finding(what, len(raw.means), "read as they are", file=raw.file))
    if doubt_scales and not outside(raw.scales, 0, np.inf):
        seen = opacity >= (np.log(MIN_ALPHA / (1 - MIN_ALPHA)) if raw.logits else MIN_ALPHA)
        more = len(raw.means) / len(means)
        with np.errstate(over="ignore"):
            if_logs = more * layers(means, np.exp(scales), seen)
        if_metres = more * layers(means, scales, seen)
        if if_logs > TOO_MANY and if_logs > 10 * if_metres:
            raw.log_scales = False
            what = f"all {len(raw.means):,} scales are at least 0: they are no logarithms"
            found.append(Finding(what, len(raw.means), "read as metres", file=raw.file))
    return found


def outside(array: np.ndarray, low: float, high: float) -> bool:
    """Whether any number lies outside; NaN does not."""
    with np.errstate(invalid="ignore"):  # NaN that signals
        return bool(
            np.fmin.reduce(array, axis=None) < low or np.fmax.reduce(array, axis=None) > high
        )


def filed_sample(raw: RawSplats) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """means (S, 3), scales (S, 3), opacity (S,) as filed, float64, of evenly spaced finite rows."""
    rows = spaced(len(raw.means))
    with np.errstate(invalid="ignore"):  # NaN that signals
        means, scales = raw.means[rows].astype(np.float64), raw.scales[rows].astype(np.float64)
        opacity = raw.opacity[rows].astype(np.float64)
    finite = np.isfinite(means).all(1) & np.isfinite(scales).all(1) & ~np.isnan(opacity)
    return means[finite], scales[finite], opacity[finite]


def fill_ratio(sample: Sample) -> float:
    """How many splats lie over every pixel when the scene fills the picture, at one sigma.

    The sum of the splats' areas over the scene's own: the two longer sides of the box between the
    1st and the 99th percentile of the positions.  No splat counts for more than the scene.
    """
    return layers_in(sample.high - sample.low, sample.sigma, sample.seen) / sample.part


def layers(means: np.ndarray, sigma: np.ndarray, seen: np.ndarray) -> float:
    """The fill ratio of splats (S, 3), (S, 3) metres, (S,) bool."""
    if not len(means):
        return 0.0
    low, high = np.percentile(means, BOX, axis=0)
    return layers_in(high - low, sigma, seen)


def layers_in(size: np.ndarray, sigma: np.ndarray, seen: np.ndarray) -> float:
    """The fill ratio of sigma (S, 3) in a box of that size (3,)."""
    longer = np.sort(np.abs(sigma), axis=1)[:, 1:]  # (S, 2)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        sides = np.sort(size + 2 * np.median(longer[:, 1]))[1:]
        share = np.pi * longer.prod(axis=1) / sides.prod()
    return float(np.where(share < 1, share, 1)[seen].sum())  # NaN, of no area at all, counts 1


def refuse_boundless(file: str, sample: Sample) -> None:
    """BadFile where most positions are no places: wild bytes are finite numbers, too."""
    largest = float((sample.high - sample.low).max())
    if not largest <= LARGEST_SCENE:
        raise BadFile(
            f"{file}: its positions spread over {largest:.3g} m, at most {LARGEST_SCENE:g} m "
            "are a scene: they are no positions in metres; export it again."
        )


def refuse_filling(file: str, sample: Sample) -> None:
    """BadFile where so many splats would lie over every pixel that drawing could halt a machine."""
    ratio = fill_ratio(sample)
    if not ratio <= MOST_LAYERS:
        raise BadFile(
            f"{file}: {ratio:,.0f} splats would lie over every pixel, at most {MOST_LAYERS:,.0f} "
            "are drawn: its scales are no logarithms of metres, or it is broken; export it again, "
            "or add --allow-huge if this is meant."
        )
