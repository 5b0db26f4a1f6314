"""What is wrong with a file as a whole: its coding is another one, it would fill every pixel."""

import numpy as np

from runtime_models.model import BadFile, Finding
from runtime_models.plain_splats import RawSplats

SAMPLE = 1 << 14  # rows that are looked at: percentiles of more are the same
TELLING = 100  # splats; fewer tell nothing about the file
BOX = (1, 99)  # percentiles of the positions between which the scene lies
MOST_LAYERS = 2000.0  # splats over every pixel; real files have 2 to 18 (docs/formats.md)
TOO_MANY = 100.0  # splats over every pixel that make a doubtful coding the wrong one
LARGEST_SCENE = 1e12  # metres; squares of distances in it are far from the end of float32
MIN_ALPHA = 1 / 255  # fainter splats are not drawn


def sample_of(raw: RawSplats) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """means (S, 3), scales (S, 3), opacity (S,) as filed, float64, of evenly spaced finite rows."""
    rows = slice(None, None, max(-(-len(raw.means) // SAMPLE), 1))
    with np.errstate(invalid="ignore"):  # NaN that signals
        means, scales = raw.means[rows].astype(np.float64), raw.scales[rows].astype(np.float64)
        opacity = raw.opacity[rows].astype(np.float64)
    finite = np.isfinite(means).all(1) & np.isfinite(scales).all(1) & ~np.isnan(opacity)
    return means[finite], scales[finite], opacity[finite]


def read_coding(raw: RawSplats) -> list[Finding]:
    """Changes raw.log_scales and raw.logits where the numbers are none; what was found.

    Scales that are metres: none is below 0 (the logarithm of a metre), as logarithms they would
    fill the scene, as metres they do not.  A file in millimetres has no scale below 0 either, but
    fills nothing.  Opacities that are no logits: all lie within 0..1 and reach both ends of it,
    which logits (0.5 to 0.73 of the light) never have reason to.
    """
    means, scales, opacity = sample_of(raw)
    found = []
    if len(means) < TELLING:
        return found
    part = len(means) / len(raw.means)
    spread = 0 <= opacity.min() < 0.3 and 0.9 < opacity.max() <= 1
    if raw.logits and spread and all_within(raw.opacity, 0, 1):
        raw.logits = False
        what = f"all {len(raw.means):,} opacities lie within 0..1: they are no logits"
        found.append(Finding(what, len(raw.means), "read as they are", file=raw.file))
    if raw.log_scales and scales.min() >= 0 and all_within(raw.scales, 0, np.inf):
        seen = fainter_out(opacity, raw.logits)
        with np.errstate(over="ignore"):
            if_logs = layers(means, np.exp(scales), seen) / part
        if_metres = layers(means, scales, seen) / part
        if if_logs > TOO_MANY and if_logs > 10 * if_metres:
            raw.log_scales = False
            what = f"all {len(raw.means):,} scales are at least 0: they are no logarithms"
            found.append(Finding(what, len(raw.means), "read as metres", file=raw.file))
    return found


def all_within(array: np.ndarray, low: float, high: float) -> bool:
    """Whether every number that is one lies there; the sample alone might miss a few."""
    with np.errstate(invalid="ignore"):  # NaN that signals
        return np.fmin.reduce(array, axis=None) >= low and np.fmax.reduce(array, axis=None) <= high


def fill_ratio(raw: RawSplats) -> float:
    """How many splats lie over every pixel when the scene fills the picture, at one sigma.

    The sum of the splats' areas over the scene's own: the two longer sides of the box between the
    1st and the 99th percentile of the positions.  No splat counts for more than the scene.
    """
    means, scales, opacity = sample_of(raw)
    with np.errstate(over="ignore"):
        sigma = np.exp(scales) if raw.log_scales else scales
    part = len(means) / max(len(raw.means), 1)
    return layers(means, sigma, fainter_out(opacity, raw.logits)) / part if part else 0.0


def fill_of(means: np.ndarray, sigma: np.ndarray, opacity: np.ndarray) -> float:
    """The same of splats in our units: means (N, 3), sigma (N, 3) metres, opacity (N,) 0..1."""
    rows = slice(None, None, max(-(-len(means) // SAMPLE), 1))
    looked_at = means[rows].astype(np.float64)
    part = len(looked_at) / len(means)
    return layers(looked_at, sigma[rows].astype(np.float64), opacity[rows] >= MIN_ALPHA) / part


def fainter_out(opacity: np.ndarray, logits: bool) -> np.ndarray:
    """(S,) bool: splats that can be seen at all."""
    return opacity >= (np.log(MIN_ALPHA / (1 - MIN_ALPHA)) if logits else MIN_ALPHA)


def layers(means: np.ndarray, sigma: np.ndarray, seen: np.ndarray) -> float:
    """fill_ratio of splats (S, 3), (S, 3) metres."""
    if not len(means):
        return 0.0
    longer = np.sort(np.abs(sigma), axis=1)[:, 1:]  # (S, 2)
    low, high = np.percentile(means, BOX, axis=0)
    sides = np.sort(high - low + 2 * np.median(longer[:, 1]))[1:]
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        share = np.pi * longer.prod(axis=1) / sides.prod()
    return float(np.where(share < 1, share, 1)[seen].sum())  # NaN, of no area at all, counts 1


def refuse_boundless(raw: RawSplats) -> None:
    """BadFile where most positions are no places: wild bytes are finite numbers, too."""
    means, _, _ = sample_of(raw)
    low, high = np.percentile(means, BOX, axis=0)
    largest = float((high - low).max())
    if not largest <= LARGEST_SCENE:
        raise BadFile(
            f"{raw.file}: its positions spread over {largest:.3g} m, at most {LARGEST_SCENE:g} m "
            "are a scene: they are no positions in metres; export it again."
        )


def refuse_filling(raw: RawSplats, allow_huge: bool) -> None:
    """BadFile where so many splats would lie over every pixel that drawing could halt a machine."""
    ratio = fill_ratio(raw)
    if not (ratio <= MOST_LAYERS or allow_huge):
        raise BadFile(
            f"{raw.file}: {ratio:,.0f} splats would lie over every pixel, at most "
            f"{MOST_LAYERS:,.0f} are drawn: its scales are no logarithms of metres, or it is "
            "broken; export it again, or add --allow-huge if this is meant."
        )
