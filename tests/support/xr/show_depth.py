"""Shows a small scene through `Session` and tells how deep the runtime's images of it are.

show_depth.py DRAWING      one line of JSON: for pixels of both eyes, metres in the runtime's depth
and those of rays through the scene's ellipsoids
"""

import json
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
SHOWN = 2  # frames


def main(drawing: str) -> None:
    sys.path.insert(0, str(ROOT))
    from shapeshift.app.headset.eyes import Eyes
    from shapeshift.renderer.gl.context import open_context
    from shapeshift.renderer.renderer import Renderer
    from shapeshift.renderer.settings import RenderSettings
    from shapeshift.scene.pose import Pose
    from shapeshift.scene.scene import IDENTITY
    from shapeshift.vr.drawn import Drawn
    from shapeshift.vr.frame import FAR_M, NEAR_M
    from shapeshift.vr.openxr.instance import Instance
    from shapeshift.vr.openxr.session import Session
    from shapeshift.vr.play_space import PlaySpace
    from tests.support.renderer.surface_reference import reference_surface
    from tests.support.splat_scenes import alone, shell

    scene, scale = alone(shell(700)), 2.0  # metres of the world a metre of the room
    with (
        open_context("egl") as ctx,
        Instance() as instance,
        Session(instance, ctx, part=0.4) as session,
        Renderer(ctx, drawing) as renderer,
        Eyes(ctx, session.sizes) as eyes,
    ):
        renderer.settings = RenderSettings(depth_scale=1.0)
        renderer.update(scene)
        session.layers.keep = True
        views, kept, layers = (), [], []
        for frame in session.frames():
            if frame.drawn and frame.head.position[1] > 0:
                away = Pose(frame.head.position * -scale + (0, 0, 3.0), IDENTITY.wxyz)
                play_space = PlaySpace(away, scale)
                views = [play_space.view(view) for view in frame.views]
                renderer.draw(views)
                for i, framebuffer in enumerate(eyes.framebuffers):
                    renderer.present(framebuffer, i)
                depths, seen = eyes.depths(renderer, scale), frame.views

                def write(i, framebuffer, depths=depths, seen=seen) -> None:
                    eyes.write_depth(i, framebuffer, seen[i], depths[i], Drawn())

                session.submit(eyes.textures, write)
                kept.append(session.layers.kept_depth)
                layers = session.layers.last
            if len(kept) == SHOWN:
                session.leave()
        told = {"layers": layers, "format": session.layers.depth, "eyes": []}
        for view, stored in zip(views, kept[-1], strict=True):
            metres = FAR_M * NEAR_M / (FAR_M - stored.astype(np.float64) * (FAR_M - NEAR_M))
            want = reference_surface(scene, view)
            solid = want.coverage > 0.7
            wanted = want.depth()[solid] / scale
            error = np.abs(metres[solid] / wanted - 1)
            told["eyes"].append(
                {"solid": float(solid.mean()), "nearest_m": float(wanted.min()),
                 "median": float(np.median(error)), "most": float(np.quantile(error, 0.99)),
                 "open": float(stored[want.coverage < 0.3].min())}
            )  # fmt: skip
    print(json.dumps(told))


if __name__ == "__main__":
    main(sys.argv[1])
