"""What a name says of a stop or of a photo: heat, visible light, or nothing of the two."""

import re
from functools import lru_cache

COLOR_NAMES = {"rgb", "color", "colour", "visible", "images", "photo"}
THERMAL_PARTS = (
    "thermal", "thermog", "thermic", "thermisch", "termic", "termogra", "warmebild", "wärmebild",
    "waermebild", "lwir", "mwir", "infrared", "infrarot", "infrarouge", "infrarroj", "thermique",
    "红外", "紅外", "赤外", "热成像", "熱成像", "熱画像", "적외선", "열화상", "теплов", "инфракрас",
)  # fmt: skip  # anywhere in a word
# Words with such a part that are about something else: places, and light that is no heat.
NOT_THERMAL = (
    "geothermal", "hydrothermal", "isothermal", "nearinfrared", "nahinfrarot", "近红外", "近紅外",
    "近赤外",
)  # fmt: skip
# Whole words.  What cameras write: irx is Autel's, thrm an older one of DJI's, boson and lepton
# are FLIR's.
THERMAL_WORDS = re.compile(
    r"ir|tir|flir|irx|thrm|boson|lepton|heat|wärme|waerme|therm"
    r"|thermo(cam\w*|ima\w*|vision|s(can|hot)s?)?"
    r"|ir(cam|camera|img|image|images|photo|photos)"
)
# Makers, models and parts of cameras of heat, which are words of other things as well.
MAKERS_OF_HEAT = set(
    "th tau seek quark hik hikmicro infiray iray topdon testo fluke optris xenics wiris workswell "
    "bolometer microbolometer uncooled radiometric temperature temperatures kelvin celsius flirone "
    "xt".split()
)
MODELS_OF_HEAT = {"h20t", "h30t", "m30t", "m3t", "m4t", "m2ea", "p2pro", "p2_pro", "vue_pro",
                  "vuepro", "duo_pro", "duopro"}  # fmt: skip
BESIDE_MAKERS = {"cam", "camera", "sensor", "left", "right", "image", "images", "pro", "raw"}
LIGHT_WORDS = {
    "rgb", "color", "colour", "colors", "colours", "visible", "visual", "vis", "optical", "wide",
    "zoom", "eo",
}  # fmt: skip
LETTERS = re.compile(r"[^\W\d_]+")
DIGITS = re.compile(r"\d+")
NEAR = re.compile(r"near[\W_]*infra[\W_]*red", re.IGNORECASE)  # light: a lamp's, no heat
# Two words of a thing or a place that is photographed, by whatever camera.
HEAT_THING = re.compile(
    r"(heat|thermal)[\W_]*(pump|exchanger|sink|gun|shield|bath|spring|spa|plant|insulation|paste)",
    re.IGNORECASE,
)
# The words of "thermalCam", "leftIR" and "IRcam".
CAMEL = re.compile(r"(?:LW|MW|T)?IR(?![A-Z])|RGB(?![A-Z])|[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def guess_kind(name: str, stops: int) -> str:
    """One of STOP_KINDS; `stops` = how many there are: a single one that says nothing is colour."""
    if is_thermal_name(name):
        return "thermal"
    return "rgb" if name.lower() in COLOR_NAMES or stops == 1 else "layer"


def is_thermal_name(name: str) -> bool:
    return any(map(is_thermal_word, words_of(name)))


def is_thermal_word(word: str) -> bool:
    """Of a word as words_of gives it."""
    part = any(part in word for part in THERMAL_PARTS)
    return (part and word not in NOT_THERMAL) or THERMAL_WORDS.fullmatch(word) is not None


def is_heat_maker(name: str) -> bool:
    """Whether a folder may be called by a camera of heat: what is in it has to say the same."""
    words = set(words_of(name)) - BESIDE_MAKERS
    return name.lower() in MODELS_OF_HEAT or (bool(words) and words <= MAKERS_OF_HEAT)


def sort_of_name(name: str) -> str:
    """The kind "thermal" or "rgb" that a name says, by its words; "": neither, or both."""
    return _sort_of_shape(DIGITS.sub("0", name))


@lru_cache(maxsize=4096)
def _sort_of_shape(shape: str) -> str:
    """Of a name whose numbers are all 0: thousands of photos have one."""
    words = words_of(shape)
    thermal, light = any(map(is_thermal_word, words)), not LIGHT_WORDS.isdisjoint(words)
    thermal |= light and "t" in words  # "RGB-T"
    return "" if thermal == light else "thermal" if thermal else "rgb"


@lru_cache(maxsize=4096)
def words_of(name: str) -> tuple[str, ...]:
    """The words of a name, in small letters: between other signs, digits, and capitals.

    Letters between digits are none ("a3ir9f"): such names are made up by a program.
    """
    words: list[str] = []
    for token in re.split(r"[\W_]+", HEAT_THING.sub(r"\2", NEAR.sub("nearinfrared", name))):
        if len(found := LETTERS.findall(token)) == 1:
            inside = CAMEL.findall(found[0])
            whole = len("".join(inside)) < len(found[0])  # other letters than ASCII's
            words += map(str.lower, found if whole else inside)
    return tuple(dict.fromkeys(words))


def stems_named(stems: list[str]) -> list[str]:
    """Names of stops from those of files: numbers that only put them in order ("2_fire") go.

    They stay where a file would have no name without, or where two would have the same.
    """
    words = [re.sub(r"^[0-9]+[ _.-]+", "", stem) for stem in stems]
    return words if all(words) and len(set(words)) == len(stems) else stems
