"""Put new stops into a finished scene: a coat of fur, a print in two inks, a part of it alone."""

import numpy as np

import shapeshift as ss

SIZE = (480, 270)
scene = ss.load(ss.DEMO).at("RGB")

# 1. A shape by a rule: seconds.  Every other stop shows what it showed.
furry = scene.add_style("Fur", shape="fur", source="RGB", after="RGB", pace=False)
print([stop.name for stop in furry.stops])
print(furry.render("Fur", size=SIZE).save("out/12_fur.png"))
print(f"RGB stays: {furry.at('RGB').compare(scene.at('RGB'))['mean']['psnr_db']:.0f} dB")


# 2. Colours by a function of a picture; a network does the same with network="mosaic.onnx".
def print_in_two_inks(picture: np.ndarray) -> np.ndarray:
    """Blue where it is dark, cream where it is light."""
    light = np.clip(4 * picture.mean(axis=2, keepdims=True) - 1.0, 0, 1)
    return light * [0.98, 0.93, 0.80] + (1 - light) * [0.05, 0.15, 0.45]


centre, radius = scene.bounds  # metres
x, y, z = np.add(centre, (0.2 * radius, 0, 0))
both = furry.add_style(
    "Print", paint=print_in_two_inks, region=[f"sphere:{x},{y},{z}:{0.45 * radius}"],
    steps=60, views=12, size=192, pace=False,
)  # fmt: skip
print(both.render("Print", size=SIZE).save("out/12_print.png"))
print(both.save("out/12_styles.shift", overwrite=True).bytes, "bytes with both")

# 3. And out again, with all that it alone had.
print([stop.name for stop in both.without_stop("Fur").stops])
