"""launch.py extras: the optional parts of the program, listed or installed.

python3 launch.py extras film && python3 launch.py film room.shift --out room.mp4
"""

import importlib
import importlib.util
import os
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from shapeshift.app.command_line import POSITIONAL
from shapeshift.app.terminal import print_text
from shapeshift.runtime_models.program import EXTRAS, Extra, program

LOG = "extras.log"
LOOK_EVERY_S = 0.5


@dataclass(frozen=True)
class Options:
    """List the optional parts of the program, or install some into the environment that runs it.

    What is installed already stays as it is, to the version."""

    names: Annotated[tuple[str, ...], POSITIONAL] = ()
    """film, thermal, usd, cluster, slurm.  Default: list them."""


def run(options: Options) -> int:
    from shapeshift.app.errors import UsageError

    if unknown := [name for name in options.names if name not in EXTRAS]:
        raise UsageError(f"there is no extra {unknown[0]!r}; give some of {', '.join(EXTRAS)}.")
    if not options.names:
        for name, extra in EXTRAS.items():
            state = f"{extra.megabytes} MB" if loads(extra) else "installed"
            print_text(f"{name:9} {state:>9}  {extra.use}")
        print_text(f"`{program()} extras NAME` installs one.")
        return 0
    wanted = []
    for name in dict.fromkeys(options.names):
        if loads(EXTRAS[name]):
            wanted.append(name)
        else:
            print_text(f"{name}: installed already.")
    if wanted:
        install(wanted)
    return 0


def loads(extra: Extra) -> str:
    """Why its packages do not load, as a new process sees it; "" where they do."""
    code = f"import importlib as i; [i.import_module(m) for m in {list(extra.modules)!r}]"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], stdin=subprocess.DEVNULL, capture_output=True,
        check=False, text=True, errors="replace",
    )  # fmt: skip
    said = done.stderr.strip().splitlines() or ["no reason given"]
    return "" if done.returncode == 0 else said[-1]


def install(names: list[str]) -> None:
    """By pip, whole or not at all as far as pip does that.  Raises UsageError."""
    from shapeshift.app.errors import UsageError
    from shapeshift.app.first_start import one_at_a_time, pip_reason, run_pip
    from shapeshift.app.progress import working
    from shapeshift.runtime_models.files.user_cache import cache_folder
    from shapeshift.runtime_models.files.whole_file import temporary_folder

    refuse_environment()
    packages = sorted({package for name in names for package in EXTRAS[name].packages})
    what = ", ".join(names)
    try:
        log = cache_folder("extras") / LOG
        with (
            temporary_folder() as temporary,
            one_at_a_time() as lock,
            working(f"installing {what}") as report,
        ):
            kept = temporary / "installed.txt"
            kept.write_text("\n".join(installed_versions()), encoding="utf-8")
            words = ["install", "--constraint", str(kept), *packages]
            code = run_pip(
                words, lock, log, Path(sys.executable), str(temporary),
                lambda line: report(f"installing {what}: {line}"), LOOK_EVERY_S,
            )  # fmt: skip
            if code != 0:
                raise UsageError(f"{what} could not be installed: {pip_reason(code, log)}.")
    except OSError as error:
        raise UsageError(
            f"{what} could not be installed: {error.strerror or error}: {error.filename}."
        ) from None
    importlib.invalidate_caches()
    for name in names:
        if why := loads(EXTRAS[name]):
            raise UsageError(f"{name} is installed and does not load ({why}).")
        print_text(f"{name}: installed.")


def refuse_environment() -> None:
    """Raises UsageError where pip may not install into what this runs in."""
    from shapeshift.app.errors import UsageError

    site = Path(sysconfig.get_path("purelib"))
    in_venv = sys.prefix != sys.base_prefix
    if not in_venv and (Path(sysconfig.get_path("stdlib")) / "EXTERNALLY-MANAGED").exists():
        raise UsageError(
            f"the Python in {sys.prefix} is managed by the system, so nothing is installed into "
            "it; install Shapeshift into a virtual environment, or with pipx."
        )
    if not os.access(site, os.W_OK):
        raise UsageError(f"{site} may not be written by you; ask whoever installed Shapeshift.")
    if importlib.util.find_spec("pip") is None:
        raise UsageError(
            f"the environment in {sys.prefix} has no pip; install the packages with what made it "
            f"(uv: `uv pip install --python {sys.executable} NAME`)."
        )


def installed_versions() -> list[str]:
    """NAME==VERSION of all that is installed here, for pip to leave as it is."""
    from importlib.metadata import distributions

    found = ((each.metadata["Name"], each.version) for each in distributions())
    return sorted({f"{name}=={version}" for name, version in found if name and version})
