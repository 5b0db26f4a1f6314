"""The scene file: what is written comes back, every wrong value is one sentence with its key."""

import copy
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.appearance import Appearance, Sky
from shapeshift.scene.cameras.upright import Up, Upright
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import (
    FORMAT,
    FirstView,
    NamedView,
    SceneFile,
    SceneItem,
    is_scene_file,
    machine_of,
    read_models,
    scene_of,
)
from shapeshift.scene.document.write_scene_file import write_scene_file
from shapeshift.scene.selectors.selector import Box, HalfSpace, Lens, Painted, Sphere
from shapeshift.scene.world.reactions import Reaction, State, TwoAxes

HALF = math.sqrt(0.5)
THIRD = 1 / 3
BLEND = StopWeights((("bone", 0.25), ("skin", 0.75)))
REGION = Box(
    centre=(1, 2, THIRD), half=(0.1, 0.2, 0.3), wxyz=(HALF, 0, HALF, 0), x=0, space="world"
)
STATES = (
    State("normal", 0.0), State("ice", THIRD), State("charcoal", 0.9),
    State("ash", StopWeights((("ice", 0.5), ("charcoal", 0.5)))),
)  # fmt: skip
SELECTORS = (
    Sphere(centre=(0.1, 0, THIRD), radius=0.2, x=1.0, border=0.01),
    Box(centre=(0, 0, 0), half=(1, 1, 1), x=THIRD, space="world"),
    HalfSpace(point=(0, 1, 0), normal=(0.3, -0.7, 0.11), x=0.5),
    Lens(position=(0, 0, 3), wxyz=(1, 0, 0, 0), half_angle=0.3, x=0.25),
    Lens(position=(0, 0, 3), wxyz=(HALF, HALF, 0, 0), tangents=(-1, 1, -0.5, 0.6), x=0.25),
    Sphere(centre=(0, 0, 0), radius=0.2, x=BLEND),
    Painted(np.array([0, 0.1, 1], np.float32), 0.75),
)
REACTIONS = (
    Reaction(on="collision", to="next", least_impulse_n_s=0.4, seconds=THIRD, ease="slow end"),
    Reaction(on="grab", to="charcoal", after=("ice", "normal"), cooldown_s=2.0),
    Reaction(on="ray", to=0.123456789012345, seconds=0.0),
    Reaction(on="enter", to="ice", region=REGION),
    Reaction(on="enter", to=0, region=Sphere(centre=(0, 0, 0), radius=1, x=0, space="world")),
    Reaction(on="ray", to=BLEND),
)
FULL = SceneItem(
    name="cube of ïce",
    model="models/three layers.ply",
    mode="exclusive",
    up="+Z",
    flip=True,
    position=(0.1, -2.5, 1e-9),
    wxyz=(HALF, 0.0, -HALF, 0.0),
    x=StopWeights((("bone", THIRD), ("skin", 2 * THIRD))),
    visible=False,
    appearance=Appearance(-1.5, 1.25, (1.0, 0.5, THIRD), 0.5),
    selectors=SELECTORS,
    collider="hulls",
    mass_kg=0.3,
    friction=0.9,
    restitution=0.25,
    states=STATES,
    ring=True,
    reactions=REACTIONS,
    two_axes=TwoAxes(0.1, 0.4, 0.9),
)
LEANING = Up("photos", (0.0, HALF, HALF), sure=False)
ON_PLANES = Up("planes", (0.6, 0.8, 0.0), things=("mug", "cup"))
TABLE = SceneItem(name="background", model="table.ply", static=True, collider="table.obj", x=0.5)


def full(folder: Path) -> SceneFile:
    return SceneFile(
        folder=folder,
        items=(FULL, SceneItem(name="plain", model="../plain.ply", static=True)),
        background=TABLE,
        floor_y=-0.25,
        gravity_m_s2=1.62,
        view=FirstView((0, 1, 2), (0, 0.5, 0), 1.1, True, 0.25),
        views=(
            NamedView("from the dôor", FirstView((0, 1, 2), (0, 0.5, 0), 1.1)),
            NamedView("plan", FirstView((0, 9, 0.1), (0, 0, 0), 0.5, True)),
        ),
        appearance=Appearance(opacity=0.25),
        sky=Sky((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0.7, 0.8, 0.9)),
        upright=Upright((Up("assumed", (0.0, 1.0, 0.0)), LEANING, ON_PLANES), ON_PLANES),
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_scene_file(full(tmp_path), tmp_path / "full.scene.json")
    return tmp_path / "full.scene.json"


def test_what_is_written_comes_back(path):
    assert read_scene_file(path) == full(path.parent)
    again = path.with_name("again.scene.json")
    write_scene_file(read_scene_file(path), again)
    assert read_scene_file(again) == full(path.parent)
    write_scene_file(read_scene_file(again), path)
    assert again.read_bytes() == path.read_bytes()
    assert sorted(p.name for p in path.parent.iterdir()) == ["again.scene.json", path.name]


@pytest.mark.parametrize("field", [f for f in vars(FULL) if f not in ("name", "model")])
def test_every_field_alone_comes_back(tmp_path, field):
    item = SceneItem(name="one", model="a.ply", **{field: getattr(FULL, field)})
    if field == "reactions":  # what leads to states needs no states in the file: the model has them
        assert item.states == ()
    file = SceneFile(folder=tmp_path, items=(item,))
    write_scene_file(file, tmp_path / "a.scene.json")
    assert read_scene_file(tmp_path / "a.scene.json") == file


def test_an_empty_scene_is_one(tmp_path):
    (tmp_path / "a.scene.json").write_text("{}")
    assert read_scene_file(tmp_path / "a.scene.json") == SceneFile(folder=tmp_path)


def test_relative_paths_follow_to_another_folder(path):
    other = path.parent / "deeper" / "still"
    other.mkdir(parents=True)
    file = full(path.parent)
    absolute = SceneItem(name="far", model="/models/a.ply")
    write_scene_file(replace(file, items=(*file.items, absolute)), other / "b.scene.json")
    read = read_scene_file(other / "b.scene.json")
    assert [i.model for i in read.items] == [
        "../../models/three layers.ply", "../../../plain.ply", "/models/a.ply",
    ]  # fmt: skip
    assert read.background.collider == "../../table.obj"
    for before, after in zip(file.all_items, read.all_items, strict=False):
        assert file.path(before.model).resolve() == read.path(after.model).resolve()


def test_it_is_recognised(tmp_path, path):
    assert is_scene_file(path)
    other = tmp_path / "scene.json"
    other.write_text(path.read_text())
    assert is_scene_file(other) and read_scene_file(other).items
    other.write_text('{"frames": []}')
    assert not is_scene_file(other)
    assert not is_scene_file(tmp_path)
    assert not is_scene_file(tmp_path / "absent.json")


# where in the file, the key, the value, what must be said beside the key
NOT_A_NUMBER = ("one", True, None, [1], {}, 10**400)
WRONG = [
    (("format",), "shapeshift-scene 2", FORMAT),
    (("gravity_m_s2",), -1, "m/s2"),
    (("floor_y",), "low", "metres"),
    (("floor_y",), 10001, "metres"),
    (("objects", 0, "pose", "position"), [0, 0, -10001], "up to 10000"),
    (("view",), [], "braces"), (("view", "eye"), [0, 1], "3 finite numbers"),
    (("view", "target"), [0, 5, 2], "straight above"),
    (("view", "fov_y"), 4, "radians"),
    (("up",), [0, 1, 0], "braces"), (("up", "used"), "stated", "'by' of one of its ways"),
    (("up", "used"), "hearsay", "'assumed'"), (("up", "ways"), [], "'by' of one of its ways"),
    (("up", "ways", 1, "up"), [0, 2, 0], "length 1"), (("up", "ways", 2, "things"), "mug", "list"),
    (("background",), "table.ply", "braces"),
    (("background", "model"), "", "path"),
    (("objects",), {}, "a list"),
    (("objects",), [1], "a list"),
    *[(("objects", 0, key), value, said) for key, value, said in [
        ("name", "", "one line"), ("name", 5, "one line"), ("name", "a\nb", "one line"),
        ("name", "n" * 101, "100 letters"),
        ("model", "a\\b.ply", "forward slashes"), ("model", "a\0b", "forward slashes"),
        ("model", None, "path"), ("collider", 5, "path"), ("collider", "a\\b", "slashes"),
        ("mode", "both", "'cumulative'"), ("up", "up", "'+X'"), ("flip", 1, "true or false"),
        ("static", "no", "true or false"), ("visible", None, "true or false"),
        ("ring", 0, "true or false"),
        ("x", 1.5, "0 to 1"), ("x", -0.1, "0 to 1"), ("x", {"bone": 0.5}, "1 in the sum"),
        ("x", {"bone": -0.5, "skin": 1.5}, "1 in the sum"), ("x", {"bone": "1"}, "numbers from"),
        ("x", {"bone": True}, "numbers from"), ("x", {}, "1 in the sum"),
        ("mass_kg", 0, "above 0"), ("mass_kg", -3, "above 0"),
        ("friction", -1, "0 to 10"), ("restitution", 1.01, "0 to 1"),
        *[(key, value, "") for value in NOT_A_NUMBER
          for key in ("x", "mass_kg", "friction", "restitution")],
        ("pose", [], "braces"), ("selectors", {}, "a list"), ("states", [1], "a list"),
        ("reactions", "grab", "a list"), ("two_axes", 1, "braces"),
    ]],
    (("objects", 0, "pose", "position"), [0, 0, "0"], "3 finite numbers"),
    (("objects", 0, "pose", "wxyz"), [1, 1, 0, 0], "length 1"),
    (("objects", 0, "pose", "wxyz"), [0, 0, 0, 0], "length 1"),
    (("objects", 0, "two_axes", "rest"), 2, "0 to 1"),
    (("objects", 0, "states", 1, "x"), 2, "0 to 1"),
    (("objects", 0, "states", 1, "name"), "next", "next"),
    (("objects", 0, "states", 1, "name"), "normal", "'states': two are called 'normal'"),
    (("objects", 0, "selectors", 0, "kind"), "cone", "'sphere'"),
    (("objects", 0, "selectors", 0, "radius"), -1, "0 or more"),
    (("objects", 0, "selectors", 0, "x"), 2, "0 to 1"),
    (("objects", 0, "selectors", 0, "space"), "mine", "'world'"),
    (("objects", 0, "selectors", 2, "normal"), [0, 0, 0], "not zero"),
    (("objects", 0, "selectors", 6, "weight"), [0, 2], "0 to 1"),
    (("objects", 0, "selectors", 6, "weight"), 7, "finite numbers"),
    (("objects", 0, "reactions", 0, "on"), "touch", "'collision'"),
    (("objects", 0, "selectors", 0, "x"), {"bone": 2}, "1 in the sum"),
    (("objects", 0, "states", 1, "x"), {"bone": 0.5}, "1 in the sum"),
    (("objects", 0, "reactions", 0, "to"), {"bone": 0.5}, "1 in the sum"),
    (("objects", 0, "reactions", 0, "to"), "", "a state"),
    (("objects", 0, "reactions", 0, "to"), 3, "a state"),
    (("objects", 0, "reactions", 0, "to"), True, "a state"),
    (("objects", 0, "reactions", 0, "seconds"), -1, "0 or more"),
    (("objects", 0, "reactions", 0, "cooldown_s"), None, "0 or more"),
    (("objects", 0, "reactions", 0, "ease"), "bouncy", "'smooth'"),
    (("objects", 0, "reactions", 0, "least_impulse_n_s"), -1, "0 or more"),
    (("objects", 0, "reactions", 1, "from"), [5], "the name of a state"),
    (("objects", 0, "reactions", 1, "region"), {"kind": "sphere"}, "'centre' is missing"),
    (("objects", 0, "reactions", 3, "region", "kind"), "half", "'box'"),
    (("objects", 0, "reactions", 3, "region", "x"), 0.5, "leave them out"),
    (("objects", 0, "reactions", 3, "region", "half"), [1, 1], "3 finite"),
]  # fmt: skip


def changed(path: Path, way: tuple, value: object, remove: bool = False) -> str:
    data = copy.deepcopy(json.loads(path.read_text()))
    inner = data
    for key in way[:-1]:
        inner = inner[key]
    if remove:
        del inner[way[-1]]
    else:
        inner[way[-1]] = value
    path.write_text(json.dumps(data))
    with pytest.raises(BadFile) as refused:
        read_scene_file(path)
    sentence = str(refused.value)
    assert "\n" not in sentence and sentence.endswith((".", "?")) and path.name in sentence
    if way[0] == "objects" and len(way) > 2 and way[2] != "name":
        assert f"object '{FULL.name}'" in sentence
    return sentence


@pytest.mark.parametrize("way,value,said", WRONG)
def test_a_wrong_value_is_one_sentence_with_object_and_key(path, way, value, said):
    sentence = changed(path, way, value)
    key = next(k for k in reversed(way) if isinstance(k, str))
    assert key in sentence or said.startswith("'states'")
    assert said in sentence


INNER = [(), ("view",), ("background",), ("sky",), ("views", 0), ("appearance",),
         ("objects", 0, "appearance"), ("objects", 0), ("objects", 0, "pose"),
         ("objects", 0, "two_axes"), ("objects", 0, "states", 0), ("objects", 0, "reactions", 0),
         ("objects", 0, "reactions", 3, "region"),
         *[("objects", 0, "selectors", i) for i in range(6)]]  # fmt: skip


@pytest.mark.parametrize("way", INNER)
def test_unknown_keys_are_refused_by_name(path, way):
    assert "'colour' is no key here" in changed(path, (*way, "colour"), 1)


def test_a_typing_error_is_told_apart(path):
    sentence = changed(path, ("objects", 0, "frictoin"), 0.5)
    assert "'frictoin' is no key here; did you mean 'friction'?  Else leave it out." in sentence


@pytest.mark.parametrize(
    "way",
    [("objects", 1, "model"), ("objects", 0, "name"), ("background", "model"), ("view", "eye"),
     ("objects", 0, "states", 0, "x"), ("objects", 0, "reactions", 0, "on"),
     ("objects", 0, "reactions", 0, "to"), ("objects", 0, "selectors", 0, "x")],
)  # fmt: skip
def test_what_must_be_there_is_missed_by_name(path, way):
    if way == ("objects", 1, "model"):
        way = ("objects", 0, "model")
    assert f"'{way[-1]}' is missing" in changed(path, way, None, remove=True)


@pytest.mark.parametrize(
    "text,said",
    [
        ("", "is empty"), ("[]", "one object in braces"), ("{", "column 2"), ('{"a":\n', "line 2"),
        ('{"objects": [NaN]}', "a list of objects"), ("[" * 100_000, "not JSON"),
        ('{"floor_y": NaN}', "'floor_y'"), ('{"floor_y": 1e999}', "'floor_y'"),
        ('{"floor_y": ' + "9" * 5000 + "}", "not JSON"),
        ('{"floor_y": 1, "floor_y": 2}', "stands twice"),
        ('{"objects": [{"name": "a", "model": "a"}, {"name": "a", "model": "b"}]}', "taken twice"),
        ('{"objects": [{"name": "background", "model": "a"}]}', "for the background alone"),
        ('{"objects": [{"name": "a", "model": "a", "static": true, '
         '"reactions": [{"on": "ray", "to": 1}]}]}', "'collider' is missing"),
        (json.dumps({"objects": [{"name": str(i), "model": "a"} for i in range(1001)]}), "at most"),
    ],
)  # fmt: skip
def test_no_scene_at_all_is_one_sentence(tmp_path, text, said):
    path = tmp_path / "a.scene.json"
    path.write_text(text)
    with pytest.raises(BadFile, match=said):
        read_scene_file(path)
    path.write_bytes(b"\xff\xff" + text.encode())
    with pytest.raises(BadFile, match="no text at all"):
        read_scene_file(path)


def test_anything_anywhere_is_a_scene_or_one_sentence(path):
    """Every value of the file, replaced by every kind of nonsense."""
    text = path.read_text()
    bad = (None, True, -1, 0.5, 1e300, "", "x", [], [0], {}, {"x": 0}, [[]], "next")

    def ways(node: object, way: tuple = ()):
        if way:
            yield way
        rows = enumerate(node) if isinstance(node, list) else ()
        for key, inner in node.items() if isinstance(node, dict) else rows:
            yield from ways(inner, (*way, key))

    for way in ways(json.loads(text)):
        for value in bad:
            data = json.loads(text)
            inner = data
            for key in way[:-1]:
                inner = inner[key]
            inner[way[-1]] = value
            path.write_text(json.dumps(data))
            try:
                assert isinstance(read_scene_file(path), SceneFile)
            except BadFile:
                pass


def write_layer(path: Path, count: int = 4) -> None:
    rng = np.random.default_rng(count)
    wxyz = np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1))
    scales = np.full((count, 3), 0.01, np.float32)
    means = rng.normal(size=(count, 3)).astype(np.float32) * 0.1
    splats = PlainSplats(means, scales, wxyz, np.full(count, 0.9, np.float32),
                         rng.normal(size=(count, 1, 3)).astype(np.float32))  # fmt: skip
    write_ply(splats, path)


def small(tmp_path: Path, **changes) -> SceneFile:
    folder = tmp_path / "two"
    folder.mkdir()
    write_layer(folder / "layer0.ply")
    write_layer(folder / "layer1.ply", 3)
    item = SceneItem(name="a", model="two", mode="exclusive", position=(1, 2, 3), x=0.25)
    background = SceneItem(name="background", model="two/layer0.ply", static=True)
    items = (replace(item, **changes), replace(item, name="b"))
    return SceneFile(folder=tmp_path, items=items, background=background)


def test_the_renderer_gets_every_object_where_it_is(tmp_path):
    file = small(tmp_path, wxyz=(HALF, 0.0, HALF, 0.0), visible=False, selectors=SELECTORS[:1])
    file, models = read_models(file)
    assert models["a"] is models["b"] and models["a"].mode == "exclusive"
    scene = scene_of(file, models)
    assert [(o.name, o.label, o.x, o.visible) for o in scene.objects] == [
        ("background", 0, 0.0, True), ("a", 1, 0.25, False), ("b", 2, 0.25, True)
    ]  # fmt: skip
    assert scene.objects[1].selectors == SELECTORS[:1]
    np.testing.assert_array_equal(scene.objects[1].world_from_object.position, (1, 2, 3))
    assert abs(np.linalg.norm(scene.objects[1].world_from_object.wxyz) - 1) < 1e-15


def test_states_without_a_list_are_the_stops(tmp_path):
    reactions = (Reaction(on="grab", to="layer1"),)
    file = small(tmp_path, reactions=reactions)
    machine = machine_of(file.items[0], read_models(file)[1]["a"])
    assert machine.states == (State("layer0", 0.0), State("layer1", 1.0))
    assert machine_of(file.items[1], read_models(file)[1]["b"]).states == ()
    wrong = replace(file.items[0], reactions=(Reaction(on="grab", to="hot"),))
    with pytest.raises(BadFile, match="object 'a': 'reactions': 'hot' is no state; there are lay"):
        machine_of(wrong, read_models(file)[1]["a"])


def test_a_blend_of_stops_that_the_model_has_not_is_refused(tmp_path):
    states = {"states": (State("a", BLEND), State("b", 0.0)), "reactions": REACTIONS[:1]}
    for number, changes in enumerate(({"x": BLEND}, states)):
        (tmp_path / str(number)).mkdir()
        file = small(tmp_path / str(number), **changes)
        with pytest.raises(BadFile, match=r"object '.*'.*no stop 'bone'; there "):
            file, models = read_models(file)
            scene_of(file, models)
            machine_of(file.items[0], models[file.items[0].name])


def test_a_model_that_is_no_model_names_its_object(tmp_path):
    file = small(tmp_path, model="absent.ply")
    with pytest.raises(BadFile, match=r"object 'a': 'model': .*absent.ply does not exist"):
        read_models(file)
    file = replace(file, items=(replace(file.items[1], selectors=SELECTORS[-1:]),))
    with pytest.raises(BadFile, match="painted are 3 weights, its model has 7 anchors"):
        scene_of(*read_models(file))
