"""DJI's radiometric JPEG, whose degrees an installed converter gives: dji-thermal-cli.

The camera's numbers lie in APP3 segments, what makes temperatures of them in APP4; only DJI's own
code and ports of it know how.  dji-thermal-cli (AGPL 3) is such a port: it is run as a program of
its own, where somebody has installed it, and never imported.
"""

import os
import shutil
import subprocess
from functools import lru_cache
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.files.plain_text import one_line, path_end
from shapeshift.runtime_models.files.whole_file import temporary_folder
from shapeshift.runtime_models.model import BadFile

PROGRAM = "dji-thermal-cli"
ADVICE = f"for degrees, install {PROGRAM} (pipx install {PROGRAM})"
RAW, PARAMETERS, START = 0xE3, 0xE4, 0xDA  # JPEG markers: APP3, APP4, start of the picture
MAKER = b"DJI"
EXIF_BYTES = 4096  # of the Exif segment, in which the maker's name is looked for
MOST_SEGMENTS = 1000
MOST_BYTES = 1 << 26
MOST_NUMBERS = 1 << 22  # an H30T has 1.3 million
NUMBER = 12  # bytes of memory a number
SECONDS = 120.0  # that one photo may take
NOTHING_C = -273.0  # what the converter writes where nothing was measured
KEPT = 24  # photos: as many as a range is taken from


def is_dji(path: Path) -> bool:
    """Whether a JPEG is a DJI camera's with the sensor's numbers in it."""
    try:
        with path.open("rb") as file:
            if file.read(2) != b"\xff\xd8":
                return False
            maker, found = False, set()
            for _ in range(MOST_SEGMENTS):
                head = file.read(4)
                if len(head) < 4 or head[0] != 0xFF or head[1] == START:
                    break
                length = int.from_bytes(head[2:], "big")
                body = file.read(min(max(length - 2, 0), EXIF_BYTES))
                maker |= head[1] == 0xE1 and MAKER in body
                found.add(head[1])
                file.seek(max(length - 2, 0) - len(body), os.SEEK_CUR)
            return maker and {RAW, PARAMETERS} <= found
    except OSError:
        return False


def converter() -> str:
    """The path of dji-thermal-cli; "": it is not installed.  Never of the folder of now."""
    found = shutil.which(PROGRAM)
    if not found or not Path(found).is_absolute() or Path(found).parent == Path.cwd():
        return ""
    return found


def dji_celsius(path: Path) -> np.ndarray:
    """(H, W) float32 °C as the camera was set; NaN: nothing was measured.  Raises BadFile."""
    there = path.stat()
    return _converted(path.resolve(), there.st_mtime_ns, there.st_size)


@lru_cache(maxsize=KEPT)
def _converted(path: Path, _changed_ns: int, size: int) -> np.ndarray:
    where, program = path_end(path), converter()
    if not program:
        raise BadFile(f"{where}: a radiometric JPEG of DJI; {ADVICE}.")
    if not 0 < size <= MOST_BYTES:
        raise BadFile(f"{where}: {size:,} bytes are no thermal photo; copy it again")
    with temporary_folder() as folder:
        photo, out = Path(folder, "in", "photo.jpg"), Path(folder, "out")
        photo.parent.mkdir()
        shutil.copyfile(path, photo)
        command = [program, "process", "--input-dir", str(photo.parent)]
        command += ["--output-dir", str(out), "-o", "temp_c:tiff"]
        try:
            done = subprocess.run(
                command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, timeout=SECONDS
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise BadFile(f"{where}: {PROGRAM} did not come to an end ({error})") from None
        written = sorted(out.rglob("*temp_c.tif*")) if out.is_dir() else []
        if done.returncode or len(written) != 1:
            said = (done.stderr or done.stdout).decode(errors="replace").strip().splitlines()
            why = one_line(said[-1])[:200] if said else f"exit code {done.returncode}"
            raise BadFile(f"{where}: {PROGRAM} gave no temperatures ({why})")
        return _read(written[0], path)


def _read(file: Path, photo: Path) -> np.ndarray:
    """The converter's TIFF of floating-point numbers, charged to the photo."""
    where = path_end(photo)
    try:
        with Image.open(file, formats=["TIFF"]) as image:
            pixels = image.width * image.height
            if image.mode != "F" or not 0 < pixels <= MOST_NUMBERS:
                raise ValueError(f"{image.mode} of {image.width}x{image.height}")
            Memory().of(photo).charge(NUMBER * pixels, f"{pixels:,} numbers")
            celsius = np.array(image, np.float32)
    except (OSError, SyntaxError, ValueError) as error:
        raise BadFile(f"{where}: {PROGRAM} wrote no picture of numbers ({error})") from None
    celsius[~(celsius > NOTHING_C)] = np.nan
    celsius.setflags(write=False)
    return celsius
