"""Measure a thermal scene: degrees at places, marks in the world, lengths with their error."""

import numpy as np

import shapeshift as ss

SIZE = (640, 480)
scene = ss.load(ss.DEMO)

# 1. A view as numbers: values before the palette, NaN where nothing is known.
seen = scene.values("front", SIZE)
pixel, celsius = seen.hottest()
print(f"hottest: {celsius:.1f} {seen.unit} at pixel {pixel}, {scene.depth(pixel, size=SIZE):.2f} m")
print(f"{np.mean(seen.values[seen.known] > 60):.1%} of what is seen is above 60 {seen.unit}")

# 2. A place in the world, read where its surface faces the eye most.
place = seen.pick((400, 240))
print(f"motor: {scene.temperature(place):.1f} {seen.unit} at {place.round(3)} m")

# 3. Marks stay in the world: another view finds them again.
marks = [ss.Mark("motor", "spot", place[None]), ss.Mark("around", "circle", place[None], 0.03)]
for camera in ("front", scene.views("orbit", 12, SIZE)[1]):
    for mark in scene.read_marks(marks, camera, SIZE):
        print(f"{mark.mark.name}: {mark.least:.1f} to {mark.most:.1f}, mean {mark.mean:.1f}")

# 4. Lengths, with one standard deviation; scaled where one length is known.
print("wide:", scene.measure("distance", (140, 200), (470, 240), size=SIZE))
known = ((140, 200), (470, 240), 1.0)
print("high:", scene.measure("distance", (300, 300), (400, 240), size=SIZE, known=known))
