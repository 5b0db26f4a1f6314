#!/usr/bin/env python3
"""The one door to Shapeshift: `python3 launch.py [command] ...`.

Uses the standard library alone.  On first use it makes the environment in .venv (and, as root on
Debian or Ubuntu, installs the few system libraries), see app/first_start.py, with this Python or
another that the packages come for, see shapeshift/which_python.py; later starts go straight to
shapeshift/__main__.py.  `python3 launch.py` opens the viewer, `python3 launch.py test`
runs the tests, `--help` lists all.
"""

import importlib.util
import os
import signal
import subprocess
import sys

ROOT = os.path.dirname(os.path.realpath(__file__))
CLI = os.path.join(ROOT, "shapeshift", "__main__.py")
WHICH_PYTHON = os.path.join(ROOT, "shapeshift", "which_python.py")
OLDEST_PYTHON = (3, 11)

# Answered without the environment, by whatever Python started this that is not too old.
ASKING = ("-h", "--help", "help", "--version")
# The whole suite runs in two processes, each file in one of them, in the order of
# tests/conftest.py; where words choose tests, or look into them, it is one process.
WHOLE_SUITE = {"-q", "-v", "-x", "-qq", "-vv"}
TWO_PROCESSES = ["-n", "2", "--dist", "loadfile", "--no-loadscope-reorder"]
TEST_HELP = """usage: python3 launch.py test [file] [options of pytest]

Runs the tests; the first time it installs what they need into .venv.

  --slow                long trainings, large sweeps and sessions of a headset, too
  --changed             what reaches the files that were edited, nearest first, for a minute;
                        --changed=REVISION since that one, --minutes=5 for so long
  -k WORDS              only tests whose names have these words
  -x                    stop at the first that fails
  -q, -v                say less, say more
  --regenerate          make the golden pictures anew
  -n 0                  one process; without words that choose tests, two run side by side
  tests/app/test_cli.py     only the tests of a file

All others, once they are installed: .venv/bin/python -m pytest --help"""


def stop(sentence):
    print(sentence, file=sys.stderr)
    raise SystemExit(2)


def hold_interrupts(held):
    """Keep Ctrl-C waiting, or let it in.  While Python starts and imports it would be lost or end
    in a traceback; app/cli.py lets it in when it can answer.
    """
    if hasattr(signal, "pthread_sigmask"):  # not on Windows
        how = signal.SIG_BLOCK if held else signal.SIG_UNBLOCK
        signal.pthread_sigmask(how, {signal.SIGINT})


def hand_over(python, arguments):
    """Run in the environment; on POSIX this process becomes the program, so signals reach it."""
    # What lies in the current folder, perhaps one of downloads, is no module: -P leaves it out,
    # and PYTHONPATH may name it.
    command = [python, "-P", *arguments]
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    if os.name != "nt":
        os.execve(python, command, environment)
    child = subprocess.Popen(command, env=environment)
    while True:
        try:
            return child.wait()
        except KeyboardInterrupt:
            continue  # the child has it too and decides


def pytest_words(arguments):
    """What pytest is started with: in two processes where all tests run and there are two cores."""
    choosing = [a for a in arguments if a not in WHOLE_SUITE and not a.startswith("--durations=")]
    together = not choosing and (os.cpu_count() or 1) >= 2
    return ["-m", "pytest", *(TWO_PROCESSES if together else []), *arguments]


def start_in_another_python(testing, arguments):
    """Where the packages come for this Python: None.  Else another starts this file, or one
    sentence says why none can.
    """
    spec = importlib.util.spec_from_file_location("which_python", WHICH_PYTHON)
    assert spec is not None and spec.loader is not None, "as of every path that ends in .py"
    which_python = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(which_python)
    try:
        other = which_python.choose_python(testing)
    except ValueError as none_fits:
        stop(none_fits)
    except OSError as error:
        stop(f"The locks of the packages cannot be read: {error.strerror}: {error.filename}.")
    except KeyboardInterrupt:
        stop("Interrupted; the next start makes the environment.")
    if other is None:
        return None
    return hand_over(other, [os.path.join(ROOT, "launch.py"), *arguments])


def main(arguments):
    testing = arguments[:1] == ["test"]
    if testing and set(arguments[1:]) & {"-h", "--help"}:
        print(TEST_HELP)
        return 0
    if sys.version_info < OLDEST_PYTHON:
        return start_in_another_python(testing, arguments)
    hold_interrupts(True)
    if ROOT not in sys.path:  # PYTHONSAFEPATH leaves a script's folder out
        sys.path.insert(0, ROOT)
    from shapeshift.app.first_start import (  # too new for the Pythons sent on above
        PYTHON,
        is_ready,
        make_environment,
    )

    if arguments and arguments[0] in ASKING and len(arguments) == 1:
        return hand_over(sys.executable, [CLI, *arguments])
    try:
        ready = is_ready(testing)
        hold_interrupts(not testing and ready)
        if not ready:
            code = start_in_another_python(testing, arguments)
            if code is not None:
                return code
        make_environment(testing)
    except KeyboardInterrupt:
        stop("Interrupted; the next start makes the environment.")
    except OSError as error:
        stop(f"The environment cannot be made: {error.strerror}: {error.filename or ROOT}.")
    if testing:
        os.chdir(ROOT)
        return hand_over(str(PYTHON), pytest_words(arguments[1:]))
    hold_interrupts(True)
    return hand_over(str(PYTHON), [CLI, *arguments])


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
