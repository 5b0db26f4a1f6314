"""A cut scene is turned upright: plain splats on planes tilted on purpose, whose things stand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.decomposition.masks.specs import ObjectSpec
from shapeshift.decomposition.segment_scene import Segmented, SegmentedPart, scene_of_parts
from shapeshift.decomposition.upright_scene import (
    planes_under,
    scale_sentence,
    turned_view,
    upright_scene,
)
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.parts import part_of
from shapeshift.scene.cameras.upright import ASSUMED, PHOTOS, PLANES, STATED, Up, angle
from shapeshift.scene.document.scene_file import FirstView
from tests.support.scene.object_scenes import exact_cloud

ZERO, WORD = (Up(source, (0.0, 1.0, 0.0)) for source in (ASSUMED, STATED))
SPACING = 0.02  # metres between splats of a plane


def tilted(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def table_and_things(degrees: float, flat: bool = True, shelf: bool = False) -> Segmented:
    """A table of 0.8 m with a mug and a cup on it, all turned about x; or a cloud around them; or
    the cup on a shelf that leans by 40 degrees more."""
    grid = np.arange(-0.4, 0.4, SPACING)
    x, z = (axis.ravel() for axis in np.meshgrid(grid, grid))
    rng = np.random.default_rng(0)
    table = np.stack([x, 0 * x, z], axis=1)
    if not flat:
        table = rng.uniform(-0.4, 0.4, table.shape)
    box = np.stack(np.meshgrid(*[np.arange(-0.04, 0.041, SPACING)] * 3), -1).reshape(-1, 3)
    mug, cup = np.add(box, (-0.15, 0.045, 0.1)), np.add(box, (0.15, 0.045, 0))
    if shelf:
        table, mug = (each - (2.0, 0, 0) for each in (table, mug))
        other = np.stack([x, 0 * x, z], axis=1) @ tilted(40).T
        cup, table = np.add(box, (0, 0.045, 0)) @ tilted(40).T, np.concatenate([table, other])
    places = np.concatenate([table, mug, cup]) @ tilted(degrees).T
    labels = np.repeat([0, 1, 2], [len(table), len(mug), len(cup)]).astype(np.int32)
    cloud = exact_cloud(len(places))
    model = replace(cloud, means=places.astype(np.float32), labels=labels,
                    opacity=np.full_like(cloud.opacity, 0.9))  # fmt: skip
    parts = tuple(SegmentedPart(ObjectSpec(label, name), 1, int((labels == label).sum()), 1.0)
                  for label, name in ((1, "mug"), (2, "cup")))  # fmt: skip
    return Segmented(model, parts, (), 0)


def cut(found: Segmented, *ups: Up):
    file = scene_of_parts(found, "room.ply", Path())
    file = replace(file, view=FirstView((0.0, 0.5, 2.0), (0.0, 0.0, 0.0)))
    return upright_scene(file, found, ups, planes_under(found.model, found.parts)), file


def places_of(file, found: Segmented, name: str) -> np.ndarray:
    """(N, 3) metres in the scene's world."""
    item = next(item for item in file.all_items if item.name == name)
    part, _ = part_of(found.model, item.part)
    assert isinstance(part, SplatLayers)
    pose = item.pose.matrix()
    return part.means @ pose[:3, :3].T + pose[:3, 3]


@pytest.mark.parametrize("degrees", [0, 0.9, 5, 5.1, 27, 68, 180])
def test_what_things_stand_on_becomes_level(degrees):
    found = table_and_things(degrees)
    (file, told), before = cut(found, ZERO)
    planes = next(way for way in file.upright.ways if way.source == PLANES)
    assert planes.off() == pytest.approx(degrees, abs=1e-3) and planes.things == ("mug", "cup")
    assert any("degrees from up by" in line for line in told) is (degrees > 5)
    if degrees <= 1:
        assert (file.items, file.upright.used) == (before.items, ZERO)
        return
    assert file.upright.used == planes
    ground, mug = places_of(file, found, "background"), places_of(file, found, "mug")
    assert np.abs(ground[:, 1]).max() < 1e-4  # metres: float32 of places, and the fit
    assert mug[:, 1].min() == pytest.approx(0.005, abs=1e-4)
    # Rigid: what was apart is so far apart.
    apart = np.linalg.norm(mug.mean(0) - places_of(file, found, "cup").mean(0))
    assert apart == pytest.approx(np.hypot(0.3, 0.1), abs=1e-5)
    # The first look turns along: the mug is where it was in the picture.
    look, eye = np.array(file.view.target), np.array(file.view.eye)
    assert np.linalg.norm(eye - look) == pytest.approx(np.hypot(0.5, 2.0), abs=0.05)


def test_the_captures_own_word_is_kept_and_the_others_are_said():
    (file, told), before = cut(table_and_things(27), WORD, Up(PHOTOS, (0.0, 1.0, 0.0)))
    assert file.items == before.items and file.upright.used == WORD
    (said,) = told
    assert "27.0 degrees from up by the planes under mug, cup (27.0 from the photos)" in said
    assert said.endswith("the capture's own word is believed.")


def test_without_a_plane_the_photos_decide():
    up = tuple((tilted(27) @ (0, 1, 0)).tolist())
    (file, told), _ = cut(table_and_things(0, flat=False), ZERO, Up(PHOTOS, up))
    assert [way.source for way in file.upright.ways] == [ASSUMED, PHOTOS]
    assert file.upright.used.source == PHOTOS
    assert "Nothing flat is under the objects, so no plane says what is up." in told


def test_of_two_planes_the_one_nearer_to_the_photos_is_level():
    (file, told), _ = cut(table_and_things(27, shelf=True), ZERO,
                          Up(PHOTOS, tuple((tilted(30) @ (0, 1, 0)).tolist())))  # fmt: skip
    assert file.upright.used.things == ("mug",)
    assert file.upright.used.off() == pytest.approx(27, abs=0.1)
    assert "Not on those planes, but on others, stand: cup." in told


@pytest.mark.parametrize("degrees", [0, 90, 180])
def test_a_first_look_never_goes_straight_up_or_down(degrees):
    found = turned_view(FirstView((0.0, 0.0, 2.0), (0.0, 0.0, 0.0)), tilted(degrees))
    away = np.array(found.target) - found.eye
    assert np.hypot(away[0], away[2]) > 1e-3 * np.linalg.norm(away)
    assert angle(away, tilted(degrees) @ (0, 0, -1)) < 1


def test_of_unknown_metres_the_size_of_things_is_said():
    found = table_and_things(0)
    said = scale_sentence(found, "")
    assert "cup 0.08 m, mug 0.08 m long" in said and "'unit_m'" in said
    assert scale_sentence(found, "its own word") == "Scale: metres are those of its own word."


def test_the_plane_of_a_captures_points_counts_where_nothing_flat_is_under_things():
    of_points = Up(PLANES, (0.0, float(np.cos(0.3)), float(np.sin(0.3))))
    (file, told), _ = cut(table_and_things(0, flat=False), ZERO, of_points)
    assert file.upright is not None and file.upright.used == of_points
    assert not any("Nothing flat" in line for line in told)
    (file, told), _ = cut(table_and_things(0), ZERO, of_points)  # nearer: what the things stand on
    assert file.upright is not None and file.upright.used == ZERO
    assert [way.source for way in file.upright.ways] == [ASSUMED, PLANES]
