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
MOST_LAYERS, MOST_PRIMS, MOST_FIELDS, MOST_INSTANCES = 256, 100_000, 1000, 10_000
KIND = "ParticleField3DGaussianSplat"
# attribute: its numbers a splat; of each there may be one of half floats, called with an h
ATTRIBUTES = {"positions": 3, "orientations": 4, "scales": 3, "opacities": 1}
INSTANCER = ("protoIndices", "positions", "positionsf", "orientations", "orientationsf", "scales",
             "invisibleIds")  # fmt: skip
MOST_TIMES = 100  # of each attribute that are looked at
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

    folder, waiting = root.resolve().parent, [str(root)]
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
        "unshown": 0,  # fields that another time shows
        "nested": 0,  # instances of instancers in instancers
    }
    arrays: dict[str, np.ndarray] = {}
    others: set[str] = set()
    seen = instances = 0
    walk = iter(Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
    for prim in walk:
        kind = str(prim.GetTypeName())
        placed: list = []
        if prim.IsA(UsdGeom.PointInstancer):
            walk.PruneChildren()  # what is in it stands where its instances are, not by itself
            placed, below, nested = instances_of(UsdGeom.PointInstancer(prim), facts)
            facts["nested"] += nested
            seen += below
        elif kind == KIND:
            placed = [(prim, None)] if is_shown(prim, facts) else []
        others |= {kind} if kind and kind != KIND else set()
        seen += 1
        if seen > MOST_PRIMS:
            raise Unreadable(f"it has over {MOST_PRIMS:,} prims")
        for each, worlds in placed:
            number = len(facts["fields"])
            if number >= MOST_FIELDS:
                raise Unreadable(f"it has over {MOST_FIELDS:,} fields of splats")
            instances += 1 if worlds is None else len(worlds)
            if instances > MOST_INSTANCES:
                raise Unreadable(f"it has over {MOST_INSTANCES:,} instances of splats")
            facts["fields"].append(field_of(each, number, arrays, worlds))
    facts["others"] = sorted(others)[:5]
    return arrays, facts


def is_shown(prim, facts: dict) -> bool:
    """Whether a prim is seen at its first time; counts those that only another time shows."""
    from pxr import UsdGeom

    imageable = UsdGeom.Imageable(prim)
    if imageable.ComputePurpose() == "guide":
        return False
    time, times = first_time(prim, [])
    if imageable.ComputeVisibility(time) != "invisible":
        return True
    facts["unshown"] += any(imageable.ComputeVisibility(each) != "invisible" for each in times)
    return False


def first_time(prim, attributes: list) -> tuple:
    """The time at which a prim is shown, and its first few: those of the attributes, and of the
    transforms and visibilities of the prim and all that it hangs on.  Default, and none, where
    nothing has times.
    """
    from pxr import Usd, UsdGeom

    times = {t for each in attributes if each for t in each.GetTimeSamples()[:MOST_TIMES]}
    above = prim
    while above and not above.IsPseudoRoot():
        if above.IsA(UsdGeom.Xformable):
            times |= set(UsdGeom.Xformable(above).GetTimeSamples()[:MOST_TIMES])
        if above.IsA(UsdGeom.Imageable):
            times |= set(UsdGeom.Imageable(above).GetVisibilityAttr().GetTimeSamples()[:MOST_TIMES])
        above = above.GetParent()
    first = Usd.TimeCode(min(times)) if times else Usd.TimeCode.Default()
    return first, sorted(times)[:MOST_TIMES]


def instances_of(instancer, facts: dict) -> tuple[list, int, int]:
    """[(prim of splats, (K, 4, 4) world_from_prim)] of a PointInstancer, how many prims were
    looked at, and how many instances stand for further instancers, which are left out.
    """
    from pxr import Usd, UsdGeom

    prim = instancer.GetPrim()
    if not is_shown(prim, facts):
        return [], 0, 0
    time, _ = first_time(prim, [prim.GetAttribute(name) for name in INSTANCER])
    all_of_them = UsdGeom.PointInstancer.IgnoreMask
    locals_ = instancer.ComputeInstanceTransformsAtTime(
        time, time, UsdGeom.PointInstancer.IncludeProtoXform, all_of_them
    )
    kinds = np.array(instancer.GetProtoIndicesAttr().Get(time) or [], np.int64)
    if len(locals_) != len(kinds) or not len(kinds):
        return [], 0, 0
    transforms = np.array(locals_, np.float64).reshape(-1, 4, 4)
    mask = instancer.ComputeMaskAtTime(time)
    shown = np.array(mask, bool) if len(mask) == len(kinds) else np.ones(len(kinds), bool)
    cache = UsdGeom.XformCache(time)
    world = np.array(cache.GetLocalToWorldTransform(prim), np.float64)
    placed, seen, nested = [], 0, 0
    for number, path in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
        mine = transforms[shown & (kinds == number)] @ world  # (K, 4, 4), of rows
        root = prim.GetStage().GetPrimAtPath(path)
        if not len(mine) or not root:
            continue
        below = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimIsActive)))
        for each in below:
            seen += 1
            if each.IsA(UsdGeom.PointInstancer):
                below.PruneChildren()
                nested += len(mine)
            elif each.GetTypeName() == KIND and is_shown(each, facts):
                inner = np.array(cache.ComputeRelativeTransform(each, root)[0], np.float64)
                placed.append((each, np.swapaxes(inner @ mine, 1, 2)))
            if seen > MOST_PRIMS:
                break
    return placed, seen, nested


def field_of(prim, number: int, arrays: dict[str, np.ndarray], worlds=None) -> dict:
    """Puts the arrays of one field, and gives what else it says.

    worlds: (K, 4, 4) where its instances stand; None where it stands by itself.
    """
    from pxr import UsdGeom

    attributes = {name: attribute_of(prim, name) for name in (*ATTRIBUTES, HARMONICS)}
    time, times = first_time(prim, list(attributes.values()))
    for name, attribute in attributes.items():
        value = attribute.Get(time) if attribute else None
        if value is not None:
            arrays[f"{number}/{name}"] = np.asarray(value)
    if worlds is None:
        matrix = UsdGeom.XformCache(time).GetLocalToWorldTransform(prim)
        worlds = np.array(matrix, np.float64).T[None]  # USD's vectors are rows
    arrays[f"{number}/worlds"] = worlds
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
