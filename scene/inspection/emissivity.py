"""Emissivity: the temperature of a surface, from what a camera sees of it and of what it mirrors.

A surface of emissivity e and temperature T sends e L(T) + (1 - e) L(T_r) to the camera: its own
radiation, and that of what is around it at T_r.  L is Planck's law at 9.8 micrometres, which stands
for the band of thermal cameras (7.5 to 14): temperatures differ by 0.2 °C at most from those by the
whole band, from 0 to 150 °C at emissivities of 0.5 and more.  Of that the air lets a share t
through and adds 1 - t of its own, at its temperature (air.py).
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.radiometric.number_photos import is_radiometric, read_radiometric
from shapeshift.scene.inspection.air import NO_AIR, Air

PLANCK = 14387.77 / 9.8  # kelvins: h c / (wavelength k), CODATA 2018, at 9.8 micrometres
ZERO_C = 273.15  # kelvins
LEAST_EMISSIVITY = 0.1  # below it nearly all that is seen is a mirror image
LEAST_C, MOST_C = -100.0, 3000.0  # of what is reflected
# unit -> (kelvins a unit, kelvins at 0)
KELVINS = {
    "°C": (1.0, ZERO_C),
    "C": (1.0, ZERO_C),
    "K": (1.0, 0.0),
    "°F": (5 / 9, ZERO_C - 160 / 9),
}


@dataclass(frozen=True)
class SurfaceRadiation:
    """What is known of a surface, or what a camera was told of it."""

    emissivity: float = 1.0
    reflected: float = 20.0  # the temperature of what it mirrors, in the unit of the values

    def __post_init__(self) -> None:
        """Refuses what no surface is: ValueError, one sentence."""
        if not LEAST_EMISSIVITY <= self.emissivity <= 1:
            raise ValueError(
                f"the emissivity is {self.emissivity:g}; a number from {LEAST_EMISSIVITY:g} to 1 "
                "is wanted."
            )
        if not LEAST_C <= self.reflected <= MOST_C:
            raise ValueError(
                f"the reflected temperature is {self.reflected:g}; a number from {LEAST_C:g} to "
                f"{MOST_C:g} is wanted."
            )


@dataclass(frozen=True)
class Emission:
    """How values of photos become temperatures of surfaces."""

    surface: SurfaceRadiation = field(default_factory=SurfaceRadiation)
    taken: SurfaceRadiation = field(default_factory=SurfaceRadiation)  # what the camera was set to
    air: Air = NO_AIR  # between the camera and the surface, at the photos
    taken_air: Air = NO_AIR  # what the camera was set to: of this its values are free already

    def corrected(
        self, values: np.ndarray, unit: str, emissivity: float | np.ndarray | None = None
    ) -> np.ndarray:
        """(...) surface temperatures of values (...), both in `unit`; NaN where less arrives than
        what is mirrored.  emissivity: of this surface alone, or (...) of each value's.  Raises
        ValueError: no temperatures.
        """
        share = self.surface.emissivity if emissivity is None else emissivity
        mirrored = radiance(self.surface.reflected, unit)
        was = self.taken.emissivity
        sent = was * radiance(values, unit) + (1 - was) * radiance(self.taken.reflected, unit)
        arrived = through(self.taken_air, sent)
        share_of_air = self.air.transmission
        seen = (arrived - (1 - share_of_air) * radiance(self.air.celsius, "°C")) / share_of_air
        return temperature((seen - (1 - share) * mirrored) / share, unit)

    def growth(self, value: float, unit: str) -> float:
        """How many times as large an error of this value is in the surface's temperature."""
        step = 0.05
        low, high = self.corrected(np.array([value - step, value + step]), unit)
        return float((high - low) / (2 * step))

    def words(self, unit: str) -> str:
        """Such as "emissivity 0.95, 20 °C reflected"."""
        text = (
            f"emissivity {self.surface.emissivity:g}, {self.surface.reflected:g} {unit} reflected"
        )
        if self.air.distance_m > 0:
            text += f", {self.air.words()}"
        if self.taken_air.distance_m > 0:
            text += f"; photos taken with {self.taken_air.words()}"
        if self.taken.emissivity == 1:
            return text
        taken = f"{self.taken.emissivity:g} and {self.taken.reflected:g} {unit}"
        return f"{text}; photos taken with {taken}"


def through(air: Air, sent: np.ndarray) -> np.ndarray:
    """(...) radiances of a surface behind the air, with what the air sends itself."""
    share = air.transmission
    return share * sent + (1 - share) * radiance(air.celsius, "°C")


def radiance(temperatures: np.ndarray | float, unit: str) -> np.ndarray:
    """(...) of a black body, up to a factor.  ValueError: the unit is of no temperature."""
    kelvins_a_unit, at_zero = scale_of(unit)
    kelvins = np.asarray(temperatures, np.float64) * kelvins_a_unit + at_zero
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(kelvins > 0, 1 / np.expm1(PLANCK / kelvins), np.nan)


def temperature(radiances: np.ndarray, unit: str) -> np.ndarray:
    """(...) of the black body that sends this; NaN where nothing is sent."""
    kelvins_a_unit, at_zero = scale_of(unit)
    with np.errstate(divide="ignore", invalid="ignore"):
        kelvins = np.where(radiances > 0, PLANCK / np.log1p(1 / radiances), np.nan)
    return (kelvins - at_zero) / kelvins_a_unit


def scale_of(unit: str) -> tuple[float, float]:
    """Kelvins a unit, and kelvins at its zero.  ValueError, one sentence: it is no temperature."""
    if unit not in KELVINS:
        raise ValueError(
            f"the stop's values are in '{unit}'; emissivity is of temperatures in °C, °F or K."
        )
    return KELVINS[unit]


def camera_settings(path: Path) -> tuple[SurfaceRadiation, Air]:
    """The surface and the air for which a thermal camera made a radiometric JPEG's °C.

    Raises BadFile, one sentence.
    """
    where = path_end(path)
    if not path.is_file():
        raise BadFile(f"{where}: there is no such photo.")
    if not is_radiometric(path):
        raise BadFile(f"{where} is no radiometric JPEG; one of a FLIR camera is wanted.")
    told = read_radiometric(path)[1]
    try:
        surface = SurfaceRadiation(
            float(told["emissivity"]), float(told["reflected_apparent_temperature"]) - ZERO_C
        )
        metres, humidity, kelvins = (
            float(told[name])
            for name in ("object_distance", "relative_humidity", "atmospheric_temperature")
        )
        return surface, Air(metres, 100 * humidity, kelvins - ZERO_C)
    except (KeyError, TypeError, ValueError) as error:
        raise BadFile(
            f"{where}: what its camera was set to is not known ({error}); say it by --taken-with "
            "and --taken-air."
        ) from None
