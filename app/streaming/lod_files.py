"""lod of several scenes: each a task of a cluster, a folder in --out.

`options` are those of lod.py, which imports this.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

from shapeshift.app.cluster.open_cluster import NONE, open_cluster
from shapeshift.app.cluster.task import Task, forget
from shapeshift.app.cluster.words import words_for
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import full
from shapeshift.app.terminal import say


def write_several(options: Any) -> int:
    """The folders of all scenes; those that an interrupted run has left are not made again."""
    from shapeshift.app.commands.exported import check_output

    if options.out.suffix:
        raise UsageError(f"--out {options.out} is no folder's name; several scenes want one.")
    scenes = (options.scene, *options.more)
    outs = [options.out / scene.stem for scene in scenes]
    twice = {out.name for out in outs if outs.count(out) > 1}
    if twice:
        raise UsageError(f"two scenes are called {min(twice)}, and so would be their folders.")
    for scene in scenes:
        if not scene.exists():
            raise UsageError(f"{scene}: there is no such file.")
    tasks = [task_of(options, scene, out) for scene, out in zip(scenes, outs, strict=True)]
    for task, out in zip(tasks, outs, strict=True):
        if not task.is_done(task.key()):
            check_output(out, scenes, options.overwrite)
    with open_cluster(options.cluster, options.certificates, options.gpus) as cluster:
        cluster.run(tasks)
    forget(tasks)
    say(f"{len(tasks)} folders in {full(options.out)}")
    return 0


def task_of(options: Any, scene: Path, out: Path) -> Task:
    """`lod` of one scene."""
    one = replace(options, scene=scene, more=(), out=out, cluster=NONE, certificates=None, gpus=0)
    return Task(
        scene.stem, words_for("lod", one), (full(scene),), (full(out),),
        notes=f"{full(options.out)}.tasks",
    )  # fmt: skip
