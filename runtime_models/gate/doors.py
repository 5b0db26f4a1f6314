"""The doors: every outside parser that reads a stranger's file, and what it may take for it.

Data alone.  docs/formats.md, "Safety", shows it as a table; tests/program/test_doors.py holds each
row against its limits, and every import of such a package against these rows.
"""

from dataclasses import dataclass

MB = 1 << 20
GB = 1 << 30


@dataclass(frozen=True)
class Door:
    """One kind of file, and the function that reads it in a process of its own."""

    name: str
    reads: str  # what it is, for messages and the table
    package: str  # the outside package, by its name on the index
    imports: tuple[str, ...]  # loaded before a limit is set: they are not the file's
    target: str  # module:function, or module:class of a process that keeps what it opened
    seconds: float  # of processor time that any file may take ...
    seconds_a_byte: float  # ... and more for each of its bytes
    memory: int  # bytes that any file may take; whoever asks may say another bound
    advice: str = "copy it again"
    tells: bool = False  # the function takes `tell`, for its progress


_SCENE, _MODELS = "shapeshift.scene", "shapeshift.runtime_models"

DOORS = {
    door.name: door
    for door in (
        Door("thermal photo", "FLIR's radiometric JPEG", "flyr", ("flyr",),
             f"{_SCENE}.captures.radiometric.flir_run:flir_numbers", 2, 1e-6, 256 * MB),
        Door("points", "laser scans, LAS and LAZ", "laspy", ("laspy", "lazrs"),
             f"{_SCENE}.captures.las_run:las_points", 2, 1e-6, 256 * MB),
        Door("mesh", "meshes of colliders, .obj, .ply and .stl", "trimesh", ("trimesh",),
             f"{_SCENE}.colliders.mesh_run:mesh_arrays", 2, 2e-6, 256 * MB),
        Door("USD", "USD scenes", "usd-core", ("pxr.Usd", "pxr.UsdVol", "pxr.UsdUtils"),
             f"{_MODELS}.splats.usd.usd_run:usd_arrays", 2, 2e-6, 256 * MB),
        Door("rare photo", "photos in none of the usual formats", "pillow", ("PIL.Image",),
             f"{_SCENE}.captures.rare_photo_run:rare_photo", 2, 4e-6, 256 * MB,
             "PNG or JPEG is wanted"),
        Door("video", "videos", "av", ("av",),
             "shapeshift.decomposition.poses.video_run:take_frames", 5, 4e-5, 2 * GB,
             tells=True),
        Door("lens", "camera models of COLMAP", "pycolmap", ("pycolmap",),
             f"{_SCENE}.captures.lenses.lens_run:lens_points", 10, 1e-6, 2 * GB,
             "check its numbers"),
        Door("network", "networks of the user's: --segmenter, --clip-model, --vgg, style networks",
             "onnxruntime", ("onnxruntime",), f"{_MODELS}.gate.network_run:OpenNetwork", 2, 4e-6,
             256 * MB, "use another one"),
    )
}  # fmt: skip

# Where an outside package that reads files is imported in our own process, and why it may be.
ELSEWHERE = {
    "app/film/write_video.py": "av writes a film of our own pictures, and reads no file",
    "decomposition/poses/colmap_run.py": "a process of its own, by colmap_child.py",
    "app/change/match_run.py": "a process of its own, by colmap_child.py",
    "training/first_anchors/triangulate_run.py": "a process of its own, by colmap_child.py",
    "runtime_models/session.py": "onnxruntime of networks that write_onnx made, or behind the gate",
    "scene/colliders/primitives.py": "trimesh calculates with our own points",
    "scene/colliders/collider_pieces.py": "trimesh writes our own triangles",
    "runtime_models/splats/usd/write_usd.py": "usd-core writes our own splats",
    "runtime_models/package/read_onnx.py": "protobuf of a network, its memory charged beforehand",
    "runtime_models/package/package_files.py": "makes networks of our own numbers",
    "training/gradients/read_network.py": "protobuf of a network, its memory charged beforehand",
    "training/gradients/fold_constants.py": "single nodes whose values are known to be small",
    "training/gradients/onnx_graph.py": "calculates with what read_network has checked",
    "training/gradients/vjp_step.py": "calculates with what read_network has checked",
}
