"""OpenCL C files to kernels: include once, defines, and errors that name the file and line."""

import re
import warnings
from pathlib import Path

import numpy as np

KERNELS = Path(__file__).parent / "kernels"
INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"')
SCALARS = {"int": np.int32, "uint": np.uint32, "float": np.float32}  # that kernels take
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
    """Kernels by name of one file for `context`.  Raises BuildError.

    They know the types of their arguments, so that they take plain numbers; where pyopencl has to
    find out at every launch, a launch takes four times as long.
    """
    import pyopencl as cl

    text, origins = read_source(path)
    try:
        with warnings.catch_warnings():
            # pyopencl warns of every log that is not empty; that of NVIDIA never is.
            warnings.simplefilter("ignore", cl.CompilerWarning)
            # -w: PoCL's compiler counts its warnings on the terminal otherwise.
            program = cl.Program(context, text).build([*options, "-cl-kernel-arg-info", "-w"])
    except cl.RuntimeError as error:
        log = str(error).split("(options:")[0]
        raise BuildError(f"{path} does not build:\n{_with_origins(log, origins)}") from error
    kernels = {kernel.function_name: kernel for kernel in program.all_kernels()}
    for kernel in kernels.values():
        names = (
            kernel.get_arg_info(i, cl.kernel_arg_info.TYPE_NAME) for i in range(kernel.num_args)
        )
        kernel.set_arg_types(None if name.endswith("*") else SCALARS[name] for name in names)
    return kernels


def _with_origins(log: str, origins: list[str]) -> str:
    """The compiler's log with flat line numbers turned back into file:line."""

    def origin(match: re.Match) -> str:
        line = int(match[1])
        return origins[line - 1] + ":" if 0 < line <= len(origins) else match[0]

    return LOG_LINE.sub(origin, log)
