"""The formats that hold plain splats, one row each: how a file is recognised, and who reads it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading

HEAD = 1 << 16  # bytes of a file that are looked at


@dataclass(frozen=True)
class Format:
    name: str
    endings: tuple[str, ...]  # lower case; of one without a mark they alone tell
    has_mark: Callable[[bytes, Path], bool] | None  # by the first HEAD bytes; None: no mark inside
    read: Callable[[Path, Reading], RawSplats]

    def fits(self, head: bytes, path: Path) -> bool:
        if self.has_mark is None:
            return path.is_file() and path.name.lower().endswith(self.endings)
        return self.has_mark(head, path)


def whole_formats() -> tuple[Format, ...]:
    """In the order in which they are tried: those without a mark last."""
    from shapeshift.runtime_models.checkpoint.read_checkpoint import (
        is_checkpoint,
        read_raw_checkpoint,
    )
    from shapeshift.runtime_models.checkpoint.read_png_folder import is_png_folder
    from shapeshift.runtime_models.checkpoint.read_png_folder import (
        read_raw_png_folder as read_raw_pngs,
    )
    from shapeshift.runtime_models.splats.gltf.read_gltf import is_gltf, read_raw_gltf
    from shapeshift.runtime_models.splats.ply.read_compressed_ply import (
        has_chunks,
        read_raw_compressed_ply,
    )
    from shapeshift.runtime_models.splats.ply.read_ply import read_raw_ply
    from shapeshift.runtime_models.splats.ply.read_points_ply import is_points, read_raw_points_ply
    from shapeshift.runtime_models.splats.read_ksplat import read_raw_ksplat
    from shapeshift.runtime_models.splats.read_splat import read_raw_splat
    from shapeshift.runtime_models.splats.sog.read_sog import is_sog, read_raw_sog
    from shapeshift.runtime_models.splats.spz.read_spz import has_spz_mark, read_raw_spz
    from shapeshift.runtime_models.splats.usd.read_usd import is_usd, read_raw_usd

    return (
        Format("compressed PLY", (".ply",), has_chunks, read_raw_compressed_ply),
        Format("PLY of points", (".ply",), is_points, read_raw_points_ply),
        Format("3DGS PLY", (".ply",), lambda head, path: head[:3] == b"ply", read_raw_ply),
        Format("glTF", (".glb", ".gltf"), is_gltf, read_raw_gltf),
        Format("SOG", (".sog", "meta.json"), is_sog, read_raw_sog),
        Format("gsplat's PNG folder", (), lambda head, path: is_png_folder(path), read_raw_pngs),
        Format("spz", (".spz",), has_spz_mark, read_raw_spz),
        Format("USD", (".usd", ".usda", ".usdc", ".usdz"), is_usd, read_raw_usd),
        Format("checkpoint", (".pt", ".ckpt", ".npz"), is_checkpoint, read_raw_checkpoint),
        Format(".ksplat", (".ksplat",), None, read_raw_ksplat),
        Format(".splat", (".splat",), None, read_raw_splat),
    )


def head_of(path: Path) -> bytes:
    """The first bytes of a file; of a folder none."""
    if path.is_dir():
        return b""
    with path.open("rb") as file:
        return file.read(HEAD)
