"""Frames of a film as tasks of a cluster: runs of them, drawn by `film --only` into one folder.

`options` are those of film.py, which imports this.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from shapeshift.app.cluster.open_cluster import NONE, open_cluster
from shapeshift.app.cluster.task import Task, absolute, forget, words_for
from shapeshift.app.paths import full

if TYPE_CHECKING:
    from shapeshift.app.film.draw_film import FrameFolder
    from shapeshift.app.film.film_plan import FilmPlan

RUN = 50  # frames of a task: opening the scene and compiling kernels then cost little beside them


def draw_by_cluster(
    options: Any, plan: "FilmPlan", folder: "FrameFolder", numbers: Sequence[int]
) -> None:
    """The frames that are not there, by the workers of --cluster."""
    tasks = frame_tasks(options, plan, folder, numbers)
    with open_cluster(options.cluster, options.certificates, options.gpus) as cluster:
        cluster.run(tasks)
    forget(tasks)


def frame_tasks(
    options: Any, plan: "FilmPlan", folder: "FrameFolder", numbers: Sequence[int]
) -> list[Task]:
    """A task for each run of frames, of those that lack any."""
    from shapeshift.app.film.draw_film import scene_files
    from shapeshift.app.film.film_plan import is_named

    reads = [full(path) for path in scene_files(plan.document, options.scene)]
    cameras = absolute(options.cameras) if is_named(options.cameras) else options.cameras
    if is_named(cameras):
        reads.append(cameras)
    out, tasks = full(folder.path), []
    for start in range(0, len(numbers), RUN):
        run = numbers[start : start + RUN]
        if not folder.lacking(run):
            continue
        part = replace(
            options, out=folder.path, only=f"{run[0]}:{run[-1] + 1}", cameras=cameras, codec="",
            cluster=NONE, certificates=None, gpus=0, poster=None, save_path=None,
            keep_frames=False, overwrite=False,
        )  # fmt: skip
        writes = [full(path) for number in run for path in folder.files(number)]
        tasks.append(Task(
            f"frames {run[0]} to {run[-1]}", words_for("film", part), tuple(dict.fromkeys(reads)),
            tuple(writes), notes=f"{out}.tasks",
        ))  # fmt: skip
    return tasks
