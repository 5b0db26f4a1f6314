"""Splats out of a USD scene by OpenUSD, behind the gate: its C++ ends the process on some files.

A scene may name other files.  Only such as lie in the scene's folder or below, or in its package,
are opened.
"""

import os
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.gate.refusal import Unreadable

ENDINGS = (".usd", ".usda", ".usdc", ".usdz")
MOST_COMMENT = 1000  # letters
MOST_LAYERS, MOST_PRIMS, MOST_FIELDS = 256, 100_000, 1000
KIND = "ParticleField3DGaussianSplat"
# attribute: its numbers a splat; of each there may be one of half floats, called with an h
ATTRIBUTES = {"positions": 3, "orientations": 4, "scales": 3, "opacities": 1}
HARMONICS, DEGREE = "radiance:sphericalHarmonicsCoefficients", "radiance:sphericalHarmonicsDegree"


def usd_arrays(name: str) -> dict:
    """{"arrays": those of prim I by I/NAME, "facts": what the stage says}.  Raises Unreadable."""
    try:
        refuse_outside(Path(name))
        arrays, facts = splats_of(Path(name))
    except (Unreadable, MemoryError):
        raise
    except Exception:  # OpenUSD's own errors are of many kinds
        raise Unreadable("no USD that can be read") from None
    return {"arrays": arrays, "facts": facts}


def refuse_outside(root: Path) -> None:
    """Raises Unreadable where a layer names a file outside the scene's folder or package."""
    from pxr import Sdf

    folder, waiting = root.parent.resolve(), [str(root)]
    seen: set[str] = set()
    while waiting:
        if len(seen) > MOST_LAYERS:
            raise Unreadable(f"it has over {MOST_LAYERS} layers")
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        layer = Sdf.Layer.FindOrOpen(name)
        if layer is None:
            raise Unreadable("no USD that can be read" if name == str(root) else
                             f"its layer {short(name)} cannot be read")  # fmt: skip
        refuse_clips(layer)
        for said in filter(None, layer.GetCompositionAssetDependencies()):  # "": itself
            inside = layer.ComputeAbsolutePath(said)
            outer = inside.partition("[")[0]
            usual = "://" not in said and "SDF_FORMAT_ARGS" not in said
            inner = not os.path.isabs(outer) or Path(outer).resolve().is_relative_to(folder)
            if not (usual and inner):
                raise Unreadable(
                    f"it names {short(said)}, and only files in its own folder are opened; flatten "
                    "it (usdcat --flatten)"
                )
            if not inside.partition("]")[0].lower().endswith(ENDINGS):
                raise Unreadable(f"it names {short(said)}, which is no USD")
            if not (os.path.isabs(outer) and os.path.isfile(outer)):
                raise Unreadable(f"it names {short(said)}, which is not there; copy all of it")
            waiting.append(inside)


def refuse_clips(layer) -> None:
    """Raises Unreadable where the times of a prim lie in further files."""
    found = []

    def look(path) -> None:
        spec = layer.GetPrimAtPath(path) if path.IsPrimPath() else None
        if spec is not None and (spec.HasInfo("clips") or spec.HasInfo("clipSets")):
            found.append(path)

    layer.Traverse(layer.pseudoRoot.path, look)
    if found:
        raise Unreadable("its splats move by value clips, which are not read")


def short(name: str) -> str:
    return repr(name if len(name) <= 60 else f"...{name[-60:]}")


def splats_of(root: Path) -> tuple[dict[str, np.ndarray], dict]:
    """The arrays of every visible field of splats, and what the stage says."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(root))
    if stage is None:
        raise Unreadable("no USD that can be composed")
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
            raise Unreadable(f"it has over {MOST_PRIMS:,} prims")
        if prim.GetTypeName() != KIND:
            others |= {str(prim.GetTypeName())} if prim.GetTypeName() else set()
            continue
        imageable = UsdGeom.Imageable(prim)
        if imageable.ComputeVisibility() == "invisible" or imageable.ComputePurpose() == "guide":
            continue
        number = len(facts["fields"])
        if number >= MOST_FIELDS:
            raise Unreadable(f"it has over {MOST_FIELDS:,} fields of splats")
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
