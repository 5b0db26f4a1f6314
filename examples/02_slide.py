"""Slide from stop to stop: by name, by number, and on the way between any two of them."""

import numpy as np

import shapeshift as ss

scene = ss.load(ss.DEMO)
rows = []
for x in ("RGB", "RGB..Thermal:0.5", "Thermal", 0.75, "Opened"):
    rows.append(scene.render(x=x, size=(320, 180)))
    print(f"{x!s:18} mean {rows[-1].mean():.3f}")

# A blend of any stops, with weights of your own.
blend = ss.StopWeights((("RGB", 0.2), ("Thermal", 0.3), ("Opened", 0.5)))
rows.append(scene.render(x=blend, size=(320, 180)))

sheet = np.concatenate(rows, axis=1)
assert isinstance(sheet, ss.Picture)  # still a picture
print(sheet.save("out/02_slide.png"))
