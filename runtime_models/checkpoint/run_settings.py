"""What a run's settings beside its checkpoint say that changes the picture.

gsplat keeps cfg.yml above ckpts/, ply/ and compression/rank0/; nerfstudio config.yml above
nerfstudio_models/; 3DGS and its kin cfg_args above point_cloud/iteration_N/.  The first two are
YAML with names of Python classes in them, the last is one Namespace(...): lines and words are
looked at, and nothing in them is ever made.
"""

import codecs
import re
from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.splats.plain_splats import COLMAP_UP, RawSplats

NAMESPACE = "cfg_args"
FILES = ("cfg.yml", "config.yml", "cfg.yaml", "config.yaml", NAMESPACE)
ABOVE = 3  # folders that are searched, that of the checkpoint first
MOST_BYTES = 1 << 20
ENCODINGS = (
    (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"),  # before those of UTF-16
    (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"),
    (codecs.BOM_UTF8, "utf-8-sig"),
)  # fmt: skip
NO_TEXT = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f]")  # escapes (1b) may be in logs
SPOILT = "\ufffd"  # what bytes become that are no UTF-8
LINE = re.compile(
    r"^\s*(antialiased|rasterize_mode|normalize_world_space)\s*:\s*['\"]?(\w+)", re.MULTILINE
)
WORD = re.compile(r"[(,]\s*(antialias)(?:ed|ing)\s*=\s*['\"]?(\w+)")  # of cfg_args
YES, NO = ("true", "yes", "on"), ("false", "no", "off")  # as YAML has them
KNOWN = {"antialiased": (*YES, *NO), "rasterize_mode": ("antialiased", "classic")}
TURNED_UP = "+Z"  # both trainers turn their world so, unless they are told not to
GSPLAT_CLOUDS = "ply"  # a folder of a run of gsplat, with its clouds
INRIA_CLOUDS = ("point_cloud", "point_cloud_color", "point_cloud_thermal")  # of 3DGS and its kin
HOLDERS = ("ckpts", GSPLAT_CLOUDS, "compression", "nerfstudio_models", *INRIA_CLOUDS)


def of_run(path: Path) -> bool:
    """Whether a PLY lies where gsplat, or 3DGS and its kin, put those of a run."""
    if path.name == "point_cloud.ply":
        return path.parent.name.startswith("iteration_")
    return path.suffix == ".ply" and path.parent.name == GSPLAT_CLOUDS


def text_of(file: Path) -> tuple[str, str]:
    """(what a file of settings says, ""), or ("", why it cannot be read)."""
    if not file.is_file():
        return "", "is no file"
    try:
        with file.open("rb") as opened:
            data = opened.read(MOST_BYTES + 1)
    except OSError as error:
        return "", f"cannot be opened ({error.strerror})"
    if len(data) > MOST_BYTES:
        return "", f"has over {MOST_BYTES:,} bytes"
    encoding = next((name for mark, name in ENCODINGS if data.startswith(mark)), "utf-8")
    try:  # a path in another code page spoils no setting
        text = data.decode(encoding, "replace" if encoding == "utf-8" else "strict")
    except UnicodeDecodeError:
        return "", f"is no {encoding.upper().removesuffix('-SIG')}, though it begins so"
    return ("", "is no text") if NO_TEXT.search(text) else (text, "")


def settings_beside(path: Path) -> tuple[str, dict[str, list[str]], str]:
    """(name of the settings' file, what it says, why it cannot be read) of the run that a path is
    of; "" without one.

    Looked for beside it, and above it where the folders between are those of a run.
    """
    folder = path.resolve() if path.is_dir() else path.resolve().parent
    for _ in range(ABOVE):
        for name in FILES:
            file = folder / name
            if not file.exists():
                continue
            text, why = text_of(file)
            said: dict[str, list[str]] = {}
            for key, value in (WORD if name == NAMESPACE else LINE).findall(text):
                key = "antialiased" if key == "antialias" else key
                if value.lower() not in said.setdefault(key, []):
                    said[key].append(value.lower())
            if not said and SPOILT in text:
                why = "is no UTF-8"
            return name, said, why
        if not (folder.name in HOLDERS or folder.parent.name in HOLDERS):
            break
        folder = folder.parent
    return "", {}, ""


def with_settings(raw: RawSplats, path: Path) -> RawSplats:
    """The splats as the settings of their run say: drawn antialiased, and what of them is up."""
    name, several, why = settings_beside(path)
    if why:
        done = "not looked at: whether it was trained antialiased is not known"
        found = Finding(f"its run's {name} {why}", 0, done, file=raw.file, repaired=False)
        return replace(raw, findings=(*raw.findings, found))
    said = {key: values[0] for key, values in several.items() if len(values) == 1}
    for key, values in several.items():
        if len(values) > 1:
            found = Finding(
                f"its run's {name} says {key} {len(values)} times: {', '.join(values)[:60]}", 0,
                "read as without it", file=raw.file, repaired=False,
            )  # fmt: skip
            raw = replace(raw, findings=(*raw.findings, found))
    for key, known in KNOWN.items():
        if said.get(key, known[0]) not in known:
            what = f"its run's {name} says {key} {said[key][:40]}, which is unknown"
            found = Finding(what, 0, "read as without it", file=raw.file, repaired=False)
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
