"""The decomposition paper's tables for ours: captures from masks to proxies (OWD, 4.1 to 4.4).

    python tools/decomposition/captures.py FOLDER ... [--segmenter SAM] --out docs/bench

Each FOLDER has NAME.shift, objects.json, labels/ (given maps) and truth/labels (maps that score):
tools/synthetic/everyday.py makes them, `--prepare DATA WORK` those of the tankard and the plush.
captures.csv: miou in photos without given maps.  capture_proxies.csv: what is touched, chosen by
the given maps, silhouettes in others; distances to what rays from all sides meet of the thing.
With --segmenter capture_segmenter.csv alone: mask_miou of the label maps that it makes, `wrong`:
accepted with an IoU under .75, merged_right: of the pixels that two masks claimed.
"""

import argparse
import csv
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.opening import open_capture  # noqa: E402
from shapeshift.app.training.evaluate import trained_downscale  # noqa: E402
from shapeshift.decomposition.assemble import (  # noqa: E402
    PIECES,
    Collider,
    choose_proxy,
    most_of,
    standing_mesh,
)
from shapeshift.decomposition.completion.complete import complete  # noqa: E402
from shapeshift.decomposition.completion.plane import Plane, looks_of, support_plane  # noqa: E402
from shapeshift.decomposition.label_photos import (  # noqa: E402
    PhotoLabelling,
    choose_photos,
)
from shapeshift.decomposition.masks.journal import open_journal  # noqa: E402
from shapeshift.decomposition.masks.sam_files import open_segmenter  # noqa: E402
from shapeshift.decomposition.masks.specs import ObjectSpecs, read_specs  # noqa: E402
from shapeshift.decomposition.masks.work_photos import work_photos  # noqa: E402
from shapeshift.decomposition.partition import LabelledView  # noqa: E402
from shapeshift.decomposition.photo_views import photo_views, row_evidence, sights_of  # noqa: E402
from shapeshift.decomposition.propagate import ACCEPTED  # noqa: E402
from shapeshift.decomposition.proxies.ground import seen_depths, seen_planes  # noqa: E402
from shapeshift.decomposition.proxies.silhouettes import score_silhouettes  # noqa: E402
from shapeshift.decomposition.score import mean_score, score_maps  # noqa: E402
from shapeshift.decomposition.segment_scene import (  # noqa: E402
    Segmented,
    read_pictures,
    scores_of,
    segment,
)
from shapeshift.decomposition.shown import ShownAnchors  # noqa: E402
from shapeshift.decomposition.walk_objects import segment_by_walk  # noqa: E402
from shapeshift.rasterizer.device import Device, open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel, ObjectLabel  # noqa: E402
from shapeshift.runtime_models.package.write_package import write_package  # noqa: E402
from shapeshift.runtime_models.parts import part_of  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.colliders.collider import Making  # noqa: E402
from shapeshift.scene.colliders.collider_pieces import hull_faces  # noqa: E402
from shapeshift.scene.colliders.convex_parts import cut_into_parts, hull_volume  # noqa: E402
from shapeshift.scene.colliders.primitives import SHAPES, collider_of_shape  # noqa: E402
from shapeshift.scene.colliders.standing import pressed  # noqa: E402
from tools.decomposition.published_masks import prepare  # noqa: E402
from tools.decomposition.segmenters import iou  # noqa: E402
from tools.decomposition.surface_scores import (  # noqa: E402
    score_surfaces,
    surface_of,
    surface_of_solids,
)
from tools.synthetic.everyday_places import KINDS  # noqa: E402

TESTS = 16  # photos in which silhouettes are held against masks
RIGHT = 0.75  # IoU of an accepted mask with the true one
PATIENCE_S = 1200.0  # for CoACD, on a machine that is busy
SCENE_COLUMNS = (
    "capture", "masks", "given", "miou", "splats", "background", "objects", "object_splats",
    "share_percent", "export_s", "holes_before", "holes_after", "splats_added", "cpu_s",
)  # fmt: skip
SEGMENTER_COLUMNS = (
    "capture", "given", "accepted", "wrong", "rejected", "unknown", "claimed_by_two",
    "merged_right", "mask_miou", "miou", "objects", "cpu_s",
)  # fmt: skip
PROXY_COLUMNS = (
    "capture", "object", "proxy", "chosen", "pieces", "triangles", "iou", "recall", "chamfer_mm",
    "f1", "hausdorff_mm", "cpu_s",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A trained capture with its truth."""

    name: str
    model: AnchorModel
    capture: Capture
    specs: ObjectSpecs
    given: list[LabelledView]
    true: list[LabelledView]  # of photos without a given map

    @staticmethod
    def read(folder: Path) -> "Case":
        model = read_model(folder / f"{folder.name}.shift")
        assert isinstance(model, AnchorModel)
        capture = open_capture(folder, None, lambda *said: None)
        factor = trained_downscale(model.provenance)
        given = read_pictures(folder / "labels", capture, model, factor)
        true = read_pictures(folder / "truth/labels", capture, model, factor)
        known = {picture.photo for picture in given}
        true = [picture for picture in true if picture.photo not in known]
        return Case(folder.name, model, capture, read_specs(folder / "objects.json"), given, true)

    @property
    def objects(self) -> list[ObjectLabel]:
        return [ObjectLabel(spec.label, spec.name) for spec in self.specs.objects]


def seconds_of_all() -> float:
    """Of processor time, with that of children: CoACD runs in one."""
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system


def export_seconds(found: Segmented) -> float:
    """Processor seconds to write every object to a package of its own."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        for part in found.parts:
            if part.rows:
                one, _ = part_of(found.model, part.spec.label)
                assert isinstance(one, AnchorModel)
                write_package(one, Path(folder) / f"{part.spec.label}.shift")
    return time.process_time() - begun


def scene_row(device: Device, case: Case, found: Segmented, masks: str, more: dict) -> dict:
    """more: what is known of the masks, with the seconds so far."""
    each = case.model.splats_per_anchor
    rows = sum(part.rows for part in found.parts)
    total = len(case.model.anchors)
    return more | {
        "capture": case.name,
        "masks": masks,
        "miou": f"{mean_score(scores_of(device, found, case.true)):.3f}",
        "splats": total * each,
        "background": (total - rows) * each,
        "objects": sum(bool(part.rows) for part in found.parts),
        "object_splats": rows * each,
        "share_percent": f"{100 * rows / total:.1f}",
        "export_s": f"{export_seconds(found):.2f}",
    }


def holes(device: Device, case: Case, found: Segmented) -> dict:
    """What completion did behind all objects (Table 4.3)."""
    assert isinstance(found.model, AnchorModel)
    views = photo_views(device, found, case.capture, trained_downscale(case.model.provenance))
    evidence = row_evidence(device, found.model, views)
    labels = [part.spec.label for part in found.parts if part.rows]
    _, done = complete(device, found.model, views, labels, evidence.background)
    tried = [one for one in done if one.verdict is not None]
    kept = [one for one in tried if one.stamp is not None]
    return {
        "holes_before": sum(one.verdict.holes_before for one in tried),
        "holes_after": sum(
            one.verdict.holes_after if one.stamp else one.verdict.holes_before for one in tried
        ),
        "splats_added": sum(len(one.stamp.rows) for one in kept) * case.model.splats_per_anchor,
    }


def by_maps(device: Device, case: Case) -> tuple[Segmented, float]:
    begun = time.process_time()
    found = segment(device, case.model, case.given, case.specs.objects, len(case.capture.photos),
                    lambda done, count: None)  # fmt: skip
    return found, time.process_time() - begun


def by_boxes(device: Device, case: Case) -> tuple[Segmented, dict]:
    begun = time.process_time()
    shown = ShownAnchors(device, case.model)
    photos = work_photos(case.capture, case.model.stops)
    found = segment_by_walk(shown, photos, case.specs)
    return found, {"cpu_s": f"{time.process_time() - begun:.1f}"}


def by_segmenter(device: Device, case: Case, files: Path, most: int) -> tuple[Segmented, dict]:
    """As `segment --segmenter`, with what became of masks against the truth."""
    begun = seconds_of_all()
    shown = ShownAnchors(device, case.model)
    photos = choose_photos(work_photos(case.capture, case.model.stops), case.specs, most)
    with tempfile.TemporaryDirectory() as folder:
        journal = open_journal(Path(folder) / "masks", {"format": "measured"})
        work = PhotoLabelling(shown, photos, case.specs, open_segmenter(files), journal)
        work.run()
        labels = work.labels()
    pictures = [
        LabelledView(photo.view, photo.stop.x, here, photo.photo.path)
        for photo, here in zip(labels.photos, labels.maps, strict=True)
    ]
    found = segment(device, case.model, pictures, case.specs.objects, len(case.capture.photos),
                    lambda done, count: None)  # fmt: skip
    figures: dict = {"cpu_s": f"{seconds_of_all() - begun:.1f}"}
    for what in ("given", "accepted", "rejected", "unknown"):
        figures[what] = sum(getattr(count, what) for count in labels.counts.values())
    true = {picture.photo: picture.labels for picture in [*case.given, *case.true]}
    wrong = claimed = right = 0
    pairs = []
    for view, (photo, here) in enumerate(zip(labels.photos, labels.maps, strict=True)):
        truth = true.get(photo.photo.path)
        if truth is None or truth.shape != here.shape:
            continue
        pairs.append((here, truth))
        masks = {label: each[view].mask for label, each in work.decisions.items()}
        masks = {label: mask for label, mask in masks.items() if mask is not None}
        wrong += sum(
            work.decisions[label][view].what == ACCEPTED and iou(mask, truth == label) < RIGHT
            for label, mask in masks.items()
        )
        twice = sum(mask.astype(int) for mask in masks.values()) > 1 if masks else []
        claimed += int(np.sum(twice))
        right += int((here == truth)[twice].sum()) if np.any(twice) else 0
    if pairs:
        figures |= {"wrong": wrong, "claimed_by_two": claimed,
                    "merged_right": f"{right / claimed:.3f}" if claimed else "",
                    "mask_miou": f"{mean_score(score_maps(pairs, case.objects)):.3f}"}  # fmt: skip
    return found, figures


@dataclass(frozen=True)
class Truth:
    """Of a capture made by rule: its things, and where the model's world lies in theirs."""

    surfaces: dict[str, np.ndarray]  # (N, 3) metres, the rule's world
    turn: np.ndarray  # (3, 3) to the rule's world
    metres: float  # a unit of the model
    move: np.ndarray  # (3,) metres

    @staticmethod
    def read(folder: Path, capture: Capture) -> "Truth | None":
        if not (folder / "truth/truth.json").exists():
            return None
        facts = json.loads((folder / "truth/truth.json").read_text())
        kind, metres = KINDS[facts["kind"]], facts["metres_a_unit"]
        photos = sorted(capture.photos, key=lambda photo: photo.path.name)
        ours = kind.views(len(photos), photos[0].view.size)
        there = [view.world_from_eye.matrix() for view in ours]
        here = [photo.view.world_from_eye.matrix() for photo in photos]
        turn = there[0][:3, :3] @ here[0][:3, :3].T
        move = there[0][:3, 3] - metres * turn @ here[0][:3, 3]
        off = [metres * turn @ h[:3, 3] + move - t[:3, 3] for h, t in zip(here, there, strict=True)]
        assert np.abs(off).max() < 1e-3, "photos of another making"
        surfaces = {name: surface_of_solids(solids) for name, solids in kind.things().items()}
        return Truth(surfaces, turn, metres, move)


def proxy_rows(device: Device, folder: Path, case: Case, found: Segmented) -> Iterator[dict]:
    model, making = found.model, Making(kept=False)
    assert isinstance(model, AnchorModel) and model.labels is not None
    truth, looks, x = Truth.read(folder, case.capture), looks_of(model), model.stops[0].x
    views = photo_views(device, found, case.capture, trained_downscale(model.provenance))
    own = row_evidence(device, model, views).own
    parts = [part for part in found.parts if part.rows]
    stands = {p.spec.label: support_plane(looks, model.labels, p.spec.label) for p in parts}
    planes = {label: plane for label, plane in stands.items() if isinstance(plane, Plane)}
    seen = seen_depths(device, model, sights_of(case.capture, model.stops), x, making)
    planes = seen_planes(planes, seen, looks.spacing_m)
    tests = case.true[:: -(-len(case.true) // TESTS)]
    for spec in (part.spec for part in parts):
        one, at = part_of(model, spec.label)
        assert isinstance(one, AnchorModel)
        plane, mine = planes.get(spec.label), own[model.labels == spec.label]
        here = plane and Plane(plane.normal, plane.offset - float(plane.normal @ np.array(at)))
        begun = seconds_of_all()
        mesh = standing_mesh(one, x, mine, here, making)
        meshed = seconds_of_all()
        pieces, _ = cut_into_parts(mesh, making.most_parts, making.report, PATIENCE_S)
        if here is not None:
            pieces = tuple(p for p in pressed(pieces, here) if hull_volume(p) > 0)
        cut = seconds_of_all()
        up = (0.0, 1.0, 0.0) if here is None else here.normal
        made = {PIECES: Collider(pieces, mesh)}
        made |= {shape: collider_of_shape(mesh, shape, up) for shape in SHAPES}
        shaped = seconds_of_all()
        simple = (shaped - cut) / len(SHAPES) + meshed - begun
        world = np.eye(4)
        world[:3, 3] = at
        pictures = most_of([view.labelled for view in views if view.labelled.photo in
                            {g.photo for g in case.given}], spec.label)  # fmt: skip
        chosen, _ = choose_proxy(made, world, spec.label, pictures)
        _, tested = choose_proxy(made, world, spec.label, tests)
        row = {"capture": case.name, "object": spec.name}
        bound = score_silhouettes(Collider((), mesh), world, spec.label, tests, as_mesh=True)
        yield row | {"proxy": "mesh", "triangles": len(mesh.faces), "iou": f"{bound.iou:.3f}",
                     "recall": f"{bound.recall:.3f}", "cpu_s": f"{meshed - begun:.2f}"}  # fmt: skip
        for proxy in tested:
            seconds = cut - begun if proxy.name == PIECES else simple
            figures: dict = {}
            if truth is not None:
                points = surface_of(proxy.collider) + np.array(at)
                points = truth.metres * points @ truth.turn.T + truth.move
                score = score_surfaces(points, truth.surfaces[spec.name])
                figures = {"chamfer_mm": f"{1e3 * score.chamfer_m:.2f}", "f1": f"{score.f1:.3f}",
                           "hausdorff_mm": f"{1e3 * score.hausdorff_m:.1f}"}  # fmt: skip
            yield row | figures | {
                "proxy": proxy.name, "chosen": "yes" * (proxy.name == chosen.name),
                "pieces": len(proxy.collider.parts),
                "triangles": sum(len(hull_faces(part)) for part in proxy.collider.parts),
                "iou": f"{proxy.score.iou:.3f}", "recall": f"{proxy.score.recall:.3f}",
                "cpu_s": f"{seconds:.2f}",
            }  # fmt: skip


def means(rows: list[dict]) -> list[dict]:
    """A row a proxy over all objects, and one of those that were chosen."""
    out = []
    for proxy in ("mesh", *SHAPES, PIECES, "chosen"):
        mine = [row for row in rows if row["proxy"] == proxy]
        if proxy == "chosen":
            mine = [row for row in rows if row.get("chosen") == "yes"]
        out.append({"capture": "all", "object": f"mean of {len(mine)}", "proxy": proxy})
        for column in PROXY_COLUMNS[4:]:
            found = [float(row[column]) for row in mine if row.get(column, "") != ""]
            if found:
                out[-1][column] = f"{np.mean(found):.3f}"
    return out


def write(path: Path, columns: tuple[str, ...], rows: list[dict], head: list[str]) -> None:
    with path.open("w", newline="") as file:
        file.writelines(f"# {line}\n" for line in head)
        table = csv.DictWriter(
            file, columns, extrasaction="ignore", lineterminator="\n", restval=""
        )
        table.writeheader()
        table.writerows(rows)


def measure(device: Device, folder: Path, sam: Path | None, photos: int) -> Iterator[dict]:
    """Rows as they come; those of a proxy have its name."""
    case = Case.read(folder)
    if sam is not None:
        found, figures = by_segmenter(device, case, sam, photos)
        yield scene_row(device, case, found, "boxes, MobileSAM", figures)
        return
    found, figures = by_boxes(device, case)
    yield scene_row(device, case, found, "boxes", figures)
    found, seconds = by_maps(device, case)
    figures = {"given": len(case.given), "cpu_s": f"{seconds:.1f}"} | holes(device, case, found)
    yield scene_row(device, case, found, "label maps", figures)
    yield from proxy_rows(device, folder, case, found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", type=Path, nargs="*")
    parser.add_argument("--prepare", type=Path, nargs=2, metavar=("DATA", "WORK"))
    parser.add_argument("--segmenter", type=Path)
    parser.add_argument("--photos", type=int, default=12, help="that a segmenter is asked about")
    parser.add_argument("--out", type=Path, help="a folder for both tables")
    options = parser.parse_args()
    if options.prepare:
        prepare(*options.prepare)
    device = open_device("cpu")
    rows: list[dict] = []
    for folder in options.captures:
        for row in measure(device, folder, options.segmenter, options.photos):
            rows.append(row)
            sys.stdout.write(json.dumps(row) + "\n")
            sys.stdout.flush()
    if options.out:
        write_tables(options, rows, device.platform)


def write_tables(options: argparse.Namespace, rows: list[dict], platform: str) -> None:
    names = " ".join(each.name for each in options.captures)
    asked = f"--segmenter SAM --photos {options.photos} " * bool(options.segmenter)
    head = [f"python tools/decomposition/captures.py {names} {asked}--out docs/bench", platform]
    scenes = [row for row in rows if "proxy" not in row]
    if options.segmenter:
        write(options.out / "capture_segmenter.csv", SEGMENTER_COLUMNS, scenes, head)
        return
    write(options.out / "captures.csv", SCENE_COLUMNS, scenes, head)
    head.append(f"F1 at 4 mm; silhouettes in at most {TESTS} photos without given maps")
    proxies = [row for row in rows if "proxy" in row]
    write(options.out / "capture_proxies.csv", PROXY_COLUMNS, proxies + means(proxies), head)


if __name__ == "__main__":
    main()
