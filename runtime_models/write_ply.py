"""Plain splats to INRIA's 3DGS PLY, in COLMAP's axes: the inverse of read_ply."""

from pathlib import Path

import numpy as np

from runtime_models.plain_splats import PlainSplats
from runtime_models.turn import turn_half
from runtime_models.whole_file import write_whole


def write_ply(splats: PlainSplats, path: str | Path) -> None:
    """Atomic; a logit of opacity 0 or 1 is cut at 1e-6 from the ends."""
    path, back = Path(path), turn_half(splats)
    rest = 3 * (back.sh.shape[1] - 1)
    names = ["x", "y", "z", "nx", "ny", "nz", *(f"f_dc_{i}" for i in range(3))]
    names += [f"f_rest_{i}" for i in range(rest)] + ["opacity"]
    names += [f"scale_{i}" for i in range(3)] + [f"rot_{i}" for i in range(4)]
    opacity = np.clip(back.opacity, 1e-6, 1 - 1e-6)
    table = np.concatenate(
        [
            back.means,
            np.zeros_like(back.means),
            back.sh[:, 0],
            back.sh[:, 1:].transpose(0, 2, 1).reshape(len(back.means), rest),
            np.log(opacity / (1 - opacity))[:, None],
            np.log(np.maximum(back.scales, 1e-30)),
            back.wxyz,
        ],
        axis=1,
        dtype=np.float32,
    )
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}"]
    header += [f"property float {name}" for name in names] + ["end_header", ""]
    write_whole(path, "\n".join(header).encode() + table.astype("<f4").tobytes())
