"""Colliders that are made beside the picture: once each, ended when nobody waits for them."""

import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state import bodies as bodies_module
from shapeshift.app.editor.state.bodies import Bodies
from shapeshift.app.editor.state.files.edited_file import EditedFile, key_of
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.runtime_models.model import BadFile, SplatLayers, Stop
from shapeshift.scene.colliders import collider_files
from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.document import edits
from shapeshift.scene.document.edits import History
from shapeshift.scene.document.scene_file import HULLS, SceneFile, SceneItem
from shapeshift.scene.world import physics

STOPS = (Stop("one", 0.0), Stop("two", 1.0))


def model() -> SplatLayers:
    return SplatLayers(
        np.zeros((3, 3), np.float32), np.full((3, 3), 0.1, np.float32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1)), np.full(3, 0.9, np.float32),
        np.zeros((3, 1, 3), np.float32), np.zeros(3, np.int32), STOPS,
    )  # fmt: skip


def edited(*items: SceneItem) -> EditedFile:
    file = SceneFile(folder=Path("/none"), items=items)
    sources = {key_of(item): Source(Path(item.model), model()) for item in items}
    return EditedFile(History.of(file), saved=file, sources=sources)


def obj(name: str, x: float = 0.0, collider: str | None = HULLS) -> SceneItem:
    return SceneItem(name=name, model="a.ply", x=x, collider=collider)


def cube(rough: bool = False) -> Collider:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    faces = np.array([[0, 1, 2]], np.int32)
    return Collider((corners * 0.1,), TriangleMesh(corners, faces), rough)


@pytest.fixture
def made(monkeypatch) -> list:
    """What was asked for, (name, x); it is there at once, as one that was made before."""
    asked = []

    def one_collider(file, item, model, making, stood_on=()):
        assert making.rough
        asked.append((item.name, item.x))
        if item.name == "bad":
            raise BadFile("object 'bad': there is nothing to touch.")
        return cube()

    monkeypatch.setattr(collider_files, "one_collider", one_collider)
    return asked


def until_there(bodies: Bodies, of: EditedFile) -> None:
    end = time.monotonic() + 30
    while bodies.poll(of) and time.monotonic() < end:
        time.sleep(0.001)
    assert not bodies.busy


def test_one_collider_serves_all_that_are_alike(made):
    bodies = Bodies()
    of = edited(obj("a"), obj("b"), obj("c", x=1.0), obj("d", collider=None))
    until_there(bodies, of)
    assert made == [("a", 0.0), ("c", 1.0)]  # another x is another shape
    objects = bodies.world.objects
    assert list(objects) == ["a", "b", "c", "d"] and bodies.world.paused
    assert [objects[name].body is not None for name in objects] == [True, True, True, False]


def test_a_background_s_is_another_than_an_object_s(made, monkeypatch):
    monkeypatch.setattr(bodies_module, "ground_at_once", lambda *_: None)  # nothing solid is near
    bodies, of = Bodies(), edited(obj("a"))
    background = obj("background", collider=HULLS)
    file = replace(of.file, background=replace(background, static=True))
    of.history = History.of(file)
    until_there(bodies, of)
    assert made == [("a", 0.0), ("background", 0.0)]  # the small thing first


def test_a_slider_does_not_make_it_anew(made):
    bodies, of = Bodies(), edited(obj("a"))
    until_there(bodies, of)
    for x in (0.1, 0.2, 0.3):
        of.history = of.history.record(edits.set_x(of.file, "a", x), "x")
        bodies.follow(of)
        until_there(bodies, of)
    assert made == [("a", 0.0)] and bodies.world.objects["a"].reaction_state.x == 0.3


def test_what_cannot_be_made_is_said_once_and_the_rest_can_be_touched(made):
    bodies, of = Bodies(), edited(obj("bad", x=0.5), obj("a"))
    until_there(bodies, of)
    assert "bad" in bodies.problem and "cannot be touched" in bodies.problem
    objects = bodies.world.objects
    assert objects["bad"].body is None and objects["a"].body is not None
    bodies.problem = ""
    for _ in range(5):
        bodies.poll(of)
    assert bodies.problem == "" and made == [("bad", 0.5), ("a", 0.0)]


def test_where_nothing_can_be_touched_there_is_no_world(made):
    bodies, of = Bodies(), edited(obj("a", collider=None))
    until_there(bodies, of)
    assert bodies.world is None and made == []


def test_without_physics_a_scene_can_be_seen_and_edited(made, monkeypatch):
    def absent(self, *_, **__):
        raise BadFile("the physics needs rapier3d; pip install rapier3d.")

    monkeypatch.setattr(physics.Physics, "__init__", absent)
    bodies, of = Bodies(), edited(obj("a"))
    until_there(bodies, of)
    assert "rapier3d" in bodies.problem and bodies.world is None
    bodies.problem = ""
    of.history = of.history.record(edits.hide(of.file, "a"), "hide")
    bodies.follow(of)  # is no refusal of the edit
    until_there(bodies, of)
    assert bodies.problem == "" and bodies.world is None


def test_rough_hulls_come_first_and_exact_pieces_in_their_place(monkeypatch):
    """In motion, held by nobody, at the x of then; the one that cannot be cut keeps its hull."""
    asked, cut = [], threading.Event()

    def one_collider(file, item, model, making, stood_on=()):
        asked.append((item.name, making.rough, item.x))
        if making.rough:
            return cube(True)
        assert cut.wait(30)
        if item.name == "bad":
            raise BadFile("object 'bad': the package coacd does not load.")
        return cube()

    monkeypatch.setattr(collider_files, "one_collider", one_collider)
    bodies, of = Bodies(), edited(obj("a"), obj("bad", x=0.5))
    end = time.monotonic() + 30
    while not (bodies.world and bodies.busy) and time.monotonic() < end:
        assert bodies.poll(of)
        time.sleep(0.001)
    world = bodies.living
    assert bodies.busy and all(each.collider.rough for each in world.objects.values())
    of.history = of.history.record(edits.set_x(of.file, "a", 0.25), "x")
    bodies.follow(of)
    world.paused = False
    for _ in range(9):
        world.step()
    world.move_hand("right", world.objects["a"].pose)
    world.grab_body("right", "a", world.objects["a"].pose.position)
    cut.set()
    while bodies.busy and time.monotonic() < end:
        bodies.poll(of)
        time.sleep(0.001)
    assert world.objects["a"].collider.rough and world.held("right") == "a"
    world.release("right")

    def speed(each) -> np.ndarray:
        return world.physics.velocity(each.body)[0]

    before = {n: (each.pose.position, speed(each)) for n, each in world.objects.items()}
    until_there(bodies, of)
    assert sorted(asked) == [
        ("a", False, 0.0), ("a", True, 0.0), ("bad", False, 0.5), ("bad", True, 0.5)
    ]  # fmt: skip
    assert bodies.world is world and world.objects["a"].reaction_state.x == 0.25
    for name, each in world.objects.items():
        assert not each.collider.rough
        np.testing.assert_allclose(each.pose.position, before[name][0], atol=1e-6)
        np.testing.assert_allclose(speed(each), before[name][1], atol=1e-6)
    assert "touched as one hull" in bodies.problem and before["bad"][1][1] < -0.5


def test_another_scene_ends_what_is_being_made(monkeypatch):
    begun, ended = threading.Event(), threading.Event()

    def one_collider(file, item, model, making, stood_on=()):
        try:
            while True:
                begun.set()
                making.report("cutting it into convex pieces", 0.5)
                time.sleep(0.001)
        finally:
            ended.set()

    monkeypatch.setattr(collider_files, "one_collider", one_collider)
    of = edited(obj("a"))
    with Bodies() as bodies:
        assert bodies.poll(of) and begun.wait(30)
        end = time.monotonic() + 30
        while "50%" not in bodies.status and time.monotonic() < end:
            time.sleep(0.001)
        assert bodies.status == "a: cutting it into convex pieces 50%"
        bodies.forget()
        assert ended.wait(30) and not bodies.busy
        begun.clear()
        ended.clear()
        assert bodies.poll(of) and begun.wait(30)
    assert ended.is_set()  # so does the end of the program
