"""COLMAP's camera models by pycolmap, behind the gate: it and Pillow want a process each.

Both in one process were seen to spoil its memory (pycolmap 4.2.1, Pillow 13.0.0).
"""

import numpy as np


def lens_points(model: str, size: list, params: list, given: np.ndarray, back: bool) -> np.ndarray:
    """(N, 2) pixels at tangents (N, 2); back: tangents at pixels."""
    import pycolmap

    pycolmap.logging.logtostderr = True  # else it leaves files in the temporary folder
    camera = pycolmap.Camera(model=model, width=size[0], height=size[1], params=params)
    with np.errstate(all="ignore"):
        if back:
            return np.asarray(camera.cam_from_img(given))
        return np.asarray(camera.img_from_cam(np.column_stack([given, np.ones(len(given))])))
