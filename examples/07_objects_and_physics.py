"""Objects on a table: move one, drop it, let a scripted hand at them, draw what comes of it."""

import shapeshift as ss

scene = ss.load(ss.TOUCH)  # a scene file: objects with places, bodies and reactions
for obj in scene.objects:
    place = ", ".join(f"{c:.2f}" for c in obj.world_from_object.position)
    print(f"{obj.name:12} at {place} m, x {obj.x}")

# The cube half a metre higher, falling for half a second.
lifted = scene.with_object("cube", position=(-0.22, 0.5, 0.05))
for step in ss.simulate(lifted, seconds=0.5):
    if any("cube" in contact["between"] for contact in step.contacts):
        print(f"after {step.seconds:.2f} s the cube touches {step.contacts[0]['between']}")
print(step.scene.render(size=(480, 270)).save("out/07_dropped.png"))

# A hand that grabs and throws, as the script beside the scene says: events are reactions.
for step in ss.simulate(scene, ss.TOUCH.with_name("touch.jsonl"), seconds=3.0):
    for event in step.events:
        print(f"{step.seconds:5.2f} s  {event['object']}: {event['from']} -> {event['to']}")
print(step.scene.render(size=(480, 270)).save("out/07_thrown.png"))
