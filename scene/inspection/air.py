"""The air between a camera and a surface: what part of the radiation it lets through.

Passman and Larason's fit for 7.5 to 13 micrometres as FLIR's cameras use and file it (tags
AtmosphericTransAlpha1 ... X), for distances of metres to some hundred:

    water = humidity exp(1.5587 + 0.06939 T - 0.00027816 T^2 + 6.8455e-7 T^3)       g / m^3
    share = X exp(-sqrt(d) (a1 + b1 sqrt(water))) + (1 - X) exp(-sqrt(d) (a2 + b2 sqrt(water)))
"""

from dataclasses import dataclass

from shapeshift.scene.captures.radiometric.flir_run import air_share, water_of

X = 1.9
ALPHAS = (0.006569, 0.01262)
BETAS = (-0.002276, -0.00667)
FARTHEST_M = 1000.0  # beyond it the fit gives what no air does
COLDEST_C, HOTTEST_C = -60.0, 60.0  # of air


@dataclass(frozen=True)
class Air:
    """What lies between.  distance_m 0: nothing."""

    distance_m: float = 0.0
    humidity: float = 50.0  # per cent, relative
    celsius: float = 20.0

    def __post_init__(self) -> None:
        """Refuses what is no air: ValueError, one sentence."""
        for name, value, low, high, unit in (
            ("distance", self.distance_m, 0.0, FARTHEST_M, "metres"),
            ("humidity", self.humidity, 0.0, 100.0, "per cent"),
            ("temperature", self.celsius, COLDEST_C, HOTTEST_C, "°C"),
        ):
            if not low <= value <= high:
                raise ValueError(
                    f"the air's {name} is {value:g}; {low:g} to {high:g} {unit} are wanted."
                )

    @property
    def water(self) -> float:
        """Grams in a cubic metre."""
        return water_of(self.humidity / 100, self.celsius)

    @property
    def transmission(self) -> float:
        """Share of a surface's radiation that arrives, above 0, at most 1."""
        share = air_share(self.distance_m, self.water, (X, *ALPHAS, *BETAS))
        return min(max(share, 1e-3), 1.0)

    def words(self) -> str:
        """Such as "12 m of air, 60 %, 15 °C: 97.3 % arrive"."""
        return (
            f"{self.distance_m:g} m of air, {self.humidity:g} %, {self.celsius:g} °C: "
            f"{100 * self.transmission:.1f} % arrive"
        )


NO_AIR = Air()
