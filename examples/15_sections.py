"""Cut a scene open: a plane with a capped edge, a box, another stop beyond a plane."""

import shapeshift as ss

scene = ss.load(ss.DEMO).at("RGB")
(x, y, z), radius = scene.bounds  # metres

# Kept is where normal . place <= offset, in metres of the world.
across = ss.SceneSection(shape=ss.PlaneShape((1.0, 0.0, 0.0), x), edge="capped")
print(scene.with_sections(across).render(size=(640, 360)).save("out/15_plane.png"))

# Left of the plane the photo, right of it the heat: another stop beyond instead of nothing.
hot = f"plane:1,0,0,{x}:hard:beyond=Thermal"
print(scene.with_sections(hot).render(size=(640, 360)).save("out/15_beyond.png"))

# Sections add up: what is inside of both boxes stays.
half = 0.5 * radius
box = ss.SceneSection(
    shape=ss.BoxShape((x, y, z), (half, half, half)), edge="soft", width_m=0.1 * half
)
print(scene.with_sections(box, across).render(size=(640, 360)).save("out/15_box.png"))
