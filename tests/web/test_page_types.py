"""The page's JSDoc types, checked by the TypeScript compiler; its syntax, by node."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from shapeshift.app.page.page_file import one_script
from shapeshift.app.page.squeeze import squeeze

ROOT = Path(__file__).resolve().parents[2]
OPTIONS = {
    "allowJs": True, "checkJs": True, "noEmit": True, "strict": True, "target": "es2022",
    "module": "es2022", "moduleResolution": "bundler", "lib": ["es2022", "dom", "dom.iterable"],
    "types": [],
}  # fmt: skip


def test_types_fit(tmp_path):
    tsc = shutil.which("tsc")
    if not tsc:
        pytest.skip("there is no tsc; npm install -g typescript")
    config = tmp_path / "tsconfig.json"
    config.write_text(json.dumps({"compilerOptions": OPTIONS, "include": [f"{ROOT}/web/**/*.js"]}))
    done = subprocess.run([tsc, "-p", str(config)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout[:3000]


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
