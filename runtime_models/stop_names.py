"""What a stop shows, by its name: thermal images, colour photographs, or a layer of something."""

import re

COLOR_NAMES = {"rgb", "color", "colour", "visible", "images", "photo"}
THERMAL_PARTS = ("therm", "lwir", "infrared")  # anywhere in a name
THERMAL_WORDS = {"ir", "tir", "flir"}  # alone, between other signs than letters


def guess_kind(name: str, stops: int) -> str:
    """One of STOP_KINDS; `stops` = how many there are: a single one that says nothing is colour."""
    if is_thermal_name(name):
        return "thermal"
    return "rgb" if name.lower() in COLOR_NAMES or stops == 1 else "layer"


def is_thermal_name(name: str) -> bool:
    low = name.lower()
    words = re.split(r"[^a-z]+", low)
    return any(part in low for part in THERMAL_PARTS) or not THERMAL_WORDS.isdisjoint(words)


def stems_named(stems: list[str]) -> list[str]:
    """Names of stops from those of files: numbers that only put them in order ("2_fire") go.

    They stay where a file would have no name without, or where two would have the same.
    """
    words = [re.sub(r"^[0-9]+[ _.-]+", "", stem) for stem in stems]
    return words if all(words) and len(set(words)) == len(stems) else stems
