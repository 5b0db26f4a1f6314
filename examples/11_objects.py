"""From photos to things that one can grab: cut the mug out, look behind it, let it fall."""

import json
import math
from pathlib import Path

import shapeshift as ss

# 1. Photos with poses and a scene.  Of your own they are two lines:
#        ss.poses("photos", "capture")
#        ss.train("capture", seconds=300).save("scene.shift")
# Here the bundled scene draws its own.
WIDTH, HEIGHT = 320, 240
scene, capture, frames = ss.load(ss.DEMO), Path("out/11_capture"), []
for i, view in enumerate(scene.views("orbit", 8, (WIDTH, HEIGHT))):
    scene.render("RGB", camera=view).save(capture / f"{i:03d}.png")
    pose = view.world_from_eye.matrix().tolist()
    frames.append({"file_path": f"{i:03d}.png", "transform_matrix": pose})
focal = HEIGHT / (2 * math.tan(0.8 / 2))  # the views of an orbit are 0.8 radians high
lens = {"w": WIDTH, "h": HEIGHT, "fl_x": focal, "fl_y": focal}
(capture / "transforms.json").write_text(
    json.dumps({"convention": "opengl", **lens, "frames": frames})
)

# 2. A box in one photo says where the mug is; the same networks, so it keeps its slider.
seen = ss.PhotoPrompt("000.png", box=(131, 136, 151, 158))
mug = ss.ObjectSpec(1, "mug", (seen,), mass_kg=0.3)
room = scene.segment(capture, "out/11_room.scene.json", objects=[mug], overwrite=True)
print(room.objects["mug"])
room.without("mug").at("RGB").render(size=(480, 270)).save("out/11_without.png")
room.objects["mug"].at("Thermal").render(size=(480, 270)).save("out/11_warm.png")

# 3. It has a body: from 20 cm above it falls back onto the bench.
lifted = room.objects["mug"].move(by=(0, 0.2, 0))
*_, last = ss.simulate(lifted, seconds=1.0)
fell = lifted.objects["mug"].pose.position[1] - last.scene.objects["mug"].pose.position[1]
print(f"the mug fell {100 * fell:.0f} cm")
last.scene.render(size=(480, 270)).save("out/11_fallen.png")
