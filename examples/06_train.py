"""Train a scene of photos.  These are taken of the demo: python examples/06_train.py [seconds]"""

import json
import math
import sys
from pathlib import Path

import shapeshift as ss

SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
WIDTH, HEIGHT = 160, 120
capture = Path("out/06_capture")

# 1. Photos with poses: what a capture is (docs/capture.md).  Yours come from cameras and COLMAP.
demo, frames = ss.load(ss.DEMO), []
for modality in ("RGB", "Thermal"):
    for i, view in enumerate(demo.views("orbit", 16, (WIDTH, HEIGHT))):
        name = f"{modality}/{i:03d}.png"
        demo.render(modality, camera=view).save(capture / name)
        pose = view.world_from_eye.matrix().tolist()
        frames.append({"file_path": name, "modality": modality, "transform_matrix": pose})
focal = HEIGHT / (2 * math.tan(0.8 / 2))  # the views of an orbit are 0.8 radians high
lens = {"w": WIDTH, "h": HEIGHT, "fl_x": focal, "fl_y": focal}
stops = [{"name": "RGB", "x": 0.0}, {"name": "Thermal", "x": 1.0}]
text = json.dumps({"convention": "opengl", "modalities": stops, **lens, "frames": frames})
(capture / "transforms.json").write_text(text)


# 2. Training; the more seconds, the better.
def show_step(step) -> None:
    if step.iteration % 100 == 0:
        print(f"{step.iteration} steps, {step.fraction:.0%}, {step.anchors:,} anchors")


model = ss.train(capture, seconds=SECONDS, max_anchors=2000, progress=show_step, pace=False)
print(f"{model.steps} steps in {model.seconds:.0f} s; held-out photos:", model.psnr_db)

# 3. A trained scene is a scene.
saved = model.save("out/06_scene.shift", overwrite=True)
print(f"{saved.path}: {saved.bytes:,} bytes")
print(model.render(0.5, size=(320, 240)).save("out/06_halfway.png"))
scores = ss.evaluate(saved.path, capture)["modalities"]
print({name: f"{score['psnr_db']:.2f} dB" for name, score in scores.items()})
