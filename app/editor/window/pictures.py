"""Pictures of the window on disk: whole or not at all, numbered, never over another file."""

from pathlib import Path

import numpy as np

from shapeshift.app.drawing import make_folder, save_png


def write_png(picture: np.ndarray, path: Path) -> None:
    """Writes (H, W, 3) uint8 whole or not at all, with the folder that it needs."""
    make_folder(path.parent)
    save_png(picture / 255, path)


def write_numbered_png(picture: np.ndarray, folder: Path) -> Path:
    """Writes shapeshift-0001.png or the next free number; never over a file that is there."""
    make_folder(folder)
    number = 1
    while True:
        path = folder / f"shapeshift-{number:04}.png"
        try:
            path.touch(exist_ok=False)  # claims the name, also against another viewer
        except FileExistsError:
            number += 1
            continue
        write_png(picture, path)
        return path
