"""The page's JSDoc types, checked by the TypeScript compiler; its syntax, by node."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Literal, NotRequired, TypedDict

import numpy as np
import pytest

from shapeshift.app.document import Document
from shapeshift.app.page.page_file import one_script, squeeze
from shapeshift.app.page.page_scene import PageSettings, page_scene
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.runtime_models.web.web_model import ControlEntry
from shapeshift.scene.scene import Scene
from shapeshift.scene.selectors.selector import Box, HalfSpace, Painted, Sphere
from tests.support.models import with_light
from tests.support.web.page_scenes import paced_model, plain_splats, several_objects
from tools.web.conventions import interface, script_type

ROOT = Path(__file__).resolve().parents[2]
OPTIONS = {
    "allowJs": True, "checkJs": True, "noEmit": True, "strict": True, "target": "es2022",
    "module": "es2022", "moduleResolution": "bundler", "lib": ["es2022", "dom", "dom.iterable"],
    "types": [],
}  # fmt: skip


class Sides(TypedDict):
    """Of a
    box.
    """

    wide: float
    name: NotRequired[str]


def scenes() -> list[dict]:
    """What Python writes of every kind of model, object and region, with all that may be absent."""
    (obj,) = Document.of(paced_model(20)).scene.objects
    painted = Painted(np.ones(20), StopWeights((("RGB", 0.5), ("Opened", 0.5))))
    shapes = (
        Sphere(x=0.4, centre=(0, 0, 0), radius=1),
        HalfSpace(x=1, point=(0, 0, 0), normal=(0, 1, 0)),
        Box(x=0.2, border=0.1, space="world", centre=(0, 0, 0), half=(1, 1, 1)),
    )  # fmt: skip
    parted = Document(Scene((replace(obj, selectors=(*shapes, painted)),)))
    lit = Document.of(with_light(paced_model(20, framed=False)))
    cases = [
        (several_objects(), PageSettings("several", exact=True)), (lit, PageSettings("lit")),
        (parted, PageSettings("with parts", profile="quest")),
        (Document.of(plain_splats(30, 0, thermal=True)), PageSettings("plain", pictures=False)),
    ]  # fmt: skip
    texts = [page_scene(document, settings, lambda *_: None) for document, settings in cases]
    return [json.loads(text[12 : 12 + int.from_bytes(text[8:12], "little")]) for text in texts]


def test_types_fit(tmp_path):
    """The page by the types of what Python writes, and those types by what it does write."""
    tsc = shutil.which("tsc")
    if not tsc:
        pytest.skip("there is no tsc; npm install -g typescript")
    written = tmp_path / "written.ts"
    written.write_text(
        f'import type {{ SceneEntry }} from "{ROOT}/web/entries.js";\n'
        + "".join(f"export const scene{i}: SceneEntry = {json.dumps(scene)};\n"
                  for i, scene in enumerate(scenes()))
        + "// @ts-expect-error\nexport const none: SceneEntry = { ...scene0, format: 'web 2' };\n"
        + "// @ts-expect-error\nexport const more: SceneEntry = { ...scene0, titel: '' };\n"
    )  # fmt: skip
    config = tmp_path / "tsconfig.json"
    include = [f"{ROOT}/web/**/*.js", str(written)]
    config.write_text(json.dumps({"compilerOptions": OPTIONS, "include": include}))
    done = subprocess.run([tsc, "-p", str(config)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout[:3000]


def test_a_python_type_is_written_as_json_has_it():
    wanted: list[type] = []
    for hint, text in (
        (int | None, "number | null"), (float | int, "number"), (list[str], "string[]"),
        (list[bool | None], "(boolean | null)[]"), (tuple[str, float], "[string, number]"),
        (dict[str, list[Sides]], "Record<string, Sides[]>"), (Literal["a", 'b"'], '"a" | "b\\""'),
        (ControlEntry, "ControlEntry"), (list[ControlEntry], "ControlEntry[]"),
    ):  # fmt: skip
        assert script_type(hint, wanted) == text
    assert wanted == [Sides]
    text = "/** Of a box. */\nexport interface Sides {\n    wide: number;\n    name?: string;\n}\n"
    assert interface(Sides, []) == text


@pytest.mark.parametrize("hint", [set[int], Path, tuple[int, ...], dict[int, str], bytes, list])
def test_what_json_has_not_is_refused_by_the_name_of_its_field(hint):
    wrong = type("Wrong", (), {"__annotations__": {"first": int, "second": hint}})
    with pytest.raises(TypeError, match=r"^Wrong\.second: .* is nothing that JSON has$"):
        interface(wrong, [])


def test_the_script_of_a_page_is_sound(node, tmp_path):
    path = tmp_path / "page.mjs"
    path.write_text(one_script())
    done = subprocess.run([node, "--check", str(path)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr[:2000]


@pytest.mark.parametrize(
    "text, wanted",
    [
        ("const a = 1;  // why\n\n\nlet b = a - -1;\n", "const a=1;let b=a- -1;\n"),
        ("f(\"a // b\", 'c  d', `e  ${ g + 1 }  h`) ;", "f(\"a // b\",'c  d',`e  ${g+1}  h`);\n"),
        ("/** @type {any} */ (x).y = /[/ ]+ \\/\\//g;", "(x).y=/[/ ]+ \\/\\//g;\n"),
        ("a = b / c / d;\nreturn x\n", "a=b/c/d;return x\n"),
        ("x = `\n  // no\n  vec2 a = b + c;\n`;", "x=`\nvec2 a=b+c;\n`;\n"),
        ("f()\n(g)\n", "f()\n(g)\n"),
        ("if (a) {\n  f([1,\n 2,\n]);\n}\nb", "if(a){f([1,2])}\nb\n"),
        ("x = y ? `a${ `b  ${ 1 } }` }` : {};", "x=y?`a${`b  ${1} }`}`:{};\n"),
    ],
)
def test_squeezing_keeps_the_tokens(text, wanted):
    assert squeeze(text) == wanted
