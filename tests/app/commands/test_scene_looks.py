"""What a scene file says of its look and views, in the commands and the library."""

import json

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.scene.pose import orthographic
from tests.support.models import random_package


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("looks")
    package = random_package(folder, 50, k=4)
    view = {"eye": [1, 2, 3], "target": [0, 0, 0], "fov_y": 0.6, "orthographic": True}
    rows = {
        "objects": [{"name": "one", "model": package.name, "appearance": {"exposure": 1.1}}],
        "appearance": {"exposure": 1.1, "tint": [1, 1, 0.5]},
        "sky": {"zenith": [0, 0, 1], "horizon": [1, 1, 1], "ground": [0, 1, 0]}, "view": view,
    }  # fmt: skip
    (folder / "a.scene.json").write_text(json.dumps(rows))
    plain = {"objects": [{"name": "one", "model": package.name}], "view": view}
    (folder / "plain.scene.json").write_text(json.dumps(plain))
    return folder


def test_a_scene_file_s_look_is_drawn(folder):
    scene, plain = ss.load(folder / "a.scene.json"), ss.load(folder / "plain.scene.json")
    more = {"size": (40, 30), "context": "none", "background": (0.0, 0.0, 0.0)}
    found, wanted = scene.render(**more), plain.render(**more)
    np.testing.assert_allclose(found, wanted * (2, 2, 1), atol=2e-5)  # twice 1.1 stops: 2
    sky = ss.Sky((0, 0, 1), (1, 1, 1), (0, 1, 0))
    other = plain.with_object("one", appearance=ss.Appearance(2.2, 1, (1, 1, 0.5)))
    more["background"] = sky
    np.testing.assert_allclose(other.render(**more), scene.render(**more | {"background": None}))
    assert np.abs(scene.objects["one"].appear(opacity=0).render(**more) - sky.picture(
        scene.views(count=1, size=(40, 30))[0])).max() < 1e-6  # fmt: skip


def test_its_first_view_is_orthographic(folder):
    plain = ss.load(folder / "plain.scene.json")
    (view,) = plain.views(count=1, size=(40, 30))
    radius = plain.subject.bounds()[1]
    eye = ss.View(ss.look_at((1, 2, 3), (0, 0, 0)), ss.perspective(0.6, (40, 30)), 0.01 * radius,
                  200 * radius, (40, 30))  # fmt: skip
    wanted = orthographic(eye, 14**0.5, radius)
    np.testing.assert_allclose(view.world_from_eye.position, wanted.world_from_eye.position)
    assert view.tangents == wanted.tangents and view.near == wanted.near
