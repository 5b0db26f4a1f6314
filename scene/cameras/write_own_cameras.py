"""Our own list of cameras, with all that a view has."""

from shapeshift.scene.cameras.camera_list import CameraList


def own_rows(cameras: CameraList) -> list[dict]:
    """What `read_own_cameras` reads: our world, untouched."""
    rows = []
    for view, name in zip(cameras.views, cameras.names, strict=True):
        rows.append(
            ({"name": name} if name else {})
            | {
                "matrix": view.world_from_eye.matrix().tolist(),
                "tangents": [float(t) for t in view.tangents],
                "size": [int(n) for n in view.size],
                "near": float(view.near),
                "far": float(view.far),
            }
            | ({"whole": [float(t) for t in view.whole]} if view.whole else {})
        )
    return rows
