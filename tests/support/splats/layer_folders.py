"""Folders of PLY layers as other programs leave them."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.splats.ply_files import some_splats


def splats(count: int, seed: int = 0, coefficients: int = 4) -> PlainSplats:
    return some_splats(count, coefficients, seed, sizes=(0.01, 0.1), opacities=(0.1, 0.9))


def put(path: Path, count: int, **kind) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_ply(splats(count, **kind), path)
    return path


def with_thermal_harmonics(path: Path, count: int, coefficients: int = 4) -> np.ndarray:
    """A PLY as ThermalGaussian's OMMG writes it; returns its thermal harmonics (N, M, 3)."""
    write_ply(splats(count, 1, coefficients), path)
    data = path.read_bytes()
    start = data.index(b"end_header\n")
    names = [f"t_dc_{i}" for i in range(3)] + [f"t_rest_{i}" for i in range(3 * coefficients - 3)]
    thermal = splats(count, 2, coefficients).sh
    rest = thermal[:, 1:].transpose(0, 2, 1).reshape(count, -1)  # all of red first
    columns = np.concatenate([thermal[:, 0], rest], 1).astype("<f4")
    rows = np.frombuffer(data[start + 11 :], "<f4").reshape(count, -1)
    header = data[:start] + "".join(f"property float {name}\n" for name in names).encode()
    path.write_bytes(header + data[start : start + 11] + np.hstack([rows, columns]).tobytes())
    return thermal
