"""Densification statistics: sums over the steps since the last change of the anchors."""

import numpy as np

from shapeshift.training.heads.networks import KERNELS, HeadLayout


class DensificationStats:
    """Sums over the steps since the last change.  `stop` says whose step the next one is."""

    def __init__(self, device, layout: HeadLayout, anchors_count: int, stops: int) -> None:
        self.device, self.stop = device, 0
        self.kernel = device.program(KERNELS / "density.cl", SPLATS=layout.splats)["accumulate"]
        self.grad2d = [device.zeros((anchors_count * layout.splats, 2)) for _ in range(stops)]
        self.opacity = device.zeros((anchors_count, 2))
        self.contribution = [device.zeros((anchors_count, 2)) for _ in range(stops)]
        self.everything = device.upload(np.arange(anchors_count, dtype=np.int32))
        self.steps = 0

    def add(self, record, grad_record, opacity, size: tuple[int, int], rows=None) -> None:
        """A step: records (N, 12) and gradients by them, opacities (N,), pixels of the picture.

        The gradients are those of rasterize_backward with `absolute` and `weight`.
        rows: (R,) int32 on the device, where the step ran these anchors alone.
        """
        self.steps += 1
        rows = self.everything if rows is None else rows
        self.device.launch(
            self.kernel, len(rows), 16, len(rows), size[0] / 2, rows, record, grad_record,
            opacity, self.grad2d[self.stop], self.opacity, self.contribution[self.stop],
        )  # fmt: skip

    def state(self) -> dict[str, np.ndarray]:
        """Sums and how many steps make each.

        grad2d (stops, N, 2): absolute gradient by the mean on the screen, in half image widths,
        over the steps of a stop that showed the splat.  opacity (A, 2): of an anchor's splats,
        over the steps that ran it.  contribution (stops, A, 2): alpha times transmittance in
        pixels, over the pictures of a stop that showed any of its splats.
        """
        return {
            "densify.grad2d": np.stack([self.device.download(g) for g in self.grad2d]),
            "densify.opacity": self.device.download(self.opacity),
            "densify.contribution": np.stack([self.device.download(g) for g in self.contribution]),
            "densify.steps": np.array(self.steps),
        }

    def load(self, state: dict[str, np.ndarray]) -> None:
        self.grad2d = [self.device.upload(g) for g in state["densify.grad2d"]]
        self.opacity = self.device.upload(state["densify.opacity"])
        self.contribution = [self.device.upload(c) for c in state["densify.contribution"]]
        self.steps = int(state["densify.steps"])
