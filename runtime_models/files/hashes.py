"""Whether a file is the one that unfinished work began with: by what is in it, not by its date."""

from hashlib import blake2b, file_digest
from pathlib import Path

ABSENT = "-"  # stands for the hash of a file that cannot be read


def hash_file(path: Path) -> str:
    """Of its bytes; ABSENT where it cannot be read, which whoever reads it says."""
    try:
        with open(path, "rb") as file:
            return file_digest(file, lambda: blake2b(digest_size=12)).hexdigest()
    except OSError:
        return ABSENT
