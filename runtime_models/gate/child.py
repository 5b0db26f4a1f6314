"""The process behind the gate: `python -P child.py MAIN`, started and fed by gate.py alone.

A request names a door, a function and what it is given; the door's package is loaded, then limits
are set, then the function reads the file.  What it gives goes back through the pipe.  One process
serves many files; it ends with its parent, or when a limit is reached.

Speaks, by wire.py: {"absent": why}, or {"armed": what is limited, "most": bytes} and then
{"tell": ...} any number of times and one of {"done": value}, {"refused": what is wrong},
{"bad": sentence}, {"memory": 1}.
"""

import importlib
import importlib.util
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, BinaryIO

LARGEST_REQUEST = 1 << 40  # bytes: who asks is the program itself


def main(program: str) -> None:
    """Serves until the pipe ends."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):  # for the parent, which ends this process
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    heed_limits()
    given, answers = private_pipes()
    if os.name != "nt":  # Windows goes on naming a parent that is gone
        threading.Thread(target=end_with_parent, args=[os.getppid()], daemon=True).start()
    spec = importlib.util.spec_from_file_location("shapeshift_program", program)
    assert spec is not None and spec.loader is not None
    spec.loader.exec_module(importlib.util.module_from_spec(spec))  # makes the package known

    from shapeshift.runtime_models.gate.wire import receive, send

    held: list[Any] = []  # bytes before the file was opened, the object that keeps it open
    while True:
        try:
            request = receive(given, LARGEST_REQUEST)
        except EOFError:
            return
        answer = serve(request, held, lambda value: send(answers, value))
        try:
            send(answers, answer)
        except MemoryError:  # what was read fits, its answer not
            send(answers, {"memory": 1})
            return
        if "memory" in answer:
            return  # a process that has run out of memory is in no known state
        del request, answer  # they are no part of what the next file takes


def heed_limits() -> None:
    """Lets the signals of time end this process, also where its parent ignores or blocks them."""
    signals = [getattr(signal, name, None) for name in ("SIGPROF", "SIGXCPU")]
    for each in [number for number in signals if number is not None]:
        signal.signal(each, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [each])


def private_pipes() -> tuple[BinaryIO, BinaryIO]:
    """The pipes of the parent, where no library's print can reach them."""
    given, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1):
        os.dup2(nowhere, standard)
    return given, answers


def serve(request: dict, held: list, say: Callable[[Any], None]) -> dict:
    """The answer to one request."""
    from shapeshift.runtime_models.gate.limits import arm, disarm, own_bytes
    from shapeshift.runtime_models.gate.refusal import Unreadable
    from shapeshift.runtime_models.model import BadFile

    try:
        for package in request["imports"]:
            importlib.import_module(package)
    except ImportError as why:
        return {"absent": str(why)}
    module, _, name = request["target"].partition(":")
    target = getattr(importlib.import_module(module), name)
    more = {"hear": lambda **what: say({"tell": what})} if request["tells"] else {}
    if not request["method"]:  # else the budget is counted from where the file was opened
        held.clear()
        held[:] = [own_bytes()]
    most = held[0] + request["memory"]
    say({"armed": arm(request["seconds"], most), "most": most})
    try:
        if request["method"]:
            value = getattr(held[1], request["method"])(*request["words"], **more)
        else:
            value = target(*request["words"], **more)
        if isinstance(target, type) and not request["method"]:
            held[1:], value = [value], value.facts()
    except Unreadable as refusal:
        return {"refused": one_line(refusal)}
    except BadFile as refusal:  # a whole sentence
        return {"bad": str(refusal)}
    except (MemoryError, RecursionError):
        return {"memory": 1}
    except Exception as error:  # on damaged bytes outside parsers raise whatever comes up
        if "bad allocation" in str(error) or "bad_alloc" in str(error):
            return {"memory": 1}
        return {"refused": f"cannot be read ({one_line(error)[:80] or type(error).__name__})"}
    finally:
        disarm()
    return {"done": value}


def end_with_parent(parent: int) -> None:
    """Ends this process soon after that of the program, whatever it is busy with."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]


if __name__ == "__main__":
    main(sys.argv[1])
