"""Photos with the poses of another program beside them."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene import foreign_files as write
from tests.support.scene.foreign_files import make_shots, save_photos
from tests.support.scene.strangers.situations import Situation, found_in

SHOTS = make_shots(4)
LENS = (38.0, -0.2, 0.05)
METASHAPE = {"f": 38.0, "k1": -0.2, "p1": 0.01, "b1": 0.5}
REALITY = dict.fromkeys(("px", "py", "k1", "k2", "k3", "k4", "t1", "t2"), 0.01) | {"f": 34.0}
BLOCKS = {"f": 34.0, "x": 20.0, "y": 15.0} | dict.fromkeys(("K1", "K2", "K3", "P1", "P2"), 0.01)
PERSPECTIVE = {"projection_type": "perspective", "focal": 0.9, "k1": -0.1, "k2": 0.0}
BROWN = {"projection_type": "brown", "focal_x": 0.9, "focal_y": 0.9, "k1": -0.1}
MESHROOM = {"type": "radial1", "pxFocalLength": "37", "principalPoint": ["20", "15"],
            "distortionParams": ["-0.1"]}  # fmt: skip
SAID = "The poses are those of "


def with_photos(folder: Path, make: Callable, shots=SHOTS) -> Path:
    save_photos(folder, shots)
    make(folder, shots)
    return folder


def by_program(path: Path) -> str:
    """What read_capture finds, and whose poses it took."""
    found = found_in(path)
    try:
        doubts = read_capture(path).doubts
    except BadFile:
        return found
    whose = [doubt.removeprefix(SAID).partition(":")[0] for doubt in doubts if SAID in doubt]
    return f"{found} ({whose[0]})" if whose else found


def by_name(path: Path) -> str:
    """As what a file is named whose poses are not read."""
    try:
        read_capture(path)
    except BadFile as error:
        advice = str(error).partition("; ")[2]
        return f"refused, with the way there: {advice.partition(' is ')[2].partition(':')[0]}"
    return "read"


def beside(name: str, met: str, make: Callable, expected: str) -> Situation:
    return Situation(name, met, partial(with_photos, make=make), expected, by_program)


def two_sorts(folder: Path, shots) -> Path:
    """Metashape's labels have no folders, only its groups."""
    for name in ("rgb", "thermal"):
        save_photos(folder / name, [replace(s, name=f"{name}_{s.name}") for s in shots])
    for shot in shots:
        (folder / shot.name).unlink()
    both = [replace(s, name=f"{sort}_{s.name}") for sort in ("rgb", "thermal") for s in shots]
    return write.metashape(folder, both, METASHAPE, label=lambda n: Path(n).stem)


def two_files(folder: Path, shots) -> None:
    """Both of one moment, as an unpacked archive has them; then the newer one is touched."""
    import os

    write.metashape(folder, shots, METASHAPE)
    os.utime(write.bundler(folder, shots, LENS), (4_000_000_000, 4_000_000_000))


def above(folder: Path, shots) -> None:
    (folder / "images").mkdir()
    for shot in shots:
        shutil.move(folder / shot.name, folder / "images" / shot.name)
    write.metashape(folder, shots, METASHAPE)


def named(name: str, content: bytes) -> Callable:
    return lambda folder, shots: (folder / name).write_bytes(content)


SITUATIONS = [
    beside("Metashape", "cameras.xml",
           lambda d, s: write.metashape(d, s, METASHAPE), "RGB 4 (Metashape)"),
    beside("Metashape, labels without endings", "photos in folders",
           lambda d, s: write.metashape(d, s, METASHAPE, label=lambda n: Path(n).stem),
           "RGB 4 (Metashape)"),
    beside("Metashape, not all aligned", "2 of 4 without a pose",
           lambda d, s: write.metashape(d, s, METASHAPE, lost={s[0].name, s[1].name}),
           "RGB 2 (Metashape)"),
    beside("Metashape, light and heat", "rgb/ and thermal/, labels without folders", two_sorts,
           "rgb 4, thermal 4 (Metashape)"),
    beside("Blocks Exchange", "ContextCapture, DJI Terra",
           lambda d, s: write.blocks(d, s, BLOCKS), "RGB 4 (Blocks Exchange)"),
    beside("RealityScan's CSV", "Internal/External camera parameters",
           lambda d, s: write.realityscan(d, s, REALITY), "RGB 4 (RealityScan)"),
    beside("RealityScan's XMP", "a file beside each photo",
           lambda d, s: write.xmp(d, s, REALITY), "RGB 4 (RealityScan)"),
    beside("OpenMVG", "sfm_data.json",
           lambda d, s: write.openmvg(d, s, (37.0, 20.0, 15.0), "pinhole_radial_k1",
                                      {"disto_k1": [-0.1]}), "RGB 4 (OpenMVG)"),
    beside("Meshroom", "cameras.sfm, numbers as texts",
           lambda d, s: write.alicevision(d, s, (1, 0, 0), MESHROOM), "RGB 4 (Meshroom)"),
    beside("OpenSfM", "reconstruction.json",
           lambda d, s: write.opensfm(d, s, PERSPECTIVE), "RGB 4 (OpenSfM)"),
    beside("OpenDroneMap", "odm_report/shots.geojson, a cameras.json of lenses",
           lambda d, s: write.odm(d, s, BROWN), "RGB 4 (OpenDroneMap)"),
    beside("Bundler", "bundle.out, list.txt",
           lambda d, s: write.bundler(d, s, LENS), "RGB 4 (Bundler)"),
    beside("VisualSFM", "NVM", lambda d, s: write.nvm(d, s, 37.0, 0.1), "RGB 4 (VisualSFM)"),
    beside("Pix4D", "calibrated_camera_parameters.txt, offset.xyz",
           lambda d, s: write.pix4d(d, s, (37, 20, 15, (0.1, 0, 0), (0, 0)), s[0].centre),
           "RGB 4 (Pix4D)"),
    beside("poses above the photos", "cameras.xml beside images/", above, "RGB 4 (Metashape)"),
    beside("two programs", "Metashape's file and a newer one of Bundler", two_files,
           "RGB 4 (Bundler)"),
]  # fmt: skip
SITUATIONS += [
    Situation(name, met, partial(with_photos, make=named(file, content)),
              f"refused, with the way there: {what}", by_name)
    for name, met, file, content, what in (
        ("Metashape's project alone", "site.psx", "site.psx", b"<document/>",
         "a project of Metashape"),
        ("Pix4D's project alone", "flight.p4d", "flight.p4d", b"<pix4d/>", "a project of Pix4D"),
        ("an empty file of Metashape", "cameras.xml of 0 bytes, an export that broke off",
         "cameras.xml", b"", "empty, it has 0 bytes"),
        ("a table of zeros", "poses.csv as a full disk leaves it", "poses.csv", bytes(600),
         "empty, it has 600 bytes, all blanks or zeros"),
        ("COLMAP's data base alone", "database.db", "database.db", b"SQLite format 3\0",
         "COLMAP's data base, which has photos and matches and no poses"),
    )
]  # fmt: skip
