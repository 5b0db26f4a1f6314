"""Partition of a pile of real and mesh-made splats in contact, of which each one's object is known.

    python tools/decomposition/pile.py DATA --out docs/bench/partition_pile.csv

DATA holds .splat files of one thing each (a captured plant of 113,648 splats, seven meshes as
splats); they are set down on a table of 30,000.  Label maps are drawn from the splats' true labels;
accuracy counts every splat, also those inside that no picture shows.  The last rows are speed: to
label, cut and write as PLY so many splats (OWD, Table 4.2, exports 1.7 million a second).
"""

import argparse
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.decomposition.label_pictures import LabelPictures  # noqa: E402
from shapeshift.decomposition.partition import (  # noqa: E402
    LEAST_PIXELS,
    LabelledView,
    gather_evidence,
    label_rows,
    partition,
)
from shapeshift.decomposition.score import mean_score, score_maps  # noqa: E402
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import ObjectLabel, SplatLayers  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.splats.plain_splats import PlainSplats  # noqa: E402
from shapeshift.runtime_models.splats.ply.write_ply import write_ply  # noqa: E402
from shapeshift.scene.pose import View, look_at, perspective  # noqa: E402

# Name, metres of the longest side, where it stands.
THINGS = (
    ("plant", 0.34, (0, 0)), ("stanford_bunny", 0.2, (-0.2, 0.12)), ("spot", 0.2, (0.2, 0.1)),
    ("bob", 0.16, (0.08, 0.24)), ("cat", 0.2, (-0.06, 0.24)), ("cube", 0.12, (0.22, -0.08)),
    ("violin", 0.3, (-0.2, -0.12)), ("fish", 0.16, (0.06, -0.22)),
)  # fmt: skip
TABLE = 30_000  # splats
SIZE, VIEWS, TESTS = (400, 300), 40, 8
COPIES = 4  # of the pile, beside each other: what is exported
NAMES = tuple(ObjectLabel(label, name) for label, (name, *_) in enumerate(THINGS, 1))
COLUMNS = "views,rule,miou,splat_miou,accuracy,accuracy_seen,seen"


def load_pile(data: Path) -> SplatLayers:
    """All things and the table as one model with the true labels."""
    rng, half, f = np.random.default_rng(0), np.sqrt(0.5), np.float32
    flat = np.c_[rng.uniform(-0.5, 0.5, TABLE), np.zeros(TABLE), rng.uniform(-0.5, 0.5, TABLE)]
    rows = [(
        flat, np.tile([0.004, 0.004, 0.0008], (TABLE, 1)), np.tile([half, half, 0, 0], (TABLE, 1)),
        np.full(TABLE, 0.95), np.zeros((TABLE, 1, 3)), np.zeros(TABLE),
    )]  # fmt: skip
    for label, (name, size, (x, z)) in enumerate(THINGS, 1):
        model = read_model(sorted((data / name).glob("*.splat"))[0])
        assert isinstance(model, SplatLayers)
        core = np.percentile(model.means, (1, 99), axis=0)
        scale = size / (core[1] - core[0]).max()
        means = (model.means - core.mean(axis=0)) * scale
        means[:, 1] -= np.percentile(means[:, 1], 1)
        places = means + np.array([x, 0, z])
        rows.append((places, model.scales * scale, model.wxyz, model.opacity, model.sh[:, :1],
                     np.full(len(means), label)))  # fmt: skip
    *columns, labels = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    arrays = [c.astype(f) for c in columns]
    stops = read_model(sorted((data / "cube").glob("*.splat"))[0]).stops
    layer = np.zeros(len(labels), np.int32)
    return SplatLayers(*arrays, layer=layer, stops=stops, labels=labels.astype(np.int32))


def cameras(count: int) -> list[View]:
    """One metre away, spread by the golden angle, 12 to 67 degrees high."""
    out = []
    for i in range(count):
        turn, up = 2 * np.pi * i * 0.61803, np.deg2rad(12 + 55 * (i * 0.754877 % 1))
        eye = np.array([np.cos(up) * np.sin(turn), np.sin(up) + 0.05, np.cos(up) * np.cos(turn)])
        pose = look_at(eye, np.array([0, 0.07, 0]))
        out.append(View(pose, perspective(0.75, SIZE), 0.05, 100.0, SIZE))
    return out


def splat_iou(found: np.ndarray, true: np.ndarray) -> float:
    """The mean over objects of the IoU of their splats."""
    each = [
        ((found == n) & (true == n)).sum() / ((found == n) | (true == n)).sum()
        for n in range(1, len(THINGS) + 1)
    ]
    return float(np.mean(each))


def quality_rows(pile: SplatLayers) -> tuple[list[str], np.ndarray]:
    """Rows, and the evidence of all views."""
    device, true, count = open_device("cpu"), pile.labels, len(THINGS) + 1
    truth = LabelPictures(device, pile)
    poses = cameras(VIEWS + TESTS)
    views = [LabelledView(v, 0.0, truth.label_map(v, 0.0)) for v in poses[:VIEWS]]
    tests = [(v, truth.label_map(v, 0.0)) for v in poses[VIEWS:]]
    rows, evidence = [], None
    assert true is not None
    for number in (VIEWS, 12, 6):
        sums = gather_evidence(device, pile, views[:number], count)
        evidence = sums if evidence is None else evidence
        seen = sums.sum(axis=1) > LEAST_PIXELS
        cuts = {"unseen by neighbours": partition(pile, sums, ()).labels,
                "unseen to the background": label_rows(sums)}  # fmt: skip
        for name, labels in cuts.items():
            pictures = LabelPictures(device, pile, labels)
            pairs = [(pictures.label_map(v, 0.0), t) for v, t in tests]
            right = labels == true
            figures = (mean_score(score_maps(pairs, NAMES)), splat_iou(labels, true),
                       right.mean(), right[seen].mean(), seen.mean())  # fmt: skip
            rows.append(",".join([str(number), name, *(f"{n:.4f}" for n in figures)]))
            sys.stdout.write(rows[-1] + "\n")
    return rows, evidence


def speed_row(pile: SplatLayers, sums: np.ndarray) -> str:
    """Processor time of labelling, cutting and writing several piles beside each other."""
    apart = np.concatenate(
        [pile.means + np.array([2 * i, 0, 0], np.float32) for i in range(COPIES)]
    )
    fields = {name: np.concatenate([getattr(pile, name)] * COPIES)
              for name in ("scales", "wxyz", "opacity", "sh", "layer")}  # fmt: skip
    many, sums = replace(pile, means=apart, labels=None, **fields), np.tile(sums, (COPIES, 1))
    began = time.process_time()
    cut = partition(many, sums, ())
    assert isinstance(cut, SplatLayers)
    labelled = time.process_time() - began
    with tempfile.TemporaryDirectory() as folder:
        for label in range(len(THINGS) + 1):
            part = cut.with_rows(np.flatnonzero(cut.labels == label))
            arrays = (part.means, part.scales, part.wxyz, part.opacity, part.sh)
            write_ply(PlainSplats(*arrays, labels=part.labels), Path(folder) / f"{label}.ply")
    whole = time.process_time() - began
    count = len(apart)
    return (
        f"# {count:,} splats labelled, cut into {len(THINGS) + 1} and written as PLY: "
        f"{count / whole / 1e6:.2f} million a second of processor time "
        f"(labels {labelled:.2f} s, the rest {whole - labelled:.2f} s)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    pile = load_pile(options.data)
    rows, evidence = quality_rows(pile)
    head = [
        f"# python tools/decomposition/pile.py {options.data.name} --out {options.out}",
        f"# {pile.splat_count:,} splats; {open_device('cpu').platform}; load average "
        f"{os.getloadavg()[0]:.1f} at the end",
        speed_row(pile, evidence),
        COLUMNS,
    ]
    options.out.write_text("\n".join([*head, *rows]) + "\n")
    sys.stdout.write(head[2] + "\n")


if __name__ == "__main__":
    main()
