"""Command line: one table of modes; only the mode that is asked for is imported."""

import contextlib
import gc
import importlib
import inspect
import os
import shutil
import sys
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from shapeshift.app.command_line import Argument, arguments_of
from shapeshift.app.interrupts import answer_endings, uninterrupted
from shapeshift.app.paths import leave_current_folder
from shapeshift.app.terminal import clean_streams, drop_output, print_text, say

# command: (module below app, what it does); each module has `Options` and `run(options) -> int`
COMMANDS = {
    "view": ("editor.desktop", "open a scene in a window"),
    "render": ("commands.render", "draw a scene into PNG files, no window needed"),
    "film": ("film.film", "a flight through a scene that changes on the way, as a video"),
    "bench": ("commands.bench", "frame times and image error, no window needed"),
    "chart": ("charts.chart", "what each shortcut saves in time and costs in the picture"),
    "stability": (
        "commands.stability",
        "the cases where splat renderers fail, each held to a bound",
    ),
    "thermal": (
        "inspection.thermal",
        "degrees at marks, alarms over the photo, tables and reports of a thermal scene",
    ),
    "measure": (
        "inspection.measure",
        "distances, angles and areas on a scene, with their uncertainty",
    ),
    "change": (
        "change.change",
        "what moved, appeared, vanished or got hotter between two captures of a place",
    ),
    "lint": ("commands.lint", "what is wrong with a file, and what opening it repairs"),
    "info": ("commands.info", "what is in a scene"),
    "compare": (
        "commands.compare",
        "two scenes, stops or folders of pictures: PSNR, SSIM, differences",
    ),
    "export": (
        "commands.export",
        "a scene at one x as .ply, .compressed.ply, .spz, .glb or .splat",
    ),
    "lod": (
        "streaming.lod",
        "levels of detail of a scene as streamed SOG, for viewers that load what is seen",
    ),
    "serve": ("page.serve", "a scene in the browsers of this computer, anew when its file changes"),
    "cameras": ("commands.cameras", "list a file of cameras, or convert it"),
    "simulate": (
        "commands.simulate",
        "a scene file in motion: hands and rays of a script, written as lines",
    ),
    "colliders": (
        "commands.colliders",
        "make a scene file's colliders once, into files that travel with it",
    ),
    "vr": ("headset.headset", "a scene in a headset: walk into it and touch it"),
    "poses": ("commands.poses", "photos without poses, or a video, to a capture for train"),
    "train": ("training.train", "posed photos of several modalities to a scene"),
    "update": (
        "training.update",
        "a part of a scene trained anew from a later visit, all else as it was",
    ),
    "style": (
        "training.style",
        "put a new stop into a finished scene, all others as they were; or take one out",
    ),
    "fit": (
        "training.fit",
        "the smallest scene that shows a capture as well as the largest, and why",
    ),
    "eval": ("training.evaluate", "PSNR and SSIM of a scene on the held-out photos of a capture"),
    "segment": ("decomposition.segment", "cut a scene into objects by label maps of its photos"),
    "table": (
        "training.table",
        "one model compared with separate ones and plain splats: dB, bytes, seconds",
    ),
    "cluster": (
        "cluster.command",
        "let other machines take part: certificates, a scheduler, workers",
    ),
    "demo": ("training.demo", "make the bundled demo again: ray-trace its capture, train it"),
    "headless": ("commands.headless", "draw the bundled demo into pictures and time it"),
    "extras": ("commands.extras", "optional parts of the program, listed or installed"),
}
OPTIONS = {"view": "editor.options"}  # where a command's module is long in coming
LAUNCHED = {"test": "run the tests"}  # commands that launch.py has itself
CLAIMING = ("demo", "film", "fit", "lod", "poses", "segment", "style", "table", "train", "update")
OPEN_ENDED = ("view", "vr", "serve", "cluster")  # they last as long as somebody looks
BAD_INPUT = 2  # exit code
FAULT = 3
INTERRUPTED = 130


# What `--help` prints of a command, made of its Options: app/command_line.py.

WIDEST = 100  # letters of a line
COLUMN = 26  # where the texts begin
NOTHING = (None, "", (), float("inf"))  # defaults that the text names in words, or not at all


def help_text(kind: type, prog: str, defaults: Mapping[str, str] | None = None) -> str:
    """What `--help` prints: usage, what it does, usual options, then those for experts.

    `defaults`: in words what holds where an option is left out whose field says None.
    """
    defaults, arguments = defaults or {}, arguments_of(kind)
    needed = [a for a in arguments if a.required and not a.opt.positional]
    words = [a.invocation for a in arguments if a.opt.positional] + [a.invocation for a in needed]
    lines = [f"usage: {' '.join([prog, *words])} [options]", ""]
    if kind.__doc__ and not kind.__doc__.startswith(f"{kind.__name__}("):
        width = _width()
        for paragraph in inspect.cleandoc(kind.__doc__).split("\n\n"):
            lines += [*textwrap.wrap(paragraph, width), ""]
    groups = {
        "": [a for a in arguments if a.opt.positional],
        "usual options": [a for a in arguments if not (a.opt.positional or a.opt.expert)],
        "expert options": [a for a in arguments if a.opt.expert],
    }
    for title, members in groups.items():
        lines += [f"{title}:"] * bool(title and members)
        for each in members:
            lines += _rows(each, defaults.get(each.field.name, ""))
        lines += [""] * bool(members)
    return "\n".join(lines)


def _rows(each: Argument, default: str) -> list[str]:
    """An option in help: its name, then what it does, under each other where there is no room."""
    name, text = f"  {each.invocation}", each.help
    value = each.field.default
    if each.kind is bool and value is True:
        name = f"  {each.name}, --no-{each.name[2:]}"
    if each.required:
        text += "" if each.opt.positional else " (required)"
    elif "Default:" in text:
        pass
    elif default:
        text += f" (default: {default})"
    elif each.kind is bool:
        text += " (default: on)" if value else ""
    elif value not in NOTHING:
        values = value if isinstance(value, tuple) else (value,)
        words = (f"{each:g}" if isinstance(each, float) else str(each) for each in values)
        text += f" (default: {' '.join(words)})"
    body = textwrap.wrap(text, _width() - COLUMN, break_on_hyphens=False)
    rest = [" " * COLUMN + line for line in body]
    if body and len(name) + 2 <= COLUMN:
        return [f"{name:{COLUMN}}{body[0]}", *rest[1:]]
    return [name, *rest]


def _width() -> int:
    return min(shutil.get_terminal_size().columns, WIDEST)


@contextlib.contextmanager
def importing() -> Iterator[None]:
    """Uninterrupted, and an import leaves no garbage: looking for it takes a tenth of a start."""
    before = gc.isenabled()
    gc.disable()
    try:
        with uninterrupted():
            yield
    finally:
        if before:
            gc.enable()


def usage() -> str:
    from shapeshift.runtime_models.program import program

    name = program()
    return "\n".join(
        [
            f"usage: {name} [command] [options]",
            f"       {name} command --help     lists its options",
            f"       {name} --version",
            "",
            "With no command: the viewer on the bundled demo, or, without a display, its pictures.",
            "With a file or folder: the viewer on that scene.",
            "",
            *(f"  {command:9} {text}" for command, text in offered().items()),
        ]
    )


def offered() -> dict[str, str]:
    """Every command and what it does; an installed package has no tests to run."""
    from shapeshift.runtime_models.program import is_installed

    rows = {command: text for command, (_, text) in COMMANDS.items()}
    return rows if is_installed() else rows | LAUNCHED


def has_display() -> bool:
    if sys.platform.startswith("linux"):
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return True


def choose(arguments: list[str]) -> tuple[str, list[str]]:
    """The command and its own arguments; no command means the viewer or its stand-in."""
    if arguments and arguments[0] in COMMANDS:
        return arguments[0], arguments[1:]
    if not arguments and not has_display() and not sys.stderr.isatty():
        say("No display here: drawing the demo without a window.")
        return "headless", []
    return "view", arguments


def known_failures() -> tuple[type[Exception], ...]:
    """Errors whose text is meant for the user.  Looked up late: they live with heavy modules."""
    names = {
        "shapeshift.runtime_models.model": "BadFile",
        "shapeshift.app.errors": "UsageError",
        "shapeshift.rasterizer.device": "NoDevice",
        "shapeshift.renderer.gl.context": "NoContext",
    }
    loaded = [(sys.modules.get(module), name) for module, name in names.items()]
    return tuple(getattr(module, name) for module, name in loaded if module)


def refuse(sentence: str) -> int:
    """One line on stderr, whatever a path or a file put into it."""
    warn(f"shapeshift {sentence}")
    return BAD_INPUT


def warn(text: str) -> None:
    """A line on stderr; the exit code stays what it is where nobody reads it."""
    with contextlib.suppress(BrokenPipeError):
        say(text)


def report_fault(command: str, error: Exception) -> int:
    """A fault of the program itself: one sentence for the user, the traceback in a file."""
    import tempfile
    import traceback

    if os.environ.get("SHAPESHIFT_DEBUG"):
        raise error
    with tempfile.NamedTemporaryFile(
        "w", prefix="shapeshift-", suffix=".log", delete=False, encoding="utf-8",
        errors="backslashreplace",
    ) as log:  # fmt: skip
        traceback.print_exception(error, file=log)
    text = str(error).splitlines()[0] if str(error) else type(error).__name__
    warn(
        f"shapeshift {command}: a fault of the program, not of your input ({text}); "
        f"the details are in {log.name}."
    )
    return FAULT


def run_command(command: str, arguments: list[str]) -> int:
    from shapeshift.app.caches import settle_caches_for
    from shapeshift.app.command_line import parse, wants_help
    from shapeshift.app.paths import begin_at_start
    from shapeshift.app.progress import lines
    from shapeshift.runtime_models.program import program

    own = COMMANDS[command][0]
    with importing():
        module = importlib.import_module(f"shapeshift.app.{OPTIONS.get(command, own)}")
    prog = f"{program()} {command}"
    if wants_help(arguments):
        defaults = module.defaults() if hasattr(module, "defaults") else {}
        print_text(help_text(module.Options, prog, defaults))
        return 0
    options: Any = begin_at_start(parse(module.Options, arguments, prog))
    settle_caches_for(command)
    if command == "view":
        from shapeshift.app.page.serve import view

        return view(options, has_display(), importing)
    with importing():
        module = importlib.import_module(f"shapeshift.app.{own}")
    if command in OPEN_ENDED:
        return module.run(options)
    with lines(command), claim_of(command, options):
        return module.run(options)


def claim_of(command: str, options: Any) -> contextlib.AbstractContextManager[None]:
    """Long work has its --out for itself; the parts of a film share one."""
    if command not in CLAIMING or getattr(options, "only", ""):
        return contextlib.nullcontext()
    from shapeshift.app.commands.claims import claimed

    return claimed(options.out, command)


def main(arguments: list[str] | None = None) -> int:
    """The program's exit code; without arguments, those of this process."""
    if arguments is None:  # the program itself, not a part of another
        arguments = sys.argv[1:]
        answer_endings()
        leave_current_folder()
    try:
        with clean_streams():
            return answer(arguments)
    except BrokenPipeError:
        drop_output()
        return 0  # the reader of our output went away, as `| head` does
    except SystemExit as ended:
        if not isinstance(ended.__context__, BrokenPipeError):  # so a table of rich ends it
            raise
        drop_output()
        return 0
    except OSError as error:  # what was left of the output found no room
        drop_output()
        return refuse(f"{error.strerror}: {error.filename}")


def answer(arguments: list[str]) -> int:
    from shapeshift.app.paths import plain, plain_path, what_replaced

    arguments = [plain_path(argument) for argument in arguments]
    if arguments[:1] == ["help"] and len(arguments) == 2:
        arguments = [arguments[1], "--help"]
    if arguments[:1] in (["-h"], ["--help"], ["help"]):
        print_text(usage())
        return 0
    if arguments[:1] in (["--version"], ["-V"], ["version"]):
        from shapeshift.runtime_models.program import version

        print_text(f"shapeshift {version()}")
        return 0
    command, rest = choose(arguments)
    if replaced := next(filter(None, map(what_replaced, rest)), ""):
        return refuse(f"{command}: {replaced}")
    named = rest[0] if rest else "-"  # an address is left to the readers, who say what to do
    known = named.startswith("-") or "://" in named or plain(named).exists()
    if command == "view" and not known:
        return refuse(no_command(rest[0]))
    try:
        return run_command(command, rest)
    except KeyboardInterrupt:
        warn("Interrupted.")
        return INTERRUPTED
    except BrokenPipeError:
        raise
    except known_failures() as error:
        if not arguments and command == "view" and type(error).__name__ == "NoContext":
            warn(f"No window here ({error}) Drawing the demo without one.")
            return answer(["headless"])
        return refuse(f"{command}: {error}")
    except OSError as error:
        if isinstance(error, FileNotFoundError) and is_folder_gone():
            return refuse(f"{command}: the folder that this was started in is gone; go to another.")
        return refuse(f"{command}: {error.strerror or error}: {error.filename or 'no file named'}")
    except MemoryError as error:
        return refuse(f"{command}: {no_room(str(error))}")
    except Exception as error:
        if any(words in str(error) for words in NO_ROOM):
            return refuse(f"{command}: {no_room(str(error))}")
        return report_fault(command, error)


# Of a library that is loaded late, and of a thread.
NO_ROOM = ("failed to map segment", "can't start new thread")


def no_room(text: str) -> str:
    """What is said where memory is full; text: the error's own."""
    what = f" ({text.splitlines()[0]})" if text else ""
    return (
        f"this process got no more memory{what}; end other programs, raise its limit (ulimit -v), "
        "or give it less: --max-splats, --downscale, a smaller --size."
    )


def is_folder_gone() -> bool:
    """Whether the current folder was deleted since somebody went there."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


def no_command(word: str) -> str:
    """What is said of a first word that is nothing."""
    from shapeshift.app.command_line import nearest

    meant = nearest(word, list(offered()))
    hint = f"did you mean {meant}? " if meant else ""
    return f"'{word}' is neither a command nor a file; {hint}--help lists the commands."
