"""One certificate and its key for all machines of a cluster: who has them is in, nobody else."""

import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.program import install_words, program

if TYPE_CHECKING:
    from distributed.security import Security

CERTIFICATE, KEY = "cluster.pem", "cluster-key.pem"
OTHERS = stat.S_IRWXG | stat.S_IRWXO


def require_dask() -> None:
    """Raises UsageError where the extra is not installed."""
    try:
        import cryptography
        import distributed  # noqa: F401

        del cryptography
    except ImportError:
        raise UsageError(
            "more than one process, or another machine, wants Dask, which "
            f"{install_words('cluster')} installs; or leave --cluster out."
        ) from None


def write_certificates(folder: Path) -> None:
    """A new pair for a year, readable by their owner alone.  Raises UsageError where one is."""
    from distributed.security import Security

    from shapeshift.runtime_models.files.whole_file import make_folders, write_whole

    for name in (CERTIFICATE, KEY):
        if (folder / name).exists():
            raise UsageError(f"{folder / name} exists; name another --out, or remove both files.")
    folder.parent.mkdir(parents=True, exist_ok=True)
    make_folders(folder.parent, folder.name, 0o700)
    made = Security.temporary()
    for name, text in ((KEY, made.tls_client_key), (CERTIFICATE, made.tls_client_cert)):
        handle = os.open(folder / name, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
        os.close(handle)  # what takes its place has its rights
        write_whole(folder / name, text.encode())


def read_certificates(folder: Path | None, address: str) -> "Security":
    """What a connection to tls://... wants.  Raises UsageError."""
    from distributed.security import Security

    make = f"`{program()} cluster certificates --out DIR` makes them"
    if folder is None:
        raise UsageError(f"{address} wants --certificates DIR; {make}.")
    certificate, key = folder / CERTIFICATE, folder / KEY
    for path in (certificate, key):
        if not path.is_file():
            raise UsageError(f"--certificates {folder}: there is no {path.name} in it; {make}.")
    if os.name != "nt" and key.stat().st_mode & OTHERS:
        raise UsageError(f"{key} can be read by others; `chmod 600 {key}`, or make new ones.")
    check_pair(certificate, key)
    roles = {
        f"tls_{role}_{part}": str(path)
        for role in ("client", "scheduler", "worker")
        for part, path in (("cert", certificate), ("key", key))
    }
    return Security(require_encryption=True, tls_ca_file=str(certificate), **roles)


def check_pair(certificate: Path, key: Path) -> None:
    """Raises UsageError where they are no pair, or too old."""
    import datetime

    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        read = x509.load_pem_x509_certificate(certificate.read_bytes())
        pair = load_pem_private_key(key.read_bytes(), None)
    except (ValueError, TypeError):
        raise UsageError(f"{certificate} and {key.name} are no certificate and its key.") from None
    if read.public_key() != pair.public_key():
        raise UsageError(f"{certificate} and {key.name} belong to different pairs.")
    if read.not_valid_after_utc < datetime.datetime.now(datetime.UTC):
        raise UsageError(
            f"{certificate} was valid until {read.not_valid_after_utc:%Y-%m-%d}; make new ones."
        )
