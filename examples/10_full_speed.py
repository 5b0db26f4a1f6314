"""A loop at full speed: one renderer, one array, nothing decoded or copied twice."""

import time

import numpy as np

import shapeshift as ss

scene = ss.load(ss.DEMO).at("RGB")
views = scene.views("orbit", 24, (640, 360))
frame = np.empty((360, 640, 3), np.float32)

with ss.Renderer() as renderer:
    renderer.render(scene, views[0], out=frame)  # the first one compiles kernels
    print(renderer.backends)
    start = time.perf_counter()
    for view in views:
        renderer.render(scene, view, out=frame)
    ms = (time.perf_counter() - start) / len(views) * 1e3
    print(f"{ms:.1f} ms a frame; passes of the last one:")
    print({name: round(each, 1) for name, each in renderer.stats.ms.items()})
    rgba = renderer.premultiplied(scene, views[0])  # before any background; tiles: not even copied
    print(rgba.shape, "alpha in the mean", round(float(rgba[..., 3].mean()), 3))
