"""project: splats -> screen ellipses and depth keys; the only culling gate."""

import numpy as np

from renderer import layout
from renderer.buffers import Arena, bind
from renderer.gpu import Gpu, groups_for
from renderer.settings import RenderSettings
from scene.pose import View

NO_COUNTS = np.zeros(layout.COUNTS_SIZE, np.uint32)
NO_COUNTS[layout.COUNTS["NEAREST"]] = layout.CULLED_KEY


class Projector:
    """Writes the records, keys and counts of an arena for one view after the other."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._program = gpu.compute("project.comp")

    def project(self, arena: Arena, view: View, settings: RenderSettings) -> None:
        """Projects all objects with their poses, under the limits of the settings."""
        if not settings.min_alpha > 0:
            raise ValueError(f"min_alpha is {settings.min_alpha}; it must be above 0 (say 1/255).")
        arena.counts.write(NO_COUNTS)
        if not arena.count:
            return
        # In float64 on the CPU: a far world origin must not eat the digits of a near splat.
        eye_from_object = view.eye_from_world() @ arena.world_from_object
        arena.poses.write(np.ascontiguousarray(eye_from_object[:, :3], np.float32))
        bind(
            mean_opacity=arena.mean_opacity, covariance=arena.covariance, color=arena.color,
            object=arena.object, poses=arena.poses, records=arena.records, keys=arena.keys,
            counts=arena.counts,
        )  # fmt: skip
        self._gpu.run(
            self._program, groups_for(arena.count, layout.WORKGROUP),
            count=arena.count, tangents=view.tangents, size=view.size, near=view.near,
            min_alpha=settings.min_alpha, low_pass=settings.low_pass,
            max_pixels=min(settings.max_pixels, layout.HUGE),
            max_distance=min(settings.max_distance, layout.HUGE),
        )  # fmt: skip

    def counts(self, arena: Arena) -> dict[str, int]:
        """Splats of the last projection: drawn, and culled by opacity, distance, frustum, size.

        Waits for the GPU.
        """
        rows = np.frombuffer(arena.counts.read(), np.uint32)
        names = ("drawn", "opacity", "distance", "frustum", "size")
        return {name: int(rows[layout.COUNTS[name.upper()]]) for name in names}

    def release(self) -> None:
        """Nothing of its own: programs belong to the Gpu."""

    def __enter__(self) -> "Projector":
        return self

    def __exit__(self, *failure) -> None:
        self.release()
