"""A film: a flight around the scene while it goes from stop to stop, as one moving picture."""

import sys

import shapeshift as ss

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 6.0
scene = ss.load(ss.DEMO)

# Half of the film from RGB to Opened, straight: nothing thermal is seen.  Then heat, then back.
path = " ".join(f"{name}@{part * seconds:g}s" for name, part in
                (("RGB", 0), ("Opened", 0.4), ("Thermal", 0.7), ("RGB", 1)))  # fmt: skip
film = scene.film(
    "out/13_film.webp", path, cameras="orbit", seconds=seconds, fps=8, size=(320, 180),
    overwrite=True,
)  # fmt: skip
print(film, film.stat().st_size, "bytes")

# The same flight as numbered pictures, and how far away everything is in each.
frames = scene.film("out/13_frames", path, cameras="orbit", seconds=seconds, fps=2, size=(320, 180),
                    streams=("depth",), overwrite=True)  # fmt: skip
print(sorted(p.name for p in frames.glob("*.png"))[:3], (frames / "depth").is_dir())
