"""GLSL files: includes, defines, errors with file and line; and what holds for every shader."""

import re
from typing import Any

import pytest

from shapeshift.renderer import layout
from shapeshift.renderer.gl import shader

FILES = sorted(
    p.relative_to(shader.SHADERS).as_posix()
    for p in shader.SHADERS.rglob("*")
    if p.suffix in (".comp", ".vert", ".frag")
)
COMPUTE = [name for name in FILES if name.endswith(".comp")]
NO_DRIVER: Any = None
DECODER = {"LAYER_VECS": 16, "BLOCK_VECS": 1024, "STORED_WEIGHTS": 0, "OWN_CONTROL": 0}
NEEDS = {  # of shaders that say so at their head
    "decode_mlp.comp": DECODER,
    "colors/heat.comp": {"BLEND": 0},
    "weigh.comp": {"OWN_CONTROL": 0},
}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "common").mkdir()
    (tmp_path / "common" / "inner.glsl").write_text("int inner() { return 1; }\n")
    (tmp_path / "common" / "outer.glsl").write_text(
        '#include "common/inner.glsl"\nint outer() { return inner() + TWO; }\n'
    )
    (tmp_path / "main.comp").write_text(
        '#include "common/outer.glsl"\n#include "common/inner.glsl" // again\nvoid main() {}\n'
    )
    return tmp_path


def test_includes_come_once_and_keep_their_place(folder):
    lines = shader.read_shader("main.comp", folder, TWO=2)
    ours = [line for line in lines if line[0] != "<defines>"]
    assert ours == [
        ("common/inner.glsl", 1, "int inner() { return 1; }"),
        ("common/outer.glsl", 2, "int outer() { return inner() + TWO; }"),
        ("main.comp", 3, "void main() {}"),
    ]
    assert lines[0] == ("<defines>", 1, "#version 430")
    assert "#define TWO 2" in shader.joined(lines)


def test_a_missing_include_names_who_wants_it(folder):
    (folder / "common" / "outer.glsl").write_text('\n#include "common/gone.glsl"\n')
    with pytest.raises(shader.ShaderError, match=r"common/outer\.glsl:2 wants common/gone\.glsl"):
        shader.read_shader("main.comp", folder)


@pytest.mark.parametrize(
    "said",
    [
        "0:{}(5): error: `x' undeclared",  # Mesa
        '0({}) : error C1503: undefined variable "x"',  # NVIDIA
        "ERROR: 0:{}: 'x' : undeclared identifier",  # AMD, Intel on Windows
    ],
)
def test_every_driver_s_error_is_mapped_to_file_and_line(folder, said):
    lines = shader.read_shader("main.comp", folder)
    flat = next(i for i, line in enumerate(lines, start=1) if line[0] == "common/outer.glsl")
    told = shader.explain(said.format(flat), [lines])
    assert told.startswith("common/outer.glsl:2: ") and "x" in told.splitlines()[0]
    assert told.splitlines()[1] == "    int outer() { return inner() + TWO; }"


def test_the_driver_in_use_names_the_line(ctx, folder, monkeypatch):
    monkeypatch.setattr(shader, "SHADERS", folder)
    monkeypatch.setattr(shader.read_shader, "__defaults__", (folder,))
    with pytest.raises(shader.ShaderError, match=r"common/outer\.glsl:2: .*TWO"):
        shader.compile_compute(ctx, "main.comp")


def test_a_fragment_error_is_not_looked_up_in_the_vertex_file(ctx, folder):
    (folder / "a.vert").write_text("void main() { gl_Position = vec4(0); }\n")
    (folder / "a.frag").write_text("out vec4 color;\nvoid main() { color = vec4(nowhere); }\n")
    with pytest.raises(shader.ShaderError, match=r"a\.frag:2: .*nowhere"):
        shader.compile_program(ctx, "a.vert", "a.frag", folder)


@pytest.mark.parametrize("name", COMPUTE)
def test_every_compute_shader_compiles(gpu, name):
    defines = NEEDS.get(name, {})
    assert gpu.compute(name, **defines) is gpu.compute(name, **defines)


@pytest.mark.parametrize("name", NEEDS)
def test_a_shader_that_is_not_given_what_it_needs_says_the_name(name):
    """Before a driver sees it: some take a name that nobody has defined for 0."""
    needed = list(NEEDS[name])[-1]
    with pytest.raises(shader.ShaderError, match=rf"^{name}:\d+: #if {needed}, which nobody"):
        shader.compile_compute(NO_DRIVER, name, **dict(list(NEEDS[name].items())[:-1]))


def test_a_condition_of_an_include_names_that_file(folder):
    (folder / "a.vert").write_text("void main() {}\n")
    (folder / "common" / "outer.glsl").write_text("\n#if TWOO == 2  // once TWO\n#endif\n")
    (folder / "a.frag").write_text('#include "common/outer.glsl"\nvoid main() {}\n')
    with pytest.raises(shader.ShaderError, match=r"^common/outer\.glsl:2: #if TWOO, which nobody"):
        shader.compile_program(NO_DRIVER, "a.vert", "a.frag", folder, TWO=2)


def test_chunks_of_the_renderer_are_there_for_other_folders(folder):
    """As vr/shaders has them; a file of that folder's own comes first."""
    (folder / "b.frag").write_text('#include "common/finite.glsl"\n#include "common/inner.glsl"\n')
    files = {file for file, _, _ in shader.read_shader("b.frag", folder)}
    assert files == {"<defines>", "common/finite.glsl", "common/inner.glsl"}
    assert shader.read_shader("full.vert", folder) == shader.read_shader("full.vert")


@pytest.mark.parametrize("name", FILES)
def test_slots_of_a_shader_are_all_different_and_low(name):
    text = shader.joined([line for line in shader.read_shader(name) if line[0] != "<defines>"])
    slots = re.findall(r"binding = SLOT_(\w+)", text)
    numbers = [layout.SLOTS[slot] for slot in slots]
    assert len(set(numbers)) == len(numbers), slots
    assert max(numbers, default=0) < 8  # GL promises no more


@pytest.mark.parametrize("name", FILES)
def test_shaders_are_plain_gl_43(name):
    text = shader.joined([line for line in shader.read_shader(name) if line[0] != "<defines>"])
    assert "#extension" not in text and "subgroup" not in text
    for kind, _ in re.findall(r"buffer \w+ \{ (\w+) (\w+)\[\]; \}", text):
        assert kind in ("float", "uint", "vec4", "uvec4")
    assert text.count("readonly buffer") + len(re.findall(r"writeonly buffer|\) buffer", text)) == (
        len(re.findall(r"buffer \w+ \{ \w+ \w+\[\]; \}", text))
    )
