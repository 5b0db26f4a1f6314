"""Photos without poses -> a COLMAP folder that `train` reads: images/, sparse/0, poses.json.

Structure from motion by pycolmap (Schoenberger and Frahm 2016; "all photos at once" is GLOMAP, Pan
et al. 2024), then the frame: upright, and in metres where a length is known.
"""

import io
import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.decomposition.poses.photo_list import PhotoList
from shapeshift.decomposition.poses.write_posed import PoseReport, write_posed
from shapeshift.runtime_models.files.hashes import hash_file
from shapeshift.runtime_models.files.memory import PART, machine_memory
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.files.whole_file import make_folders, write_whole
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.upright import up_of_photos
from shapeshift.scene.capture_files import photo_key
from shapeshift.scene.captures.colmap.colmap_child import Progress, run_child
from shapeshift.scene.captures.photo import open_image
from shapeshift.scene.mask_files import masks_in

WORK = "poses.work"  # below the folder that is written, as long as the search is not done
MOST_FOR_ALL_PAIRS = 120  # photos; beyond that neighbours by name are matched alone
NEIGHBOURS = 10
SCRIPT = Path(__file__).with_name("colmap_run.py")
FAILURE = (
    "the search for poses ended with code {code}, perhaps for want of memory; {log} has its last "
    "words.  Try smaller photos (--side) or fewer (--every)."
)
# Seconds of processor time that a search may take: in all, for each photo, for each pair of them.
START_S, PHOTO_S, PAIR_S = 600, 60, 5
FEW_POINTS = 60  # that a photo sees: its pose hangs on little


@dataclass(frozen=True)
class Length:
    """A known length: between what two pixels of a photo show."""

    metres: float
    photo: str  # a name of the list
    ends: tuple[tuple[float, float], tuple[float, float]]  # px, (0, 0) the upper left corner


@dataclass(frozen=True)
class PoseSettings:
    masks: Path | None = None  # folder; black: no features there
    neighbours: int | None = (
        None  # photos by name that each is matched with; 0: all; None: by count
    )
    side: int = 1600  # longest side, pixels, on which features are looked for
    features: int = 8192  # of a photo, at most
    lens: str = "SIMPLE_RADIAL"  # COLMAP's camera model
    length: Length | None = None
    straight: bool = False  # write undistorted photos of pinhole cameras
    threads: int = 0  # 0: one a core

    def __post_init__(self) -> None:
        if self.straight and self.masks is not None:
            raise ValueError("masks lie on the photos as they are; undistort without masks.")
        for name, least in (("side", 100), ("features", 100), ("threads", 0), ("neighbours", 0)):
            value = getattr(self, name)
            if value is not None and not value >= least:
                raise ValueError(f"{name} is {value}; it has to be at least {least}.")
        if self.length is not None and not 0 < self.length.metres < np.inf:
            raise ValueError(f"length is {self.length.metres:g} metres; it has to be above 0.")


def find_poses(
    photos: PhotoList, out: Path, settings: PoseSettings, progress: Progress
) -> PoseReport:
    """Writes the capture into `out`, which has at most an unfinished search in it.

    Raises BadFile where no poses are found.  Interrupted, it keeps features and matches in
    out/poses.work, and the same call goes on from there.
    """
    make_folders(out.parent, out.name)
    work = make_folders(out, WORK)
    refuse_links(work)
    masks = copy_masks(photos, settings.masks, work) if settings.masks else None
    job = describe(photos, work, settings, masks)
    reports = run_colmap("find", start_job(work, job), job, progress)
    if not reports or reports[-1]["registered"] < 2:
        raise BadFile(
            f"{photos.root}: no two of its {len(photos.photos)} photos could be placed beside each "
            "other; photos must overlap by more than half, be sharp, and show something with "
            "texture."
        )
    with np.load(work / "best.npz") as file:
        best = {name: file[name] for name in file.files}
    turn, up, scale = frame_of(best, photos, settings.length)
    write_job = work / "write.json"
    write_whole(write_job, json.dumps(job | {"similarity": turn.tolist()}).encode())
    run_colmap("write", write_job, job, progress)
    placed = {str(name) for name in best["names"]}
    report = PoseReport(
        photos=len(photos.photos),
        placed=len(placed),
        left_out=sorted(p.name for p in photos.photos if p.name not in placed),
        few_points={str(n): int(c) for n, c in zip(best["names"], best["points"], strict=True)
                    if c < FEW_POINTS},
        points=len(best["xyz"]),
        error_px=round(float(best["error_px"]), 3),
        attempts=[line for line in reports if "attempt" in line],
        scale=scale,
        up=up,
        paired=sum(name in placed for name in photos.paired.values()),
        others=[name for name, _ in photos.others],
    )  # fmt: skip
    write_posed(photos, placed, out, work, settings.straight, report)
    return report


def run_colmap(what: str, file: Path, job: dict, progress: Progress) -> list[dict]:
    """Does `what` of the job in `file`, beside which the log is; returns what it reports.

    It may take the memory of this machine that files may take.  Raises BadFile.
    """
    words = [what, str(file), f"{allowed_s(job):.1f}", str(int(PART * machine_memory()))]
    return run_child(SCRIPT, words, file.with_name("log.txt"), progress, FAILURE)


def allowed_s(job: dict) -> float:
    """Seconds of processor time that a search may take: many times what photos that are whole take,
    so that it ends where a damaged one would make a decoder run on."""
    return START_S + PHOTO_S * sum(map(len, job["groups"])) + PAIR_S * job["pairs"]


def refuse_links(work: Path) -> None:
    """pycolmap writes into files of the folder by their names: a link there leads it elsewhere."""
    link = next((path for path in work.rglob("*") if path.is_symlink()), None)
    if link is not None:
        raise BadFile(
            f"{link} is a link, and a search writes through none; --overwrite begins anew."
        )


def describe(photos: PhotoList, work: Path, settings: PoseSettings, masks: Path | None) -> dict:
    """The job as colmap_run.py reads it."""
    count = len(photos.photos)
    near = settings.neighbours
    if near is None:
        near = 0 if count <= MOST_FOR_ALL_PAIRS else NEIGHBOURS
    return {
        "photos": str(photos.root.absolute()), "work": str(work.absolute()),
        "groups": photos.groups, "masks": str(masks.absolute()) if masks else "",
        "neighbours": near, "pairs": count_pairs(count, near), "side": settings.side,
        "features": settings.features, "lens": settings.lens, "straight": settings.straight,
        "threads": settings.threads or os.cpu_count() or 1,
        "measured": settings.length.photo if settings.length else "",
        "ends": settings.length.ends if settings.length else [],
        "contents": {photo.name: hash_file(photos.root / photo.name) for photo in photos.photos},
    }  # fmt: skip


def count_pairs(photos: int, near: int) -> int:
    """How many pairs are matched, for the progress: quadratic neighbours are 1, 2, 4, ... away."""
    if not near:
        return photos * (photos - 1) // 2
    steps = set(range(1, near + 1)) | {1 << i for i in range(near)}
    return sum(max(photos - step, 0) for step in steps)


def start_job(work: Path, job: dict) -> Path:
    """The file of the job.  Raises BadFile where another one is unfinished in the folder."""
    path = work / "job.json"
    text = json.dumps(job, indent=1).encode()
    if path.is_file() and (before := path.read_bytes()) != text:
        raise BadFile(
            f"{work} has an unfinished search with other photos or options"
            f"{what_changed(before, job)}; give those again, or --overwrite to begin anew."
        )
    write_whole(path, text)
    return path


def what_changed(before: bytes, job: dict) -> str:
    """Which photo is another one under the same name; "" where it is something else."""
    try:
        contents = json.loads(before)["contents"]
        name = next(n for n, now in job["contents"].items() if contents.get(n, now) != now)
    except (ValueError, LookupError, TypeError, AttributeError, StopIteration):
        return ""
    return f" ({name} is another picture)"


def copy_masks(photos: PhotoList, masks: Path, work: Path) -> Path:
    """Masks under the names that COLMAP looks for, NAME.jpg.png.  Raises BadFile."""
    if not masks.is_dir():
        raise BadFile(f"{masks}: no folder of masks; name one with a PNG for each photo.")
    names = [photo.name for photo in photos.photos]
    of, _ = masks_in(masks, names, {photos.root / name for name in names})
    if not of:
        raise BadFile(
            f"{masks}: no mask has a photo's name; a mask of a.jpg is called a.jpg.png or a.png."
        )
    for photo in photos.photos:
        source = of.get(photo_key(photo.name))
        if source is None:
            continue
        with open_image(source) as image:
            if image.size != photo.size:
                raise BadFile(
                    f"{path_end(source)} has {image.size[0]}x{image.size[1]} pixels, its photo "
                    f"{photo.size[0]}x{photo.size[1]}; a mask is as large as its photo."
                )
            grey = image.convert("L")
            seen, data = grey.getextrema()[1], source.read_bytes()
            if image.format != "PNG":
                file = io.BytesIO()
                grey.save(file, "PNG")
                data = file.getvalue()
        if not seen:
            raise BadFile(f"{path_end(source)} is all black; white marks what counts.")
        target = make_folders(work, Path("masks") / Path(photo.name).parent)
        write_whole(target / f"{Path(photo.name).name}.png", data)
    return work / "masks"


def frame_of(
    best: dict[str, np.ndarray], photos: PhotoList, length: Length | None
) -> tuple[np.ndarray, str, str]:
    """(3, 4) to the capture's world, and where its up and its metres come from."""
    orientation = {photo.name: photo.orientation for photo in photos.photos}
    poses = best["world_from_camera"]
    found = up_of_photos(poses, [orientation[str(name)] for name in best["names"]])
    said = "not known: the photos do not agree"
    if found is not None:
        said = "as most photos were held" + ("" if found.sure else ", which all look one way")
    up = COLMAP_UP if found is None else np.array(found.direction)
    centre = np.median(best["xyz"], axis=0)
    if length is None:
        scale = 1 / float(np.nanmedian(best["depth"]))
        words = "arbitrary: what the photos show is 1 m away in the median; say a length (--metres)"
        return similarity(up, scale, centre), said, words
    measured = model_length(best, photos, length)
    words = f"{length.metres:g} m in {length.photo}"
    return similarity(up, length.metres / measured, centre), said, words


def model_length(best: dict[str, np.ndarray], photos: PhotoList, length: Length) -> float:
    """The known length in the model's own units.  Raises BadFile where that cannot be told."""
    sizes = {photo.name: photo.size for photo in photos.photos}
    if length.photo not in sizes:
        raise BadFile(f"--metres names the photo {length.photo}, which is none of those given.")
    if length.photo not in set(map(str, best["names"])):
        raise BadFile(f"--metres names {length.photo}, which got no pose; name another photo.")
    width, height = sizes[length.photo]
    ends = np.array(length.ends, float)
    if not ((ends >= 0) & (ends <= (width, height))).all():
        raise BadFile(f"--metres: {length.photo} has {width}x{height} pixels; name two in it.")
    found = length_between(ends, best["at"], best["away"], best["rays"], max(width, height))
    if not 0 < found < np.inf:
        raise BadFile(
            f"--metres: nothing is known near those pixels of {length.photo}, or they are one "
            "place; name two with texture around them."
        )
    return found


# Which way is up in a world that structure from motion has made, and how long a metre is in it.
#
# Structure from motion knows neither: its world is right but for a similarity. People hold
# cameras level, so the rows of their photos lie in planes through the horizon.

NEAREST = 8  # points around a pixel that say how far what it shows is
NEAR_PX = 0.05  # of the photo's longest side: no point nearer than that, and nobody knows
COLMAP_UP = np.array([0.0, -1.0, 0.0])


def similarity(up: np.ndarray, scale: float, centre: np.ndarray) -> np.ndarray:
    """(3, 4) new from old: `up` becomes COLMAP's -Y by the shortest turn, `centre` the origin."""
    axis, cosine = np.cross(up, COLMAP_UP), float(up @ COLMAP_UP)
    if cosine < -1 + 1e-12:
        turn = np.diag([1.0, -1.0, -1.0])
    else:
        x, y, z = axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = np.eye(3) + cross + cross @ cross / (1 + cosine)
    return np.hstack([scale * turn, -scale * (turn @ centre)[:, None]])


def length_between(
    ends: np.ndarray, at: np.ndarray, away: np.ndarray, rays: np.ndarray, side: int
) -> float:
    """Between what two pixels of a photo show, in the units of the model; NaN: nobody knows.

    ends: (2, 2) px; at: (M, 2) px and away: (M,) depth along the view of the points that the
    photo sees; rays: (2, 3) directions through the ends, 1 long along the view.
    """
    if len(at) < 3:
        return np.nan
    places = []
    for end, ray in zip(ends, rays, strict=True):
        far = np.linalg.norm(at - end, axis=1)
        near = np.argsort(far)[:NEAREST]
        if not far[near[0]] <= NEAR_PX * side:
            return np.nan
        places.append(ray * np.median(away[near]))
    return float(np.linalg.norm(places[0] - places[1]))
