#!/usr/bin/env bash
# pip's PoCL takes fifteen signals of its process over, as soon as platforms are asked for.
#
# Expected: a driver that is loaded into a program leaves the program's signals alone, or says that
# it does not; what a program has set for SIGABRT, SIGTERM or SIGHUP goes on to hold.
# What happens: pocl-binary-distribution 3.0 (PoCL 3.0-rc2, LLVM 14) has handlers for 1, 3 to 8, 10
# to 12, 15, 24, 25, 31 and one of the real-time signals after cl.get_platforms(), where Python had
# one for SIGINT alone.  LLVM, which PoCL links, installs such to print its stack.  Python's fault
# handler, switched on before that, writes nothing when the process aborts; switched on after it, it
# writes where each thread was.  Handlers of Python's own that were set before are still called.
# What it means: switch faulthandler on (or off and on again) once the device is open; who looks for
# the cause of an abort in a log that was set up at the start finds it empty.
#
# Packages: pip pyopencl 2026.1.4, pocl-binary-distribution 3.0, numpy 2.4.6; Linux on x86-64.
# Seen in November 2026.
# Exit code: 0 while this holds, 1 when it has changed, 3 when a package cannot be had.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
[ -r /proc/self/status ] || exit 3
python3 -m venv venv &&
    venv/bin/pip install -q pyopencl==2026.1.4 pocl-binary-distribution==3.0 numpy==2.4.6 >/dev/null 2>&1 ||
    exit 3

cat >ask.py <<'PY'
import faulthandler
import os
import signal
import sys


def caught() -> set[int]:
    """Signals that have a handler in this process."""
    line = next(line for line in open("/proc/self/status") if line.startswith("SigCgt"))
    bits = int(line.split()[1], 16)
    return {number + 1 for number in range(64) if bits >> number & 1}


def open_pocl() -> None:
    import pyopencl as cl

    named = [p for p in cl.get_platforms() if "PoCL 3.0-rc2" in p.version]
    if not named:
        raise SystemExit(3)
    named[0].get_devices()


if sys.argv[1] == "signals":
    heard = []
    signal.signal(signal.SIGTERM, lambda *_: heard.append("SIGTERM"))
    before = caught()
    open_pocl()
    taken = sorted(caught() - before)
    print("taken over:", taken)
    os.kill(os.getpid(), signal.SIGTERM)
    print("a handler of Python's is still called:", heard == ["SIGTERM"])
    right = {signal.SIGHUP, signal.SIGABRT, signal.SIGSEGV} <= set(taken) and len(heard) == 1
    raise SystemExit(not right)
with open(sys.argv[2], "wb") as log:
    if sys.argv[1] == "early":
        faulthandler.enable(log)
    open_pocl()
    if sys.argv[1] == "late":
        faulthandler.enable(log)
    os.abort()
PY
venv/bin/python ask.py signals || exit $?
for when in early late; do
    { venv/bin/python ask.py "$when" "$when.log" >/dev/null 2>&1; } 2>/dev/null ||
        [ $? -ne 3 ] || exit 3
    echo "fault handler switched on $when: $(wc -c <"$when.log") bytes written at an abort"
done
[ ! -s early.log ] && [ -s late.log ] || exit 1
