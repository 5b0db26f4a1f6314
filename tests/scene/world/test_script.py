"""Scripts of hands and rays: what a line may say, and the line that every refusal names."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.document.scene_file import SceneItem
from shapeshift.scene.pose import Pose
from shapeshift.scene.world.reactions import TwoAxes
from shapeshift.scene.world.read_script import HandPath, between, read_script

ITEMS = (SceneItem(name="a", model="a"), SceneItem(name="b", model="b", two_axes=TwoAxes()))
HALF = math.sqrt(0.5)
HAND = {"t": 0, "do": "hand", "position": [0, 0, 0]}


def write(tmp_path: Path, *rows: dict | str) -> Path:
    path = tmp_path / "s.jsonl"
    path.write_text("\n".join(r if isinstance(r, str) else json.dumps(r) for r in rows))
    return path


def test_a_script_reads_as_it_says(tmp_path):
    path = write(
        tmp_path, "# a comment", HAND, "", {"t": 0.5, "do": "grab", "reach_m": 0.2}, "  ",
        {"t": 0.5, "do": "ray", "origin": [0, 1, 0], "direction": [0, -2, 0]},
        {"t": 1, "do": "control", "object": "b", "balance": -1, "power": 0.5},
        {"t": 1, "do": "control", "object": "a", "x": 1}, {"t": 2, "do": "lose"}, "",
    )  # fmt: skip
    acts = read_script(path, ITEMS)
    assert [(a.line, a.t, a.do) for a in acts] == [
        (2, 0, "hand"), (4, 0.5, "grab"), (6, 0.5, "ray"), (7, 1, "control"), (8, 1, "control"),
        (9, 2, "lose"),
    ]  # fmt: skip
    assert acts[1].reach_m == 0.2 and acts[2].direction == (0, -2, 0)
    assert (acts[3].balance, acts[3].power, acts[3].x, acts[4].x) == (-1, 0.5, None, 1)
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert [a.line for a in read_script(path, ITEMS)] == [a.line for a in acts]
    assert read_script(write(tmp_path), ITEMS) == ()


@pytest.mark.parametrize(
    "row,said",
    [
        ("{", "not JSON"), ("[]", "one object"), ("\xff", "not JSON"), ({"do": "grab"}, "'t' is m"),
        ({"t": -1, "do": "lose"}, "'t' is -1"), ('{"t": NaN, "do": "lose"}', "'t' is NaN"),
        ({"t": 1e9, "do": "lose"}, "to a day"), ({"t": 0.5, "do": "grab"}, "lines go on in time"),
        ({"t": 1}, "'do' is missing"), ({"t": 1, "do": "jump"}, "'do' is \"jump\""),
        ({"t": 1, "do": "hand"}, "'position' is missing"),
        ({"t": 1, "do": "hand", "position": [1, 2]}, "3 finite numbers"),
        ({"t": 1, "do": "hand", "position": [1, 2, 1e5]}, "up to 10000"),
        ({"t": 1, "do": "hand", "position": [1, 2, 3], "wxyz": [2, 0, 0, 0]}, "length 1"),
        ({"t": 1, "do": "hand", "position": [1, 2, 3], "hnad": "left"}, "did you mean 'hand'?"),
        ({"t": 1, "do": "grab", "hand": "left"}, "hand 'left' is nowhere yet"),
        ({"t": 1, "do": "release", "hand": "left"}, "hand 'left' is nowhere yet"),
        ({"t": 1, "do": "grab", "reach_m": -1}, "metres"),
        ({"t": 1, "do": "ray", "origin": [0, 0, 0]}, "'direction' is missing"),
        ({"t": 1, "do": "ray", "origin": [0, 0, 0], "direction": [0, 0, 0]}, "not zero"),
        ({"t": 1, "do": "control", "object": "c", "x": 0}, "'a' or 'b'"),
        ({"t": 1, "do": "control", "object": "a"}, "either 'x' or"),
        ({"t": 1, "do": "control", "object": "b", "x": 0, "balance": 0, "power": 0}, "either 'x'"),
        ({"t": 1, "do": "control", "object": "b", "balance": 0}, "either 'x' or"),
        ({"t": 1, "do": "control", "object": "b", "balance": 2, "power": 0}, "-1 to 1"),
        ({"t": 1, "do": "control", "object": "a", "balance": 0, "power": 0}, "has no 'two_axes'"),
        ('{"t": 1, "t": 2, "do": "lose"}', "stands twice"),
    ],
)  # fmt: skip
def test_every_wrong_line_is_one_sentence_with_its_number(tmp_path, row, said):
    path = write(tmp_path, "# first", HAND, {"t": 1, "do": "lose"}, "", row)
    with pytest.raises(BadFile) as refused:
        read_script(path, ITEMS)
    sentence = str(refused.value)
    assert sentence.startswith("s.jsonl, line 5") and said in sentence
    assert "\n" not in sentence


def test_no_script_at_all(tmp_path):
    with pytest.raises(BadFile, match="is no file"):
        read_script(tmp_path)
    with pytest.raises(BadFile, match="no object to control"):
        read_script(write(tmp_path, {"t": 1, "do": "control", "object": "a", "x": 1}))


def test_a_hand_goes_straight_and_turns_evenly(tmp_path):
    turned = [HALF, 0, HALF, 0]
    acts = read_script(
        write(
            tmp_path, {"t": 1, "do": "hand", "position": [0, 0, 0]},
            {"t": 2, "do": "hand", "hand": "left", "position": [9, 9, 9]},
            {"t": 3, "do": "hand", "position": [1, 2, 3], "wxyz": turned},
            {"t": 3, "do": "hand", "position": [5, 5, 5]},
        )
    )  # fmt: skip
    path = HandPath(acts, "right")
    for time, place in ((0, 0), (1, 0), (2, 0.5), (2.5, 0.75)):
        np.testing.assert_allclose(path.at(time).position, np.array([1, 2, 3]) * place)
    for time in (3, 4):  # of two at once the later one counts
        np.testing.assert_array_equal(path.at(time).position, [5, 5, 5])
    quarter = path.at(2).wxyz  # half of a quarter turn
    np.testing.assert_allclose(quarter, [math.cos(math.pi / 8), 0, math.sin(math.pi / 8), 0])


@pytest.mark.parametrize("seed", range(5))
def test_between_is_the_shorter_way_and_of_length_one(seed):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(2, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    first, last = (Pose(np.zeros(3), row) for row in q)
    half = between(first, last, 0.5).wxyz
    assert abs(half @ q[0]) == pytest.approx(abs(half @ q[1]))
    assert abs(half @ q[0]) >= math.cos(math.pi / 4) - 1e-12
    same = between(first, Pose(np.ones(3), -q[0]), 0.3)
    np.testing.assert_allclose(same.wxyz, q[0], atol=1e-12)


def test_anything_in_a_line_is_an_act_or_one_sentence(tmp_path):
    lines = [
        HAND | {"wxyz": [1, 0, 0, 0], "hand": "left"}, {"t": 1, "do": "grab", "reach_m": 1},
        {"t": 1, "do": "ray", "origin": [0, 1, 0], "direction": [0, -2, 0]},
        {"t": 1, "do": "control", "object": "b", "balance": -1, "power": 0.5},
    ]  # fmt: skip
    bad = (None, True, -1, 0.5, 1e300, "", "x", [], [0], [0, 0, 1e300], {}, "hand", "\ud800", "a\0")
    for line in lines:
        for key in line:
            for value in bad:
                path = write(tmp_path, HAND, line | {key: value})
                try:
                    assert len(read_script(path, ITEMS)) == 2
                except BadFile as error:
                    assert str(error).startswith("s.jsonl, line 2")


def test_a_script_without_end_is_refused(tmp_path):
    with pytest.raises(BadFile, match="100,002 lines"):
        read_script(write(tmp_path, *[""] * 100_002))
