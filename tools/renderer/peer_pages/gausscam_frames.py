"""Runs in gausscam's own environment: python gausscam_frames.py FOLDER, which holds job.json."""

import json
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
from gausscam.backends.webgpu import (  # pyright: ignore[reportMissingImports]  # a peer
    Pipeline,
    pick_variant,
)
from gausscam.core.assets import GaussianCloud  # pyright: ignore[reportMissingImports]

DEGREE_0 = 3  # of its SH columns: it draws no more


def main(folder: Path) -> None:
    job = json.loads((folder / "job.json").read_text())
    cloud = GaussianCloud.from_ply(folder / "splats.ply")
    poses = np.array(job["poses"]).reshape(-1, 4, 4)
    names = {field: getattr(cloud, field) for field in cloud.__dataclass_fields__}
    means, wxyz, log_scales, logits, sh = list(names.values())[:5]
    scene = {
        "xyz": means, "rot": wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True),
        "scale": np.exp(log_scales), "opacity": 1 / (1 + np.exp(-logits)),
        "sh": np.ascontiguousarray(sh[:, :DEGREE_0]), "slots": np.zeros(0, np.int32),
        "W": np.int32(job["size"][0]), "H": np.int32(job["size"][1]),
        "fovy": np.float32(job["fov_y_degrees"]), "cam_pos": poses[:1, :3, 3].astype(np.float32),
        "cam_xmat": np.ascontiguousarray(poses[:1, :3, :3], np.float32),
    }  # fmt: skip
    pipeline = Pipeline(scene, "", variant=pick_variant(""))
    pipeline.set_links(np.zeros((1, 3), np.float32), np.array([[1.0, 0, 0, 0]], np.float32))
    wall, cpu = [], []
    for i in [0] * job["warm_up"] + list(range(len(poses))):
        start, cpu_start = time.perf_counter(), time.process_time()
        pipeline.set_cam(poses[i : i + 1, :3, 3], poses[i : i + 1, :3, :3])
        rgb, depth = pipeline.render_frame()
        wall.append((time.perf_counter() - start) * 1e3)
        cpu.append((time.process_time() - cpu_start) * 1e3)
        if len(wall) == job["warm_up"]:
            picture, _ = pipeline.unpack(rgb, depth)
            np.save(folder / "picture.npy", picture[0])
    warm = job["warm_up"]
    result = {"wall_ms": wall[warm:], "cpu_ms": cpu[warm:], "version": version("gausscam")}
    (folder / "result.json").write_text(json.dumps(result))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
