"""Numbers of FLIR's radiometric JPEG by flyr, behind the gate: on damaged files it may not end."""

import io
import math
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.gate.refusal import Unreadable


def flir_numbers(path: str, low: float, high: float) -> dict:
    """{"celsius": (H, W) float32 °C as the camera was set, "settings": to what, by flyr's names}.

    low, high: kelvins where the camera's numbers end, see saturation_kelvin; at and beyond them,
    of a black body without air before it, it measured nothing: NaN.  Raises Unreadable.
    """
    import flyr

    try:
        opened = flyr.unpack(io.BytesIO(Path(path).read_bytes()))
        with np.errstate(all="ignore"):  # of a camera set to nonsense: NaN stays
            celsius = np.asarray(opened.celsius, np.float32)
            if high < math.inf:
                apparent = opened.adjust_metadata(
                    emissivity=1.0, object_distance=0.0, ir_window_transmission=1.0
                ).kelvin
                measured = (apparent > low) & (apparent < high)
                celsius = np.where(measured, celsius, np.float32(np.nan))
        told = dict(opened.metadata)
    except MemoryError:
        raise
    except Exception as error:  # of a parser that checks nothing: any
        raise Unreadable(f"its thermal numbers cannot be read ({str(error)[:80]})") from None
    if celsius.ndim != 2 or not celsius.size:
        raise Unreadable(f"its thermal numbers are {celsius.shape}, which is no picture")
    return {"celsius": celsius, "settings": {str(k): v for k, v in told.items() if plain(v)}}


def plain(value: object) -> bool:
    """Whether a setting is a number or a word; others, of dates, nobody asks for."""
    return isinstance(value, str) or (isinstance(value, int | float) and math.isfinite(value))
