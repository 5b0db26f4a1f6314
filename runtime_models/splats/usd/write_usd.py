"""Plain splats to USD: one ParticleField3DGaussianSplat in metres, +Y up, by usd-core."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import temporary_folder, write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.usd.read_usd import refuse_without

ROOT, FIELD = "/World", "/World/Splats"
PIECE = 1 << 24  # bytes that are copied at a time
INNER = "splats.usdc"  # of a .usdz


def write_usd(splats: PlainSplats, path: str | Path) -> None:
    """Atomic; .usda is text, .usdc and .usd binary, .usdz a package of one binary layer.

    A far origin stands in the transform of the root, in float64.  Raises BadFile without usd-core.
    """
    path = Path(path)
    refuse_without(path)
    ending = path.suffix.lower()
    with temporary_folder() as folder:
        layer = Path(folder, INNER if ending == ".usdz" else f"splats{ending}")
        write_stage(splats, layer)
        if ending == ".usdz":
            layer = packed(layer)
        write_whole(path, pieces(layer))


def write_stage(splats: PlainSplats, layer: Path) -> None:
    from pxr import Gf, Usd, UsdGeom, UsdVol, Vt

    stage = Usd.Stage.CreateNew(str(layer))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, ROOT)
    stage.SetDefaultPrim(root.GetPrim())
    if any(splats.origin):
        root.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*splats.origin))
    field = UsdVol.ParticleField3DGaussianSplat.Define(stage, FIELD)
    prim = field.GetPrim()
    count, coefficients, _ = splats.sh.shape
    values = {
        "positions": Vt.Vec3fArray.FromNumpy(floats(splats.means)),
        "scales": Vt.Vec3fArray.FromNumpy(floats(splats.scales)),
        "orientations": Vt.QuatfArray.FromNumpy(floats(splats.wxyz[:, [1, 2, 3, 0]])),
        "opacities": Vt.FloatArray.FromNumpy(floats(splats.opacity.clip(0, 1))),
        "radiance:sphericalHarmonicsCoefficients": Vt.Vec3fArray.FromNumpy(
            floats(splats.sh).reshape(count * coefficients, 3)
        ),
        "radiance:sphericalHarmonicsDegree": round(coefficients**0.5) - 1,
        "sortingModeHint": "cameraDistance",
        "extent": Vt.Vec3fArray.FromNumpy(extent_of(splats)),
    }
    for name, value in values.items():
        prim.GetAttribute(name).Set(value)
    stage.GetRootLayer().Save()


def floats(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array, np.float32)


def extent_of(splats: PlainSplats) -> np.ndarray:
    """(2, 3) a box around all splats, at three sigma along any axis."""
    reach = 3 * splats.scales.max(axis=1, keepdims=True)
    return floats(np.stack([(splats.means - reach).min(0), (splats.means + reach).max(0)]))


def packed(layer: Path) -> Path:
    """A .usdz around a layer, its arrays at multiples of 64 bytes, as its rules have it."""
    from pxr import Sdf

    package = layer.with_suffix(".usdz")
    with Sdf.ZipFileWriter.CreateNew(str(package)) as writer:
        if not writer.AddFile(str(layer), layer.name):
            raise BadFile(f"{package.name} cannot be packed; is the disk full?")
    return package


def pieces(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while piece := file.read(PIECE):
            yield piece
