"""Splats as trainers keep them: gsplat's ckpt_N_rank0.pt, nerfstudio's step-N.ckpt, arrays in .npz.

gsplat (examples/simple_trainer.py): splats.means, .scales, .quats, .opacities, .sh0, .shN, or
.colors where a network adds to them.  nerfstudio (models/splatfacto.py):
pipeline._model.gauss_params.means, .scales, .quats, .opacities, .features_dc, .features_rest.
Scales are logarithms, opacities logits, quaternions w x y z.  Nothing of torch is needed, and
nothing in a file is ever run.
"""

import codecs
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.checkpoint.read_torch import INDEX, read_tensors
from shapeshift.runtime_models.colors.spherical_harmonics import C0, COEFFICIENTS
from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.files.npy import read_array
from shapeshift.runtime_models.files.zip_files import member_names, opened_zip
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.splats.plain_splats import (
    COLMAP_UP,
    RawSplats,
    Reading,
    empty_splats,
    fourth_degree,
)
from shapeshift.runtime_models.splats.ply.read_points_ply import splats_of_points

PARTS = {  # what each array is called, by gsplat, by nerfstudio, by others
    "means": ("means", "means3d", "xyz"),
    "scales": ("scales",),
    "quats": ("quats", "quaternions"),
    "opacities": ("opacities", "opacity"),
    "first": ("sh0", "features_dc"),  # of the harmonics
    "rest": ("shN", "features_rest"),
    "colors": ("colors",),
}
ROLES = {name: role for role, names in PARTS.items() for name in names}
GEOMETRY = ("means", "scales", "quats", "opacities")
UP = "+Z"  # both trainers turn their world so that the cameras' up is +Z
FLAT = -80.0  # logarithm of a sigma that 2D splats leave out
WANTED = (
    "wanted are the splats of gsplat (ckpt_*.pt), nerfstudio (step-*.ckpt) or arrays called means, "
    "scales, quats, opacities and sh0"
)


def is_checkpoint(head: bytes, path: Path) -> bool:
    """A zip of torch's (an index of tensors in it) or of numpy's (nothing but arrays)."""
    return head[:2] == b"PK" and path.is_file() and holds_arrays(member_names(path))


def holds_arrays(names: list[str]) -> bool:
    """Whether the members of a zip are torch's or numpy's."""
    by_torch = any(name == INDEX or name.endswith(f"/{INDEX}") for name in names)
    return by_torch or (bool(names) and all(name.endswith(".npy") for name in names))


def read_raw_checkpoint(path: Path, reading: Reading) -> RawSplats:
    """Splats of SH degree 0 to 3, or the coloured points that an .npz holds.  Raises BadFile."""
    reading = reading.within(path)
    memory = reading.account
    reading.report(f"reading {path.name}", 0.0)
    arrays = arrays_of(path, memory)
    lacking = [name for name in GEOMETRY if name not in arrays]
    if set(lacking) == {"scales", "quats", "opacities"}:
        points = splats_of_points(arrays["means"], shades(arrays, path), path.name, reading)
        return replace(points, up=UP)
    if lacking:
        held = ", ".join(arrays) or "none of them"
        raise BadFile(f"{path.name} has no {lacking[0]} (it has {held}); {WANTED}.")
    count = len(arrays["means"])
    coefficients, fill_colors, findings = colors_of(arrays, count, path)
    raw = RawSplats(
        **empty_splats(count, coefficients, memory),
        file=path.name,
        format=f"checkpoint{path.suffix.lower()}",
        up=UP,
        findings=findings,
        memory=memory,
    )
    with np.errstate(over="ignore", invalid="ignore"):  # what is beyond float32 is for the judge
        raw.means[:] = shaped(arrays["means"], (count, 3), "means", path)
        raw.wxyz[:] = shaped(arrays["quats"], (count, 4), "quats", path)
        raw.opacity[:] = shaped(arrays["opacities"], (count,), "opacities", path)
        scales = arrays["scales"]
        if scales.shape == (count, 2):  # of 2DGS
            raw.scales[:, :2], raw.scales[:, 2] = scales, FLAT
        else:
            raw.scales[:] = shaped(scales, (count, 3), "scales", path)
        fill_colors(raw.sh)
    return with_settings(raw, reading.outer or path)


def arrays_of(path: Path, memory: Account) -> dict[str, np.ndarray]:
    """role -> array, as stored.  Raises BadFile where there are two sets of splats, or none."""
    if all(name.endswith(".npy") for name in member_names(path)):
        with opened_zip(path, path.name, memory) as archive:
            names = {n[:-4]: ROLES[n[:-4]] for n in archive.namelist() if n[:-4] in ROLES}
            read = {role: read_array(archive, n, path.name, memory) for n, role in names.items()}
            return {role: array for role, array in read.items() if array is not None}
    found: dict[str, dict[str, np.ndarray]] = {}
    tensors = read_tensors(path, memory, lambda name: name.rpartition(".")[2] in ROLES)
    for name, tensor in tensors.items():
        place, _, last = name.rpartition(".")
        found.setdefault(place, {})[ROLES[last]] = tensor
    whole = {place: arrays for place, arrays in found.items() if arrays.keys() >= set(GEOMETRY)}
    if len(whole) != 1:
        what = f"{len(whole)} sets of splats" if whole else "no splats"
        raise BadFile(f"{path.name} is a file of torch with {what}; {WANTED}.")
    return next(iter(whole.values()))


def shaped(array: np.ndarray, shape: tuple[int, ...], name: str, path: Path) -> np.ndarray:
    """The array as numbers of that shape, a last side of 1 left out.  Raises BadFile."""
    if array.shape == (*shape, 1):
        array = array[..., 0]
    if array.shape != shape or array.dtype.kind not in "fiu":
        raise BadFile(
            f"{path.name}: {name} is {array.dtype} of shape {array.shape!s:.40}, expected {shape}; "
            "save it again."
        )
    return array


def colors_of(
    arrays: dict[str, np.ndarray], count: int, path: Path
) -> tuple[int, Callable[[np.ndarray], None], tuple[Finding, ...]]:
    """(coefficients, what fills them in, findings)."""
    first, rest, colors = (arrays.get(role) for role in ("first", "rest", "colors"))
    if first is not None:
        first = first[:, 0] if first.ndim == 3 else first
        first = shaped(first, (count, 3), "the first harmonics", path)
        more = 0 if rest is None or rest.ndim != 3 else rest.shape[1]
        kept = min(more, COEFFICIENTS[-1] - 1)
        if 1 + kept not in COEFFICIENTS or more not in (*(n - 1 for n in COEFFICIENTS), 24):
            raise BadFile(f"{path.name} has {more} further harmonics; 0, 3, 8, 15 or 24 are known.")
        if rest is not None and more:
            rest = shaped(rest, (count, more, 3), "further harmonics", path)
        # nerfstudio without harmonics keeps logits of colours
        by_logits = more == 0 and rest is not None

        found: tuple[Finding, ...] = ()
        if more > kept and rest is not None:  # SH degree 4
            with np.errstate(over="ignore", invalid="ignore"):
                squares = np.square(rest, dtype=np.float64)
                left_out, whole = float(squares[:, kept:].sum()), float(squares.sum())
            found = (fourth_degree(more - kept, left_out, whole, path.name),)

        def fill_harmonics(sh: np.ndarray) -> None:
            sh[:, 0] = (sigmoid(first) - 0.5) / C0 if by_logits else first
            if kept and rest is not None:
                sh[:, 1:] = rest[:, :kept]

        return 1 + kept, fill_harmonics, found
    if colors is None:
        raise BadFile(f"{path.name} has splats without colours; {WANTED}.")
    what = "colours of which a network makes others, for each photo"
    without = Finding(what, 0, "shown without it", file=path.name, repaired=False)

    logits = shaped(colors, (count, 3), "colors", path)

    def fill_colors(sh: np.ndarray) -> None:
        sh[:, 0] = (sigmoid(logits) - 0.5) / C0

    return 1, fill_colors, (without,)


def sigmoid(logits: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-logits.astype(np.float32)))


def shades(arrays: dict[str, np.ndarray], path: Path) -> np.ndarray | None:
    """(N, 3) float32 0..1 of points' colours, in bytes or numbers; None without."""
    colors = arrays.get("colors")
    if colors is None:
        return None
    colors = shaped(colors, (len(arrays["means"]), 3), "colors", path)
    most = np.iinfo(colors.dtype).max if colors.dtype.kind in "iu" else 1
    return colors.astype(np.float32) / np.float32(most)


# What a run's settings beside its checkpoint say that changes the picture.
#
# gsplat keeps cfg.yml above ckpts/, ply/ and compression/rank0/; nerfstudio config.yml above
# nerfstudio_models/; 3DGS and its kin cfg_args above point_cloud/iteration_N/.  The first two are
# YAML with names of Python classes in them, the last is one Namespace(...): lines and words are
# looked at, and nothing in them is ever made.

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
