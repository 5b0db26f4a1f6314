"""Frames of a film: around the scene while the slider goes through all of its stops.

python examples/08_film_frames.py [frames]; then, where ffmpeg is installed:
ffmpeg -framerate 24 -i out/08_film/%04d.png out/08_film.mp4
"""

import sys

import shapeshift as ss

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 24

scene = ss.load(ss.DEMO)
for i, picture in enumerate(scene.frames(x="sweep", camera="orbit", count=COUNT, size=(480, 270))):
    picture.save(f"out/08_film/{i:04d}.png")
print(f"{COUNT} frames in out/08_film")
