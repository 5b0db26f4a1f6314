"""Objects on a bench: move one, drop it, let a scripted hand at them, draw what comes of it."""

import shapeshift as ss

scene = ss.load(ss.TOUCH)  # a scene file: objects with places and bodies
for obj in scene.objects:
    place = ", ".join(f"{c:.2f}" for c in obj.world_from_object.position)
    print(f"{obj.name:12} at {place} m, x {obj.x}")

# The mug a little higher, falling for half a second.
lifted = scene.objects["mug"].move(by=(0, 0.3, 0))
for step in ss.simulate(lifted, seconds=0.5):
    if any("mug" in contact["between"] for contact in step.contacts):
        print(f"after {step.seconds:.2f} s the mug touches {step.contacts[0]['between']}")
print(step.scene.render(size=(480, 270)).save("out/07_dropped.png"))

# A hand that grabs and throws, as the script beside the scene says; what it hits is told.
for step in ss.simulate(scene, ss.TOUCH.with_name("demo.jsonl"), seconds=3.0):
    for contact in step.contacts:
        print(f"{step.seconds:5.2f} s  {' on '.join(contact['between'])}")
print(step.scene.at("Thermal").render(size=(480, 270)).save("out/07_thrown.png"))
