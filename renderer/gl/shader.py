"""GLSL files to programs: `#include` once, shared defines, errors that name the file and line.

What several shaders say alike stands once, in renderer/shaders/common/: rasterizer/program.py.
"""

import re
from pathlib import Path
from typing import Any

import moderngl

from shapeshift.rasterizer.program import Lines, announce, check_names, joined, read_lines
from shapeshift.renderer import layout

SHADERS = Path(__file__).parents[1] / "shaders"
# What stands before a message: Mesa `0:17(5): `, NVIDIA `0(17) : `, AMD, Intel `ERROR: 0:17: `
ERROR_AT = re.compile(r"^\s*(?:ERROR:\s*|WARNING:\s*)?\d+[:(](\d+)\)?(?:\(\d+\))?\s*:\s*")


class ShaderError(RuntimeError):
    """A shader does not compile or link; the message quotes file, line and source."""


def read_shader(name: str, folder: Path = SHADERS, **defines: Any) -> Lines:
    """Every line of one stage, includes expanded, with the file and line that it came from.

    Files are looked for in `folder`, then in renderer/shaders.
    """

    def missing(asked_by: str, wanted: str) -> ShaderError:
        return ShaderError(f"{asked_by} wants {wanted}, which is not in {folder.name}/.")

    numbers = layout.defines() | defines
    lines = read_lines(name, (folder, SHADERS), missing)
    head = ["#version 430", *(f"#define {name} {value}" for name, value in numbers.items())]
    return [("<defines>", i, text) for i, text in enumerate(head, start=1)] + lines


def compile_compute(ctx: moderngl.Context, name: str, **defines: Any) -> moderngl.ComputeShader:
    """The program of one .comp file; ShaderError where it does not compile."""
    lines = read_shader(name, **defines)
    check_names(lines, (), ShaderError)
    announce(name)
    try:
        return ctx.compute_shader(joined(lines))
    except moderngl.Error as failure:
        raise ShaderError(explain(str(failure), [lines])) from None


def compile_program(
    ctx: moderngl.Context, vertex: str, fragment: str, folder: Path = SHADERS, **defines: Any
) -> moderngl.Program:
    """The program of a .vert and a .frag file; ShaderError where it does not compile or link."""
    stages = [read_shader(name, folder, **defines) for name in (vertex, fragment)]
    for lines in stages:
        check_names(lines, (), ShaderError)
    announce(fragment)
    try:
        return ctx.program(vertex_shader=joined(stages[0]), fragment_shader=joined(stages[1]))
    except moderngl.Error as failure:
        wrong = stages[1:] if "fragment_shader" in str(failure) else stages
        raise ShaderError(explain(str(failure), wrong)) from None


def explain(log: str, stages: list[Lines]) -> str:
    """The driver's log with file, line and source in place of lines of the expanded text.

    `#line N FILE` would be shorter, but Mesa 22 drops FILE inside expressions.
    """
    lines = stages[0]
    explained = []
    for message in log.splitlines():
        found = ERROR_AT.match(message)
        if found and 0 < int(found[1]) <= len(lines):
            path, number, text = lines[int(found[1]) - 1]
            explained += [f"{path}:{number}: {message[found.end() :]}", f"    {text.strip()}"]
        elif message.strip():
            explained.append(message)
    return "\n".join(explained)
