"""One band of a photo that holds several: a page or a sample of a TIFF, a channel of others.

Pillow opens TIFFs of one number a pixel, and colours of 8 bits.  Of others a header is written over
the same strips or tiles that says they are a picture of bytes, so that its decoders (libtiff's)
unpack them; predictors and byte orders are undone here.
"""

import io
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import TiffImageFile

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.radiometric.no_value import GDAL_NODATA
from shapeshift.scene.captures.rare_photo import is_rare, rare_photo
from shapeshift.scene.captures.rare_photo_run import USUAL

HEADS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
MOST_PAGES, MOST_BANDS, MOST_TAGS = 1024, 4096, 4096
MOST_NUMBERS = 1 << 22  # of one tag: offsets of strips
MOST_BYTES = (1 << 32) - (1 << 26)  # of a file, whose places the new header says in 32 bits
FREE_BYTES, BYTES_A_BYTE = 1 << 28, 64  # that a file may unpack to
BROKEN = (OSError, SyntaxError, ValueError, EOFError, RuntimeError)  # of Pillow, in broken files
SMALLER_OR_MASK = 1 | 4  # bits of tag 254: a page that is none of the picture's bands
# struct letter and bytes of each type of TIFF
TYPES = {1: "B", 2: "s", 3: "H", 4: "I", 6: "b", 7: "s", 8: "h", 9: "i", 11: "f", 12: "d",
         13: "I", 16: "Q", 17: "q", 18: "Q"}  # fmt: skip
(KIND, WIDTH, HEIGHT, BITS, PACKING, LIGHT, FILL, STRIPS, SAMPLES, ROWS, STRIP_BYTES, PLANES,
 PREDICTOR, TILE_WIDTH, TILE_HEIGHT, TILES, TILE_BYTES, FORMAT) = (
    254, 256, 257, 258, 259, 262, 266, 273, 277, 278, 279, 284, 317, 322, 323, 324, 325,
    339)  # fmt: skip
WANTED = {KIND, WIDTH, HEIGHT, BITS, PACKING, LIGHT, FILL, STRIPS, SAMPLES, ROWS, STRIP_BYTES,
          PLANES, PREDICTOR, TILE_WIDTH, TILE_HEIGHT, TILES, TILE_BYTES, FORMAT,
          GDAL_NODATA}  # fmt: skip
APART = 2  # of PLANES
DIFFERENCES, FLOATING = 2, 3  # of PREDICTOR
DTYPES = {1: "u", 2: "i", 3: "f"}  # of FORMAT


@dataclass(frozen=True)
class Page:
    """What the header of a page says, by its tags."""

    tags: dict[int, tuple]

    def one(self, tag: int, default: int = 0) -> int:
        return int(self.tags.get(tag, (default,))[0])

    @property
    def size(self) -> tuple[int, int]:
        """Width, height."""
        return self.one(WIDTH), self.one(HEIGHT)

    @property
    def samples(self) -> int:
        return self.one(SAMPLES, 1)

    @property
    def beside(self) -> bool:
        """Whether the bands of a pixel lie side by side, and not each band on its own."""
        return self.samples > 1 and self.one(PLANES, 1) != APART

    @property
    def across(self) -> int:
        """Pixels of a row as it is stored: tiles are whole."""
        tile = self.one(TILE_WIDTH) if TILES in self.tags else 0
        return -(-self.one(WIDTH) // tile) * tile if tile else self.one(WIDTH)

    @property
    def no_data(self) -> str:
        """The text of GDAL's tag."""
        return b"".join(self.tags.get(GDAL_NODATA, ())).decode("ascii", "replace").rstrip("\0")

    def dtype(self, sample: int) -> np.dtype | None:
        """Of a sample's numbers, in the machine's own order; None: of bits that nothing reads."""
        bits = (*self.tags.get(BITS, (1,)), *[0] * sample)[sample] or self.one(BITS, 1)
        formats = self.tags.get(FORMAT, (1,))
        kind = DTYPES.get(formats[sample] if sample < len(formats) else formats[0], "")
        known = {"u": (8, 16, 32), "i": (8, 16, 32), "f": (32, 64)}.get(kind, ())
        return np.dtype(f"{kind}{bits // 8}") if bits in known else None


def is_tiff(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(4) in HEADS
    except OSError:
        return False


def read_pages(path: Path) -> tuple[str, list[Page]]:
    """The order of its bytes, < or >, and the pages of a TIFF that hold bands, of one size.

    Raises BadFile.
    """
    where, size, pages = str(path), path.stat().st_size, []
    with path.open("rb") as file:
        head = file.read(16)
        order, big = "<" if head[:2] == b"II" else ">", head[2:4] in (b"+\0", b"\0+")
        try:
            at = struct.unpack(order + ("Q" if big else "I"), head[8:16] if big else head[4:8])[0]
            seen: set[int] = set()
            while at and at not in seen and len(seen) < MOST_PAGES:
                seen.add(at)
                tags, at = _tags(file, at, order, big, size)
                pages.append(Page(tags))
        except (struct.error, OverflowError, MemoryError):
            raise BadFile(f"{where}: a TIFF whose header is cut off; copy it again") from None
    pages = [page for page in pages if not page.one(KIND) & SMALLER_OR_MASK]
    if not pages or not all(side > 0 for page in pages for side in page.size):
        raise BadFile(f"{where}: a TIFF without a picture; save it again")
    return order, pages


def _tags(file, at: int, order: str, big: bool, size: int) -> tuple[dict[int, tuple], int]:
    """The tags of a page that are wanted, and where the next page is."""
    file.seek(at)
    width, letter = (20, "Q") if big else (12, "I")
    count = struct.unpack(order + ("Q" if big else "H"), file.read(8 if big else 2))[0]
    if count > MOST_TAGS:
        raise struct.error
    table = file.read(width * count + (8 if big else 4))
    tags = {}
    for number in range(count):
        entry = table[width * number : width * (number + 1)]
        tag, kind, values = struct.unpack(order + "HH" + letter, entry[: width - (8 if big else 4)])
        if tag not in WANTED or kind not in TYPES:
            continue
        form = TYPES[kind]
        bytes_of = values * struct.calcsize("=" + form)
        if values > MOST_NUMBERS or bytes_of > size:
            raise struct.error
        inline = entry[width - (8 if big else 4) :]
        if bytes_of > len(inline):
            file.seek(struct.unpack(order + letter, inline)[0])
            inline = file.read(bytes_of)
        pattern = f"{order}{values}{form}"
        tags[tag] = struct.unpack(pattern, inline[:bytes_of])
    return tags, struct.unpack(order + letter, table[width * count :])[0]


def bands_of(path: Path, pages: list[Page]) -> list[tuple[Page, int]]:
    """Each band as its page and its sample there.  Raises BadFile where their sizes differ."""
    first, found = pages[0], []
    for page in pages:
        if page.size != first.size:
            one, other = ("{}x{}".format(*each.size) for each in (first, page))
            raise BadFile(
                f"{path}: bands of {one} and of {other} pixels; those of one file must "
                "have one size: save them apart, or resample them"
            )
        found += [(page, sample) for sample in range(page.samples)]
        if len(found) > MOST_BANDS:
            raise BadFile(f"{path}: more than {MOST_BANDS:,} bands; save fewer")
    return found


def band_header(path: Path) -> Image.Image | None:
    """The size of a TIFF that Pillow does not open, as an image without pixels, whose info has
    "bands", or its only band; None: it is none.  Raises BadFile.
    """
    if not is_tiff(path):
        return None
    found = bands_of(path, read_pages(path)[1])
    page, sample = found[0]
    dtype = page.dtype(sample)
    if len(found) == 1 and dtype is not None:  # of 64 bits
        return open_band(path, 1)
    header = Image.Image()
    header._size = page.size
    header._mode = "F" if dtype is not None and dtype.kind == "f" else "I;16"
    header.info["bands"] = len(found)
    header.__dict__["tag_v2"] = {GDAL_NODATA: page.no_data}  # where Pillow's TIFFs have it
    return header


def is_misread(image: Image.Image) -> bool:
    """Whether Pillow takes the only band of a TIFF for other numbers: -1 of 8 bits for 255, the
    upper half of 32 bits without a sign for less than 0, and of a band that is said to lie apart
    from none other the bytes.
    """
    if image.format != "TIFF" or image.mode not in ("L", "I", "I;16", "I;16B"):
        return False
    tags = getattr(image, "tag_v2", {})
    kind, bits, planes = (np.ravel(tags.get(tag, 1))[0] for tag in (FORMAT, BITS, PLANES))
    return (kind, bits) in ((2, 8), (1, 32)) or (bits > 8 and planes == APART)


def open_band(path: Path, band: int) -> Image.Image:
    """One band, counted from 1, with its pixels: of mode L, I;16, I or F.  Raises BadFile."""
    where = str(path)
    if is_tiff(path):
        order, pages = read_pages(path)
        found = bands_of(path, pages)
        refuse_band(where, band, len(found))
        page, sample = found[band - 1]
        if page.dtype(sample) is None and len(pages) > 1:
            raise BadFile(f"{where}: band {band} holds numbers of bits that are not read")
        if page.dtype(sample) is not None and page.one(PACKING, 1) not in (6, 7):
            return _opened(path, order, page, sample, band)
    with Image.open(path, formats=USUAL) as opened:
        image = rare_photo(path, MOST_NUMBERS)[0] if is_rare(opened) else opened
        if image is None:
            raise BadFile(f"{where}: {opened.width}x{opened.height} pixels; scale it down")
        image.load()
        shown = image.convert("RGB") if image.mode in ("P", "CMYK", "YCbCr", "LAB") else image
        refuse_band(where, band, len(shown.getbands()))
        if len(shown.getbands()) == 1:
            return shown.copy()
        return shown.getchannel(band - 1)


def refuse_band(where: str, band: int, bands: int) -> None:
    """Raises BadFile."""
    if not 1 <= band <= bands:
        has = "one band" if bands == 1 else f"bands 1 to {bands}"
        raise BadFile(f"{where}: 'band' is {band}; the file has {has}")


def _opened(path: Path, order: str, page: Page, sample: int, band: int) -> Image.Image:
    """The band by Pillow's decoders, through a header of its own behind the file's bytes."""
    where, size = str(path), path.stat().st_size
    if size > MOST_BYTES:
        raise BadFile(f"{where}: {size:,} bytes; at most {MOST_BYTES:,} are read of a TIFF's bands")
    if page.beside and len(set(page.tags.get(BITS, (1,)))) > 1:
        raise BadFile(f"{where}: bands of different bits side by side; save them with one type")
    dtype, (width, height) = page.dtype(sample), page.size
    assert dtype is not None, "open_band has seen to it"
    across, many = page.across, page.samples if page.beside else 1
    unpacked = across * many * dtype.itemsize * height
    if unpacked > max(FREE_BYTES, BYTES_A_BYTE * size):
        raise BadFile(
            f"{where}: {unpacked:,} bytes of bands out of {size:,}; at most {BYTES_A_BYTE} a byte "
            "are read: save it again"
        )
    Memory().of(path).charge(size + 4 * unpacked, "its bands")
    data = path.read_bytes()
    data += b"\0" * (len(data) % 2)
    table = _table(page, sample, across * many * dtype.itemsize, many * dtype.itemsize)
    start = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "I", len(data))
    try:
        header = _header(table, order, len(data))
        with TiffImageFile(io.BytesIO(start + data[8:] + header)) as image:
            image.load()
            numbers = np.asarray(image)
        if numbers.shape != (height, across * many * dtype.itemsize):
            raise OSError("its strips hold another picture")
    except (*BROKEN, struct.error, KeyError) as error:
        raise BadFile(f"{where}: band {band} cannot be read ({error}); save it again") from None
    tile = page.one(TILE_WIDTH) if TILES in page.tags else across
    numbers = _numbers(numbers, dtype, order, (many, tile, page.one(PREDICTOR, 1)))
    band_of = numbers[:, :width, sample if page.beside else 0]
    made = Image.fromarray(np.ascontiguousarray(_shown(band_of, dtype)))
    made.__dict__["tag_v2"] = {GDAL_NODATA: page.no_data}
    return made


def _shown(numbers: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Numbers as Pillow holds them: bytes, 16 bits without a sign, else 32 bits."""
    if dtype in (np.uint8, np.uint16):
        return numbers.astype(dtype)
    with np.errstate(over="ignore"):  # of 64 bits: Inf, which is no value
        return numbers.astype(np.float32 if dtype.kind == "f" or dtype == np.uint32 else np.int32)


def _numbers(
    rows: np.ndarray, dtype: np.dtype, order: str, form: tuple[int, int, int]
) -> np.ndarray:
    """(H, W, samples) numbers of the bytes of rows (H, W samples itemsize) of a picture.

    form: samples side by side, pixels of a tile across, and the predictor.  Differences are from
    the same sample of the pixel at the left, within a tile; of floating-point numbers they are of
    their bytes, all highest ones of a tile's row first (TIFF Technical Note 3).
    """
    samples, tile, predictor = form
    height, size = len(rows), dtype.itemsize
    rows = rows.reshape(height, -1, tile * samples * size)  # a tile each
    if predictor == FLOATING:
        steps = rows.reshape(height, rows.shape[1], -1, samples)
        summed = np.cumsum(steps, axis=2, dtype=np.uint8)
        planes = summed.reshape(height, rows.shape[1], size, tile * samples)
        rows, order = np.ascontiguousarray(np.moveaxis(planes, 2, 3)), ">"
    found = (
        np.ascontiguousarray(rows)
        .view(dtype.newbyteorder(">" if order == ">" else "<"))
        .astype(dtype)
    )
    found = found.reshape(height, -1, tile, samples)
    if predictor == DIFFERENCES:
        found = np.cumsum(found, axis=2, dtype=dtype)
    return found.reshape(height, -1, samples)


def _table(page: Page, sample: int, width: int, each: int) -> dict[int, tuple[str, tuple]]:
    """The tags of a picture of bytes with the page's strips or tiles: type and values by number.

    width: bytes of a row; each: bytes of a pixel.
    """
    table: dict[int, tuple[str, tuple]] = {
        WIDTH: ("I", (width,)), HEIGHT: ("I", (page.one(HEIGHT),)), BITS: ("H", (8,)),
        PACKING: ("H", (page.one(PACKING, 1),)), LIGHT: ("H", (1,)), SAMPLES: ("H", (1,)),
        PLANES: ("H", (1,)), FORMAT: ("H", (1,)),
    }  # fmt: skip
    if page.one(FILL, 1) != 1:
        table[FILL] = ("H", (page.one(FILL),))
    tiled = TILES in page.tags
    names = (TILES, TILE_BYTES) if tiled else (STRIPS, STRIP_BYTES)
    places, lengths = (page.tags.get(name, ()) for name in names)
    if not page.beside and page.samples > 1:  # one after the other: each band has its own
        count = len(places) // page.samples
        places, lengths = (row[sample * count : (sample + 1) * count] for row in (places, lengths))
    table |= {names[0]: ("I", places), names[1]: ("I", lengths)}
    if tiled:
        table |= {TILE_WIDTH: ("I", (page.one(TILE_WIDTH) * each,)),
                  TILE_HEIGHT: ("I", (page.one(TILE_HEIGHT),))}  # fmt: skip
    else:
        table[ROWS] = ("I", (min(page.one(ROWS, page.one(HEIGHT)), page.one(HEIGHT)),))
    return table


def _header(table: dict[int, tuple[str, tuple]], order: str, at: int) -> bytes:
    """The table as it lies in a file at a place."""
    rows, more, behind = b"", b"", at + 2 + 12 * len(table) + 4
    for tag, (form, values) in sorted(table.items()):
        data = struct.pack(f"{order}{len(values)}{form}", *values)
        kind = {"H": 3, "I": 4}[form]
        if len(data) > 4:
            field, more = struct.pack(order + "I", behind + len(more)), more + data
        else:
            field = data.ljust(4, b"\0")
        rows += struct.pack(order + "HHI", tag, kind, len(values)) + field
    return struct.pack(order + "H", len(table)) + rows + b"\0" * 4 + more
