"""Compare two captures of one place: what moved, what got hotter."""

from dataclasses import replace

import numpy as np

import shapeshift as ss

# A second capture would be a scene of its own; here the demo's mug is pushed by 12 cm.
before = ss.load(ss.DEMO)
model = before.model
assert isinstance(model, ss.AnchorModel)
mug = np.linalg.norm(model.anchors - (-0.13, 0.045, 0.22), axis=1) < 0.07
pushed = np.where(mug[:, None] & (model.anchors[:, 1:2] > 0.01), (-0.12, 0.0, 0.03), 0.0)
anchors = (model.anchors + pushed).astype(np.float32)
after = before.with_model(replace(model, anchors=anchors))

changed = ss.change(before, after, size=(200, 150), out="out/16_change")
fit = changed.registration
print(f"{fit.how}: surfaces lie {100 * fit.residual_m:.2f} cm apart, {fit.shared:.0%} together")
for place in changed.places:
    cm = 100 * place.shift.round(3)
    print(place.number, place.kind, place.centre.round(2), f"{1e4 * place.area_m2:.0f} cm²", cm)

# The folder that was written opens as a scene with a stop a measure of change.
layers = ss.load("out/16_change/layers")
print([(stop.name, stop.value_range, stop.unit) for stop in layers.stops if stop.unit])
layers.at("Change of shape").render(size=(320, 240)).save("out/16_change.png")
