"""A process of its own for CoACD: `python -P coacd_run.py IN.npz OUT.npz`; see collider_hulls.py.

CoACD is C++ that can run for minutes, prints a lot and ends the process on input that it does not
like: none of this may happen to the program.  It ends when its standard input does, as that of a
program that was killed.
"""

import os
import sys
import threading

import numpy as np


def main(given: str, wanted: str) -> None:
    try:
        import coacd
    except ImportError as why:
        sys.stderr.write(str(why))
        sys.exit(ABSENT)
    coacd.set_log_level("off")
    with np.load(given) as file:
        mesh = coacd.Mesh(file["vertices"], file["faces"])
        settings = {name: float(file[name]) for name in ("threshold",)}
        settings |= {name: int(file[name]) for name in WHOLE}
    pieces = coacd.run_coacd(mesh, decimate=True, preprocess_mode="off", seed=0, **settings)
    np.savez(wanted, *[vertices for vertices, _ in pieces])


ABSENT = 3  # the exit code where CoACD is not installed or does not load
WHOLE = ("max_convex_hull", "max_ch_vertex", "mcts_iterations", "mcts_nodes", "resolution")


def end_with_parent() -> None:
    """Waits until the other end of standard input is gone."""
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=end_with_parent, daemon=True).start()
    main(*sys.argv[1:])
