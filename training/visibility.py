"""Which anchors a training step runs: those that its view can show at its stop.

What lies out of view, or is absent at the stop, has no gradient.  It is found by a sphere about
each anchor that holds what its splats showed when it last ran at that stop; every LOOK-th step of a
stop runs all anchors, so that what has changed since comes back.
"""

import numpy as np

from shapeshift.rasterizer.project import LEAST_ALPHA, LOW_PASS, Camera
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.heads.networks import KERNELS

LOOK = 10  # steps of a stop: one of them runs all anchors
# A pixel more on each side than the screen filter widens the most opaque splat.
MARGIN_PX = np.float32(np.sqrt(2 * np.log(1 / LEAST_ALPHA) * LOW_PASS) + 1)


class Visibility:
    """The spheres of A anchors at every stop, and whose turn it is to be looked at."""

    def __init__(self, device, anchors_count: int, stops: int, splats: int) -> None:
        self.device, self.count, self.splats = device, anchors_count, splats
        self.kernels = device.program(KERNELS / "visibility.cl")
        # metres; infinite: nothing is known, below zero: absent
        self.reach = [device.upload(np.full(anchors_count, np.inf, np.float32))] * stops
        self.reach = [array.copy() for array in self.reach]
        self.visits = [0] * stops
        self.everything = device.upload(np.arange(anchors_count, dtype=np.int32))

    def visible_rows(self, stop: int, camera: Camera, anchors):
        """(R,) int32 on the device: which anchors (A, 3) a step at a stop has to run; None: all.

        At least one, so that there is something to launch.
        """
        self.visits[stop] += 1
        if self.visits[stop] % LOOK == 1:
            return None
        device = self.device
        seen = device.empty(self.count, np.uint8)
        device.launch(
            self.kernels["find_visible"], self.count, 64,
            self.count, *camera.size, float(camera.near), MARGIN_PX,
            device.constants(camera.packed()), anchors, self.reach[stop], seen,
        )  # fmt: skip
        rows = np.flatnonzero(device.view(seen)).astype(np.int32)
        if len(rows) == self.count:
            return None
        return device.upload(rows if len(rows) else np.zeros(1, np.int32))

    def update_reach(self, stop: int, rows, anchors, splats: Gaussians) -> None:
        """What anchors (R, 3), the `rows` of a step at a stop, reach with their splats (R * k)."""
        rows = self.everything if rows is None else rows
        self.device.launch(
            self.kernels["measure_reach"], len(rows), 64,
            len(rows), self.splats, LEAST_ALPHA, rows, anchors, splats.means, splats.scales,
            splats.opacity, self.reach[stop],
        )  # fmt: skip

    def state(self) -> dict[str, np.ndarray]:
        """reach (stops, A) metres and visits (stops,): with it a run goes on to the same bits."""
        return {
            "visibility.reach": np.stack([self.device.download(r) for r in self.reach]),
            "visibility.visits": np.array(self.visits),
        }

    def load(self, state: dict[str, np.ndarray]) -> None:
        self.reach = [self.device.upload(reach) for reach in state["visibility.reach"]]
        self.visits = state["visibility.visits"].tolist()
