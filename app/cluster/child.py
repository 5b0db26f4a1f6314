"""The program as a task: it ends with whoever started it, and keeps what it has by then.

It reads standard input, whose other end its parent holds.  Where that closes, because the parent
wants so or was killed, this process is interrupted as by Ctrl-C, and after a while for good.
"""

import os
import signal
import sys
import threading
import time

GRACE_S = 20.0  # to save what there is


def main() -> int:
    watch_parent()
    if len(sys.argv) > 1 and sys.argv[1].endswith(".py"):
        return run_script(sys.argv[1:])
    from shapeshift.app.cli import main as run_program

    return run_program()


def run_script(argv: list[str]) -> int:
    """A program of tools/ instead of a command of this one, as Python itself starts it."""
    import runpy

    sys.argv[:] = argv
    sys.path.insert(0, os.path.dirname(argv[0]))
    runpy.run_path(argv[0], run_name="__main__")
    return 0


def watch_parent() -> None:
    """From the main thread, before anything else."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # workers ignore it, and hand that on
    threading.Thread(target=end_with_parent, name="parent", daemon=True).start()


def end_with_parent() -> None:
    while os.read(sys.stdin.fileno(), 4096):
        pass
    interrupt()
    time.sleep(GRACE_S)
    end_group()


def interrupt() -> None:
    if os.name == "nt":
        import _thread

        _thread.interrupt_main()
    else:  # the main thread may be asleep
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


def end_group() -> None:
    """This process with all that it has started."""
    if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
        os.killpg(os.getpgrp(), signal.SIGKILL)
    os._exit(1)
