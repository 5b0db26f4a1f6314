"""A photo in one of Pillow's rarer formats, behind the gate: nobody tries their decoders much."""

from typing import Any

from shapeshift.runtime_models.gate.refusal import Unreadable

# Read in our own process, photo.py: formats of which there are many files, tried by everybody.
USUAL = ("JPEG", "PNG", "WEBP", "TIFF", "BMP", "PPM")
NEVER = {"EPS", "WMF"}  # they start another program, or ask the system to draw
PACKINGS = ("raw", "tiff_lzw", "tiff_adobe_deflate", "tiff_deflate", "packbits")  # usual TIFF
KEPT = ("L", "LA", "I", "F", "I;16", "I;16B", "I;16L", "P", "RGB", "RGBA")  # modes as they are


def rare_photo(path: str, most: int) -> dict[str, Any]:
    """What makes the image again: see photo_of in rare_photo.py.  Of more than `most` pixels the
    size alone.

    Raises Unreadable.
    """
    import PIL.Image as pillow

    pillow.init()
    rare = sorted((set(pillow.OPEN) - set(USUAL) - NEVER) | {"TIFF"})
    try:
        with pillow.open(path, formats=rare) as image:
            told: dict[str, Any] = {"size": list(image.size), "format": image.format}
            if image.width * image.height > most:
                return told
            image.load()
            exif, unseen = image.info.get("exif"), image.info.get("transparency")
            shown: pillow.Image = image
            if image.mode not in KEPT:
                shown = image.convert("RGBA" if "A" in image.mode or unseen is not None else "RGB")
            palette = shown.getpalette() if shown.mode == "P" else None
            return told | {
                "mode": shown.mode, "pixels": shown.tobytes(), "palette": palette,
                "exif": exif if isinstance(exif, bytes) else b"",
                "transparency": unseen if isinstance(unseen, int | bytes) else None,
            }  # fmt: skip
    except MemoryError:
        raise
    except Exception as error:  # on damaged bytes its decoders raise whatever comes up
        what = str(error).replace(f" {path!r}", "") or type(error).__name__
        raise Unreadable(f"not a readable image ({what[:120]})") from None
