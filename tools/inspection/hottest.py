"""The hottest place of the demo's held-out views: the ray tracer's, what its pixels allow, ours.

    python3 tools/inspection/hottest.py > docs/bench/hottest.csv

size: of the pictures.  truth_c: the tracer's hottest pixel, and pixels: how many beside it are
within 2 °C of it.  filtered_c: the hottest of the tracer's own picture after the drawing rule's
screen filter (0.3 px^2), which no model is free of; model_c: the hottest that the model shows.
"""

import sys
from pathlib import Path

import numpy as np
from scipy import ndimage

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shapeshift.app.document import Document  # noqa: E402
from shapeshift.app.drawing import open_renderer  # noqa: E402
from shapeshift.app.inspection.draw_values import draw_values, measured_scene  # noqa: E402
from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.renderer.settings import RenderSettings  # noqa: E402
from shapeshift.runtime_models.package.read_package import read_package  # noqa: E402
from shapeshift.training.synthetic.tracer import photograph  # noqa: E402
from shapeshift.training.synthetic.workshop import COLD, HOT, dome, radiance  # noqa: E402

SIZES = ((384, 288), (768, 576))  # that of the photos of its training, and twice that
ALIKE_C = 2.0


def hottest(celsius: np.ndarray, counts: np.ndarray) -> tuple[float, int]:
    """°C, and how many pixels that hang together with it are ALIKE_C below it at most."""
    known = np.where(counts, celsius, -np.inf)
    labels, _ = ndimage.label(known >= known.max() - ALIKE_C)
    return float(known.max()), int(
        (labels == labels[np.unravel_index(known.argmax(), known.shape)]).sum()
    )


def main() -> None:
    say = sys.stdout.write
    say("# python3 tools/inspection/hottest.py > docs/bench/hottest.csv\n")
    say("size,view,truth_c,pixels,filtered_c,model_c,model_to_truth_c,model_to_filtered_c\n")
    measured = measured_scene(Document.of(read_package(DEMO)))
    sigma = RenderSettings().low_pass ** 0.5
    with open_renderer("none", "tiles") as (renderer, _):
        for size in SIZES:
            for number, view in enumerate(dome(8, 1 / 3 + 0.17, size)):
                color, share = photograph(view, radiance("Thermal"))
                truth = COLD + (HOT - COLD) * color[..., 0].astype(np.float64)
                counts = share >= 0.5
                celsius, pixels = hottest(truth, counts)
                filtered, _ = hottest(ndimage.gaussian_filter(truth, sigma, mode="nearest"), counts)
                model = draw_values(renderer, measured, view).hottest()[1]
                say(
                    f"{size[0]}x{size[1]},{number},{celsius:.1f},{pixels},{filtered:.1f},"
                    f"{model:.1f},{model - celsius:.1f},{model - filtered:.1f}\n"
                )


if __name__ == "__main__":
    main()
