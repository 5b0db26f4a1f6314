"""Shapeshift: captured scenes of Gaussian splats that change their colours and their shape.

In a checkout the folders beside this one (app/, renderer/, scene/, ...) are its subpackages, in a
wheel they lie inside it: `shapeshift.renderer.renderer` is the same module in both, once.
"""

import os

_here = os.path.dirname(os.path.abspath(__file__))
if not os.path.isdir(os.path.join(_here, "renderer")):  # a checkout
    __path__.append(os.path.dirname(_here))
