"""Files that are known and not read: each has a name, and one sentence that says what to do."""

import re
from dataclasses import dataclass
from pathlib import Path

from shapeshift.runtime_models.files.zip_files import is_zip, member_names

ADDRESS = re.compile(r"(?:https?|ftp|s3|gs):/", re.IGNORECASE)
EXPORT = "export it as a 3DGS PLY, .spz, .sog or .glb"
FEW = 3  # members of a zip that are named


@dataclass(frozen=True)
class Foreign:
    """One format that is not read."""

    what: str  # "a .rad of Spark"
    advice: str
    endings: tuple[str, ...] = ()
    marks: tuple[bytes, ...] = ()  # how it begins
    within: bytes = b""  # what stands in its first kilobytes

    def fits(self, head: bytes, name: str) -> bool:
        if self.within:
            return head.lstrip()[:1] in (b"<", b"{") and self.within in head.lower()
        return name.endswith(self.endings) if self.endings else head.startswith(self.marks)


NO_SPLATS = "it holds no splats; train them from photos (the command train), or name their file"
FOREIGN = (
    Foreign("a SuperSplat page", "save the scene in it as .ply or .sog: SuperSplat, File, Export",
            within=b"supersplat"),
    Foreign("a web page", "download the file of splats that it shows, and open that",
            marks=(b"<!DOCTYPE html", b"<!doctype html", b"<html", b"<HTML")),
    Foreign("a tile set of 3D Tiles", "open one of its .glb tiles, or convert it to one file",
            within=b'"geometricerror"'),
    Foreign("a tile of 3D Tiles before glTF", EXPORT, marks=(b"b3dm", b"i3dm", b"pnts", b"cmpt")),
    Foreign("a tree of levels for Spark (.rad)", "open the PLY or .spz that it was made of",
            endings=(".rad",)),
    Foreign("a moving scene for the web (.splatv)",
            "open the PLY of SpacetimeGaussians that it was made of", endings=(".splatv",)),
    Foreign("a file of tensors (.safetensors)", "export the splats in it as a PLY from its trainer",
            endings=(".safetensors",)),
    Foreign("a project of Postshot", "in Postshot: Export, Splat PLY", endings=(".psht",)),
    Foreign("a moving scene of fourdgs (.4dgs)",
            "write it as glTF or USD with its own to_gltf or to_usd", endings=(".4dgs",)),
    Foreign("a file of Reall3DViewer (.spx)", EXPORT, endings=(".spx",)),
    Foreign("a project of vk_gaussian_splatting", "open the file of splats that it names",
            endings=(".vkgs",)),
    Foreign("a project of SuperSplat (.ssproj)", "in SuperSplat: File, Export, PLY or SOG",
            endings=(".ssproj",)),
    Foreign("a laser scan", "it has points, no splats: train with --points takes it",
            marks=(b"LASF", b"ASTM-E57", b"# .PCD")),
    Foreign("a mesh", "it can be a collider in a scene file (docs/scene.md); " + NO_SPLATS,
            endings=(".obj", ".stl", ".fbx", ".dae", ".off", ".3mf", ".blend", ".x3d", ".step")),
    Foreign("a Blender, Maya or FBX file", EXPORT, marks=(b"BLENDER", b"Kaydara FBX")),
    Foreign("a volume (OpenVDB)", NO_SPLATS, endings=(".vdb",)),
    Foreign("a picture", NO_SPLATS,
            marks=(b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"BM", b"II*\0", b"MM\0*", b"RIFF",
                   b"\0\0\0\x0cJXL", b"\x76\x2f\x31\x01")),
    Foreign("a film", "train wants posed photos of it (docs/capture.md)",
            endings=(".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v", ".insv")),
    Foreign("a single array of numpy (.npy)", "save means, scales, quats, opacities and sh0 in "
            "one .npz", marks=(b"\x93NUMPY",)),
    Foreign("a bare pickle of Python", "load it with torch and save it again (torch.save)",
            marks=(b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05")),
    Foreign("an archive", "unpack it, and open the file of splats in it",
            marks=(b"Rar!", b"7z\xbc\xaf", b"\xfd7zXZ", b"BZh", b"\x28\xb5\x2f\xfd")),
    Foreign("an archive (tar)", "unpack it, and open the file of splats in it",
            endings=(".tar", ".tgz", ".tar.gz")),
    Foreign("a document (PDF)", NO_SPLATS, marks=(b"%PDF",)),
    Foreign("a file of HDF5", EXPORT, marks=(b"\x89HDF",)),
    Foreign("a data base", EXPORT, marks=(b"SQLite format 3",)),
    Foreign("a program", NO_SPLATS, marks=(b"\x7fELF", b"MZ")),
)  # fmt: skip
BEGINS = {  # how a file of that ending begins; it does not, or nobody would ask
    ".ply": "'ply'", ".spz": "gzip's mark or 'NGSP'", ".sog": "a zip's mark", ".glb": "'glTF'",
    ".shift": "a zip's mark", ".npz": "a zip's mark", ".pt": "a zip's mark", ".gltf": "a brace",
    ".ckpt": "a zip's mark", ".usdz": "a zip's mark", ".usdc": "'PXR-USDC'", ".usda": "'#usda'",
    ".zip": "a zip's mark", ".gz": "gzip's mark",
}  # fmt: skip


def is_address(path: Path) -> bool:
    """Whether somebody gave an address of the web instead of a file."""
    return bool(ADDRESS.match(path.as_posix()))


def refusal(path: Path, head: bytes, known: str) -> str:
    """One sentence about a file that is not read; `known` says what is."""
    name = path.name.lower()
    for foreign in FOREIGN:
        if foreign.fits(head, name):
            return f"{path} is {foreign.what}, which is not read here; {foreign.advice}."
    if head[:2] == b"PK" and is_zip(path):
        return zip_refusal(path, member_names(path))
    ending = next((e for e in BEGINS if name.endswith(e)), "")
    if ending:
        return (
            f"{path} does not begin with {BEGINS[ending]}, as a {ending} does: it is another file, "
            "or its beginning is lost; copy or export it again."
        )
    return f"{path} is of no known format; wanted is {known}."


def zip_refusal(path: Path, names: list[str]) -> str:
    """The same of a zip, by what is in it."""
    files = [name for name in names if not name.endswith("/")]
    first = ", ".join(repr(name[:40]) for name in files[:FEW]) + (", ..." if files[FEW:] else "")
    if any(name.lower().endswith((".usd", ".usda", ".usdc")) for name in files[:1]):
        return f"{path} is a USD package; it needs the ending .usdz to be read as one."
    what = f"{len(files)} file{'s' * (len(files) != 1)}" + (f" ({first})" if files else "")
    return (
        f"{path} is a zip with {what}: neither a package (scene.json, anchors.npz, five ONNX "
        "files) nor just one file of splats; unpack it, and open what is meant."
    )
