"""Small photos that belong to a mark: kept in the file of marks itself, as JPEG."""

import base64
import binascii
import io
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.scene.captures.photo import BROKEN, decoded, over_black, quiet

LONGEST_PX = 640  # of a side: a report shows it so wide
QUALITY = 85  # of JPEG
MOST_BYTES = 300_000  # of one; 640x640 of noise has 270,000
MOST_OF_ALL = 6_000_000  # of one file of marks, as bytes of JPEG
JPEG = b"\xff\xd8\xff"


def shrunk_photo(path: Path) -> bytes:
    """An image file as a JPEG of at most LONGEST_PX a side, upright.  Raises BadFile."""
    image = decoded(path, None).image
    with quiet():
        image = ImageOps.exif_transpose(over_black(image).convert("RGB"))
    image.thumbnail((LONGEST_PX, LONGEST_PX))
    held = io.BytesIO()
    image.save(held, "JPEG", quality=QUALITY)
    return held.getvalue()


def photo_pixels(photo: bytes) -> np.ndarray | None:
    """(H, W, 3) float32 display sRGB of a kept photo; None: it is broken, or larger than any."""
    try:
        with quiet(), Image.open(io.BytesIO(photo), formats=["JPEG"]) as image:
            if not 0 < max(image.size) <= LONGEST_PX:
                return None
            return np.asarray(image.convert("RGB"), np.float32) / 255
    except (Image.DecompressionBombError, *BROKEN):
        return None


def read_photo(row: Fields) -> bytes:
    """'photo' of a row of the file of marks; b"": there is none.  Raises BadFile."""
    if not row.has("photo"):
        return b""
    wanted = f"a JPEG of at most {MOST_BYTES:,} bytes as base64"
    text = row.value("photo")
    if not isinstance(text, str) or len(text) > 4 * -(-MOST_BYTES // 3):
        raise row.error("photo", wanted)
    try:
        photo = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise row.error("photo", wanted) from None
    if not photo.startswith(JPEG):
        raise row.error("photo", wanted)
    return photo


def photo_text(photo: bytes) -> str:
    """As the file of marks has it."""
    return base64.b64encode(photo).decode()
