"""Round values along a scale, and how they are written."""

import numpy as np

TICKS = 6


def nice_ticks(low: float, high: float, count: int = TICKS) -> list[float]:
    """About `count` round values (1, 2 or 5 times a power of ten apart) within low..high."""
    if not high > low:
        return [low]
    raw = (high - low) / count
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((1, 2, 5, 10), key=lambda m: abs(np.log(m * power / raw)))
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(i * step) + 0.0 for i in np.arange(first, last + 1)]  # no minus zero


def tick_text(values: list[float]) -> list[str]:
    """The values with as many decimals as their distance needs."""
    step = min(np.diff(values), default=1.0)
    decimals = max(0, int(np.ceil(-np.log10(step) - 1e-9)))
    return [f"{value:.{decimals}f}".replace("-", "\u2212") for value in values]
