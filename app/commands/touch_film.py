"""The demo in motion, of the main job: its script's hand at work, pictures and frame times."""

import time
from pathlib import Path

import numpy as np

from shapeshift.app.commands.simulate import make_simulation
from shapeshift.app.drawing import save_png
from shapeshift.app.measure import WARM_UP, percentiles
from shapeshift.app.paths import TOUCH
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import first_view
from shapeshift.scene.world.read_script import read_script

SCENE, SCRIPT = TOUCH, TOUCH.with_name("demo.jsonl")
MOMENTS_S = (0.0, 1.0, 1.65, 3.0)  # all at rest; the mug carried; in the air; afterwards
STEPS = 2  # of 1/90 s, a frame


def film(renderer: Renderer, ctx, size: tuple[int, int], path: Path) -> dict:
    """Plays the scene as its script says; MOMENTS_S side by side become the PNG `path`.

    ms of whole frames (physics, new poses and x, drawing) and of the physics alone in them.
    Raises BadFile.
    """
    file = read_scene_file(SCENE)
    simulation = make_simulation(file, read_script(SCRIPT, file.all_items))
    world = simulation.world
    view = first_view(file, world.drawn(), size)
    frames, physics, changes, wanted = [], [], 0, list(MOMENTS_S)
    pictures: list[np.ndarray] = []
    while wanted:
        start = time.perf_counter()
        records = [simulation.step() for _ in range(STEPS)] if pictures else []
        stepped = time.perf_counter()
        renderer.update(world.drawn())
        stats = renderer.draw([view])
        if ctx is not None:
            ctx.finish()
        frames.append((time.perf_counter() - start) * 1e3)
        physics.append((stepped - start) * 1e3)
        changes += sum(len(record.events) for record in records)
        if world.time_s >= wanted[0]:
            pictures.append(renderer.resolved(0))
            wanted.pop(0)
    save_png(np.concatenate(pictures, axis=1), path)
    return {
        "scene": SCENE.name,
        "frame_ms": percentiles(frames[WARM_UP:]),
        "physics_ms": percentiles(physics[WARM_UP:]),
        "frames": len(frames) - WARM_UP,
        "steps_a_frame": STEPS,
        "objects": len(world.objects),
        "splats": stats.splats,
        "reactions": changes,
    }
