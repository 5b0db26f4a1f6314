"""objects.json: what is written comes back, every wrong value is one sentence with its key."""

import copy
import json

import pytest

from shapeshift.decomposition.masks.specs import (
    FORMAT,
    ObjectSpec,
    ObjectSpecs,
    PhotoPrompt,
    read_specs,
)
from shapeshift.runtime_models.model import BadFile
from tests.support.decomposition.spec_files import write_specs

MUG = ObjectSpec(
    1,
    "müg",
    (
        PhotoPrompt("rgb/012.png", (310, 200.5, 402, 296), ((350, 250),), ((1, 2), (3, 4))),
        PhotoPrompt("rgb/001.png", inside=((0, 0),)),
        PhotoPrompt("rgb/002.png", mask="masks/2.png", mask_label=255),
    ),
    "a mug",
    0.3,
    True,
    None,
)
ROW = {
    "label": 1,
    "name": "mug",
    "prompts": [{"photo": "a.png", "box": [0, 0, 4, 5], "inside": [[1, 2]], "outside": []}],
}


def written(folder, row: dict, **more):
    data = {"format": FORMAT, "objects": [row], **more}
    (folder / "objects.json").write_text(json.dumps(data))
    return folder / "objects.json"


def test_what_is_written_comes_back(tmp_path):
    specs = ObjectSpecs(
        tmp_path, (MUG, ObjectSpec(254, "plain"), ObjectSpec(7, "x", collider="a/b.obj"))
    )
    write_specs(specs, tmp_path / "objects.json")
    assert read_specs(tmp_path / "objects.json") == specs
    first = (tmp_path / "objects.json").read_bytes()
    write_specs(read_specs(tmp_path / "objects.json"), tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == first
    assert specs.path(MUG.prompts[2]) == tmp_path / "masks/2.png"


WRONG = [
    ({"label": 0}, "'label' is 0"), ({"label": 255}, "'label' is 255"),
    ({"label": True}, "'label' is true"), ({"label": 1.0}, "'label' is 1.0"),
    ({"label": None}, "'label' is null"), ({"name": ""}, "'name'"), ({"name": " "}, "'name'"),
    ({"name": "a" * 101}, "at most 100 letters"), ({"name": "background"}, "label 0 is called"),
    ({"name": 3}, "'name' is 3"), ({"mass_kg": 0}, "'mass_kg' is 0"),
    ({"mass_kg": -1}, "'mass_kg'"), ({"static": 1}, "true or false"), ({"text": 5}, "'text' is 5"),
    ({"collider": "a\\b"}, "forward slashes"), ({"colider": "hulls"}, "did you mean 'collider'"),
    ({"prompts": {}}, "'prompts'"), ({"prompts": [1]}, "'prompts'"),
    ({"prompts": [ROW["prompts"][0]] * 2}, "two prompts are of the photo 'a.png'"),
]  # fmt: skip
WRONG_PROMPTS = [
    ({"photo": None}, "'photo' is null"), ({"photo": "a\\b"}, "forward slashes"),
    ({"box": [0, 0, 4]}, "'box'"), ({"box": [4, 0, 4, 5]}, "left, top, right, bottom"),
    ({"box": [0, 5, 4, 5]}, "left, top, right, bottom"), ({"box": [0, 0, 4, 1e9]}, "'box'"),
    ({"box": [0, 0, 4, "5"]}, "'box'"), ({"inside": [1, 2]}, "'inside'"),
    ({"inside": [[1, 2, 3]]}, "'inside'"), ({"inside": [[-1, 2]]}, "'inside'"),
    ({"inside": [[1, 2]] * 1001}, "at most 1,000"), ({"outside": [[True, 2]]}, "'outside'"),
    ({"mask": "m.png"}, "a mask alone"), ({"mask": 3, "box": None, "inside": []}, "'mask' is 3"),
    ({"mask_label": 3}, "together with 'mask'"), ({"box": None, "inside": []}, "shows nothing"),
    ({"mask": "m", "box": None, "inside": [], "mask_label": 0}, "'mask_label' is 0"),
    ({"point": [1, 2]}, "'point' is no key"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "word"), WRONG)
def test_a_wrong_value_is_one_sentence(tmp_path, change, word):
    with pytest.raises(BadFile) as caught:
        read_specs(written(tmp_path, ROW | change))
    assert word in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("change", "word"), WRONG_PROMPTS)
def test_a_wrong_prompt_is_one_sentence_that_names_the_object(tmp_path, change, word):
    row = copy.deepcopy(ROW)
    row["prompts"][0].update(change)
    with pytest.raises(BadFile) as caught:
        read_specs(written(tmp_path, row))
    assert word in str(caught.value) and "object 'mug': prompt 1" in str(caught.value)


def test_the_whole_file(tmp_path):
    for data, word in (
        ({"objects": [ROW]}, "'format' is missing"),
        ({"format": "shapeshift-objects 2", "objects": [ROW]}, "shapeshift-objects 1"),
        ({"format": FORMAT}, "one object or more"),
        ({"format": FORMAT, "objects": []}, "one object or more"),
        ({"format": FORMAT, "objects": [ROW, ROW]}, "two objects have the label 1"),
        ({"format": FORMAT, "objects": [ROW, ROW | {"label": 2}]}, "two objects have the name"),
        ({"format": FORMAT, "objects": [ROW], "more": 1}, "'more' is no key"),
        ([], "one object in braces"),
    ):
        (tmp_path / "a.json").write_text(json.dumps(data))
        with pytest.raises(BadFile, match=word):
            read_specs(tmp_path / "a.json")
    (tmp_path / "a.json").write_text('{"format": 1, "format": 2}')
    with pytest.raises(BadFile, match="stands twice"):
        read_specs(tmp_path / "a.json")
    with pytest.raises(BadFile, match="no file"):
        read_specs(tmp_path)
