"""What --cluster says, and who may listen where."""

import ipaddress
import re
from dataclasses import dataclass
from pathlib import Path

from shapeshift.app.errors import UsageError

FORMS = "none, local, local:N, tcp://127.0.0.1:PORT, tls://HOST:PORT or slurm:FILE"
MOST_LOCAL = 256  # workers of one machine
USUAL_LOCAL = 2
ADDRESS = re.compile(r"(tcp|tls)://(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):(\d{1,5})")


@dataclass(frozen=True)
class ClusterPlace:
    """Where tasks run."""

    kind: str  # none | local | scheduler | slurm
    workers: int = 0  # of local
    address: str = ""  # of a scheduler
    file: Path = Path()  # of slurm


@dataclass(frozen=True)
class Address:
    """Of a scheduler, checked."""

    text: str
    protocol: str  # tcp | tls
    host: str
    port: int


def read_place(text: str) -> ClusterPlace:
    """What --cluster says.  Raises UsageError."""
    kind, colon, rest = text.partition(":")
    if text == "none":
        return ClusterPlace("none")
    if kind == "local":
        if colon and not (rest.isascii() and rest.isdigit() and 1 <= int(rest) <= MOST_LOCAL):
            raise UsageError(f"--cluster is '{text}', expected local:1 to local:{MOST_LOCAL}.")
        return ClusterPlace("local", int(rest) if colon else USUAL_LOCAL)
    if kind == "slurm" and rest:
        from shapeshift.app.paths import plain

        return ClusterPlace("slurm", file=plain(rest))
    if kind in ("tcp", "tls"):
        return ClusterPlace("scheduler", address=read_address(text, "--cluster").text)
    raise UsageError(f"--cluster is '{text}', expected {FORMS}.")


def read_address(text: str, option: str) -> Address:
    """tcp://127.0.0.1:PORT or tls://HOST:PORT.  Raises UsageError."""
    found = ADDRESS.fullmatch(text)
    if not found or not 1 <= int(found[3]) <= 65535:
        raise UsageError(
            f"{option} is '{text}', expected tls://HOST:PORT, or tcp://127.0.0.1:PORT on this "
            "machine alone."
        )
    address = Address(text, found[1], found[2].strip("[]"), int(found[3]))
    if address.protocol == "tcp" and not is_loopback(address.host):
        from shapeshift.app.program import program

        raise UsageError(
            f"{option} is '{text}': whoever reaches such a port runs what he likes, so tcp:// is "
            f"for 127.0.0.1 alone; use tls://{found[2]}:{found[3]} with --certificates, which "
            f"`{program()} cluster certificates --out DIR` makes."
        )
    return address


def is_loopback(host: str) -> bool:
    """Whether nobody but this machine reaches it; names other than localhost may mean anything."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
