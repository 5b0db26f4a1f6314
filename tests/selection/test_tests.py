"""Every test can fail: it asserts something, by itself or by a helper that it names."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
FUNCTION = re.compile(r"^( *)(?:async )?def (\w+)", re.MULTILINE)
IMPORT = re.compile(r"^ *from (tests\.[\w.]+) import (\([^)]*\)|.*)$", re.MULTILINE)
JUDGES = re.compile(
    r"^ *(assert|raise AssertionError)\b|\bpytest\.(raises|warns|fail)\b|\bnp\.testing\."
    r"|\bcheck=True\b",
    re.MULTILINE,
)


# What is wanted of these is that nothing is raised.
PASSES = {
    "tests.app.test_progress.test_nobody_has_to_read_the_lines",
    "tests.program.test_doors.test_every_door_opens_names_that_are_no_utf8",
    "tests.runtime_models.files.test_memory.test_what_this_program_made_itself_is_not_bound",
    "tests.runtime_models.lint.test_lint_package.test_networks_that_give_nothing_drawable_pass_the_gate",
    "tests.runtime_models.test_package.test_onnx_models_pass_the_checker",
    "tests.scene.captures.test_depth_photo.test_points_that_are_hidden_do_not_matter",
    "tests.training.gradients.test_check_network.test_usual_networks_pass",
}


def functions_of(text: str) -> Iterator[tuple[str, str]]:
    """(name, source) of all functions, those within others and methods, too."""
    for match in FUNCTION.finditer(text):
        deeper = re.compile(rf"\n(?! {{{len(match[1])}}} |\)|[ \n]*\n)")
        end = deeper.search(text, text.index("\n", match.end()))
        yield match[2], text[match.start() : end.start() if end else len(text)]


def helpers_of(texts: dict[str, str]) -> dict[str, set[str]]:
    """Of each module the names of what judges there: its own functions, those that it imports."""
    own = {module: list(functions_of(text)) for module, text in texts.items()}
    found = {
        module: {name for name, source in functions if JUDGES.search(source)}
        for module, functions in own.items()
    }
    words = {
        module: [(name, set(re.findall(r"\w+", source))) for name, source in functions]
        for module, functions in own.items()
    }
    imports = {
        module: [(m[1], set(re.findall(r"\w+", m[2]))) for m in IMPORT.finditer(text)]
        for module, text in texts.items()
    }
    fixtures = [module for module in texts if module.endswith("conftest")]
    more = True
    while more:
        before = sum(map(len, found.values()))
        for module, names in found.items():
            for source, taken in imports[module]:
                names |= taken & found.get(source, set())
            for conftest in fixtures:
                if module.startswith(conftest.removesuffix("conftest")):
                    names |= found[conftest]
            names |= {name for name, used in words[module] if used & names}
        more = sum(map(len, found.values())) > before
    return found


def blind_tests(texts: dict[str, str]) -> list[str]:
    """Tests of modules (name: text) that pass whatever the code does, unless it raises."""
    helpers, found = helpers_of(texts), []
    for module, text in texts.items():
        doubtful = {name for name, _ in functions_of(text) if name.startswith("test_")}
        if doubtful := doubtful - helpers[module]:
            for node in ast.walk(ast.parse(text)):  # knows what is text within a text
                if isinstance(node, ast.FunctionDef) and node.name in doubtful:
                    if not JUDGES.search(ast.unparse(node)):
                        found.append(f"{module}.{node.name}")
    return found


def test_every_test_can_fail():
    texts = {
        ".".join(path.relative_to(TESTS.parent).with_suffix("").parts): path.read_text()
        for path in TESTS.rglob("*.py")
    }
    assert set(blind_tests(texts)) == PASSES


HELPER = """
def judge(x):
    assert x

def look(x):
    return x
"""
TEST = """
from tests.a import judge, look

def test_a():
    judge(1)

def test_b(
    thing,
):
    look(2)

def test_c():
    with pytest.raises(OSError):
        look(3)

class TestD:
    def test_e(self):
        look("assert")

    def test_f(self):
        assert look(5)
"""


def test_one_that_cannot_is_found():
    assert blind_tests({"tests.a": HELPER, "tests.b": TEST}) == ["tests.b.test_b", "tests.b.test_e"]
