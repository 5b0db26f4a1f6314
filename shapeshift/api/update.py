"""A part of a scene trained anew from a later visit."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from shapeshift.api.arguments import PathText
from shapeshift.api.learn import Kind, TrainedScene, finished, run, settings_of
from shapeshift.api.opened import OpenedScene
from shapeshift.api.read import opened
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import plain

if TYPE_CHECKING:
    from shapeshift.training.run import Progress


def update(
    scene: PathText | OpenedScene,
    capture: PathText,
    *,
    where: str | Sequence[str] = (),
    change: PathText | None = None,
    out: PathText | None = None,
    seconds: float | None = None,
    iterations: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    device: Kind | None = None,
    progress: "Callable[[Progress], object] | None" = None,
    **settings: Any,
) -> TrainedScene:
    """Trains a part of a scene anew from the photos of a later visit; the networks and all anchors
    outside stay to the bit, and so does every pixel that no splat touches which left or came.

    where: one or several boxes of the scene's world, box:x,y,z:hx,hy,hz in metres: centre and half
    the sides.  change: the folder that `ss.change(scene, later, out=...)` wrote; its places are
    where nothing else is named, and its registration moves the capture into the scene's world.
    capture: posed photos of every stop, as `train` takes them.  The rest as of `ss.train`; psnr_db
    of the result is of the held-out photos where they see the region.  Raises BadFile, UsageError,
    NoDevice.

        ss.change("march.shift", "june.shift", out="changed")
        scene = ss.update("march.shift", "photos/june", change="changed", iterations=1000)
    """
    from shapeshift.app.commands.exported import check_output
    from shapeshift.app.training.saving import check_writable, memory_for_training
    from shapeshift.app.training.update_region import base_of, region_of
    from shapeshift.rasterizer.device import open_device
    from shapeshift.runtime_models.package.write_package import refuse_foreign
    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint
    from shapeshift.training.update.begin_update import begin_update
    from shapeshift.training.update.regions import moved_capture

    given = opened(scene)
    path = None if out is None else plain(str(out))
    if path is not None:
        read = [] if given.path is None else [given.path]
        check_output(path, read, overwrite or resume, "")
        check_writable(path)
        refuse_foreign(path)
    elif resume:
        raise UsageError("resume goes on from the checkpoint beside out; give out, too.")
    boxes = (where,) if isinstance(where, str) else tuple(where)
    region, a_from_b = region_of(boxes, None if change is None else plain(str(change)), "")
    before = read_checkpoint(checkpoint_path(path)) if resume and path is not None else None
    settings |= {"iterations": iterations, "seconds": seconds}
    wished = settings_of(settings, before[1]["settings"] if before else None)
    base = base_of(given.model, region)
    photos = read_capture(plain(str(capture)))
    if a_from_b is not None:
        photos = moved_capture(photos, a_from_b)
    with memory_for_training():
        trainer = begin_update(open_device(device), base, photos, wished, before)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
    run(trainer, path, progress)
    return finished(trainer, path, pace=False)
