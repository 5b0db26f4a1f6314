"""Splats out of a USD scene, in a process of its own: see read_usd.py.

`python -P usd_run.py IN OUT.npz BYTES`: OpenUSD's C++ ends the process on some damaged files, and a
scene may name other files.  Only such as lie in the scene's folder or below, or in its package, are
opened, and no more memory is taken than BYTES.  The arrays of prim I are called I/NAME in OUT.npz.
"""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

REFUSED = 2  # exit code where the last line of standard error says what is wrong
SECONDS, SECONDS_A_BYTE = 20, 2e-6  # of processor time
UNKNOWN = 2 << 30  # bytes that a process has taken, where the system does not say
ENDINGS = (".usd", ".usda", ".usdc", ".usdz")
MOST_COMMENT = 1000  # letters
MOST_LAYERS, MOST_PRIMS, MOST_FIELDS = 256, 100_000, 1000
KIND = "ParticleField3DGaussianSplat"
# attribute: its numbers a splat; of each there may be one of half floats, called with an h
ATTRIBUTES = {"positions": 3, "orientations": 4, "scales": 3, "opacities": 1}
HARMONICS, DEGREE = "radiance:sphericalHarmonicsCoefficients", "radiance:sphericalHarmonicsDegree"


class UnreadableScene(ValueError):
    """What is wrong with a scene, without its name."""


def refuse_outside(root: Path) -> None:
    """Raises UnreadableScene where a layer names a file outside the scene's folder or package."""
    from pxr import Sdf

    folder, waiting = root.parent.resolve(), [str(root)]
    seen: set[str] = set()
    while waiting:
        if len(seen) > MOST_LAYERS:
            raise UnreadableScene(f"it has over {MOST_LAYERS} layers")
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        layer = Sdf.Layer.FindOrOpen(name)
        if layer is None:
            raise UnreadableScene("no USD that can be read" if name == str(root) else
                             f"its layer {short(name)} cannot be read")  # fmt: skip
        refuse_clips(layer)
        for said in filter(None, layer.GetCompositionAssetDependencies()):  # "": itself
            inside = layer.ComputeAbsolutePath(said)
            outer = inside.partition("[")[0]
            usual = "://" not in said and "SDF_FORMAT_ARGS" not in said
            inner = not os.path.isabs(outer) or Path(outer).resolve().is_relative_to(folder)
            if not (usual and inner):
                raise UnreadableScene(
                    f"it names {short(said)}, and only files in its own folder are opened; flatten "
                    "it (usdcat --flatten)"
                )
            if not inside.partition("]")[0].lower().endswith(ENDINGS):
                raise UnreadableScene(f"it names {short(said)}, which is no USD")
            if not (os.path.isabs(outer) and os.path.isfile(outer)):
                raise UnreadableScene(f"it names {short(said)}, which is not there; copy all of it")
            waiting.append(inside)


def refuse_clips(layer) -> None:
    """Raises UnreadableScene where the times of a prim lie in further files."""
    found = []

    def look(path) -> None:
        spec = layer.GetPrimAtPath(path) if path.IsPrimPath() else None
        if spec is not None and (spec.HasInfo("clips") or spec.HasInfo("clipSets")):
            found.append(path)

    layer.Traverse(layer.pseudoRoot.path, look)
    if found:
        raise UnreadableScene("its splats move by value clips, which are not read")


def short(name: str) -> str:
    return repr(name if len(name) <= 60 else f"...{name[-60:]}")


def splats_of(root: Path) -> tuple[dict[str, np.ndarray], dict]:
    """The arrays of every visible field of splats, and what the stage says."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(root))
    if stage is None:
        raise UnreadableScene("no USD that can be composed")
    facts = {
        "up": f"+{UsdGeom.GetStageUpAxis(stage)}",
        "metres": UsdGeom.GetStageMetersPerUnit(stage),
        "states metres": UsdGeom.StageHasAuthoredMetersPerUnit(stage),
        "comment": stage.GetRootLayer().comment[:MOST_COMMENT],
        "fields": [],
    }
    arrays: dict[str, np.ndarray] = {}
    others: set[str] = set()
    seen = 0
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        seen += 1
        if seen > MOST_PRIMS:
            raise UnreadableScene(f"it has over {MOST_PRIMS:,} prims")
        if prim.GetTypeName() != KIND:
            others |= {str(prim.GetTypeName())} if prim.GetTypeName() else set()
            continue
        imageable = UsdGeom.Imageable(prim)
        if imageable.ComputeVisibility() == "invisible" or imageable.ComputePurpose() == "guide":
            continue
        number = len(facts["fields"])
        if number >= MOST_FIELDS:
            raise UnreadableScene(f"it has over {MOST_FIELDS:,} fields of splats")
        facts["fields"].append(field_of(prim, number, arrays))
    facts["others"] = sorted(others)[:5]
    return arrays, facts


def field_of(prim, number: int, arrays: dict[str, np.ndarray]) -> dict:
    """Puts the arrays of one field, and gives what else it says."""
    from pxr import Usd, UsdGeom

    attributes = {name: attribute_of(prim, name) for name in (*ATTRIBUTES, HARMONICS)}
    times = sorted({t for a in attributes.values() if a for t in a.GetTimeSamples()[:2]})
    time = Usd.TimeCode(times[0]) if times else Usd.TimeCode.Default()
    for name, attribute in attributes.items():
        value = attribute.Get(time) if attribute else None
        if value is not None:
            arrays[f"{number}/{name}"] = np.asarray(value)
    matrix = UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)
    arrays[f"{number}/matrix"] = np.array(matrix, np.float64).T  # USD's vectors are rows
    degree = prim.GetAttribute(DEGREE).Get(time)
    return {
        "degree": 3 if degree is None else int(degree),
        "states degree": prim.GetAttribute(DEGREE).HasAuthoredValue(),
        "moves": len(times) > 1,
        "projection": str(prim.GetAttribute("projectionModeHint").Get() or "perspective"),
    }


def attribute_of(prim, name: str):
    """The attribute in floats where it has a value, else the one in half floats, else None."""
    for each in (name, f"{name}h"):
        attribute = prim.GetAttribute(each)
        if attribute and attribute.HasAuthoredValue():
            return attribute
    return None


def limit(size: int, memory: int) -> None:
    """Where the system can do so: not more time and memory than a scene of so many bytes needs."""
    from pxr import UsdUtils, UsdVol  # noqa: F401  what they take is not the file's

    try:
        import resource
    except ImportError:
        return
    try:
        taken = int(Path("/proc/self/statm").read_text().split()[5]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        taken = UNKNOWN
    for what, most in (
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_CPU, round(SECONDS + SECONDS_A_BYTE * size)),
        (resource.RLIMIT_DATA, taken + memory),
    ):
        hard = resource.getrlimit(what)[1]
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(what, (most, hard))


def main(given: str, wanted: str, memory: str) -> None:
    limit(os.path.getsize(given), int(memory))
    try:
        refuse_outside(Path(given))
        arrays, facts = splats_of(Path(given))
    except Exception as error:  # OpenUSD's own errors are of many kinds
        text = str(error) if isinstance(error, UnreadableScene) else "no USD that can be read"
        sys.stderr.write(f"\n{' '.join(text.split())[:300]}\n")
        sys.exit(REFUSED)
    save: Callable[..., None] = np.savez  # numpy takes its keywords for one flag
    save(wanted, facts=np.frombuffer(json.dumps(facts).encode(), np.uint8), **arrays)


if __name__ == "__main__":
    main(*sys.argv[1:])
