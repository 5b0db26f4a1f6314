"""What is known of every splat and anchor since the last densification, summed up step by step."""

import numpy as np

from shapeshift.training.heads.networks import KERNELS, HeadLayout


class Evidence:
    """Sums over the steps since the last change.  `stop` says whose step the next one is."""

    def __init__(self, device, layout: HeadLayout, anchors_count: int, stops: int) -> None:
        self.device, self.stop = device, 0
        self.kernel = device.program(KERNELS / "density.cl", SPLATS=layout.splats)["accumulate"]
        self.pull = device.zeros((anchors_count * layout.splats, 2))
        self.opacity = device.zeros((anchors_count, 2))
        self.given = [device.zeros((anchors_count, 2)) for _ in range(stops)]
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
            opacity, self.pull, self.opacity, self.given[self.stop],
        )  # fmt: skip

    def state(self) -> dict[str, np.ndarray]:
        """Sums and how many steps make each: pull (N, 2), opacity (A, 2), given (stops, A, 2).

        pull: absolute gradient by the mean on the screen, in half image widths, over the steps that
        showed the splat.  opacity: of an anchor's splats, over the steps that ran it.  given: alpha
        times transmittance in pixels, over the pictures of a stop that showed any of its splats.
        """
        return {
            "evidence.pull": self.device.download(self.pull),
            "evidence.opacity": self.device.download(self.opacity),
            "evidence.given": np.stack([self.device.download(g) for g in self.given]),
            "evidence.steps": np.array(self.steps),
        }

    def load(self, state: dict[str, np.ndarray]) -> None:
        self.pull = self.device.upload(state["evidence.pull"])
        self.opacity = self.device.upload(state["evidence.opacity"])
        self.given = [self.device.upload(given) for given in state["evidence.given"]]
        self.steps = int(state["evidence.steps"])
