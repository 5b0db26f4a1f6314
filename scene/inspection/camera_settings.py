"""What a thermal camera was set to, as its radiometric JPEG says."""

from pathlib import Path

from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.radiometric.number_photos import is_radiometric, read_radiometric
from shapeshift.scene.inspection.air import Air
from shapeshift.scene.inspection.emissivity import ZERO_C, SurfaceRadiation


def camera_settings(path: Path) -> tuple[SurfaceRadiation, Air]:
    """The surface and the air for which a photo's °C were made.  Raises BadFile, one sentence."""
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
