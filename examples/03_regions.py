"""Show a part of a scene at another x: see the heat in a sphere, open one half of the workshop."""

import shapeshift as ss

scene = ss.load(ss.DEMO).at("RGB")
centre, radius = scene.bounds  # metres
stops = {stop.name: stop.x for stop in scene.stops}

warm = ss.Sphere(centre=tuple(centre), radius=0.4 * radius, x=stops["Thermal"], border=0.1 * radius)
opened = ss.HalfSpace(point=tuple(centre), normal=(1.0, 0.0, 0.0), x=stops["Opened"])
print(scene.with_regions(opened, warm).render(size=(640, 360)).save("out/03_regions.png"))

# The same as text, as the commands take it: form, centre, radius, x, border.
x, y, z = centre
text = f"sphere:{x},{y},{z}:{0.4 * radius}:Thermal:{0.1 * radius}"
print(scene.render(select=[text], size=(640, 360)).save("out/03_lens.png"))
