"""glTF 2.0 (.glb, .gltf) with KHR_gaussian_splatting, release candidate of 2026, to plain splats.

Its compression by spz (KHR_gaussian_splatting_compression_spz_2) and its drafts are read, too.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.splats.gltf.gltf_files import Asset
from shapeshift.runtime_models.splats.gltf.gltf_nodes import OBEYED, Placed, extension, placed_nodes
from shapeshift.runtime_models.splats.operations.rotate_splats import HALF_TURN_Y, ours_from_file
from shapeshift.runtime_models.splats.placed_splats import instances, joined, moved
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading, fourth_degree

SPLATS = "KHR_gaussian_splatting"
SPZ = ("KHR_gaussian_splatting_compression_spz_2", "KHR_gaussian_splatting_compression_spz")
OLD_SPZ = "KHR_spz_gaussian_splats_compression"  # of early 2025, without SPLATS
PREFIX = f"{SPLATS}:"
ROTATION, SCALE, OPACITY = f"{PREFIX}ROTATION", f"{PREFIX}SCALE", f"{PREFIX}OPACITY"
FIRST, COLOR = f"{PREFIX}SH_DEGREE_0_COEF_0", "COLOR_0"
FOURTH = tuple(f"{PREFIX}SH_DEGREE_4_COEF_{n}" for n in range(9))  # not drawn
NAME = "glTF"
# Required extensions that do not touch what is read here: materials are ignored by the extension.
HARMLESS = (SPLATS, OLD_SPZ, "KHR_mesh_quantization", "KHR_materials_", "KHR_texture_",
            "KHR_lights_", *OBEYED)  # fmt: skip
ROW = 44  # bytes of a splat without its harmonics


def is_gltf(head: bytes, path: Path) -> bool:
    """A .glb by its first bytes; a .gltf is JSON like others, so by its ending, too."""
    plain = path.name.lower().endswith(".gltf") and head.lstrip()[:1] == b"{"
    return head[:4] == b"glTF" or plain


def read_raw_gltf(path: Path, reading: Reading) -> RawSplats:
    """The splats of all nodes of the scene, where these stand.  Raises BadFile."""
    reading = reading.within(path)
    asset = Asset(path, reading.account)
    for name in asset.item(asset.json, "extensionsRequired", list, []):
        if not str(name).startswith(HARMLESS):
            raise asset.refuse(f"it needs the extension {str(name)[:60]}, which is not read here.")
    found = [
        (primitive, node)
        for node in placed_nodes(asset)
        for primitive in splat_primitives(asset, node.mesh)
    ]
    placed = [
        (primitive, node) for primitive, node in found if not node.hidden and len(node.worlds)
    ]
    if not placed:
        raise no_splats(asset, len(found))
    parts = []
    for number, (primitive, node) in enumerate(placed):
        reading.report(f"reading {path.name}", number / len(placed))
        parts += instances(read_primitive(asset, primitive, reading), node.worlds)
    raw = joined(parts, path.name)
    findings = (*raw.findings, *unseen([node for _, node in found], path.name))
    if not reading.flip:
        findings += overturned(raw)
    return replace(raw, front=not asset.in_our_axes, findings=findings)


def no_splats(asset: Asset, hidden: int) -> BadFile:
    """Why a scene shows no splats: no such mesh, all of them hidden, or the extension lost."""
    if hidden:
        return asset.refuse("all its splats are on hidden nodes or on such without instances.")
    meshes = asset.item(asset.json, "meshes", list, [])
    rows = [row for i in range(len(meshes))
            for row in asset.item(asset.entry("meshes", i), "primitives", list, [])]  # fmt: skip
    names = {name for row in rows if isinstance(row, dict)
             for name in asset.item(row, "attributes", dict, {})}  # fmt: skip
    if any(present_name(name).startswith(PREFIX) for name in names):
        return asset.refuse(
            f"it has the attributes of Gaussian splats without the extension: another program, "
            f"such as gltf-transform, dropped {SPLATS}; take the file from before that."
        )
    return asset.refuse(
        f"its scene has no Gaussian splats ({len(meshes)} mesh{'es' * (len(meshes) != 1)}, none "
        f"shown with {SPLATS}); export them with that extension."
    )


def unseen(nodes: list[Placed], file: str) -> list[Finding]:
    """What the nodes of splats are that is not shown."""
    hidden = sum(node.hidden for node in nodes)
    animated = sum(node.animated and not node.hidden for node in nodes)
    empty = sum(not len(node.worlds) and not node.hidden for node in nodes)
    told = (
        (hidden, "hidden (KHR_node_visibility)", "left out"),
        (empty, "of no instance (EXT_mesh_gpu_instancing)", "left out"),
        (animated, "moved by animations", "shown at rest"),
    )
    return [
        Finding(f"{count:,} of {len(nodes):,} nodes of splats {what}", count, done, file=file,
                repaired=False)
        for count, what, done in told
        if count
    ]  # fmt: skip


def overturned(raw: RawSplats) -> tuple[Finding, ...]:
    """That what an spz within holds stands on its head, as far as a floor tells: programs that pack
    any .spz as it is pack those in a PLY's axes, too.
    """
    from shapeshift.runtime_models.lint.lint_whole import spaced
    from shapeshift.runtime_models.splats.spz.spz_axes import PLY_AXES, axes_by_floor

    if not raw.axes:
        return ()
    rows = spaced(len(raw.means))
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.log(raw.scales[rows])
    few = replace(raw, means=raw.means[rows], scales=logs, opacity=raw.opacity[rows])
    floor = axes_by_floor(few)
    if floor is None or floor.name != PLY_AXES:
        return ()
    done = "read with +Y up, as glTF has it; --up=-Y turns it over"
    return (Finding(f"upside down, {floor.reason}", 0, done, file=raw.file, repaired=False),)


def splat_primitives(asset: Asset, mesh: object) -> list[dict]:
    """The primitives of a mesh that are splats."""
    rows = asset.item(asset.entry("meshes", mesh), "primitives", list, [])
    if not all(isinstance(row, dict) for row in rows):
        raise asset.refuse(f"mesh {mesh} has a primitive that is no object.")
    splats = {SPLATS, OLD_SPZ}
    return [row for row in rows if splats & asset.item(row, "extensions", dict, {}).keys()]


def compressed_view(asset: Asset, primitive: dict) -> int | None:
    """The buffer view of the spz file that a primitive's splats are in, if they are."""
    inner = extension(asset, primitive, SPLATS)
    places = [(primitive, OLD_SPZ), *((inner, name) for name in SPZ)]
    found = (asset.item(extension(asset, owner, name), "bufferView", int) for owner, name in places)
    return next((view for view in found if view is not None), None)


def read_primitive(asset: Asset, primitive: dict, reading: Reading) -> RawSplats:
    """The splats of one primitive in its mesh's own axes."""
    splats = extension(asset, primitive, SPLATS)
    findings = unusual(asset, splats)
    view = compressed_view(asset, primitive)
    if view is not None:
        raw = read_spz_view(asset, view, "colorSpace" in splats, reading)
    else:
        raw = read_attributes(asset, asset.item(primitive, "attributes", dict, {}))
    if asset.item(splats, "colorSpace", str, "") == "lin_rec709_display":
        with asset.memory.lend(5 * raw.sh.nbytes, f"colours of {len(raw.means):,} splats"):
            raw.sh = display_from_linear(raw.sh)
        what = f"colours of {len(raw.means):,} splats are linear"
        done = "turned into display colours one by one; where they overlap they blend otherwise"
        findings.append(Finding(what, len(raw.means), done, file=asset.path.name, repaired=False))
    raw.findings = (*raw.findings, *findings)
    return raw


def unusual(asset: Asset, splats: dict) -> list[Finding]:
    """What the extension's object asks for beyond what is drawn here."""
    known = {
        "kernel": ("ellipse",),
        "colorSpace": ("srgb_rec709_display", "lin_rec709_display"),
        "projection": ("perspective",),
    }
    findings = []
    for name, values in known.items():
        value = asset.item(splats, name, str, values[0])
        if value not in values:
            what = f"{name} is {value[:40]!r}"
            findings.append(Finding(what, 0, f"drawn as {values[0]}", file=asset.path.name))
    return findings


def read_attributes(asset: Asset, attributes: dict) -> RawSplats:
    """Splats of a primitive's accessors, also by the names of the extension's drafts."""
    attributes = {present_name(name): index for name, index in attributes.items()}

    def read(name: str, width: int) -> np.ndarray:
        if name not in attributes:
            raise asset.refuse(f"a splat primitive has no {name}; export it again.")
        array = asset.read(attributes[name], name, width)
        if len(array) != count:
            raise asset.refuse(f"{name} has {len(array)} rows, POSITION has {count}.")
        return array

    if "POSITION" not in attributes:
        raise asset.refuse("a splat primitive has no POSITION; export it again.")
    count, draft = asset.count(attributes["POSITION"]), is_draft(attributes)
    row = ROW + 12 * max(sum("SH_DEGREE_" in name for name in attributes), 1)  # bytes
    asset.memory.charge(count * row, f"{count:,} splats")
    means, xyzw, scales = read("POSITION", 3), read(ROTATION, 4), read(SCALE, 3)
    opacity = read(COLOR, 4)[:, 3:] if draft else read(OPACITY, 1)
    names = harmonic_names(asset, attributes, draft)
    sh = np.empty((count, len(names), 3), np.float32)
    for coefficient, name in enumerate(names):
        sh[:, coefficient] = (read(name, 4)[:, :3] - 0.5) / C0 if name == COLOR else read(name, 3)
    left_out = [name for name in FOURTH if name in attributes]
    findings: tuple[Finding, ...] = ()
    if left_out:
        share = sum(float(np.square(read(name, 3), dtype=np.float64).sum()) for name in left_out)
        drawn = float(np.square(sh[:, 1:], dtype=np.float64).sum())
        findings = (fourth_degree(len(left_out), share, share + drawn, asset.path.name),)
    return RawSplats(
        means=np.array(means),  # out of the file: who judges them may write into them
        scales=np.array(scales),
        wxyz=xyzw[:, [3, 0, 1, 2]],
        opacity=np.array(opacity[:, 0]),
        sh=sh,
        file=asset.path.name,
        format=f"{NAME} (draft)" if draft else NAME,
        log_scales=False,
        logits=False,
        up="+Y",
        findings=findings,
        memory=asset.memory,
    )


def present_name(name: str) -> str:
    """An attribute's name as the release candidate has it: drafts wrote _SCALE."""
    return PREFIX + name[1:] if name.startswith(("_ROTATION", "_SCALE", "_SH_DEGREE_")) else name


def is_draft(attributes: dict) -> bool:
    """Whether colour and opacity are in COLOR_0 alone, as the drafts of 2025 have it."""
    return COLOR in attributes and not {FIRST, OPACITY} & attributes.keys()


def harmonic_names(asset: Asset, attributes: dict, draft: bool) -> list[str]:
    """The attributes of the spherical harmonics, by degree and order; whole degrees alone."""
    names: list[str] = [COLOR] if draft else []
    for degree in range(len(names), 4):
        row = [f"{PREFIX}SH_DEGREE_{degree}_COEF_{n}" for n in range(2 * degree + 1)]
        there = sum(name in attributes for name in row)
        if there not in (0, len(row)) or (there and len(names) < degree**2):
            raise asset.refuse(f"of its harmonics of degree {degree} or below some are missing.")
        names += row if there else []
    if not names:
        raise asset.refuse(f"a splat primitive has no {FIRST}: no colours.")
    return names


def read_spz_view(asset: Asset, view: int, turned: bool, reading: Reading) -> RawSplats:
    """Splats of an spz file within a buffer view.

    turned: by the extension's text it is stored half a turn about +Y from the scene (spz is right,
    up, back; glTF is left, up, front).  Drafts, which name no colour space, are as stored.
    """
    from shapeshift.runtime_models.splats.spz.read_spz import read_spz_bytes
    from shapeshift.runtime_models.splats.spz.spz_axes import FORMAT_AXES

    data, _ = asset.view(view)
    with asset.memory.lend(len(data), "its bytes of spz"):
        raw = read_spz_bytes(data.tobytes(), asset.path.name, reading, FORMAT_AXES)
    matrix = np.eye(4)
    upright = ours_from_file(raw.up, front=raw.front)
    matrix[:3, :3] = (HALF_TURN_Y if turned else np.eye(3)) @ upright
    said = "" if turned else ", half a turn about the vertical away, as drafts store it"
    axes = f"of the spz within: {raw.axes}{said}" if raw.axes else ""
    metres = replace(
        raw, scales=np.exp(raw.scales), log_scales=False, up="+Y", front=False, axes=axes
    )
    return replace(moved(metres, matrix), format=f"{NAME} with {raw.format}")


def display_from_linear(sh: np.ndarray) -> np.ndarray:
    """(N, M, 3) harmonics of display sRGB from such of linear light.

    Exact for the mean colour; what varies with direction is scaled by the curve's slope there.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        mean = np.clip(0.5 + C0 * sh[:, :1], 0, None)  # (N, 1, 3)
        low = mean <= 0.0031308
        power = np.maximum(mean, 0.0031308)
        shown = np.where(low, 12.92 * mean, 1.055 * power ** (1 / 2.4) - 0.055)
        slope = np.where(low, 12.92, 1.055 / 2.4 * power ** (1 / 2.4 - 1))
        out = sh * slope
        out[:, :1] = (shown - 0.5) / C0
    return out.astype(np.float32)
