"""OpenCL C files to kernels: include once, defines, and errors that name the file and line."""

import re
from pathlib import Path

KERNELS = Path(__file__).parent / "kernels"
INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"')
LOG_LINE = re.compile(r"(?:<[^>]*>|[^\s:]*\.cl):(\d+):(\d+)?")


class BuildError(RuntimeError):
    """A kernel file does not compile.  The message says file and line."""


def read_source(path: Path) -> tuple[str, list[str]]:
    """The text of `path` with its includes, once each, and the origin "file:line" of every line.

    An include is looked for beside the including file, then in rasterizer/kernels.
    """
    lines: list[str] = []
    origins: list[str] = []
    seen: set[Path] = set()

    def add(file: Path) -> None:
        seen.add(file)
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
            match = INCLUDE.match(line)
            if not match:
                lines.append(line)
                origins.append(f"{file.name}:{number}")
                continue
            places = [folder / match[1] for folder in (file.parent, KERNELS)]
            found = next((p.resolve() for p in places if p.is_file()), None)
            if found is None:
                raise BuildError(f'{file}:{number}: no file for #include "{match[1]}"')
            if found not in seen:
                add(found)

    add(Path(path).resolve())
    return "\n".join(lines) + "\n", origins


def build(context, path: Path, options: list[str]) -> dict:
    """Kernels by name of one file for `context`.  Raises BuildError."""
    import pyopencl as cl

    text, origins = read_source(path)
    try:
        program = cl.Program(context, text).build(options)
    except cl.RuntimeError as error:
        log = str(error).split("(options:")[0]
        raise BuildError(f"{path} does not build:\n{_with_origins(log, origins)}") from error
    return {kernel.function_name: kernel for kernel in program.all_kernels()}


def _with_origins(log: str, origins: list[str]) -> str:
    """The compiler's log with flat line numbers turned back into file:line."""

    def origin(match: re.Match) -> str:
        line = int(match[1])
        return origins[line - 1] + ":" if 0 < line <= len(origins) else match[0]

    return LOG_LINE.sub(origin, log)
