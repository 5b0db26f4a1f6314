"""Numbers of FLIR's radiometric JPEG by flyr, behind the gate: on damaged files it may not end."""

import io
import math
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.gate.refusal import Unreadable

WATER = (1.5587, 0.06939, -0.00027816, 6.8455e-7)  # of powers of T in °C
KELVIN = 273.15
FIT = ("x", "alpha1", "alpha2", "beta1", "beta2")  # of the air, as flyr calls them
PNG, END = b"\x89PNG\r\n", b"IEND\xaeB`\x82"


def water_of(humidity: float, celsius: float) -> float:
    """Grams in a cubic metre of air of a relative humidity (0 to 1)."""
    return humidity * math.exp(sum(c * celsius**power for power, c in enumerate(WATER)))


def air_share(metres: float, water: float, fit: tuple[float, float, float, float, float]) -> float:
    """Share of radiation that so much air lets through; fit: X, both alphas, both betas."""
    x, alpha1, alpha2, beta1, beta2 = fit
    far, wet = math.sqrt(metres), math.sqrt(water)
    first, second = math.exp(-far * (alpha1 + beta1 * wet)), math.exp(-far * (alpha2 + beta2 * wet))
    return x * first + (1 - x) * second


def through_whole_air(opened):
    """A photo of flyr's through air of its whole distance.

    flyr takes two halves of the way, each with the share of half the distance, which falls with
    its root: more than FLIR's S = E t B(T) + (1 - E) t B(reflected) + (1 - t) B(air) with t of the
    whole.  Each half is given the root of that t here, by alpha alone over a way of 2 m.
    """
    told = opened.metadata
    fit = tuple(told[f"atmospheric_trans_{name}"] for name in FIT)
    water = water_of(told["relative_humidity"], told["atmospheric_temperature"] - KELVIN)
    share = air_share(told["object_distance"], water, fit)
    if not 0 < share < math.inf:
        raise ValueError("its camera's air lets nothing through")
    return opened.adjust_metadata(
        object_distance=2.0,
        atmospheric_trans_x=1.0,
        atmospheric_trans_alpha1=-math.log(share) / 2,
        atmospheric_trans_beta1=0.0,
        atmospheric_trans_alpha2=0.0,
        atmospheric_trans_beta2=0.0,
    )


def flir_numbers(path: str, low: float, high: float) -> dict:
    """{"celsius": (H, W) float32 °C as the camera was set, "settings": to what, by flyr's names}.

    low, high: kelvins where the camera's numbers end, see saturation_kelvin; at and beyond them,
    of a black body without air before it, it measured nothing: NaN.  Raises Unreadable.
    """
    import flyr

    data = Path(path).read_bytes()
    try:
        opened = flyr.unpack(io.BytesIO(data))
        with np.errstate(all="ignore"):  # of a camera set to nonsense: NaN stays
            celsius = np.asarray(through_whole_air(opened).celsius, np.float32)
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
        why = str(error)[:80]
        if "truncated" in why and END in data[max(data.find(PNG), 0) :]:
            why = "they are a PNG of more bytes than numbers, of which flyr reads a part"
        raise Unreadable(f"its thermal numbers cannot be read ({why})") from None
    if celsius.ndim != 2 or not celsius.size:
        raise Unreadable(f"its thermal numbers are {celsius.shape}, which is no picture")
    return {"celsius": celsius, "settings": {str(k): v for k, v in told.items() if plain(v)}}


def plain(value: object) -> bool:
    """Whether a setting is a number or a word; others, of dates, nobody asks for."""
    return isinstance(value, str) or (isinstance(value, int | float) and math.isfinite(value))
