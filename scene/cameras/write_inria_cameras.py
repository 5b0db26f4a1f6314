"""cameras.json in the form of 3DGS, in the world of its splats."""

import numpy as np

from shapeshift.scene.cameras.camera_list import CameraList, data_from_ours, is_centred


def inria_rows(cameras: CameraList) -> list[dict]:
    """One row a view; "cx" and "cy", which 3DGS does not know, only where they are off centre."""
    rows, turn = [], data_from_ours()
    for i, (view, name) in enumerate(zip(cameras.views, cameras.names, strict=True)):
        camera_from_ours, fx, fy, cx, cy = view.pinhole()
        world_from_camera = turn @ np.linalg.inv(camera_from_ours)
        row = {
            "id": i,
            "img_name": name or f"{i:05d}",
            "width": int(view.size[0]),
            "height": int(view.size[1]),
            "position": world_from_camera[:3, 3].tolist(),
            "rotation": world_from_camera[:3, :3].tolist(),
            "fy": float(fy),
            "fx": float(fx),
        }
        rows.append(row if is_centred(view) else row | {"cx": float(cx), "cy": float(cy)})
    return rows
