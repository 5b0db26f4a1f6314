"""OpenCL C files to kernels: include once, defines, and errors that name the file and line.

What several kernels or shaders say alike stands once, in a file of common/ that they #include.
Where the pieces differ in a name, that name is a macro: of the chunk, with arguments, or defined
before the #include.  GLSL files (renderer/gl/shader.py) are put together by the same functions.
Nothing is taken for granted: an #include that is no file and a name in an #if that nobody has
defined are errors, where a compiler would take the name for 0.
"""

import re
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

KERNELS = Path(__file__).parent / "kernels"
INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"')
DEFINE = re.compile(r"^\s*#\s*define\s+(\w+)")
CONDITION = re.compile(r"^\s*#\s*(?:if|elif)\b(.*)")
ASKED = re.compile(r"\bdefined\s*\(?\s*(\w+)")  # may be undefined
COMMENT = re.compile(r"//.*|/\*.*?\*/")
GIVEN = re.compile(r"-D(\w+)")
NAME = re.compile(r"(?<![\w.])[A-Za-z]\w*")  # those of compilers begin with _
SCALARS = {"int": np.int32, "uint": np.uint32, "float": np.float32}  # that kernels take
LOG_LINE = re.compile(r"(?:<[^>]*>|[^\s:]*\.cl):(\d+):(\d+)?")

# Called with the name of each file of kernels or shaders before a compiler begins with it.
compiling: list[Callable[[str], None]] = []

Lines = list[tuple[str, int, str]]  # file, line number in it, text


class BuildError(RuntimeError):
    """A kernel file does not compile.  The message says file and line."""


def read_lines(
    name: str, folders: Sequence[Path], missing: Callable[[str, str], RuntimeError]
) -> Lines:
    """Every line of file `name` with its includes, once each, and where each line comes from.

    Files are looked for beside the one that includes them, then in `folders`, and are named from
    the folder that has them.  missing: from who asks and what for, the error for a file in none.
    """
    seen: set[Path] = set()
    roots = [folder.resolve() for folder in folders]

    def expand(wanted: str, places: Sequence[Path], asked_by: str) -> Lines:
        found = next((p for folder in places if (p := (folder / wanted).resolve()).is_file()), None)
        if found is None:
            raise missing(asked_by, wanted)
        if found in seen:
            return []
        seen.add(found)
        root = next((root for root in roots if found.is_relative_to(root)), found.parent)
        file, lines = found.relative_to(root).as_posix(), []
        for number, text in enumerate(found.read_text(encoding="utf-8").splitlines(), 1):
            if include := INCLUDE.match(text):
                lines += expand(include[1], (found.parent, *roots), f"{file}:{number}")
            else:
                lines.append((file, number, text))
        return lines

    return expand(name, roots, "Python")


def check_names(lines: Lines, defines: Iterable[str], error: type[RuntimeError]) -> None:
    """Raises `error` where an #if asks for a name that neither `defines` nor a line above has."""
    known = {"defined", *defines}
    for file, number, text in lines:
        if define := DEFINE.match(text):
            known.add(define[1])
        elif condition := CONDITION.match(COMMENT.sub("", text)):
            for name in NAME.findall(condition[1]):
                if name not in known.union(ASKED.findall(condition[1])):
                    raise error(f"{file}:{number}: #if {name}, which nobody has defined")


def read_source(path: Path, defines: Iterable[str] | None = None) -> tuple[str, list[str]]:
    """The text of `path` with its includes, once each, and the origin "file:line" of every line.

    An include is looked for beside the including file, then in rasterizer/kernels.  With the names
    that are defined beforehand every #if is checked, too.  Raises BuildError.
    """

    def missing(asked_by: str, wanted: str) -> BuildError:
        return BuildError(f'{asked_by}: no file for #include "{wanted}"')

    lines = read_lines(path.name, (path.parent, KERNELS), missing)
    if defines is not None:
        check_names(lines, defines, BuildError)
    return joined(lines), [f"{file}:{number}" for file, number, _ in lines]


def joined(lines: Lines) -> str:
    """The text that a compiler is given."""
    return "\n".join(text for _, _, text in lines) + "\n"


def announce(name: str) -> None:
    """Says to all who want to know that a compiler begins with a file."""
    for each in compiling:
        each(name)


def build(context, path: Path, options: list[str]) -> dict:
    """Kernels by name of one file for `context`.  Raises BuildError.

    They know the types of their arguments, so that they take plain numbers; where pyopencl has to
    find out at every launch, a launch takes four times as long.
    """
    import pyopencl as cl

    text, origins = read_source(path, GIVEN.findall(" ".join(options)))
    announce(path.name)
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
            str(kernel.get_arg_info(i, cl.kernel_arg_info.TYPE_NAME))
            for i in range(kernel.num_args)
        )
        kernel.set_arg_types(None if name.endswith("*") else SCALARS[name] for name in names)
    return kernels


def _with_origins(log: str, origins: list[str]) -> str:
    """The compiler's log with flat line numbers turned back into file:line."""

    def origin(match: re.Match) -> str:
        line = int(match[1])
        return origins[line - 1] + ":" if 0 < line <= len(origins) else match[0]

    return LOG_LINE.sub(origin, log)
