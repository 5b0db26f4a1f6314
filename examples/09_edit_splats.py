"""Scenes are arrays: take them, change them with numpy, put them back."""

from dataclasses import replace

import numpy as np

import shapeshift as ss

scene = ss.load(ss.DEMO)

# Plain splats at one x: means (N, 3) metres, scales, wxyz, opacity, sh, all your own copies.
splats = scene.splats("RGB")
centre, radius = scene.bounds
far = np.linalg.norm(splats.means - centre, axis=1) > 0.6 * radius
splats.opacity[far] *= 0.1  # what lies outside fades
splats.sh[:, 0, 0] += 0.2  # a little redder
faded = ss.Scene.from_splats(splats)
print(faded, faded.render(size=(480, 270)).save("out/09_faded.png"))

# The trained model itself: anchors (A, 3) metres, features, five networks; it keeps its slider.
model = scene.model
assert isinstance(model, ss.AnchorModel)
turn = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]], np.float32)  # a quarter about +Y
wide = replace(model, anchors=model.anchors * np.array([1.3, 1.0, 1.0], np.float32))
print(scene.with_model(wide).render("Thermal", size=(480, 270)).save("out/09_wide.png"))

# Two sets of splats become two stops of one slider.
turned = replace(splats, means=np.ascontiguousarray(splats.means @ turn.T))
both = ss.Scene.from_splats(splats, turned, names=("as it is", "turned"))
print(both, both.render(0.5, size=(480, 270)).save("out/09_both.png"))
