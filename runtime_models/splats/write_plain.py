"""The formats that plain splats are written in: by ending, with what each can hold."""

import importlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import COEFFICIENTS
from shapeshift.runtime_models.files.blocks import BLOCK
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.shapes import three
from shapeshift.runtime_models.splats.layers.read_layers import joined, moved, widened
from shapeshift.runtime_models.splats.operations.activate import FINE
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_splats
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.usd.read_usd import refuse_without

FEW = 4  # columns that are named
SPZ_SIZES = (float(np.exp(-10.0)), float(np.exp(255 / 16 - 10)))  # metres, ends of its codes
COMPRESSED_SIZES = (float(np.exp(-20.0)), float(np.exp(20.0)))
SPZ_HARMONICS, COMPRESSED_HARMONICS = 1.0, 4.0


@dataclass(frozen=True)
class Writer:
    name: str
    ending: str
    sh_degree: int  # the highest that it holds
    function: str  # of the module of the same name, with the folder that it is in
    antialiased: bool = True  # has a place for the flag
    columns: bool = False  # has a place for labels and other columns
    far: bool = True  # keeps places far from zero, or refuses them
    also: tuple[str, ...] = ()  # further endings

    def write(self, splats: PlainSplats, path: Path, **options: Any) -> None:
        """Atomic; what the format cannot hold is lost.  options: of the function itself."""
        module = importlib.import_module(f"{__package__}.{self.function}")
        getattr(module, self.function.rpartition(".")[2])(splats, path, **options)


WRITERS = (  # of two endings that fit a name, the longer one stands first
    Writer("compressed PLY", ".compressed.ply", 3, "ply.write_compressed_ply", far=False),
    Writer("3DGS PLY", ".ply", 3, "ply.write_ply", columns=True),
    Writer("spz", ".spz", 3, "spz.write_spz"),
    Writer("glTF", ".glb", 3, "gltf.write_gltf", antialiased=False),
    Writer(".splat", ".splat", 0, "write_splat", antialiased=False, far=False),
    Writer("USD", ".usdz", 3, "usd.write_usd", False, also=(".usd", ".usda", ".usdc")),
)


def writer_of(path: Path) -> Writer:
    """Who writes a file of that name.  Raises BadFile."""
    for writer in WRITERS:
        if path.name.lower().endswith((writer.ending, *writer.also)):
            if writer.name == "USD":
                refuse_without(path)
            return writer
    endings = ", ".join(ending for writer in WRITERS for ending in (writer.ending, *writer.also))
    raise BadFile(f"{path} has no ending that can be written; known are {endings}.")


def describe_losses(splats: PlainSplats, writer: Writer) -> tuple[Finding, ...]:
    """What the splats have and the format has no place for, apart from what its codes round."""
    findings = []
    if splats.antialiased and not writer.antialiased:
        what = "the splats were trained antialiased"
        done = f"{writer.name} cannot say so; other viewers draw thin ones thicker"
        findings.append(Finding(what, 0, done, repaired=False))
    names = [*(["labels"] if splats.labels is not None else []), *splats.extra]
    if names and not writer.columns:
        said = ", ".join(names[:FEW]) + (", ..." if len(names) > FEW else "")
        done = f"left out, {writer.name} has no place for them; .ply has"
        findings.append(Finding(f"other columns ({said})", 0, done, repaired=False))
    step = np.spacing(np.float32(np.abs(splats.origin).max()))
    if not writer.far and step > FINE * np.median(splats.scales.max(axis=1)):
        what = f"the scene lies far from zero, where float32 has steps of {step:.3g} m"
        done = f"{writer.name} rounds its places to that; .ply and .glb keep them"
        findings.append(Finding(what, 0, done, repaired=False))
    return (*findings, *held_codes(splats, writer))


def held_codes(splats: PlainSplats, writer: Writer) -> tuple[Finding, ...]:
    """Numbers beyond the ends of a format's codes, which hold them there."""
    largest = splats.scales.max(axis=1)
    ends = {"spz": SPZ_SIZES, "compressed PLY": COMPRESSED_SIZES}.get(writer.name)
    beyond = {"spz": SPZ_HARMONICS, "compressed PLY": COMPRESSED_HARMONICS}.get(writer.name)
    found = []
    if ends is not None:
        held = int(np.count_nonzero(largest > ends[1]) + np.count_nonzero(
            (largest > 0) & (largest < ends[0])))  # fmt: skip
        if held:
            what = (
                f"{held:,} splats are smaller than {ends[0]:.2g} m or larger than {ends[1]:.3g} m"
            )
            found.append((what, held, f"held there, {writer.name} has no codes beyond; .ply has"))
    if beyond is not None:
        rows = sum(
            int((np.abs(splats.sh[first : first + BLOCK, 1:]) > beyond).any(axis=(1, 2)).sum())
            for first in range(0, len(splats.sh), BLOCK)
        )
        if rows:
            what = f"{rows:,} splats have harmonics beyond {beyond:g}"
            found.append((what, rows, f"held there, {writer.name} has no codes beyond; .ply has"))
    if writer.name == "compressed PLY" and (moved := moved_by_chunks(splats)) is not None:
        count, farthest = moved
        what = f"{count:,} splats move by up to {farthest:.2g} m, more than their size"
        done = (
            "written so: splats that lie far off stretch the steps of their chunk of 256; leave "
            "those out (--only), or write .ply or .spz"
        )
        found.append((what, count, done))
    return tuple(Finding(what, rows, done, repaired=False) for what, rows, done in found)


def moved_by_chunks(splats: PlainSplats) -> tuple[int, float] | None:
    """(splats whose place a compressed PLY may change by more than their largest sigma, the most in
    metres); None where there are none."""
    from shapeshift.runtime_models.splats.operations.merge_pairs import morton_order
    from shapeshift.runtime_models.splats.ply.read_compressed_ply import CHUNK

    order = morton_order(splats.means * np.array([1, -1, -1], np.float32))  # as it is written
    starts = np.arange(0, len(order), CHUNK)
    places = splats.means[order]
    spans = np.maximum.reduceat(places, starts) - np.minimum.reduceat(places, starts)
    codes = np.array([2047, 1023, 2047], np.float32)
    steps = (spans / codes / 2).max(axis=1)  # metres, half a code
    each = np.repeat(steps, CHUNK)[: len(order)]
    rows = each > splats.scales[order].max(axis=1)
    return (int(rows.sum()), float(each[rows].max())) if rows.any() else None


def truncate_harmonics(splats: PlainSplats, sh_degree: int) -> PlainSplats:
    """Without harmonics above a degree: the best of that degree, as they are orthogonal."""
    return replace(splats, sh=splats.sh[:, : COEFFICIENTS[sh_degree]])


def placed(splats: PlainSplats, rotation: np.ndarray, position: np.ndarray) -> PlainSplats:
    """The splats after a rotation (3, 3) about zero and a shift (3,) in metres, exactly."""
    turned = rotate_splats(splats, rotation)
    origin = three(np.add(turned.origin, position))
    return replace(turned, origin=origin)


def merged(parts: list[PlainSplats]) -> PlainSplats:
    """One set of splats, from the first part's origin; what a part lacks is zero."""
    if len(parts) == 1:
        return parts[0]
    origin, counts = parts[0].origin, [len(part.means) for part in parts]
    shifts = [np.subtract(part.origin, origin) for part in parts]  # metres, float64
    width = max(part.sh.shape[1] for part in parts)
    columns = sorted({name for part in parts for name in part.extra})
    labels = [part.labels for part in parts]
    return PlainSplats(
        means=joined([moved(p.means, s) for p, s in zip(parts, shifts, strict=True)], counts),
        scales=joined([part.scales for part in parts], counts),
        wxyz=joined([part.wxyz for part in parts], counts),
        opacity=joined([part.opacity for part in parts], counts),
        sh=joined([widened(part.sh, width) for part in parts], counts),
        origin=origin,
        antialiased=any(part.antialiased for part in parts),
        labels=joined(labels, counts) if any(x is not None for x in labels) else None,
        extra={n: joined([part.extra.get(n) for part in parts], counts) for n in columns},
        findings=tuple(finding for part in parts for finding in part.findings),
        format="baked",
    )
