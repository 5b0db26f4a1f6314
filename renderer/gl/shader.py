"""GLSL files to programs: `#include` once, shared defines, errors that name the file and line."""

import re
from pathlib import Path
from typing import Any

import moderngl

from shapeshift.renderer import layout

SHADERS = Path(__file__).parents[1] / "shaders"
INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*(//.*)?$')
# What stands before a message: Mesa `0:17(5): `, NVIDIA `0(17) : `, AMD, Intel `ERROR: 0:17: `
ERROR_AT = re.compile(r"^\s*(?:ERROR:\s*|WARNING:\s*)?\d+[:(](\d+)\)?(?:\(\d+\))?\s*:\s*")

Lines = list[tuple[str, int, str]]  # file, line number in it, text


class ShaderError(RuntimeError):
    """A shader does not compile or link; the message quotes file, line and source."""


def read_shader(name: str, folder: Path = SHADERS, **defines: Any) -> Lines:
    """Every line of one stage, includes expanded, with the file and line that it came from."""
    seen: set[str] = set()

    def expand(path: str, asked_by: str) -> Lines:
        if path in seen:
            return []
        seen.add(path)
        try:
            texts = (folder / path).read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            raise ShaderError(f"{asked_by} wants {path}, which is not in {folder.name}/.") from None
        lines: Lines = []
        for number, text in enumerate(texts, start=1):
            found = INCLUDE.match(text)
            lines += expand(found[1], f"{path}:{number}") if found else [(path, number, text)]
        return lines

    numbers = layout.defines() | defines
    head = ["#version 430", *(f"#define {name} {value}" for name, value in numbers.items())]
    return [("<defines>", i, text) for i, text in enumerate(head, start=1)] + expand(name, "Python")


def compile_compute(ctx: moderngl.Context, name: str, **defines: Any) -> moderngl.ComputeShader:
    """The program of one .comp file; ShaderError where it does not compile."""
    lines = read_shader(name, **defines)
    try:
        return ctx.compute_shader(joined(lines))
    except moderngl.Error as failure:
        raise ShaderError(explain(str(failure), [lines])) from None


def compile_program(
    ctx: moderngl.Context, vertex: str, fragment: str, folder: Path = SHADERS, **defines: Any
) -> moderngl.Program:
    """The program of a .vert and a .frag file; ShaderError where it does not compile or link."""
    stages = [read_shader(name, folder, **defines) for name in (vertex, fragment)]
    try:
        return ctx.program(vertex_shader=joined(stages[0]), fragment_shader=joined(stages[1]))
    except moderngl.Error as failure:
        wrong = stages[1:] if "fragment_shader" in str(failure) else stages
        raise ShaderError(explain(str(failure), wrong)) from None


def joined(lines: Lines) -> str:
    return "\n".join(text for _, _, text in lines) + "\n"


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
