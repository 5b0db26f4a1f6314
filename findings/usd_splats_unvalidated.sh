#!/usr/bin/env bash
# usd-core 26.11 finds nothing wrong with a splat prim whose arrays a renderer has to ignore.
#
# Expected: the schema of ParticleField3DGaussianSplat says that arrays too short for its positions
# are ignored, and that the degree of its harmonics is 3 where none is authored, so 16 coefficients
# a splat are wanted.  One of OpenUSD's own validators would name a prim that breaks this.
# What happens: all of the registered validators pass a prim with 100 sizes for 200 places, one with
# a colour for each splat and no degree (read as the schema says, it has no colours at all: gray),
# one with degree 9 and one with degree -1.
# What it means: a clean report of OpenUSD says nothing about the arrays of splats; whoever writes
# DC colours alone has to author radiance:sphericalHarmonicsDegree = 0, and a reader has to count.
#
# Packages: pip usd-core 26.11, numpy 2.4.6.  Seen in November 2026.
# Source of the rules: the schema's own documentation, as the package has it (usdVol, ParticleField).
# Exit code: 0 while this holds, 1 when it has changed, 3 when a package cannot be had.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv && venv/bin/pip install -q usd-core==26.11 numpy==2.4.6 >/dev/null 2>&1 || exit 3

cat >validate.py <<'PY'
import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdValidation, UsdVol, Vt

COUNT, DEGREE = 200, "radiance:sphericalHarmonicsDegree"
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
context = UsdValidation.ValidationContext(validators)
print(f"{len(validators)} validators")


def problems(size_count: int, degree: int | None) -> tuple[int, int]:
    """How many things are found wrong with 200 splats, and the degree that a reader sees."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    prim = UsdVol.ParticleField3DGaussianSplat.Define(stage, "/splats").GetPrim()
    stage.SetDefaultPrim(prim)
    places = np.random.default_rng(0).uniform(-1, 1, (COUNT, 3)).astype("f4")
    vectors = {
        "positions": places,
        "scales": np.full((size_count, 3), 0.1, "f4"),
        "radiance:sphericalHarmonicsCoefficients": np.full((COUNT, 3), 0.1, "f4"),
        "extent": np.array([[-2, -2, -2], [2, 2, 2]], "f4"),
    }
    for name, values in vectors.items():
        prim.GetAttribute(name).Set(Vt.Vec3fArray.FromNumpy(values))
    prim.GetAttribute("orientations").Set(Vt.QuatfArray([Gf.Quatf(1)] * COUNT))
    prim.GetAttribute("opacities").Set(Vt.FloatArray([0.5] * COUNT))
    if degree is not None:
        prim.GetAttribute(DEGREE).Set(degree)
    return len(context.Validate(stage)), prim.GetAttribute(DEGREE).Get()


holds = len(validators) > 0
for sizes, degree, seen in ((200, 0, 0), (100, 0, 0), (200, None, 3), (200, 9, 9), (200, -1, -1)):
    found, read = problems(sizes, degree)
    print(f"{sizes} sizes, degree {degree} authored: {found} problems; degree read {read}")
    holds &= found == 0 and read == seen
raise SystemExit(0 if holds else 1)
PY
venv/bin/python validate.py
