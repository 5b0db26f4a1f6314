"""Keeps the splats that show most, where a scene has more than a device or a budget holds."""

from dataclasses import replace

import numpy as np

from runtime_models.model import Finding, SplatLayers

ROWS = ("means", "scales", "wxyz", "opacity", "sh", "layer", "labels")  # of SplatLayers


def thin(layers: SplatLayers, most: int) -> SplatLayers:
    """The `most` splats with the greatest prominence, in their order; all of them where most is 0.

    Of equals the earlier stay.  A finding says how many went.
    """
    count = layers.splat_count
    if not 0 < most < count:
        return layers
    kept = largest(prominence(layers), most)
    arrays = {name: getattr(layers, name) for name in ROWS}
    found = Finding(
        f"{count:,} splats, --max-splats asks for {most:,}",
        0,
        f"the {most:,} that show most are kept",
        file=", ".join(layers.provenance.get("files", ())[:3]),
    )
    return replace(
        layers,
        **{name: array[kept] for name, array in arrays.items() if array is not None},
        extra={name: column[kept] for name, column in layers.extra.items()},
        findings=(*layers.findings, found),
    )


def prominence(layers: SplatLayers) -> np.ndarray:
    """(N,) float32: opacity times the area of the ellipse of the two larger scales."""
    _, middle, most = np.sort(layers.scales, axis=1).T
    return layers.opacity * middle * most


def largest(values: np.ndarray, count: int) -> np.ndarray:
    """(count,) rows of the largest values, rising; of equal values the earlier rows."""
    limit = np.partition(values, len(values) - count)[len(values) - count]
    kept = values > limit
    equal = np.flatnonzero(values == limit)
    kept[equal[: count - np.count_nonzero(kept)]] = True
    return np.flatnonzero(kept)
