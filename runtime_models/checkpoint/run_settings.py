"""What a run's settings beside its checkpoint say that changes the picture.

gsplat keeps cfg.yml above ckpts/, ply/ and compression/rank0/; nerfstudio config.yml above
nerfstudio_models/.  Both are YAML with names of Python classes in them: lines are looked at, and
nothing in them is ever made.
"""

import re
from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.splats.plain_splats import COLMAP_UP, RawSplats

FILES = ("cfg.yml", "config.yml")
ABOVE = 3  # folders that are searched, that of the checkpoint first
MOST_BYTES = 1 << 20
TOO_LONG = ""  # the key that says so
LINE = re.compile(
    r"^\s*(antialiased|rasterize_mode|normalize_world_space)\s*:\s*['\"]?(\w+)", re.MULTILINE
)
YES, NO = ("true", "yes", "on"), ("false", "no", "off")  # as YAML has them
TURNED_UP = "+Z"  # both trainers turn their world so, unless they are told not to
GSPLAT_CLOUDS = "ply"  # a folder of a run of gsplat, with its clouds
HOLDERS = ("ckpts", GSPLAT_CLOUDS, "compression", "nerfstudio_models")  # folders of a run


def settings_beside(path: Path) -> tuple[str, dict[str, list[str]]]:
    """(name of the settings' file, what it says) of the run that a path is of; "" without one.

    Looked for beside it, and above it where the folders between are those of a run.
    """
    folder = path.resolve() if path.is_dir() else path.resolve().parent
    for _ in range(ABOVE):
        for name in FILES:
            file = folder / name
            if file.is_file():
                with file.open("rb") as opened:
                    data = opened.read(MOST_BYTES + 1)
                if len(data) > MOST_BYTES:
                    return name, {TOO_LONG: []}
                text = data.decode("utf-8", "replace")
                said: dict[str, list[str]] = {}
                for key, value in LINE.findall(text):
                    if value.lower() not in said.setdefault(key, []):
                        said[key].append(value.lower())
                return name, said
        if not (folder.name in HOLDERS or folder.parent.name in HOLDERS):
            break
        folder = folder.parent
    return "", {}


def with_settings(raw: RawSplats, path: Path) -> RawSplats:
    """The splats as the settings of their run say: drawn antialiased, and what of them is up."""
    name, several = settings_beside(path)
    if TOO_LONG in several:
        what = f"its run's {name} has over {MOST_BYTES:,} bytes"
        found = Finding(what, 0, "not looked at", file=raw.file, repaired=False)
        return replace(raw, findings=(*raw.findings, found))
    said = {key: values[0] for key, values in several.items() if len(values) == 1}
    for key, values in several.items():
        if len(values) > 1:
            found = Finding(
                f"its run's {name} says {key} {len(values)} times: {', '.join(values)[:60]}", 0,
                "read as without it", file=raw.file, repaired=False,
            )  # fmt: skip
            raw = replace(raw, findings=(*raw.findings, found))
    if said.get("antialiased") in YES or said.get("rasterize_mode") == "antialiased":
        found = Finding(
            f"its run's {name} says that it was trained antialiased", 0, "drawn so",
            file=raw.file, repaired=False,
        )  # fmt: skip
        raw = replace(raw, antialiased=True, findings=(*raw.findings, found))
    normal = said.get("normalize_world_space")
    up = COLMAP_UP if normal in NO else TURNED_UP if normal in YES else raw.up
    if up != raw.up:
        how = "was turned" if up == TURNED_UP else "was left as COLMAP has it"
        what = f"its run's {name} says that its world {how}"
        done = f"read with {up} up; --up={raw.up} reads it as without that"
        found = Finding(what, 0, done, file=raw.file, repaired=False)
        raw = replace(raw, up=up, findings=(*raw.findings, found))
    return raw
