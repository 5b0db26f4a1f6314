"""Stages of USD with splats, as others write them: usd-core alone, attribute by attribute."""

from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdVol, Vt

SH = "radiance:sphericalHarmonicsCoefficients"


def stage_with(path: Path, splats, up: str = "Y", metres: float | None = 1.0) -> Usd.Stage:
    """A stage as others write it: usd-core alone, attribute by attribute."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    if metres is not None:
        UsdGeom.SetStageMetersPerUnit(stage, metres)
    add_field(stage, "/World/A", splats)
    stage.Save()
    return stage


def add_field(stage: Usd.Stage, at: str, splats, half: bool = False) -> Usd.Prim:
    prim = UsdVol.ParticleField3DGaussianSplat.Define(stage, at).GetPrim()
    arrays = {
        "positions": splats.means, "scales": splats.scales,
        "orientations": splats.wxyz[:, [1, 2, 3, 0]], "opacities": splats.opacity,
        SH: splats.sh.reshape(-1, 3),
    }  # fmt: skip
    kinds = {1: (Vt.FloatArray, Vt.HalfArray), 3: (Vt.Vec3fArray, Vt.Vec3hArray),
             4: (Vt.QuatfArray, Vt.QuathArray)}  # fmt: skip
    for name, array in arrays.items():
        kind = kinds[1 if array.ndim == 1 else array.shape[1]][half]
        array = np.ascontiguousarray(array, np.float16 if half else np.float32)
        prim.GetAttribute(name + "h" * half).Set(kind.FromNumpy(array))
    prim.GetAttribute("radiance:sphericalHarmonicsDegree").Set(round(splats.sh.shape[1] ** 0.5) - 1)
    return prim
