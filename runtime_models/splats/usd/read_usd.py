"""USD scenes (.usd, .usda, .usdc, .usdz) with ParticleField3DGaussianSplat, of OpenUSD 26.03 on.

Read by the package usd-core, an optional one, behind the gate (usd_run.py): its C++ ends the
process on some damaged files.
"""

import importlib.util
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import COEFFICIENTS
from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.files.zip_files import member_names
from shapeshift.runtime_models.gate.gate import ask, in_utf8
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.program import package_words
from shapeshift.runtime_models.splats.placed_splats import instances, joined
from shapeshift.runtime_models.splats.plain_splats import (
    COLMAP_UP,
    RawSplats,
    Reading,
    empty_splats,
)
from shapeshift.runtime_models.splats.usd.usd_run import HARMONICS, KIND

PACKAGE = "usd-core"
MARKS = (b"#usda", b"PXR-USDC")
ENDINGS = (".usd", ".usda", ".usdc")
CENTIMETRE = 0.01  # metres a unit, where a stage does not say, by USD's own rule
GRAY = 0.0  # of a first harmonic that is not there: 0.5
LEAVES_AXES = "gsplat2USD"  # NVIDIA's: up to 0.1.5, in the layer's comment, whatever its upAxis
MOST_DEGREE = 3  # of the harmonics that are drawn
Read = Callable[[str], np.ndarray | None]


def is_usd(head: bytes, path: Path) -> bool:
    """By the first bytes, or a zip whose first file is USD."""
    if head[:2] != b"PK":
        return head.startswith(MARKS)
    names = member_names(path) if path.is_file() else []
    return bool(names) and names[0].lower().endswith(ENDINGS)


def refuse_without(path: Path) -> None:
    """BadFile where the package that reads and writes USD is not installed."""
    if importlib.util.find_spec("pxr") is None:
        raise BadFile(
            f"{path.name} is USD, which needs the package {PACKAGE}: {package_words(PACKAGE)} "
            "installs it"
        )


def read_raw_usd(path: Path, reading: Reading) -> RawSplats:
    """The visible splats of a scene where its prims stand, SH degree 0 to 3.  Raises BadFile."""
    refuse_without(path)
    reading = reading.within(path)
    memory = reading.account
    reading.report(f"reading {path.name}", 0.0)
    with in_utf8(path.resolve()) as name:
        read_by_usd = ask("USD", path, [name], memory=memory.left)
    arrays, facts = read_by_usd["arrays"], read_by_usd["facts"]
    memory.charge(sum(array.nbytes for array in arrays.values()), "its arrays")
    metres = np.diag([facts["metres"]] * 3 + [1.0])
    parts: list[RawSplats] = []
    for number, field in enumerate(facts["fields"]):
        part = part_of(arrays.get, number, field, facts, path, memory)
        if part is not None:
            parts += instances(part, metres @ arrays[f"{number}/worlds"])
    if not parts:
        held = f" (it has {', '.join(facts['others'])})" if facts["others"] else ""
        raise BadFile(f"{path.name} has no visible {KIND}{held}; export splats of that kind.")
    raw = joined(parts, path.name)
    told = (
        (facts["unshown"], "of its fields of splats show later in time only"),
        (facts["nested"], "instances of point instancers within point instancers"),
    )
    left = [
        Finding(f"{count:,} {what}", count, "left out", file=path.name, repaired=False)
        for count, what in told
        if count
    ]
    return replace(raw, findings=(*raw.findings, *left))


def part_of(
    read: Read, number: int, field: dict, facts: dict, path: Path, memory: Account
) -> RawSplats | None:
    """The splats of one prim in its own axes and units; None where it has none."""
    places = read(f"{number}/positions")
    if places is None or not len(places):
        return None
    count, degree = len(places), field["degree"]
    coefficients = read(f"{number}/{HARMONICS}")
    sh, findings = harmonics_of(coefficients, count, degree, path, field["states degree"])
    up, said = up_of(facts, path)
    findings += said if number == 0 else []
    raw = RawSplats(
        **empty_splats(count, 1 if sh is None else sh.shape[1], memory),
        file=path.name,
        format="USD",
        log_scales=False,
        logits=False,
        up=up,
        memory=memory,
    )
    raw.means[:] = shaped(places, (count, 3), "positions", path)
    for name, into, unset in (
        ("scales", raw.scales, 1.0),
        ("orientations", raw.wxyz, (0.0, 0.0, 0.0, 1.0)),
        ("opacities", raw.opacity, 1.0),
    ):
        array = read(f"{number}/{name}")
        if array is None or len(array) < count:
            into[:] = unset
            there = 0 if array is None else len(array)
            what = f"{name} has {there:,} entries for {count:,} splats" if there else (
                f"{count:,} splats without {name}"
            )  # fmt: skip
            findings.append(Finding(what, count, "each has the usual ones", file=path.name))
        else:
            into[:] = shaped(array[:count], into.shape, name, path)
    raw.wxyz[:] = raw.wxyz[:, [3, 0, 1, 2]]  # a copy first: filed as x y z w
    raw.sh[:] = GRAY if sh is None else sh
    raw.findings = (*findings, *unusual(field, facts, count, path, first=number == 0))
    return raw


def up_of(facts: dict, path: Path) -> tuple[str, list[Finding]]:
    """The stage's up axis, or that of a writer which is known not to turn what it says it does."""
    if LEAVES_AXES not in facts["comment"]:
        return facts["up"], []
    what = f"{LEAVES_AXES} made it, which says {facts['up']} is up and leaves a PLY's axes"
    done = f"read with {COLMAP_UP} up; --up={facts['up']} reads it as it says"
    return COLMAP_UP, [Finding(what, 0, done, file=path.name, repaired=False)]


def shaped(array: np.ndarray, shape: tuple[int, ...], name: str, path: Path) -> np.ndarray:
    if array.shape != shape:
        raise BadFile(f"{path.name}: {name} is of shape {array.shape!s:.40}, expected {shape}.")
    return array


def harmonics_of(
    array: np.ndarray | None, count: int, degree: int, path: Path, said: bool = True
) -> tuple[np.ndarray | None, list[Finding]]:
    """(N, M, 3) of the flat array, coefficients of a splat together, M at most 16; None for gray.

    One that is too short is left alone, one that is too long is cut, as the schema has it.
    """
    if not 0 <= degree <= 16:
        raise BadFile(f"{path.name} has harmonics of degree {degree}; 0 to 3 are drawn.")
    size = (degree + 1) ** 2
    if array is None or len(array) < count * size:
        what = f"{count:,} splats without colours"
        if array is not None and len(array):
            by = f"degree {degree}" + ("" if said else ", which is meant where none is authored,")
            what = f"{HARMONICS} has {len(array):,} entries; {by} wants {count * size:,}"
        return None, [Finding(what, count, "shown in gray", file=path.name)]
    sh = shaped(array[: count * size], (count * size, 3), "harmonics", path)
    sh = sh.reshape(count, size, 3)
    if degree <= MOST_DEGREE:
        return sh, []
    what = f"harmonics of degree {degree}"
    found = Finding(what, 0, f"drawn up to degree {MOST_DEGREE}", file=path.name, repaired=False)
    return sh[:, : COEFFICIENTS[MOST_DEGREE]], [found]


def unusual(field: dict, facts: dict, count: int, path: Path, first: bool) -> list[Finding]:
    """What the scene asks for beyond what is drawn."""
    found = []
    if field["moves"]:
        what = f"{count:,} splats that move in time"
        found.append(Finding(what, count, "shown still, at their first time", file=path.name,
                             repaired=False))  # fmt: skip
    if field["projection"] != "perspective":
        what = f"projectionModeHint is {field['projection'][:40]!r}"
        found.append(Finding(what, 0, "drawn in perspective", file=path.name, repaired=False))
    if first and not facts["states metres"]:
        what = "it does not state metersPerUnit"
        done = f"a unit is {CENTIMETRE:g} m, as USD has it"
        found.append(Finding(what, 0, done, file=path.name, repaired=False))
    return found
