"""Scenes in motion and what is touched in them; files of cameras, and where photos were taken."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from shapeshift.api.arguments import PathText, Progress, Size, X
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import in_words_of_python, opened
from shapeshift.api.scene import Scene
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain
from shapeshift.scene.cameras.camera_list import CameraList, CameraReading

if TYPE_CHECKING:
    from shapeshift.decomposition.poses.write_posed import PoseReport

HZ = 90
AFTER_S = 2.0  # seconds that go on after the script's last line
LONGEST_S = 24 * 3600.0


@dataclass(frozen=True)
class Step:
    """A scene file after one step of its physics."""

    number: int  # steps done, from 1 on
    seconds: float
    row: dict[str, Any]  # what has moved, changed or touched, as `shapeshift simulate` writes it
    scene: Scene  # as it stands then, ready to be drawn

    @property
    def events(self) -> list[dict[str, Any]]:
        """Reactions of this step: object, on, reaction, from, to, x.

        [event["object"] for event in step.events]
        """
        return list(self.row.get("events", ()))

    @property
    def contacts(self) -> list[Any]:
        """Pairs that begin to touch: names, impulse in N s, point in metres.

        step.contacts
        """
        return list(self.row.get("contacts", ()))


def simulate(
    scene: PathText | OpenedScene,
    script: PathText | None = None,
    *,
    seconds: float | None = None,
    x: X | None = None,
    rough: bool = False,
    progress: Progress | None = None,
) -> Iterator[Step]:
    """The objects of a scene file in motion, step by step of 1/90 s: gravity, contacts, reactions.

    scene: a scene file, or one that was opened and rearranged (`with_object`).  script: JSON lines
    of hands, grabs, rays and controls with times (docs/scene.md); None: all just falls.  seconds:
    None is two more than the script.  x: where all sliders stand at the start.  rough: what has
    no collider yet is touched as one hull, at once.  progress: of the colliders, which are made
    once and kept in the user's cache.  The same scene, script and colliders give the same steps for
    ever.  Raises BadFile, UsageError before the first step.

        for step in ss.simulate("room.scene.json", seconds=2):
            print(step.seconds, step.events)
    """
    from shapeshift.scene.world.read_script import read_script
    from shapeshift.scene.world.simulation import Simulation

    scene = opened(scene).at(x)
    file = scene.subject.file
    if file is None:
        raise UsageError(
            "this is one model; simulate moves the objects of a NAME.scene.json (docs/scene.md)."
        )
    acts = read_script(plain(script), file.all_items) if script is not None else ()
    if seconds is None:
        seconds = (acts[-1].t if acts else 0.0) + AFTER_S
    if not 0 < seconds <= LONGEST_S:
        raise UsageError(f"seconds is {seconds:g}; above 0 and at most a day is wanted.")
    simulation = Simulation(world_of(scene, progress, rough), acts)
    return steps_of(scene, simulation, math.ceil(seconds * HZ - 1e-6))


def colliders(
    scene: PathText,
    out: PathText,
    *,
    shape: str | Mapping[str, str] = "",
    overwrite: bool = False,
    progress: Progress | None = None,
) -> dict[str, Path]:
    """Makes what "hulls" of a scene file asks for once, into files beside a new scene file `out`,
    NAME.scene.json, which names them; the file of each object's collider, by the object's name.

    shape: one convex piece in place of up to 16: hull, box, cylinder, sphere or capsule; of all, or
    of objects by their names.  progress: called with (what, part 0..1).  Raises BadFile,
    UsageError.

        made = ss.colliders("room.scene.json", "ready.scene.json", shape={"cup": "cylinder"})
    """
    from shapeshift.app.commands.colliders import Options, make_colliders

    named = [f"{name}={each}" for name, each in shape.items()] if isinstance(shape, Mapping) else []
    words = tuple(named) if isinstance(shape, Mapping) else (shape,) * bool(shape)
    options = Options(plain(scene), plain(out), words, overwrite)
    with in_words_of_python():
        return make_colliders(options, lambda said: None, progress or (lambda what, part: None))


def world_of(scene: OpenedScene, progress: Progress | None, rough: bool = False):
    """The bodies and physics of a scene file, each object's x as the scene has it."""
    from shapeshift.scene.colliders.collider_files import colliders_of
    from shapeshift.scene.document import edits
    from shapeshift.scene.world.settle import begin
    from shapeshift.scene.world.world import World

    file = scene.subject.file
    assert file is not None
    for obj in scene.objects:
        file = edits.change(file, obj.name, x=obj.x)
    models = {obj.name: obj.model for obj in scene.objects}
    world = World(file, models, colliders_of(file, models, progress, rough), hz=HZ)
    begin(world)
    return world


def steps_of(scene: OpenedScene, simulation: Any, steps: int) -> Iterator[Step]:
    """The steps, made as they are asked for."""
    for number in range(1, steps + 1):
        row = simulation.step().row()
        stands = Scene(Document(simulation.world.drawn(), scene.subject.file), scene.path)
        yield Step(number, number / HZ, row, stands)


def cameras(
    path: PathText,
    *,
    size: Size | None = None,
    fov_y: float = 0.0,
    up: Literal["", "+X", "-X", "+Y", "-Y", "+Z", "-Z"] = "",
    flip: bool = False,
    out: PathText | None = None,
    to: Literal[
        "ours", "inria", "transforms", "nerfstudio", "vr", "colmap-bin", "colmap-txt"
    ] = "ours",
) -> CameraList:
    """The views (`.views`) and names of a file or folder of cameras in any known form.

    size: width, height in pixels instead of the file's.  fov_y: radians from top to bottom, where
    the file says nothing about the lens.  up, flip: as of `load`.  out, to: writes them in another
    form, a file, or for COLMAP a folder; docs/cameras.md has the forms.  Raises BadFile, UsageError
    for a file that exists.

        views = ss.cameras("capture/transforms.json", size=(640, 360)).views
        ss.cameras("run/cameras.json", out="model", to="colmap-txt")
    """
    from shapeshift.scene.cameras.read_cameras import read_camera_list
    from shapeshift.scene.cameras.write_cameras import paths_of, write_cameras

    if not (fov_y == 0 or 0 < fov_y < math.pi):
        raise UsageError(f"fov_y is {fov_y}, expected radians between 0 and pi.")
    found = read_camera_list(plain(path), CameraReading(size, fov_y, up, flip))
    if out is not None:
        for file in paths_of(plain(out), to):
            if file.exists():
                raise UsageError(f"{file} exists; choose another place.")
        write_cameras(found, plain(out), to)
    return found


def poses(
    photos: PathText,
    out: PathText,
    *,
    every: int = 1,
    masks: PathText | None = None,
    progress: "Callable[[str, int, int], None] | None" = None,
    **settings: Any,
) -> "PoseReport":
    """Finds where photos were taken from, upright, and writes a COLMAP folder for `train`.

    photos: a folder, its sub-folders modalities; thermal photos get the poses of the photos of
    visible light with the same name.  out: a new or empty folder, or one with the same search
    unfinished, which goes on.  every: each n-th photo of a folder.  settings: any field of
    `shapeshift.decomposition.poses.find_poses.PoseSettings`, such as length, neighbours or
    straight.
    Lengths are arbitrary unless `length` names one.  Gives what was found: photos placed, left
    out, or placed by few points; mean error in pixels.

    Structure from motion: Schoenberger and Frahm 2016, by pycolmap.  Raises BadFile, UsageError.

        found = ss.poses("photos", "capture")
        model = ss.train("capture", seconds=60)
    """
    from shapeshift.decomposition.poses.find_poses import WORK, PoseSettings, find_poses
    from shapeshift.decomposition.poses.photo_list import list_photos

    if not every >= 1:
        raise UsageError(f"every is {every}; give 1 or more.")
    try:
        wished = replace(PoseSettings(masks=None if masks is None else plain(masks)), **settings)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{error}.") from None
    folder = plain(out)
    if folder.is_dir() and any(path.name != WORK for path in Path(folder).iterdir()):
        raise UsageError(f"{folder} is not empty; name a new folder.")
    listed = list_photos(plain(photos), every)
    return find_poses(listed, folder, wished, progress or (lambda what, done, of: None))
