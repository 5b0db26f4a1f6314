"""Open a scene, look at what is in it, draw a picture: python examples/01_load_and_render.py"""

import shapeshift as ss

scene = ss.load(ss.DEMO)  # or a path: a package, .ply, .spz, .glb, a folder, NAME.scene.json
print(scene)
for stop in scene.stops:
    print(f"  {stop.x:.2f}  {stop.name} ({stop.kind})")

picture = scene.render(size=(640, 360))  # at its first stop, from where the viewer stands first
print(picture.shape, picture.dtype, "display sRGB, mean", round(float(picture.mean()), 3))
print(picture.save("out/01_workshop.png"))

depth_m = scene.render(size=(640, 360), output="depth")  # (360, 640) metres, NaN where nothing is
print(depth_m.save("out/01_depth.png"))
