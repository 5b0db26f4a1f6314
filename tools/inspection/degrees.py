"""Where the demo's degrees are off, and what other ways to read them would change.

    python tools/inspection/degrees.py --out docs/bench/degrees.csv

Four held-out views and four of the training against the ray tracer's own degrees, 384x288: mean
error, pixels within 2 °C, and the share of all of them, by how the value is read from what is drawn
and by how much the tracer's degrees differ within 5x5 pixels.  "The tracer blurred" is the truth
itself after the drawing rule's screen filter (0.3 px^2): what no model can be free of.
"""

import argparse
import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy import ndimage

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shapeshift.app.document import Document  # noqa: E402
from shapeshift.app.drawing import open_renderer  # noqa: E402
from shapeshift.app.inspection.draw_values import draw_values, measured_scene  # noqa: E402
from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.renderer.colors.palette import LUMINANCE  # noqa: E402
from shapeshift.renderer.settings import RenderSettings  # noqa: E402
from shapeshift.runtime_models.package.read_package import read_package  # noqa: E402
from shapeshift.training.synthetic.tracer import photograph  # noqa: E402
from shapeshift.training.synthetic.workshop import COLD, HOT, dome, radiance  # noqa: E402

SIZE = (384, 288)
VIEWS = {"held out": dome(8, 1 / 3 + 0.17, SIZE)[:4], "training": dome(72, 1 / 3, SIZE)[::18]}
SPANS = (0.0, 0.5, 2.0, 5.0, 10.0, np.inf)  # °C within 5x5 pixels
COLUMNS = "views,read,pixels_percent,mean_c,within_2_c_percent,error_percent,beyond_2_c_percent"


@dataclass(frozen=True)
class Seen:
    """A view: degrees of the tracer, values, where both count, and what was drawn."""

    truth: np.ndarray  # (H, W) °C
    values: np.ndarray  # (H, W) °C
    counts: np.ndarray  # (H, W) bool
    drawn: np.ndarray  # (H, W, 4) premultiplied
    finer: np.ndarray  # (H, W, 4) of twice the pixels a side, averaged


def looked(renderer, measured, view) -> Seen:
    color, share = photograph(view, radiance("Thermal"))
    values = draw_values(renderer, measured, view)
    drawn = np.array(renderer.image(0), np.float64)
    renderer.draw([replace(view, size=(2 * SIZE[0], 2 * SIZE[1]))])
    finer = np.array(renderer.image(0), np.float64)
    finer = finer.reshape(SIZE[1], 2, SIZE[0], 2, 4).mean(axis=(1, 3))
    truth = COLD + (HOT - COLD) * color[..., 0].astype(np.float64)
    return Seen(truth, values.values, values.known & (share >= 0.5), drawn, finer)


def readings(seen: Seen, behind: float) -> dict[str, np.ndarray]:
    """(H, W) °C by how they are read."""

    def celsius(rgba: np.ndarray, take) -> np.ndarray:
        share = take(rgba[..., :3]) + (1 - rgba[..., 3]) * behind
        return COLD + (HOT - COLD) * np.clip(share, 0, 1)

    mean = celsius(seen.drawn, lambda c: c.mean(axis=-1))
    sharper = mean + 0.3 * (mean - ndimage.gaussian_filter(mean, 1.0))
    sigma = RenderSettings().low_pass ** 0.5
    return {
        "luminance (as it is)": seen.values,
        "mean of the channels": mean,
        "median of the channels": celsius(seen.drawn, lambda c: np.median(c, axis=-1)),
        "luminance of twice the pixels": celsius(seen.finer, lambda c: c @ LUMINANCE),
        "unsharp mask of 0.3": sharper,
        "median of 3x3 pixels": ndimage.median_filter(mean, 3),
        "the tracer blurred": ndimage.gaussian_filter(seen.truth, sigma, mode="nearest"),
    }


def row(name: str, read: str, errors: list[np.ndarray], of: list[np.ndarray]) -> str:
    """errors: (n,) a view that count here; of: all of these views."""
    mine, every = np.concatenate(errors), np.concatenate(of)
    mean = np.mean([e.mean() for e in errors if len(e)])
    within = 100 * np.mean([(e <= 2).mean() for e in errors if len(e)])
    beyond = 100 * (mine > 2).sum() / max((every > 2).sum(), 1)
    return (f"{name},{read},{100 * len(mine) / len(every):.1f},{mean:.3f},{within:.1f},"
            f"{100 * mine.sum() / every.sum():.0f},{beyond:.0f}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    measured = measured_scene(Document.of(read_package(DEMO)))
    rows = []
    with open_renderer("none", "tiles") as (renderer, _):
        for name, views in VIEWS.items():
            seen = [looked(renderer, measured, view) for view in views]
            made = [readings(each, measured.behind or 0.0) for each in seen]
            for read in made[0]:
                errors = [
                    np.abs(m[read] - s.truth)[s.counts] for m, s in zip(made, seen, strict=True)
                ]
                rows.append(row(name, read, errors, errors))
            every = [np.abs(s.values - s.truth)[s.counts] for s in seen]
            for low, high in pairwise(SPANS):
                parts = []
                for s, errors in zip(seen, every, strict=True):
                    span = ndimage.maximum_filter(s.truth, 5) - ndimage.minimum_filter(s.truth, 5)
                    parts.append(errors[((span >= low) & (span < high))[s.counts]])
                read = f"{low:g} to {high:g} C in 5x5" if high < np.inf else f"{low:g} C and more"
                rows.append(row(name, read, parts, every))
    head = "# python tools/inspection/degrees.py --out degrees.csv\n"
    out.write_text(head + COLUMNS + "\n" + "\n".join(rows) + "\n")
    sys.stdout.write(out.read_text())


if __name__ == "__main__":
    main()
