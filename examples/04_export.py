"""Write a scene for other programs: the splats as they are at one x, or a part of them."""

import shapeshift as ss

scene = ss.load(ss.DEMO)
for name in ("rgb.ply", "rgb.spz"):  # also .glb, .compressed.ply, .splat, .usdz
    written = scene.export(f"out/04_{name}", x="RGB", overwrite=True)
    print(f"{written.path}: {written.splats:,} splats, {written.bytes:,} bytes")

centre, radius = scene.bounds
inside = ss.Sphere(centre=tuple(centre), radius=0.5 * radius, x=0.0)
part = ss.export(scene, "out/04_part.spz", x="RGB", only=[inside], overwrite=True)
print(f"{part.path}: {part.splats:,} splats lie in the sphere")

again = ss.load(part.path)  # what was written opens as any file does
print(again, again.render(size=(320, 180)).save("out/04_part.png"))
