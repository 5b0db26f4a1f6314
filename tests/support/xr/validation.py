"""The core validation layer, which pyopenxr brings along: on, and what it had to say."""

import importlib.util
from pathlib import Path


def switched_on(folder: Path) -> dict[str, str]:
    """Variables for a program's environment."""
    layers = Path(importlib.util.find_spec("xr").origin).parent / "api_layer" / "linux_x86_64"
    return {
        "XR_API_LAYER_PATH": str(layers),
        "XR_ENABLE_API_LAYERS": "XR_APILAYER_LUNARG_core_validation",
        "XR_CORE_VALIDATION_EXPORT_TYPE": "text",
        "XR_CORE_VALIDATION_FILE_NAME": str(folder / "validation.txt"),
    }


def complaints(folder: Path) -> list[str]:
    """What the layer told, but for its own beginning and end, which prove that it ran."""
    told = (folder / "validation.txt").read_text().splitlines()
    own = [line for line in told if "Core Validation Layer " in line]
    assert own and len(own) % 2 == 0, told  # a lost session is tried anew, each time from its start
    return [line for line in told if line and line not in own]
