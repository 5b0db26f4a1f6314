"""How kernels and shaders read: each begins with its contract and says why it does what it does."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("rasterizer/kernels", "renderer/shaders", "training/kernels", "vr/shaders")
KINDS = (".cl", ".comp", ".glsl", ".vert", ".frag")
# Lines with a comment over lines with code.  Shaders by those who explain their maths best have
# 0.3 to 0.5 (pygfx, splatapult, nvpro): nobody can step through them.
LEAST_SHARE = 0.30
LABELS = ("Reads", "Writes", "Defines", "Units")  # in this order
ENTRY = re.compile(r"^(void main\(\)|__kernel\b)", re.MULTILINE)  # a pass has one, a chunk has none


def files(folder: str) -> dict[str, str]:
    """Text by path of every kernel and shader under a folder of the project."""
    paths = sorted(p for p in (ROOT / folder).rglob("*") if p.suffix in KINDS)
    return {str(p.relative_to(ROOT)): p.read_text(encoding="utf-8") for p in paths}


FILES = {path: text for folder in FOLDERS for path, text in files(folder).items()}


def contract(text: str) -> dict[str, str]:
    """What the comment at the file's beginning says: its purpose, and each label by its name."""
    said, label = {"purpose": ""}, "purpose"
    for line in text.splitlines():
        if not line.startswith("//"):
            break
        found = re.match(r"//\s*(\w+):\s+(.*)", line)
        if found and found[1] in LABELS:
            label = found[1]
            said[label] = ""
            line = found[2]
        said[label] += line.lstrip("/ ") + " "
    return {name: words.strip() for name, words in said.items()}


def counted(text: str) -> tuple[int, int]:
    """Lines with code, and lines with a comment; one line may be both."""
    code = commented = 0
    for line in text.splitlines():
        before = re.split(r"//|/\*", line)[0]
        code += bool(before.strip(" \\"))
        commented += before != line
    return code, commented


def test_every_file_begins_with_its_purpose_and_its_contract():
    wrong = {}
    for path, text in FILES.items():
        said = contract(text)
        writes = "Writes" if ENTRY.search(text) else "Defines"  # passes write, chunks define
        if [*said] != ["purpose", "Reads", writes, "Units"] or not all(said.values()):
            wrong[path] = [*said]
    assert FILES
    assert not wrong


@pytest.mark.parametrize("folder", FOLDERS)
def test_three_lines_in_ten_carry_a_comment(folder):
    pairs = [counted(text) for text in files(folder).values()]
    code, commented = (sum(column) for column in zip(*pairs, strict=True))
    assert commented >= LEAST_SHARE * code, f"{commented} lines of {code}"


def said_twice(texts: dict[str, str], lines: int) -> list[str]:
    """Places where so many lines of code follow each other as they do in an earlier place."""
    seen, found = {}, []
    for path, text in texts.items():
        code = [
            (number, " ".join(words.split()))
            for number, line in enumerate(text.splitlines(), 1)
            if re.search(r"\w", words := line.split("//")[0])
        ]
        for i in range(len(code) - lines + 1):
            window = tuple(line for _, line in code[i : i + lines])
            here = f"{path}:{code[i][0]}"
            if seen.setdefault(window, here) != here:
                found.append(f"{here} ~ {seen[window]}")
    return found


def test_what_is_said_alike_stands_once():
    """Five lines that stand twice belong in a chunk of common/, which both include."""
    page = {
        path.name: "\n".join(path.read_text(encoding="utf-8").split("`")[1::2])
        for path in sorted((ROOT / "web").rglob("*.js"))
    }
    kernels = {path: text for path, text in FILES.items() if path.endswith(".cl")}
    shaders = {path: text for path, text in FILES.items() if path not in kernels}
    for texts in (kernels, shaders, page):
        assert sum("main()" in text or "__kernel" in text for text in texts.values()) >= 6
        assert not said_twice(texts, 5)
    text = "int a;\nint b;  // why\n\n}\nint c;\n"
    assert said_twice({"x": text, "y": f"int d;\n  {text}"}, 3) == ["y:2 ~ x:1"]


def test_no_line_is_too_long_and_no_file():
    """100 columns and 400 lines, as in Python; comments of the one kind that is counted right."""
    for path, text in FILES.items():
        lines = text.splitlines()
        assert len(lines) <= 400, path
        for number, line in enumerate(lines, 1):
            assert len(line) <= 100 and line == line.rstrip(), f"{path}:{number}"
            assert line.count("/*") == line.count("*/"), f"{path}:{number}: over several lines"


def test_the_count_knows_what_a_line_is():
    text = "// purpose\n\nint a;  // why\n  \\\nint b;\n#define C 1 /* of a macro */ \\\n"
    assert counted(text) == (3, 3)


def test_a_contract_needs_its_words():
    text = (
        "// draw: splats.\n// more of it\n// Reads:   a,\n//          b\n// Units:   px\nint x;\n"
    )
    assert contract(text) == {"purpose": "draw: splats. more of it", "Reads": "a, b", "Units": "px"}


def test_builtins_of_clang_that_take_plain_pointers_are_for_processors_alone():
    """NVIDIA's compiler knows __builtin_prefetch, and refuses it any __global pointer."""
    guard = "#if defined(__has_builtin) && (defined(__x86_64__) || defined(__aarch64__))"
    found = 0
    for path, text in FILES.items():
        for part in text.split("__builtin_prefetch")[:-1]:
            found += 1
            within = text[: text.index(part) + len(part)].rsplit(guard, 1)
            assert len(within) == 2 and "#e" not in within[1], f"{path}: outside of {guard}"
    assert found == 2
