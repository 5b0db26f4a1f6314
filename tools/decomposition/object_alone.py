"""Objects cut from the demo, and the ray tracer's truth of each alone."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "decomposition")]

from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.decomposition.completion.plane import (  # noqa: E402  # noqa: E402
    AnchorLooks,
    Plane,
    looks_of,
    support_plane,
)
from shapeshift.decomposition.partition import (  # noqa: E402
    LabelledView,
    gather_evidence,
    partition,
)
from shapeshift.rasterizer.bin import bin_tiles  # noqa: E402
from shapeshift.rasterizer.device import Device  # noqa: E402
from shapeshift.rasterizer.project import Camera, project  # noqa: E402
from shapeshift.rasterizer.raster import rasterize_rgba  # noqa: E402
from shapeshift.runtime_models.colors.spherical_harmonics import turn_light  # noqa: E402
from shapeshift.runtime_models.evaluate import Evaluator  # noqa: E402
from shapeshift.runtime_models.model import AnchorFrames, AnchorModel, ObjectLabel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.rotation import product  # noqa: E402
from shapeshift.scene.pose import Pose, View, look_at, perspective  # noqa: E402
from shapeshift.training.synthetic.placing import (  # noqa: E402
    Clearance,
    frame,
    inside,
    turned,
)
from shapeshift.training.synthetic.tracer import Place, look, photograph, shade  # noqa: E402
from shapeshift.training.synthetic.workshop import GOLDEN, GREY, LIGHT, dome, things  # noqa: E402
from tools.synthetic.labels import LABELS, OBJECTS, label_map  # noqa: E402

VIEWS, SIZE = 24, (384, 288)  # that label
BELOW, BELOW_SIZE = 8, (256, 192)  # that judge
LEAST_SEEN = 1.0  # pixel of evidence in all views, for an anchor to be seen


@dataclass(frozen=True)
class Cut:
    """An object as the first capture knows it."""

    name: str
    model: AnchorModel  # its anchors alone
    seen: np.ndarray  # (A,) bool
    looks: AnchorLooks
    plane: Plane
    pictures: list[LabelledView]
    middle: np.ndarray  # (3,) metres
    reach: float  # metres, the diagonal of its box

    @property
    def known(self) -> np.ndarray:
        """(n,) rows that photos show."""
        return np.flatnonzero(self.seen & self.looks.there)


@dataclass(frozen=True)
class Truth:
    views: list[View]
    stood: list[tuple[np.ndarray, np.ndarray]]  # photo (H, W, 3) and mask (H, W) a view
    turned: list[tuple[np.ndarray, np.ndarray]]


def cut_objects(device: Device, names: list[str]) -> Iterator[Cut]:
    """The demo's objects by evidence."""
    model = read_model(DEMO)
    pictures = [LabelledView(view, 0.0, label_map(view)) for view in dome(VIEWS, 0.0, SIZE)]
    sums = gather_evidence(device, model, pictures, len(LABELS))
    assert isinstance(model, AnchorModel)
    model = partition(model, sums, tuple(ObjectLabel(LABELS[n], n) for n in OBJECTS))
    assert isinstance(model, AnchorModel) and model.labels is not None
    looks = looks_of(model)
    for name in names:
        label = LABELS[name]
        plane = support_plane(looks, model.labels, label)
        if isinstance(plane, str):
            raise SystemExit(f"{name}: {plane}")
        mine = model.labels == label
        alone = model.with_anchors(mine)
        seen = sums[mine, label] > LEAST_SEEN
        own = replace(
            looks, places=looks.places[mine], there=looks.there[mine], colors=looks.colors[mine]
        )
        low, high = np.percentile(own.places[seen & own.there], (1, 99), axis=0)
        reach = float(np.linalg.norm(high - low))
        yield Cut(name, alone, seen, own, plane, pictures, (low + high) / 2, reach)


def turned_over(cut: Cut) -> np.ndarray:
    """(4, 4) second from first: bottom up, turned and tilted by what nobody knows."""
    rotation = turned("y", 37.0) @ turned("z", 8.0) @ turned("x", 180.0)
    return frame(-rotation @ cut.middle + (0.02, 0.01, -0.03), rotation)


def photos_alone(cut: Cut, views: list[View], pose: np.ndarray) -> list:
    """The tracer's photos and masks of the object alone under that pose (4, 4)."""
    solids = dict(things(False))[cut.name]
    here = Place.of(inside(pose, solids))
    middle = pose[:3, :3] @ cut.middle + pose[:3, 3]
    clearance = Clearance.of(here, tuple(middle - cut.reach), tuple(middle + cut.reach))

    def rgb(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        color = shade(here, hits, d, LIGHT, clearance.openness(hits))
        color[hits.index < 0] = GREY
        return color, hits.index

    return [photograph(view, rgb) for view in views]


def around(middle: np.ndarray, reach: float, heights: np.ndarray, size: tuple) -> list[View]:
    """Views from all sides; heights are sines of the elevation."""
    out = []
    for i, height in enumerate(heights):
        turn, level = 2 * np.pi * GOLDEN * i, np.sqrt(1 - height**2)
        way = np.array([level * np.sin(turn), height, level * np.cos(turn)])
        pose = look_at(middle + 2.2 * reach * way, middle)
        out.append(View(pose, perspective(0.6, size), 0.02, 50.0, size))
    return out


def truth_of(cut: Cut) -> Truth:
    """From 20 to 75 degrees below."""
    heights = -np.linspace(np.sin(np.deg2rad(20)), np.sin(np.deg2rad(75)), BELOW)
    views, pose = around(cut.middle, cut.reach, heights, BELOW_SIZE), turned_over(cut)
    lying = [moved_view(view, pose) for view in views]
    return Truth(views, photos_alone(cut, views, np.eye(4)), photos_alone(cut, lying, pose))


def moved_view(view: View, pose: np.ndarray) -> View:
    """The view under a rigid pose (4, 4)."""
    return replace(view, world_from_eye=Pose.from_matrix(pose @ view.world_from_eye.matrix()))


def draw_together(device: Device, parts: list[AnchorModel], view: View) -> np.ndarray:
    """(H, W, 4) of models in one frame, each with its own networks, at the first stop."""
    eye, columns = np.asarray(view.world_from_eye.position, np.float32), []
    for part in parts:
        evaluator = Evaluator(part)
        columns.append((*evaluator.geometry(0.0), evaluator.color(0.0, eye)))
    arrays = [
        device.upload(np.concatenate(each).astype(np.float32))
        for each in zip(*columns, strict=True)
    ]
    camera = Camera(*view.pinhole(), view.size, view.near)
    projected = project(device, *arrays, camera=camera)
    tiles = bin_tiles(device, projected, view.size)
    return rasterize_rgba(device, projected, tiles, view.size).copy()


def moved(model: AnchorModel, pose: np.ndarray) -> AnchorModel:
    """Every anchor with its axes under a rigid pose (4, 4); colours look as they did."""
    assert model.frames is not None, "demo and second model have frames"
    quaternion = Pose.from_matrix(pose).wxyz[None].repeat(len(model.anchors), 0)
    wxyz = product(quaternion, model.frames.wxyz.astype(np.float64)).astype(np.float32)
    anchors = (model.anchors @ pose[:3, :3].T + pose[:3, 3]).astype(np.float32)
    light = None if model.light is None else turn_light(model.light, pose[:3, :3])
    frames = AnchorFrames(model.frames.scales, wxyz)
    return replace(model, anchors=anchors, frames=frames, light=light)
