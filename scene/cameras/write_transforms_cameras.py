"""transforms.json in nerfstudio's form, in the world of 3DGS's splats: its "up" says -Y."""

from shapeshift.scene.cameras.camera_list import CameraList, data_from_ours
from shapeshift.scene.captures.capture_rules import COLMAP_UP


def transforms(cameras: CameraList) -> dict:
    """The file; every frame has its own lens and size, and OpenGL axes of the camera."""
    frames, turn = [], data_from_ours()
    for i, (view, name) in enumerate(zip(cameras.views, cameras.names, strict=True)):
        _, fx, fy, cx, cy = view.pinhole()
        frames.append(
            {
                "file_path": name or f"images/{i:05d}.png",
                "transform_matrix": (turn @ view.world_from_eye.matrix()).tolist(),
                "w": int(view.size[0]),
                "h": int(view.size[1]),
                "fl_x": float(fx),
                "fl_y": float(fy),
                "cx": float(cx),
                "cy": float(cy),
            }
        )
    return {
        "camera_model": "OPENCV",
        "convention": "opengl",
        "up": [float(c) for c in COLMAP_UP],
        "frames": frames,
    }
